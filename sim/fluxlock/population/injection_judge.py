# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How a start by injection went: right, ended by a fault that names it in time, or wrong for stated reasons.

Everything is measured against the true machine. An angle that is lost, a speed that is not the rotor's and motion the
wrong way are wrong if the drive runs on with them. A fault that comes in time ends a life as `named`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluxlock.firmware.binding import names
from fluxlock.native.injection_run import READY_S, InjectionRun
from fluxlock.population.injection_life import InjectionLife
from fluxlock.results.rundata import FloatArray

LOST_DEG, NAMED_S = 60.0, 0.05
WRONG_WAY_DEG = 90.0
SPEED_SHARE, SPEED_OF_BASE = 0.1, 0.02  # reported over true speed
RMS_DEG, SETTLE_S = 3.0, 0.1  # after the search, and after the friction
SEARCHED_DEG, BACKWARD_DEG = 10.0, 10.0
FORWARD_DEG = 90.0
STARTS_SHARE = 0.8  # of the rated torque, friction that the drive starts against


@dataclass(frozen=True)
class InjectionFound:
    """kind, text of each reason; fault: its name, also of a right angle; rms: of the angle, before and after."""

    reasons: tuple[tuple[str, str], ...]
    fault: str
    searched_deg: float
    rms_deg: tuple[float, float]
    found_s: float
    fault_s: float

    @property
    def named(self) -> bool:
        """A fault ended it, and nothing went wrong before."""
        return not self.reasons and self.fault != "none"


def longest(where: NDArray[np.bool_], period_s: float) -> float:
    """Longest time without a break, s."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], where.astype(np.int8), [0]))))
    return float(np.diff(edges)[::2].max(initial=0)) * period_s


class _Judge:
    def __init__(self, run: InjectionRun, life: InjectionLife) -> None:
        self.run, self.life = run, life
        self.rows, self.time_s = run.rows, run.time_s
        self.period_s = run.chip.setup.period_s
        self.base_rpm = life.scenario.motor.max_speed_rpm
        self.forward = math.copysign(1.0, life.target_rpm)
        states = names("drive_state_t")
        self.running: NDArray[np.bool_] = self.rows["state"] == states.index("running")
        self.omega: FloatArray = self.rows["omega"]
        self.reasons: list[tuple[str, str]] = []

    def wrong(self, kind: str, text: str) -> None:
        self.reasons.append((kind, text))

    def found(self) -> bool:
        return not math.isnan(self.run.found_s)

    def backward_deg(self) -> float:
        """Electrical travel against the target while it is faster that way than when the search ended."""
        begun = max(0.0, -self.forward * float(self.omega[self.time_s >= self.run.found_s][0]))
        against = np.where(self.running, -self.forward * self.omega, 0.0)
        return float(np.degrees(np.sum(np.where(against > begun + 1e-9, against, 0.0)) * self.period_s))

    def while_running(self) -> None:
        """Angle, speed and way as long as the drive said that it runs."""
        if longest(self.running & (np.abs(self.rows["error_deg"]) > LOST_DEG), self.period_s) > NAMED_S:
            self.wrong("angle lost", f"off by more than {LOST_DEG:g} deg for more than {1e3 * NAMED_S:g} ms")
        true_rpm = self.omega / self.life.machine.pole_pairs * 30.0 / math.pi
        off = np.abs(self._mean(self.rows["rpm"]) - self._mean(true_rpm))
        allowed = np.maximum(SPEED_SHARE * np.abs(self._mean(true_rpm)), SPEED_OF_BASE * self.base_rpm)
        after = self.running & (self.time_s > self.run.found_s + SETTLE_S)
        if longest(after & (off > allowed), self.period_s) > NAMED_S:
            self.wrong("speed reported", f"up to {off[after].max():.0f} r/min beside the rotor's")
        backward = self.backward_deg()
        if backward > WRONG_WAY_DEG:
            self.wrong("wrong way", f"{backward:.0f} deg el. against the target")
        elif backward > BACKWARD_DEG and self.run.fault == "none":
            self.wrong("backward", f"{backward:.1f} deg el. against the target")

    def _mean(self, values: FloatArray) -> FloatArray:
        """Over 20 ms: a loop's delay and ripple are no wrong speed."""
        count = max(1, round(0.02 / self.period_s))
        return np.convolve(values, np.full(count, 1.0 / count), "same")

    def rms(self, from_s: float, to_s: float) -> float:
        inside = (self.time_s >= from_s) & (self.time_s < to_s)
        return float(np.sqrt(np.mean(self.rows["error_deg"][inside] ** 2))) if inside.any() else math.nan

    def to_the_end(self) -> tuple[float, float]:
        """Angle and start of a life that no fault ended."""
        run, d = self.run, self.life.draw
        loaded_s = run.found_s + self.life.run_s
        before, after = self.rms(run.found_s + SETTLE_S, loaded_s), self.rms(loaded_s + SETTLE_S, run.chip.now)
        for name, value in (("angle", before), ("angle, loaded", after)):
            if value > RMS_DEG:
                self.wrong(name, f"{value:.2f} deg rms")
        turned = self.forward * float(np.degrees(self.rows["theta"][-1] - self.rows["theta"][self.running][0]))
        if not d.blocked and not d.turning and turned < FORWARD_DEG:
            self.wrong("no start", f"{turned:.0f} deg el. in {2 * self.life.run_s:.1f} s")
        return before, after

    def searched_deg(self) -> float:
        """Of a rotor that stood."""
        if self.life.draw.turning:
            return 0.0
        moved = self.run.searched_deg()
        if moved > SEARCHED_DEG:
            self.wrong("search moved the rotor", f"{moved:.1f} deg el.")
        return moved


def judge_injection(run: InjectionRun, life: InjectionLife) -> InjectionFound:
    """A run of a life on the host."""
    j, rms = _Judge(run, life), (math.nan, math.nan)
    searched = j.searched_deg()
    if j.found():
        j.while_running()
        if run.fault == "none":
            rms = j.to_the_end()
    elif run.fault == "none":
        j.wrong("search", f"neither an angle nor a fault at {run.chip.now - READY_S:.2f} s")
    return InjectionFound(tuple(j.reasons), run.fault, searched, rms, run.found_s, run.fault_s)


def row_of(found: InjectionFound, run: InjectionRun) -> dict[str, Any]:
    """What is kept of it. A named end says whether the angle was right until then."""
    reasons = [{"kind": kind, "text": text} for kind, text in found.reasons]
    if found.named:
        worst = float(np.abs(run.window(found.found_s)["error_deg"]).max()) if not math.isnan(found.found_s) else 0.0
        at = "search" if math.isnan(found.found_s) else "lost" if worst > LOST_DEG else "angle right"
        reasons = [{"kind": f"{found.fault}, {at}", "text": f"after {found.fault_s - READY_S:.3f} s, {worst:.0f} deg"}]
    return {
        "reasons": reasons,
        "fault": found.fault,
        "searched_deg": found.searched_deg,
        "rms_deg": [None if math.isnan(value) else value for value in found.rms_deg],
    }
