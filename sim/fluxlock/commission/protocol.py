# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Lines of the commissioning program (sw/images/commission/main.c) in SI units.

Vectors are complex, d + jq in the program's frame, amplitude-invariant. Voltages are those that the duty cycles and the
measured DC link make, without dead time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fluxlock.config.inverter import Inverter
from fluxlock.cosim.plan import ConversationError

Q17, Q25, Q30, Q32, Q36, Q44 = 2.0**17, 2.0**25, 2.0**30, 2.0**32, 2.0**36, 2.0**44
MANTISSA_MAX = 2**17 - 1
TRIPPED = "a protection of the inverter has switched the gates off; is a phase shorted, is the supply too weak?"
LIMIT_SHARE = 0.9  # of vdc / sqrt(3)


class MeasurementError(ConversationError):
    """The machine cannot be measured like this; the text says why and what to do."""


@dataclass(frozen=True)
class Block:
    """Means over a block.

    last_a, angle: current of its last sample and angle of the frame there (rad); omega: of the frame at its end
    (electrical, rad/s). corner_a, middle_a: of an alternating voltage, current at the end of the half period and in its
    middle.
    """

    duration_s: float
    current_a: complex
    voltage_v: complex
    vdc_v: float
    last_a: complex
    omega: float
    angle: float = 0.0
    corner_a: complex = 0j
    middle_a: complex = 0j


@dataclass(frozen=True)
class Scales:
    """How the program's integers and SI units belong together. carrier, tick: clocks."""

    clock_hz: float
    carrier_cycles: int
    tick_cycles: int
    supply_v: float
    voltage_full_scale_v: float
    current_full_scale_a: float

    @staticmethod
    def of(inverter: Inverter, clock_hz: float, carrier_cycles: int, tick_cycles: int) -> Scales:
        """Of an inverter and the timing of its parameter block."""
        s = inverter.sensing
        return Scales(
            clock_hz,
            carrier_cycles,
            tick_cycles,
            inverter.supply_v,
            s.voltage_full_scale_v,
            s.current_full_scale_a,
        )

    @property
    def tick_s(self) -> float:
        """Control tick."""
        return self.tick_cycles / self.clock_hz

    @property
    def _scale(self) -> tuple[int, int]:
        """Mantissa and shift of the modulator's scale: exact from units of v_q17 to clocks."""
        clocks = self.carrier_cycles * self.voltage_full_scale_v / self.supply_v / Q17
        shift = min(31, math.floor(math.log2(MANTISSA_MAX / clocks)))
        return math.floor(clocks * 2.0**shift), shift

    @property
    def clocks_a_unit(self) -> float:
        """Clocks of duty a unit of v_q17."""
        mantissa, shift = self._scale
        return mantissa * 2.0**-shift

    def scale(self) -> str:
        """Sets the modulator's scale and the limit of the voltage."""
        mantissa, shift = self._scale
        limit = LIMIT_SHARE * self.supply_v / math.sqrt(3) / self.voltage_full_scale_v * Q17
        return f"s {mantissa} {shift} {round(limit)}"

    def legs(self, letter: str, along: int, across: int = 0) -> str:
        """Voltage of whole clocks on the legs of a frame that stands on a phase axis.

        along: that leg gets `along` clocks above half of the carrier, the other two that much below, which is
        4/3 along vdc / carrier on d. across (even): one of the other two gets as much more as the last one less,
        2/sqrt(3) across vdc / carrier on q.
        """
        d = along / 0.75 / self.clocks_a_unit
        q = 2.0 * across / math.sqrt(3) / self.clocks_a_unit
        return f"{letter} {round(d)} {round(q)}"

    def along_v(self, along: int) -> float:
        """Voltage on d of `legs` at the nominal supply."""
        return 4.0 / 3.0 * along * self.supply_v / self.carrier_cycles

    def across_v(self, across: int) -> float:
        """Voltage on q of `legs` at the nominal supply."""
        return 2.0 / math.sqrt(3) * across * self.supply_v / self.carrier_cycles

    def current(self, current_a: complex) -> str:
        """Current in the frame."""
        unit = self.current_full_scale_a / Q17
        return f"i {round(current_a.real / unit)} {round(current_a.imag / unit)}"

    def gains(self, resistance_ohm: float, inductance_h: float, bandwidth_hz: float, omega_max: float) -> str:
        """Complex vector PI, k_p = w L, k_i = w (R + j omega L), for speeds up to omega_max."""
        unit = self.current_full_scale_a / self.voltage_full_scale_v * Q25 / Q17
        w, ts = 2.0 * math.pi * bandwidth_hz, self.carrier_cycles / self.clock_hz
        h = w * inductance_h * unit
        g = h + w * resistance_ohm * ts * unit
        cross = w * inductance_h * ts * unit * 2.0 * math.pi * self.clock_hz / Q36
        largest = max(g, cross * self.turn_q36(omega_max))
        shift = min(31, math.floor(math.log2(MANTISSA_MAX / largest)))
        if shift < 0:
            raise MeasurementError(f"a regulator of {bandwidth_hz:g} Hz does not fit the chip's gains")
        factor = 2.0**shift
        return f"g {round(g * factor)} {round(h * factor)} {round(cross * factor * Q30)} {shift}"

    def turn_q36(self, omega: float) -> float:
        """Speed in 2^-36 turn a clock."""
        return omega / (2.0 * math.pi) / self.clock_hz * Q36

    def speed(self, omega: float, acceleration: float) -> str:
        """Electrical speed of the frame (rad/s) and the way to it (rad/s^2)."""
        a_tick = self.turn_q36(acceleration * self.tick_s) * 256
        return f"f {round(self.turn_q36(omega) * 256)} {max(1, round(a_tick))}"

    @staticmethod
    def ahead(angle_deg: float) -> str:
        """Turn the frame by an angle."""
        turn = round(angle_deg / 360.0 * Q32) % 2**32
        return f"a {turn - 2**32 if turn >= 2**31 else turn}"

    def patience(self, seconds: float) -> str:
        """Gates off after a silence of the host."""
        return f"t {round(seconds / self.tick_s)}"

    def run(self, duration_s: float, block_s: float) -> str:
        """Measure for a time in blocks; both are rounded to whole ones, a block to whole periods of four ticks."""
        block = min(512, 4 * max(1, round(block_s / self.tick_s / 4)))
        return f"r {block * max(1, round(duration_s / self.tick_s / block))} {block}"

    def block(self, line: str) -> Block:
        """A line `b ...`."""
        words = [int(word) for word in line.split()[1:]]
        ticks, i_d, i_q, v_d, v_q, steps, vdc, last_d, last_q, omega, turn = words[:11]
        alternating = words[11:] or [0, 0, 0, 0]
        ampere = self.current_full_scale_a / Q17
        vdc_v = vdc / ticks / 16 * self.voltage_full_scale_v / Q17
        volt = self.clocks_a_unit * vdc_v / self.carrier_cycles / max(1, steps)
        pairs = ampere / (ticks / 2)
        return Block(
            duration_s=ticks * self.tick_s,
            current_a=complex(i_d, i_q) * ampere / ticks,
            voltage_v=complex(v_d, v_q) * volt,
            vdc_v=vdc_v,
            last_a=complex(last_d, last_q) * ampere,
            omega=omega / Q36 * self.clock_hz * 2.0 * math.pi,
            angle=turn / Q32 * 2.0 * math.pi,
            corner_a=complex(*alternating[:2]) * pairs,
            middle_a=complex(*alternating[2:]) * pairs,
        )

    def blocks(self, reply: Sequence[str]) -> list[Block]:
        """The blocks of a reply; an error of the program raises MeasurementError."""
        if reply[-1].startswith("error: "):
            text = reply[-1].removeprefix("error: ")
            raise MeasurementError(TRIPPED if text == "tripped" else f"the chip's program: {text}")
        return [self.block(line) for line in reply if line.startswith("b ")]
