# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chip and machine for the firmware's injection on the host: a sample a step, in floating point but for the formats.

Machine, inverter and converter are those of the float model (`fluxlock.theory.injection.machine`); injection,
separator or I/Q sums, current regulators, transforms as the chip has them. What the firmware sets acts from the next
sample on.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.firmware.binding import new
from fluxlock.firmware.block import gain
from fluxlock.firmware.injection_formats import SEPARATOR_FULL_SCALE
from fluxlock.firmware.vector_formats import Complex, from_complex
from fluxlock.headers import CData
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.injection.loop import SUBSTEPS, Loop
from fluxlock.theory.injection.machine import (
    OMEGA_AT,
    THETA_AT,
    InverterSet,
    MachineSet,
    advance,
    axis_tables,
    compiled,
    converted,
    leg_voltages,
    machine_set,
    phase_current,
    scratch,
    triangle,
)

Q25, Q30, Q32, Q36, Q60 = 2.0**25, 2.0**30, 2.0**32, 2.0**36, 2.0**60
TURN = 2 * math.pi


@compiled
def seed_noise(seed: int) -> None:
    """Noise of the converter."""
    np.random.seed(seed)


@compiled
def period(
    m: MachineSet,
    inv: InverterSet,
    state: FloatArray,
    legs: FloatArray,
    ts: float,
    rising: bool,
    loads: FloatArray,
    cosine: FloatArray,
    sine: FloatArray,
    room: FloatArray,
    seen: FloatArray,
) -> None:
    """A sample period and its sample; loads: constant and Coulomb torque (N m), imposed speed (rad/s) or NaN."""
    load, coulomb, imposed = loads[0], loads[1], loads[2]
    edges = np.zeros((2, m.phases))  # of mean voltages there are none
    advance(m, inv, state, legs, ts, SUBSTEPS, 0, SUBSTEPS, rising, load, coulomb, imposed, cosine, sine, room, edges)
    for x in range(m.phases):
        seen[x] = converted(inv, phase_current(state[:4], state[THETA_AT], 1 + (m.phases == 5), cosine, sine, x))


@dataclass
class Command:
    """What the firmware sets. Currents in A, of the chip's frame; turn_q32 acts once."""

    turn_q32: int = 0
    speed_turn_q36: int = 0
    lead_q32: int = 0
    reference_a: complex = 0j
    third_a: complex = 0j
    inject: bool = True


@dataclass
class InjectionBench:
    """One machine with a chip; `loop` has machine, inverter and settings of the float model."""

    loop: Loop
    theta: float = 0.0
    seed: int = 1
    speed_rad_s: float = 0.0
    command: Command = field(default_factory=Command)
    load_nm: float = 0.0
    coulomb_nm: float = 0.0
    imposed_rad_s: float = math.nan  # electrical
    amplitude: CData | None = None  # injection_amplitude_t of this sample
    current_a: complex = 0j  # for the regulators, chip's frame

    def __post_init__(self) -> None:
        s, motor = self.loop.settings, self.loop.motor
        assert s.method in {"separator", "iq"}
        self.m = machine_set(motor, self.loop.saturated, self.loop.viscous)
        self.inv = self.loop.inverter.kernel_set(s.double)
        self.cycles = round(s.ts_s * CLOCK_HZ)
        n = motor.phases
        self.cosine, self.sine = axis_tables(n)
        self.planes = [np.exp(1j * TURN / n * np.arange(n) * h) * (2.0 / n) for h in (1, 3)[: n // 2]]
        self.room, self.state = scratch(), np.zeros(7)
        self.state[THETA_AT], self.state[OMEGA_AT] = self.theta, self.speed_rad_s
        self.legs, self.next_legs = np.zeros(n), np.zeros(n)
        self.seen, self.last = np.zeros(n), np.zeros(n)
        self.vector = np.zeros(4)
        self.loads = np.zeros(3)
        w = TURN * s.current_hz
        r = self.m.r
        self.gains = s.current_gains or (w * self.m.l_d, w * r, w * self.m.l_q, w * r)
        self.integral = [0.0] * 4
        self.held = 0j
        self.held_3 = 0j
        self.nco_q36 = self.omega_q36 = 0
        self.step = 0
        self.zeros: list[complex] = []
        self.peak = 0j
        self.peak_phase = 0
        self.sums, self.sums_known, self.last_phase = [0j, 0j], False, -1
        self.filters = [0j, 0j]
        self.injecting = False
        self.whole = 0  # samples since the wave began
        seed_noise(self.seed)

    @property
    def frame_rad(self) -> float:
        """Angle of the chip's frame at the sample."""
        return self.nco_q36 / Q36 * TURN

    @property
    def theta_rad(self) -> float:
        """True angle."""
        return float(self.state[THETA_AT])

    def error_rad(self, ahead_rad: float = 0.0) -> float:
        """Frame and what the published angle has beyond it, less the truth, within a half turn."""
        return math.remainder(self.frame_rad + ahead_rad - self.theta_rad, TURN)

    def sample(self) -> None:
        """One sample period, then its sample, its amplitudes and the voltage of the one after next."""
        s, n = self.loop.settings, self.loop.motor.phases
        if self.step > 0:
            self.loads[:] = self.load_nm, self.coulomb_nm, self.imposed_rad_s / self.m.pole_pairs
            rising = self.step % 2 == 0
            period(
                *(self.m, self.inv, self.state, self.legs, s.ts_s, rising),
                *(self.loads, self.cosine, self.sine, self.room, self.seen),
            )
            # What the firmware set after the sample before acts from the update on, which is now.
            self.nco_q36 += (self.command.turn_q32 << 4) + self.omega_q36 * self.cycles
            self.nco_q36 %= int(Q36)
            self.command.turn_q32 = 0
        self.omega_q36 = self.command.speed_turn_q36
        frame = self.frame_rad
        turn = cmath.exp(1j * frame)
        sampled = complex(self.planes[0] @ self.seen) / turn
        phase = (self.step - 1 + s.period // 4) % s.period
        self.current_a = sampled
        self.amplitude = None
        if s.method == "separator":
            self._separate(sampled, phase)
        else:
            self._sum(sampled, phase)
        # The first results of a wave that has just begun hold samples from before.
        self.whole = min(self.whole + 1, 3 * s.period) if self.injecting else 0
        if self.whole < 3 * s.period:
            self.amplitude = None
        self._regulate(phase, frame)
        act = frame + self.command.lead_q32 / Q32 * TURN
        inject = self._wave((self.step + 1 + s.period // 4) % s.period)
        first = (self.held + inject) * cmath.exp(1j * act)
        third = self.held_3 * cmath.exp(3j * act)
        self.vector[:] = first.real, first.imag, third.real, third.imag
        move = 0.0
        if self.inv.model:
            turns = (self.step + s.period // 4) / s.period
            peak = s.amplitude_v * s.ts_s * s.period / (4 * self.m.l_d) if self.injecting else 0.0
            move = peak * (triangle(turns + 1.5 / s.period) - triangle(turns))
        self.legs, self.next_legs = self.next_legs, np.zeros(n)
        leg_voltages(
            self.inv,
            self.vector,
            self.seen,
            self.last,
            move,
            frame,
            True,
            np.zeros((2, n)),
            s.ts_s,
            self.cosine,
            self.sine,
            self.next_legs,
        )
        self.step += 1

    def _wave(self, phase: int) -> float:
        """Voltage; it starts and ends where its current crosses zero."""
        s = self.loop.settings
        if phase == s.period // 4:
            self.injecting = self.command.inject
        return 0.0 if not self.injecting else s.amplitude_v if phase < s.period // 2 else -s.amplitude_v

    def _separate(self, sampled: complex, phase: int) -> None:
        if phase % 2:
            self.peak, self.peak_phase = sampled, phase
            self.current_a = self.zeros[-1] if self.zeros else sampled
            return
        self.zeros = [*self.zeros[-1:], sampled]
        if len(self.zeros) == 2 and self.step >= 3:
            hf = (self.peak - sum(self.zeros) / 2) * (1 if self.peak_phase == 1 else -1)
            unit = SEPARATOR_FULL_SCALE / self.loop.inverter.current_full_scale_a
            d, q = (Complex(round(x * unit), 0) for x in (hf.real, hf.imag))
            self.amplitude = new("injection_amplitude_t", d=d, q=q)

    def _sum(self, sampled: complex, phase: int) -> None:
        s = self.loop.settings
        if phase < self.last_phase:
            if self.sums_known:
                unit = 2**19 / self.loop.inverter.current_full_scale_a
                d, q = (from_complex(z, unit) for z in self.sums)
                self.amplitude = new("injection_amplitude_t", d=d, q=q, count=s.period)
            self.sums_known, self.sums = True, [0j, 0j]
        self.last_phase = phase
        kernel = cmath.exp(-1j * TURN * (self.step + s.period // 4) / s.period)
        self.sums[0] += sampled.real * kernel
        self.sums[1] += sampled.imag * kernel
        if s.remove:
            # Trapezoidal state-variable filter at the injection's frequency.
            g = math.tan(math.pi / s.period)
            v1 = (self.filters[0] + g * (sampled - self.filters[1])) / (1 + g * (g + s.band_k))
            v2 = self.filters[1] + g * v1
            self.filters = [2 * v1 - self.filters[0], 2 * v2 - self.filters[1]]
            self.current_a = sampled - s.band_k * v1

    def _regulate(self, phase: int, third_frame: float) -> None:
        s, m = self.loop.settings, self.m
        hold = s.method == "separator"
        if not hold or phase % 2 == 1:
            error = self.command.reference_a - self.current_a
            t = s.ts_s * (2 if hold else 1)
            self.integral[0] += t * self.gains[1] * error.real
            self.integral[1] += t * self.gains[3] * error.imag
            self.held = complex(
                self.gains[0] * error.real + self.integral[0], self.gains[2] * error.imag + self.integral[1]
            )
            omega = self.command.speed_turn_q36 / Q36 * CLOCK_HZ * TURN
            i_d, i_q = self.command.reference_a.real, self.command.reference_a.imag
            self.held += complex(-omega * m.l_q * i_q, omega * (m.l_d * i_d + m.psi))
            reach = (0.5257 if m.phases == 5 else 0.5774) * self.inv.vdc
            most = math.sqrt(reach * reach - s.amplitude_v**2)
            if abs(self.held) > most:
                excess = self.held * (1 - most / abs(self.held))
                self.integral[0] -= excess.real
                self.integral[1] -= excess.imag
                self.held -= excess
        if m.phases == 5:
            seen = complex(self.planes[1] @ self.seen) * cmath.exp(-3j * third_frame)
            error = self.command.third_a - seen
            w = TURN * s.current_hz
            self.integral[2] += s.ts_s * w * m.r * error.real
            self.integral[3] += s.ts_s * w * m.r * error.imag
            self.held_3 = complex(
                w * m.l_d3 * error.real + self.integral[2], w * m.l_q3 * error.imag + self.integral[3]
            )


def firmware_pll(gains: tuple[float, float, float], period_s: float, speed_max_rad_s: float = 1000.0) -> CData:
    """Gains a, b (1/s), c (1/s^2) of the float model as pll_gains_t, for ticks of period_s."""
    per_turn = Q60 / (TURN * CLOCK_HZ * Q30)
    return new(
        "pll_gains_t",
        angle=gain(gains[0] * Q32 / (TURN * Q30)),
        speed=gain(gains[1] * per_turn),
        acceleration=gain(gains[2] * period_s * per_turn),
        speed_max_turn_q36=round(speed_max_rad_s / TURN / CLOCK_HZ * Q36),
    )
