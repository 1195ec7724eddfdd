# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The measurement: what is asked of the commissioning program, step by step, and what follows from the answers.

Knows the name plate and the inverter, nothing else: `conversation` runs the same against a simulated and a real bench.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fluxlock.commission import estimate
from fluxlock.commission.estimate import Line, Mechanics, Motion, Winding
from fluxlock.commission.plate import NamePlate
from fluxlock.commission.protocol import Block, MeasurementError, Scales
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import RPM_PER_RAD_S

Dialogue = Generator[str, list[str], Any]

PATIENCE_S = 3.0  # of the program with a silent host
BLOCK_S = 1e-3
AXES_DEG = (0.0, 60.0, 120.0)  # along A, against C, along B
ALIGN_SHARE = 0.6  # of the highest current
LEVELS = (0.9, 0.65, 0.4)  # of the highest current
CURRENT_SHARE = 0.8  # of the trip, at most
LEVEL_S = 4e-3
FIRST_SETTLE_S = 8e-3  # before L/R is known
SETTLED_TIMES = 6.0  # L/R, after a step of the voltage; of the alternating current, whose offset counts little
ALTERNATING_TIMES = 4.0
ALTERNATE_SHARE = 0.15  # corner over the highest current
ALTERNATE_S = 6e-3
# At rest: over a span of blocks the current stays within this share of itself, or within that many LSB, and lies on d
# to a share: what its EMF drives is on q.
REST_SHARE, APPROACH_SHARE, REST_LSB = 0.05, 0.15, 2.0
REST_Q_SHARE = 0.12
SWING_SHARE, SWING_LIMIT_S = 0.2, 0.1
REST_S, REST_LIMIT_S = 5e-3, 1.5
# Run: share of the acceleration at which the rotor falls out of step; of the highest speed, of the phase voltage.
ACCELERATION_SHARE = 0.2
UP_LEAST_S = 0.1
SPEED_SHARE, EMF_SHARE = 0.2, 0.45
LEAST_SPEED_SHARE = 0.35  # from where on the run counts
HOLD_S = 0.03
BLOCKS_A_SWING, BLOCK_MOST_S = 20.0, 5e-3
BANDWIDTH_TICKS = 25.0  # of the current regulator: a period in ticks
IN_STEP_RAD = 2.0  # the rotor's swing against the frame, peak to peak


@dataclass
class Commissioning:
    """A bench with an unknown machine. carrier_cycles, tick_cycles: clocks. stage, share: how far the work has come."""

    plate: NamePlate
    inverter: Inverter
    clock_hz: float
    carrier_cycles: int
    tick_cycles: int
    stage: str = "start"
    share: float = 0.0

    def __post_init__(self) -> None:
        self.scales = Scales.of(self.inverter, self.clock_hz, self.carrier_cycles, self.tick_cycles)
        self.highest_a = min(self.plate.rated_current_a, CURRENT_SHARE * self.inverter.protection.phase_current_a)
        self.lsb_a = 2.0 * self.inverter.sensing.current_full_scale_a / 2.0**self.inverter.sensing.bits
        self.before: Block | None = None
        self.lost = 0  # clocks that the dead time takes, by the inverter file
        self.alternating: dict[bool, tuple[int, float]] = {}  # by axis: clocks, and the inductance found with them
        if self.highest_a < 50.0 * self.lsb_a:
            raise MeasurementError(
                f"{self.highest_a:.3g} A are {self.highest_a / self.lsb_a:.0f} LSB of the current channels, 50 are "
                "wanted; take an inverter with a smaller current_full_scale_a"
            )

    def conversation(self) -> Dialogue:
        """Yields lines, gets the lines of the replies, returns the measurement as plain values."""
        try:
            return (yield from self._measure())
        except MeasurementError:
            yield "o"
            raise

    def _measure(self) -> Dialogue:
        yield f"o {self.scales.patience(PATIENCE_S)}"
        yield f"{self.scales.scale()} v 0 0 r 80 80"
        above = yield from self._approach()
        winding, resistance, falls = yield from self._windings(above)
        motions, psi, mech = yield from self._run(winding, falls)
        self.stage, self.share = "end", 1.0
        return {
            **resistance,
            "ld_h": winding.ld_h,
            "lq_h": winding.lq_h,
            "dead_v": winding.dead_v,
            "psi_vs": psi,
            "inertia_kgm2": mech.inertia_kgm2,
            "coulomb_nm": mech.coulomb_nm,
            "viscous_nm_s_per_rad": mech.viscous_nm_s_per_rad,
            "fan_nm_s2_per_rad2": mech.fan_nm_s2_per_rad2,
            "run": _shown(motions, mech, winding),
        }

    def _segment(self, line: str, duration_s: float, block_s: float = BLOCK_S) -> Dialogue:
        """Run for a time, return the blocks."""
        reply = yield f"{line} {self.scales.run(duration_s, block_s)}".strip()
        blocks = self.scales.blocks(reply)
        self.before = blocks[-1]
        return blocks

    def _rest(self, line: str, share: float, swing: bool) -> Dialogue:
        """Run until the current keeps still, to a share of itself; return all blocks.

        swing: the rotor has to move first; what its EMF drives on q must have been seen, or time enough have passed.
        """
        blocks: list[Block] = []
        while True:
            blocks += yield from self._segment(line, REST_S)
            line = ""
            block_s = blocks[0].duration_s
            time_s = block_s * len(blocks)
            span = max(REST_S, 0.2 * time_s)
            last = np.array([b.current_a for b in blocks[-round(span / block_s) :]])
            allowed = max(share * abs(last.mean()), REST_LSB * self.lsb_a)
            still = float(np.max(np.abs(last - last.mean()))) <= allowed
            aligned = abs(last.mean().imag) <= max(REST_Q_SHARE * abs(last.mean()), REST_LSB * self.lsb_a)
            swung = [abs(b.current_a.imag) for b in blocks[round(FIRST_SETTLE_S / block_s) :]]
            seen = max(swung, default=0.0) >= SWING_SHARE * abs(last.mean())
            waited = not swing or seen or time_s > SWING_LIMIT_S
            if time_s >= 2.0 * REST_S and still and aligned and waited:
                return blocks
            if time_s > REST_LIMIT_S:
                raise MeasurementError(f"the rotor does not come to rest within {REST_LIMIT_S:g} s; brake it")

    def _approach(self) -> Dialogue:
        """Raise the voltage until the aligning current flows; return the clocks beside those of the dead time."""
        self.stage, self.share = "current", 0.02
        i = self.inverter
        lost_v = i.dead_time_s * self.clock_hz / self.carrier_cycles * (i.supply_v + 2 * i.diode_drop_v)
        one_v = self.scales.along_v(1)
        wanted = ALIGN_SHARE * self.highest_a
        self.lost = round(4 / 3 * lost_v / one_v)
        above = max(1, round(0.002 * i.supply_v / one_v))
        turn = self.scales.ahead(-60.0)
        while True:
            blocks = yield from self._rest(f"{turn} {self._along(above)}".strip(), APPROACH_SHARE, False)
            turn = ""
            current = blocks[-1].current_a.real
            if current >= 0.9 * wanted:
                return above
            most = 2.0 if current < 0.05 * wanted else min(2.0, 0.98 * wanted / current)
            above = max(above + 1, round(above * most))
            volts = self.scales.along_v(self.lost + above)
            if volts > 0.4 * i.supply_v:
                raise MeasurementError(f"{volts:.3g} V drive only {current:.3g} A: are all three phases connected?")

    def _along(self, above: float) -> str:
        """DC voltage on d: clocks beside those of the dead time."""
        return self.scales.legs("v", self.lost + max(1, round(above)))

    def _windings(self, above: int) -> Dialogue:
        """Resistances, dead time and inductances on three axes; the rotor swings to each."""
        lines: list[Line] = []
        axes: list[tuple[float, float]] = []
        falls: list[tuple[list[Block], Block]] = []
        settle = FIRST_SETTLE_S
        for n, _ in enumerate(AXES_DEG):
            self.stage, self.share = f"winding {n + 1}", 0.1 + 0.18 * n
            before = self.before
            assert before is not None
            turned = Block(0.0, 0j, 0j, 0.0, before.last_a * np.exp(-1j * math.pi / 3), 0.0)
            blocks = yield from self._rest(f"{self.scales.ahead(60.0)} {self._along(above)} w 0 0", REST_SHARE, True)
            falls.append((blocks, turned))
            line = yield from self._levels(above, settle)
            axes.append((yield from self._axis_inductances(above, line.slope_ohm)))
            wanted = SETTLED_TIMES * max(axes[-1]) / line.slope_ohm
            if n == 0 and wanted > settle:
                line = yield from self._levels(above, wanted)
            settle = wanted
            lines.append(line)
        a, c, b = (line.slope_ohm for line in lines)
        phases = estimate.phase_resistances((a, b, c))
        mean = sum(phases) / 3
        winding = Winding(
            resistance_ohm=mean,
            ld_h=float(np.mean([axis[0] for axis in axes])),
            lq_h=float(np.mean([axis[1] for axis in axes])),
            dead_v=0.75 * float(np.mean([line.intercept_v for line in lines])),
        )
        found = {
            "resistance_ohm": list(phases),
            "lines": [asdict(line) for line in (lines[0], lines[2], lines[1])],
            "axes_h": [list(axis) for axis in (axes[0], axes[2], axes[1])],
        }
        return winding, found, falls

    def _levels(self, above: int, settle_s: float) -> Dialogue:
        """Voltage over current on the axis where the rotor rests."""
        points: list[Block] = []
        for level in LEVELS:
            yield from self._segment(f"{self._along(above * level / ALIGN_SHARE)} w 0 0", settle_s)
            points += yield from self._segment("", LEVEL_S, LEVEL_S)
        return Line.through(points)

    def _axis_inductances(self, above: int, resistance: float) -> Dialogue:
        """L on d and q, with the rotor at rest on the axis."""
        d = yield from self._inductance(above, resistance, False)
        q = yield from self._inductance(above, resistance, True)
        return d, q

    def _inductance(self, above: int, resistance: float, across: bool) -> Dialogue:
        """L from the triangle of current that an alternating voltage on d, or across it on q, makes."""
        if across not in self.alternating:
            self.alternating[across] = yield from self._amplitude(above, resistance, across)
        count, inductance = self.alternating[across]
        settle_s = min(0.05, ALTERNATING_TIMES * inductance / resistance)
        blocks = yield from self._segment(self._alternate(above, count, across), settle_s + ALTERNATE_S)
        last = blocks[-round(ALTERNATE_S / blocks[0].duration_s) :]
        found = self._triangle(last, count, resistance, across)
        self.alternating[across] = count, found
        return found

    def _alternate(self, above: int, count: int, across: bool) -> str:
        legs = self.scales.legs("w", 0, count) if across else self.scales.legs("w", count)
        return f"{self._along(above)} {legs}"

    def _amplitude(self, above: int, resistance: float, across: bool) -> Dialogue:
        """Clocks of alternating voltage for a triangle of the wanted size, and a first inductance."""
        count = 2
        wanted = ALTERNATE_SHARE * self.highest_a
        while True:
            blocks = yield from self._segment(self._alternate(above, count, across), 2 * BLOCK_S)
            more = min(6.0, wanted / max(abs(blocks[-1].corner_a), self.lsb_a))
            if more < 1.4 or count > self.carrier_cycles / 8:
                return count, self._triangle(blocks[-1:], count, resistance, across)
            count = 2 * max(count // 2 + 1, round(count * more / 2))

    def _triangle(self, blocks: Sequence[Block], count: int, resistance: float, across: bool) -> float:
        corner = complex(np.mean([b.corner_a for b in blocks]))
        middle = complex(np.mean([b.middle_a for b in blocks]))
        if abs(middle) > 0.8 * abs(corner):
            raise MeasurementError(
                "the alternating current is not in step with its voltage: no winding, or one whose L/R is shorter than "
                f"{self.scales.tick_s * 1e6:.0f} us"
            )
        volts = self.scales.across_v(count) if across else self.scales.along_v(count)
        volts *= float(np.mean([b.vdc_v for b in blocks])) / self.inverter.supply_v
        share = corner.imag if across else corner.real
        return estimate.triangle_inductance(volts, share, resistance, 2 * self.scales.tick_s)

    def _run(self, w: Winding, falls: Sequence[tuple[list[Block], Block]]) -> Dialogue:
        """Turn the rotor with a current that is led round; flux, inertia, friction."""
        self.stage, self.share = "run", 0.64
        p = self.plate.pole_pairs
        swings = [estimate.falling(blocks, before, w, -60.0) for blocks, before in falls[1:]]
        psi = float(np.mean([psi for _, psi in swings]))
        rough = estimate.mechanics([motion for motion, _ in swings], w, psi, p).inertia_kgm2
        current = ALIGN_SHARE * self.highest_a
        phase_v = self.inverter.supply_v / math.sqrt(3)
        omega = min(SPEED_SHARE * self.plate.omega_max, EMF_SHARE * phase_v / psi)
        most = 1.5 * p * p * psi * current / rough
        bandwidth = 1.0 / (BANDWIDTH_TICKS * self.scales.tick_s)
        gains = self.scales.gains(w.resistance_ohm, max(w.ld_h, w.lq_h), bandwidth, omega)
        acceleration = min(ACCELERATION_SHARE * most, omega / UP_LEAST_S)
        block_s = min(max(2.0 * math.pi / math.sqrt(most) / BLOCKS_A_SWING, BLOCK_S), BLOCK_MOST_S)
        line = f"{gains} {self.scales.current(complex(current))}"
        motions = yield from self._lead_round(line, omega, acceleration, block_s, w)
        yield "o"
        if any(np.ptp(m.delta) > IN_STEP_RAD for m in motions):
            raise MeasurementError(
                f"the rotor fell out of step on the way to {omega / p * RPM_PER_RAD_S:.0f} r/min; "
                "take the load off its shaft"
            )
        psi = estimate.flux(motions, w)
        return motions, psi, estimate.mechanics(motions, w, psi, p)

    def _lead_round(self, line: str, omega: float, acceleration: float, block_s: float, w: Winding) -> Dialogue:
        """Up and hold, and down; of both what is fast enough."""
        least = LEAST_SPEED_SHARE * omega
        motions = []
        legs = ((omega, omega / acceleration + HOLD_S), (0.9 * least, (omega - 0.9 * least) / acceleration))
        for target, duration_s in legs:
            before = self.before
            assert before is not None
            blocks = yield from self._segment(f"{line} {self.scales.speed(target, acceleration)}", duration_s, block_s)
            motions.append(estimate.turning(blocks, before, w).above(least))
            line, self.share = "", 0.85
        return motions


def _shown(motions: Sequence[Motion], mech: Mechanics, w: Winding) -> dict[str, list[float]]:
    """What the plot of the run shows."""
    return {
        "time_s": mech.time_s.tolist(),
        "omega": np.concatenate([m.omega for m in motions]).tolist(),
        "magnet_emf_v": np.concatenate([m.magnet_emf_v(w) for m in motions]).tolist(),
        "delta": np.concatenate([m.delta for m in motions]).tolist(),
        "torque_nm": mech.torque_nm.tolist(),
        "omega_m": mech.omega_m.tolist(),
    }
