# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""One run of an injected drive on the host twin: start, target, load, jumps of the angle, and what came out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Load, Motor, Scenario
from fluxlock.native.injection_chip import InjectionChip

READY_S, STEP_S = 0.02, 1e-3
LOST_DEG, LOST_S = 90.0, 2e-3


@dataclass
class InjectionRun:
    """One run. target_rpm: set before the start; machine: the true one, if it is not that of the file."""

    scenario: Scenario
    theta_deg: float = 200.0
    target_rpm: float | None = None
    machine: Motor | None = None
    seed: int = 1
    begun_rpm: float = 0.0
    chip: InjectionChip = field(init=False)
    found_s: float = math.nan  # when the search ended
    fault_s: float = math.nan

    def __post_init__(self) -> None:
        s = self.scenario
        initial = s.initial.model_copy(update={"theta_deg": self.theta_deg % 360.0, "speed_rpm": self.begun_rpm})
        self.chip = InjectionChip(s.model_copy(update={"initial": initial}), self.seed, self.machine)
        if self.target_rpm is None:
            self.target_rpm = next(event.speed_rpm for event in s.event if event.speed_rpm is not None)
        self._rows: list[NDArray[Any]] = []

    def run(self, seconds: float, each: Callable[[InjectionRun], None] | None = None) -> None:
        """So long, or until a fault."""
        end = self.chip.now + seconds
        while self.chip.now < end - 1e-9 and math.isnan(self.fault_s):
            count = max(1, round(min(STEP_S, end - self.chip.now) / self.chip.setup.period_s))
            self.chip.keep_rows(count)
            self.chip.advance(count)
            self._rows.append(self.chip.rows().copy())
            if self.chip.fw.state == "fault":
                self.fault_s = self.chip.now
            if math.isnan(self.found_s) and self.chip.fw.state == "running":
                self.found_s = self.chip.now
            if each is not None:
                each(self)

    def start(self, seconds: float = 0.4) -> bool:
        """Boot, start, search; whether the drive runs."""
        self.run(READY_S)
        assert self.chip.fw.state == "ready", self.chip.fw.command("status")
        self.aim(self.target_rpm or 0.0)
        assert self.chip.fw.command("start") == ["ok"]
        end = self.chip.now + seconds
        while self.chip.now < end and math.isnan(self.found_s) and math.isnan(self.fault_s):
            self.run(STEP_S)
        return not math.isnan(self.found_s)

    def aim(self, rpm: float) -> None:
        """Set the target."""
        self.target_rpm = rpm
        assert self.chip.fw.command(f"set speed_rpm {round(rpm)}") == ["ok"]

    def load(self, torque_nm: float) -> None:
        """A constant torque against positive rotation, over the file's load."""
        shaft = self.scenario.shaft_load
        self.chip.set_load(Load.model_validate(shaft.model_dump() | {"constant_nm": torque_nm}))

    @property
    def fault(self) -> str:
        """Its name, or `none`."""
        return self.chip.fault if not math.isnan(self.fault_s) else "none"

    @property
    def rows(self) -> NDArray[Any]:
        """All that was recorded."""
        return np.concatenate(self._rows)

    @property
    def time_s(self) -> NDArray[Any]:
        """Instants of the rows."""
        return np.asarray(self.rows["t_cycle"] / CLOCK_HZ)

    def window(self, from_s: float, to_s: float = math.inf) -> NDArray[Any]:
        """Rows from an instant to another one."""
        t = self.time_s
        return np.asarray(self.rows[(t >= from_s) & (t < to_s)])

    def rms_deg(self, from_s: float, to_s: float = math.inf) -> float:
        """Of the published angle."""
        return float(np.sqrt(np.mean(self.window(from_s, to_s)["error_deg"] ** 2)))

    def searched_deg(self) -> float:
        """Largest electrical motion of the rotor until the search ended, or the fault came."""
        end_s = self.found_s if not math.isnan(self.found_s) else self.fault_s
        theta = self.window(READY_S, end_s)["theta"]
        return float(np.degrees(np.abs(theta - theta[0]).max()))

    def wrong_deg(self, from_s: float) -> float:
        """Farthest electrical travel against the target after an instant, from the most forward place before."""
        assert self.target_rpm is not None
        theta = np.degrees(self.window(from_s)["theta"]) * (1.0 if self.target_rpm >= 0 else -1.0)
        return float((np.maximum.accumulate(theta) - theta).max(initial=0.0))

    def lost_s(self, from_s: float) -> float:
        """From the first instant at which the angle is off by 90 degrees for 2 ms, nan without one."""
        rows = self.window(from_s)
        off = np.abs(rows["error_deg"]) > LOST_DEG
        need = max(1, round(LOST_S / self.chip.setup.period_s))
        run = np.convolve(off, np.ones(need), mode="valid")
        found = np.flatnonzero(run >= need)
        return float(rows["t_cycle"][found[0]] / CLOCK_HZ) if found.size else math.nan
