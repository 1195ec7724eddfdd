# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The steps of a first start, each with what it does to the machine at most."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fluxlock.commission.report import beside_the_file, figure, motor_file, quantities, write_motor
from fluxlock.commission.simulate import plate_of
from fluxlock.config import ConfigError, Motor, Scenario
from fluxlock.config.least_speed import least_six_step_rpm, least_vector_rpm
from fluxlock.cosim.plan import ConversationError
from fluxlock.first_start.bench import Bench
from fluxlock.first_start.guide import ByHandError, Guide
from fluxlock.first_start.plot import turns_figure
from fluxlock.first_start.turn import Lead, Record, TurnError
from fluxlock.flash.board_console import SilentError
from fluxlock.flash.loader import LoaderError
from fluxlock.flash.serial_port import PortError
from fluxlock.results.rundata import SimulationFault
from fluxlock.results.verdict import Verdict
from fluxlock.theory.six_step.plots import save
from fluxlock.wiring.command import verdict_of
from fluxlock.wiring.naming import CURRENT_SHARE
from fluxlock.wiring.reach import WiringError

STEPS = ("wiring", "identify", "first turn", "tune")
# Of the highest speed; over the least speed that the method holds.
TURN_SHARE, TURN_OVER_LEAST = 0.15, 1.5
# What the measurement may reach: it asks for 0.2, and a rotor that swings behind its current was 7 % faster.
IDENTIFY_SHARE = 0.22
STEP_FACTOR = 1.5  # the step goes to so many times the first speed
TURN_S, STEP_S = 20.0, 10.0  # patience
TROUBLES = (WiringError, ConversationError, SimulationFault, TurnError, SilentError, LoaderError, PortError)


class StoppedError(RuntimeError):
    """A first start that ends before its end; the message says in which step, and why."""


class FirstStart:
    """One first start. out: folder of what it writes. share: of the rated current, in the turns."""

    def __init__(self, scenario: Scenario, out: Path, share: float, guide: Guide) -> None:
        self.scenario, self.out, self.guide = scenario, out, guide
        self.step, self.done = STEPS[0], dict[str, Any]()
        self.record: Record | None = None
        motor, drive = scenario.motor, scenario.drive
        vector = drive.method == "vector"
        least_rpm = least_vector_rpm(motor, scenario.inverter) if vector else least_six_step_rpm(motor)
        self.turn_rpm = round(max(TURN_SHARE * motor.max_speed_rpm, TURN_OVER_LEAST * least_rpm))
        self.step_rpm = round(STEP_FACTOR * self.turn_rpm)
        self.limit_a = min(share * motor.rated_current_a, drive.current_limit_a or motor.rated_current_a)
        if self.step_rpm > motor.max_speed_rpm:
            text = f"the method holds {least_rpm:.0f} r/min and more, too near this highest speed for a first turn"
            raise ConfigError([scenario.sources.problem("motor.max_speed_rpm", text)])

    def run(self, bench: Bench) -> Verdict:
        """All steps, and the report of them. At the end of a board's the gates are off."""
        try:
            self._lead(bench)
            verdict = Verdict(True, ["the machine is wired, measured, turns and follows a step of its speed"])
        except StoppedError as error:
            verdict = Verdict(False, str(error).splitlines())
        except (ByHandError, KeyboardInterrupt):
            verdict = Verdict(False, [f"stopped by hand in the step {self.step}; the gates are off"])
        self._write(verdict)
        return verdict

    def _lead(self, bench: Bench) -> None:
        """Raises StoppedError, and ByHandError."""
        try:
            self._wiring(bench)
            motor = self._identify(bench)
            self._begin("first turn")
            with bench.drive(self.scenario, motor) as drive:
                lead = Lead(drive, self.guide.look)
                self.record = lead.record
                with lead.within(self.limit_a):
                    self._turn(lead)
                    self._tune(lead)
        except TROUBLES as error:
            raise StoppedError(f"{self.step}: {error}") from None

    def _write(self, verdict: Verdict) -> None:
        document = {"verdict": verdict.as_json(), "scenario": self.scenario.name, "steps": self.done}
        (self.out / "first-start.json").write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
        if self.record is not None and self.record.time_s:
            save(turns_figure(self.record, self.limit_a, self.scenario.name), self.out / "turns.png")

    def limits(self, step: str) -> str:
        """What a step does to the machine at most."""
        motor = self.scenario.motor
        if step == "wiring":
            return f"pulses up to {CURRENT_SHARE * motor.rated_current_a:.3g} A for 0.2 s; the rotor stays where it is"
        if step == "identify":
            most = f"{motor.rated_current_a:.3g} A and {IDENTIFY_SHARE * motor.max_speed_rpm:.0f} r/min"
            return f"up to {most} for some seconds; the shaft has to turn freely"
        speed_rpm = self.turn_rpm if step == "first turn" else self.step_rpm
        return f"up to {self.limit_a:.3g} A and {speed_rpm} r/min"

    def _begin(self, step: str) -> None:
        self.step = step
        self.guide.begin(STEPS.index(step) + 1, step, self.limits(step))
        if not self.guide.ask("go on?"):
            raise StoppedError(f"stopped before the step {step}; the gates are off")

    def _end(self, passed: bool, text: str, **values: object) -> None:
        self.done[self.step] = {"passed": passed, "text": text, **values}
        self.guide.end(self.step, passed, text)
        if not passed:
            raise StoppedError(f"{self.step}: {text}")

    def _wiring(self, bench: Bench) -> None:
        self._begin("wiring")
        measured = bench.wiring(self.scenario)
        verdict = verdict_of(measured)
        self._end(verdict.passed, "; ".join(verdict.lines), current_peak_a=round(measured.peak_a, 6))

    def _identify(self, bench: Bench) -> Motor:
        self._begin("identify")
        s = self.scenario
        with self.guide.progress() as progress:
            measured = bench.identify(s, progress)
        plate, found = plate_of(s.motor), quantities(measured.values, s.inverter.on_resistance_ohm, s.motor)
        origin = f"Measured by fluxlock first-start with the inverter {s.inverter.name}."
        motor = write_motor(self.out / "motor.toml", motor_file(measured.values, plate, s.inverter, origin))
        save(figure(measured.values, f"{plate.name} on {s.inverter.name}"), self.out / "motor.png")
        off_percent = {q.name: q.error_percent for q in found}
        self._end(True, beside_the_file(found).lines[0], off_file_percent=off_percent)
        return motor

    def _turn(self, lead: Lead) -> None:
        turned = lead.reach(self.turn_rpm, TURN_S)
        lead.rest()
        if not self.guide.ask("did the shaft turn the way that you want?"):
            text = "the other way is wanted: swap two leads of the motor and begin anew, or ask for negative speeds"
            self._end(False, text)
        self._end(True, f"{self.turn_rpm} r/min after {turned.settled_s:.2f} s", settled_s=round(turned.settled_s, 3))

    def _tune(self, lead: Lead) -> None:
        self._begin("tune")
        lead.reach(self.turn_rpm, TURN_S)
        up = lead.reach(self.step_rpm, STEP_S)
        down = lead.reach(self.turn_rpm, STEP_S)
        lead.rest()
        text = f"to {self.step_rpm} r/min in {up.settled_s:.2f} s, {100 * up.overshoot:.1f} % too fast at most; "
        text += f"back in {down.settled_s:.2f} s"
        if not up.passed:
            text += ": the loops are those of the measured inertia; couple the load before the step identify, or set a "
            text += "lower speed_hz"
        self._end(up.passed, text, overshoot=round(up.overshoot, 5), settled_s=round(up.settled_s, 3))
