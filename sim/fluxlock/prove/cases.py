# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The lives that `fluxlock prove` runs on the twin, and what each was like."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from fluxlock.api import simulate
from fluxlock.config import ConfigError
from fluxlock.config.drive import MotorError
from fluxlock.config.vector_design import handover_rpm
from fluxlock.cosim.parameters import refusals
from fluxlock.prove.life import LIGHT, Machine, life
from fluxlock.results.rundata import SimulationFault
from fluxlock.workers import side_by_side

VALUES = {"resistance": "R", "inductance": "L", "flux": "flux", "inertia": "J"}
SHARES = (-0.2, -0.1, 0.1, 0.2)  # of which each value of the file is off
HIGH_SHARES = (1.0, 0.9, 0.8, 0.7, 0.6)  # of the highest speed that are tried with load
REST_STEP_DEG = 10
RIGHT = MotorError()  # the drive is told the machine's own values
HOLDS, FAILS, REFUSED, BROKEN = "holds", "fails", "refused", "broken"


@dataclass(frozen=True)
class Case:
    """One life. group: nominal, rest or value; load: over the full one at the start."""

    group: str
    name: str
    error: MotorError = RIGHT
    theta_deg: float = 0.0
    load: float = LIGHT

    @property
    def whole(self) -> bool:
        """Whether the whole life is run, or the start alone."""
        return self.group != "rest"


@dataclass(frozen=True)
class Row:
    """What a case was like. off: largest error of a held speed as a share; angle_deg: largest rms of a window."""

    case: Case
    outcome: str
    reasons: tuple[str, ...]
    off: float | None = None
    angle_deg: float | None = None

    @property
    def holds(self) -> bool:
        """Whether every demand was met."""
        return self.outcome == HOLDS

    def as_json(self) -> dict[str, Any]:
        """To keep."""
        case = self.case
        factors = {name: getattr(case.error, key) for key, name in VALUES.items()}
        told = {name: factor for name, factor in factors.items() if factor != 1.0}
        head = {"group": case.group, "case": case.name, "rest_deg": case.theta_deg, "load": case.load, "told": told}
        return {
            **head,
            "outcome": self.outcome,
            "reasons": self.reasons,
            "speed_off": self.off,
            "angle_deg": self.angle_deg,
        }


def run_case(machine: Machine, case: Case) -> Row:
    """Run one life on the twin."""
    try:
        scenario = life(machine, case.error, case.theta_deg, whole=case.whole, load=case.load)
        if reasons := refusals(scenario):
            return Row(case, REFUSED, tuple(reasons))
        run = simulate(scenario, twin=True)
    except ConfigError as error:
        return Row(case, REFUSED, tuple(str(problem) for problem in error.problems))
    except SimulationFault as error:
        return Row(case, BROKEN, (str(error),))
    off, angles = [], []
    for expect in scenario.expect:
        metrics = run.metrics[expect.window]
        assert expect.min is not None
        assert expect.max is not None
        target = (expect.min + expect.max) / 2
        off.append(abs(metrics["speed_rpm"]["mean"] / target - 1.0))
        angle = metrics["angle_error_deg" if machine.method == "vector" else "commutation_error_deg"]["rms"]
        angles += [] if angle is None else [float(angle)]
    outcome = HOLDS if run.verdict.passed else FAILS
    return Row(case, outcome, tuple(run.verdict.failures), max(off, default=None), max(angles, default=None))


def least_rpm(machine: Machine) -> float:
    """Speed to which the drive raises a lower target. Raises ConfigError for what the file checks refuse."""
    from fluxlock.cosim.parameters import parameter_block

    scenario = life(machine, RIGHT, whole=False)
    least = float(parameter_block(scenario).number("stop_rpm"))
    return max(least, handover_rpm(scenario)) if machine.method == "vector" else least


def find_high(machine: Machine) -> tuple[Machine, list[Row]]:
    """The machine with the highest share of its speed at which the right file holds under load; what was tried.

    A lower share is tried only where voltage is what lacks.
    """
    tried: list[Row] = []
    for share in HIGH_SHARES:
        found = replace(machine, high=share)
        tried.append(run_case(found, Case("nominal", f"right values, to {100 * share:.0f} % of the highest speed")))
        if tried[-1].holds:
            return found, tried
        if not any("voltage" in reason or " V " in reason for reason in tried[-1].reasons):
            break
    return machine, tried


def cases(step_deg: int = REST_STEP_DEG) -> list[Case]:
    """All but the nominal one: rest angles light and loaded, and each value of the file off."""
    found = [
        Case("rest", f"{theta} deg, {name}", theta_deg=float(theta), load=load)
        for name, load in (("light", LIGHT), ("full load", 1.0))
        for theta in range(0, 360, step_deg)
    ]
    found += [
        Case("value", f"{name} {100 * share:+.0f} %", MotorError(**{key: 1.0 + share}))
        for key, name in VALUES.items()
        for share in SHARES
    ]
    return found


def run_cases(machine: Machine, of: Sequence[Case], jobs: int, done: Callable[[], None]) -> list[Row]:
    """Rows in the order of the cases; done: called for each as it comes."""
    rows: dict[Case, Row] = {}

    def store(case: Case, row: Row) -> None:
        rows[case] = row
        done()

    side_by_side(partial(run_case, machine), of, jobs, store)
    return [rows[case] for case in of]
