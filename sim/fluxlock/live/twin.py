# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The twin as a source: the firmware as a program on a machine model, with everything that was done to it."""

from __future__ import annotations

from typing import Any

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import Event, Fault
from fluxlock.headers import CData
from fluxlock.live.played import Played
from fluxlock.live.source import KEPT_S, SLICE_S
from fluxlock.live.traces import CHIP_ONLY, TOLD, Floats, Marks, columns, marks_of
from fluxlock.native.play import not_played
from fluxlock.native.player import player

BEYOND = 3.0  # times the motor's speed at which the machine model ends: its open gates have no diodes


class Twin(Played):
    """A drive on a machine model."""

    kind = "twin"

    def __init__(self, scenario: Scenario, seed: int) -> None:
        super().__init__(scenario, seed)
        self.play = player(scenario, seed, KEPT_S)
        self._marks: Marks = []
        self._beyond = False

    @property
    def now(self) -> float:
        """Simulated time, s."""
        return self.play.now

    def hello(self) -> dict[str, Any]:
        """What a page draws itself from."""
        five = ("current_d", "current_e") if self.scenario.motor.phases == 5 else ()
        return super().hello() | {"without": ["motor_a", *(name for name in CHIP_ONLY if name not in five)]}

    def advance(self, seconds: float, until: str = "end") -> bool:
        """So much simulated time at most, with the scenario's events at their times; none behind the model's end."""
        if self._beyond:
            return False
        return self._advance(self.now + min(seconds, SLICE_S))

    def _go(self, end_s: float, until: str = "end") -> bool:
        self.play.advance(end_s)
        rpm = self.play.shaft[0] * RPM_PER_RAD_S
        if not self._beyond and abs(rpm) > BEYOND * self.scenario.motor.max_speed_rpm:
            self._beyond = True
            text = f"the load turns the rotor at {rpm:.0f} r/min: the twin's model ends here, Restart begins anew"
            self.said.append({"kind": "said", "t_s": self.now, "text": text, "answer": ""})
        return False

    def _missing(self, fault: Fault) -> str:
        why = not_played(fault, self.scenario.mechanics)
        return f"{why}; `fluxlock live SCENARIO --chip` has it" if why else ""

    def _carry_out(self, event: Event) -> None:
        before = len(self.play.uart)
        self.play.act(event)
        answer = " ".join(self.play.uart[before:][-1:])
        del self.play.uart[:]
        self._answered(event, answer)

    def _telemetry(self) -> CData:
        return self.play.firmware.telemetry()

    def take(self) -> tuple[Floats, Floats]:
        """Times and traces since the last call."""
        taken = self.play.take()
        self._causes |= taken.trips
        self._marks += marks_of(taken.log, CLOCK_HZ, int(self._last[TOLD.index("state")]))
        time_s, rows = columns(taken, CLOCK_HZ, self.scenario.motor.pole_pairs, self._last)
        self._note_speed(time_s, rows)
        return time_s, rows

    def marks(self) -> Marks:
        """Instants since the last call."""
        found, self._marks = self._marks, []
        return found

    def status(self) -> dict[str, Any]:
        """The drive as it is."""
        return super().status() | {"load_factor": self.play.load_factor, "supply_v": self.play.supply_v}
