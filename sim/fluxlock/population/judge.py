# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How a life went: right, or wrong for stated reasons.

Everything is measured against the true machine, over the holds of the life; current, trips and a lost angle over the
whole of it. An error of the angle that follows from the motor file's errors is taken off before it is judged.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fluxlock.config.machine import Machine
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.firmware.host import one_at_a_time
from fluxlock.population.ideal import ideal_ripple_rpm
from fluxlock.population.life import SPEED_TOLERANCE, Change, Hold, Life
from fluxlock.results.angles import dq_current
from fluxlock.results.metrics import Analysis, largest_current, trips
from fluxlock.results.rundata import ComplexArray, FloatArray, RunData
from fluxlock.results.verdict import CURRENT_SHARE, LOST_COMMUTATIONS, LOST_DEG, LOST_S, RUNNING, STATES

ANGLE_RMS_DEG, COMMUTATION_RMS_DEG = 3.0, 1.0
RIPPLE_SHARE, RIPPLE_OF_IDEAL = 0.01, 1.3
OVERSHOOT_SHARE = 0.05


@dataclass(frozen=True)
class Reason:
    """Why a life is wrong. kind: to count by; text: with numbers."""

    kind: str
    text: str


@dataclass(frozen=True)
class Measured:
    """One hold. ripple: p-p over the speed; ideal: that of the ideal drive; angle: rms without the file's errors."""

    name: str
    rpm: float
    off: float
    ripple: float
    ideal: float
    angle_rms_deg: float | None
    file_deg: float
    current_a: float


@dataclass(frozen=True)
class Judgement:
    """reasons: none if the life is right.

    overshoot: the largest; current: largest mean over a millisecond over the limit.
    """

    reasons: tuple[Reason, ...]
    holds: tuple[Measured, ...]
    overshoot: float
    current: float

    def as_json(self) -> dict[str, Any]:
        """To keep."""
        return asdict(self)


class Judge:
    """What is wrong with a run, kind by kind."""

    def __init__(self, data: RunData, life: Life) -> None:
        self.data, self.life, self.scenario = data, life, life.scenario
        self.analysis = Analysis(data)
        self.vector = life.method == "vector"
        self.time_s: FloatArray = data.records["t_cycle"] / data.clock_hz
        self.rpm: FloatArray = data.records["omega_e"] / life.scenario.motor.pole_pairs * RPM_PER_RAD_S
        self.current: ComplexArray = dq_current(data.records)
        self.reasons: list[Reason] = []

    def wrong(self, kind: str, text: str) -> None:
        """Note a reason."""
        self.reasons.append(Reason(kind, text))

    def ended(self) -> None:
        """Trips, faults, refused lines, and times in which the drive does not run although it was told to."""
        for trip in trips(self.data):
            self.wrong(f"trip {trip['cause']}", f"{trip['cause']} at {trip['time_s']:.4f} s")
        if self.data.fault:
            self.wrong(f"fault {self.data.fault}", f"fault {self.data.fault}")
        for rejected in self.data.rejected:
            self.wrong("line refused", f"{rejected.line}: {rejected.reason}")
        states = self.data.states()
        caught_s = self.life.caught_s
        late = states[(states["t_s"] >= caught_s) & (states["state"] != RUNNING)]
        if late.size:
            name = STATES[int(late["state"][0])]
            kind = "not caught" if late["t_s"][0] < caught_s + 1e-3 else "stopped running"
            self.wrong(kind, f"{name} at {late['t_s'][0]:.4f} s")

    def lost(self) -> None:
        """An angle that is lost while the drive says that it runs."""
        series = self.analysis.angles if self.vector else self.analysis.commutations
        time_s = series.cycle / self.data.clock_hz
        states = self.data.states()
        state = states["state"][np.searchsorted(states["t_s"], time_s, side="right") - 1] if states.size else time_s
        far = (np.abs(series.error_deg) > LOST_DEG) & (state == RUNNING)
        edges = np.flatnonzero(np.diff(np.concatenate(([0], far.astype(np.int8), [0]))))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            if (time_s[b - 1] - time_s[a] >= LOST_S) if self.vector else (b - a >= LOST_COMMUTATIONS):
                self.wrong("angle lost", f"from {time_s[a]:.4f} s on")
                return

    def largest_current(self) -> float:
        """Largest mean over a millisecond over the limit."""
        most_a, at_s = largest_current(self.data, self.vector)
        share = most_a / self.scenario.current_limit_a
        if share > CURRENT_SHARE:
            self.wrong("current", f"{100 * share:.0f} % of the limit at {at_s:.4f} s")
        return share

    def file_error_deg(self, current: complex, omega: float) -> float:
        """Angle by which the observed EMF is off for the file's errors alone."""
        s = self.scenario
        true, told = Machine.of(s.motor, s.inverter), Machine.of(s.motor, s.inverter, s.drive.motor_error)
        l_q, told_q = (m.inductance_h + m.saliency_h / 2 for m in (true, told))
        emf = 1j * omega * (true.fundamental_vs - true.saliency_h * current.real)
        seen = emf + (true.resistance_ohm - told.resistance_ohm) * current + 1j * omega * (l_q - told_q) * current
        return math.degrees(cmath.phase(seen / emf))

    def measure(self, hold: Hold) -> Measured:
        """One hold, its misses noted."""
        clock = self.data.clock_hz
        inside = (self.time_s >= hold.from_s) & (self.time_s < hold.to_s)
        low, high = hold.from_s * clock, hold.to_s * clock
        turned = self.analysis.track.theta_rad(np.array([low, high]))
        mean_rpm = float(turned[1] - turned[0]) / (hold.to_s - hold.from_s) / self.scenario.motor.pole_pairs
        mean_rpm *= RPM_PER_RAD_S
        off = mean_rpm / hold.rpm - 1.0
        if abs(off) > SPEED_TOLERANCE:
            self.wrong("speed", f"{hold.name}: {mean_rpm:.1f} for {hold.rpm:.0f} r/min ({100 * off:+.2f} %)")
        current = complex(np.mean(self.current[inside]))
        ideal = ideal_ripple_rpm(self.scenario.motor, self.life.method, hold.rpm, current) / hold.rpm
        ripple = float(np.ptp(self.rpm[inside])) / hold.rpm
        # A speed that is wrong or still on its way has a spread, no ripple.
        if abs(off) <= SPEED_TOLERANCE and ripple > max(RIPPLE_SHARE, RIPPLE_OF_IDEAL * ideal):
            self.wrong("ripple", f"{hold.name}: {100 * ripple:.2f} % p-p, ideal drive {100 * ideal:.2f} %")
        file_deg = 0.0
        if self.vector:
            errors, limit = self.analysis.angles.between(low, high).error_deg, ANGLE_RMS_DEG
            file_deg = self.file_error_deg(current, hold.rpm / RPM_PER_RAD_S * self.scenario.motor.pole_pairs)
        else:
            errors, limit = self.analysis.commutations.between(low, high).error_deg, COMMUTATION_RMS_DEG
        rms = float(np.sqrt(np.mean((errors - file_deg) ** 2))) if errors.size else None
        if rms is None or rms > limit:
            self.wrong("angle", f"{hold.name}: {'none' if rms is None else f'{rms:.2f}'} deg rms, file {file_deg:.2f}")
        return Measured(hold.name, hold.rpm, off, ripple, ideal, rms, file_deg, float(abs(current)))

    def overshoot(self, change: Change) -> float:
        """Beyond the target over the change of the target."""
        step = change.to_rpm - change.from_rpm
        after = (self.time_s >= change.from_s) & (self.time_s < change.to_s)
        beyond = (self.rpm[after] - change.to_rpm) * math.copysign(1.0, step)
        share = float(beyond.max(initial=0.0)) / abs(step)
        if share > OVERSHOOT_SHARE:
            text = f"{change.from_rpm:.0f} to {change.to_rpm:.0f} r/min: {100 * share:.1f} % of the change"
            self.wrong("overshoot", text)
        return share


def judge(data: RunData, life: Life) -> Judgement:
    """A run of a life, on the host or on the chip."""
    j = Judge(data, life)
    j.ended()
    j.lost()
    current = j.largest_current()
    holds = tuple(j.measure(hold) for hold in life.holds)
    overshoot = max((j.overshoot(change) for change in life.changes), default=0.0)
    return Judgement(tuple(j.reasons), holds, overshoot, current)


@one_at_a_time()
def play(life: Life) -> RunData:
    """Run a life on the host."""
    from fluxlock.native.player import player

    return player(life.scenario, life.scenario.seed).run()
