# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The events of Tian's figures 10 to 12 as the plant gets them, and what counts as having taken place."""

from __future__ import annotations

from typing import Any

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import Scenario, load_scenario
from fluxverify.figures.five_phase import tian_dynamic
from fluxverify.figures.five_phase.tian_dynamic import LOAD, SPEED, TORQUE, Event, run_of

METHODS = ("conventional", "lock-in", "best")


class Loading:
    """Runner that gives the scenario of a run in place of its outcome."""

    quick = False

    def drive(self, scenario: str, name: str, *overrides: str, accept: dict[str, str]) -> Any:
        return load_scenario(ROOT / "scenarios" / scenario, overrides)


def scenario_of(what: Event, method: str) -> Scenario:
    runner: Any = Loading()
    found: Any = run_of(runner, what, method)
    assert isinstance(found, Scenario)
    return found


@pytest.mark.parametrize("method", METHODS)
def test_load_step_is_that_of_the_paper(method: str) -> None:
    """8 N m and no more are switched on at the step: a factor of the load scales each of its parts.

    Verifies: FIG-11
    """
    loaded = scenario_of(LOAD, method)
    load = loaded.shaft_load
    assert load.constant_nm == 8.0 and load.viscous_nm_s_per_rad == 0.0
    assert [(e.at_s, e.load_factor) for e in loaded.event if e.load_factor is not None] == [(0.0, 0.0), (1.2, 1.0)]


@pytest.mark.parametrize("method", METHODS)
def test_torque_is_the_current_limit(method: str) -> None:
    """With 2 A, which the console sets before the start, the load lets the shaft reach 85 of the 120 r/min asked for.

    Verifies: FIG-11
    """
    loaded = scenario_of(TORQUE, method)
    lines = [(e.at_s, e.command) for e in loaded.event if e.command]
    assert lines == [(0.003, "set current_limit_a 2"), (0.004, "start"), (1.2, "set speed_rpm -120")]
    torque_nm = 2.0 * loaded.motor.torque_per_amp_nm
    assert loaded.shaft_load.torque_nm(TORQUE.from_rpm) == pytest.approx(torque_nm, rel=0.01)


@pytest.mark.parametrize("what", [TORQUE, LOAD, SPEED], ids=lambda what: what.name)
def test_all_methods_go_through_the_same_event(what: Event) -> None:
    """Only the demodulation differs: events, load, duration and speed loop are the same for all three.

    Verifies: FIG-11
    """
    seen = [scenario_of(what, method) for method in METHODS]
    for loaded in seen[1:]:
        assert loaded.event == seen[0].event and loaded.shaft_load == seen[0].shaft_load
        assert loaded.duration_s == seen[0].duration_s and loaded.drive.accel_rpm_per_s == seen[0].drive.accel_rpm_per_s
        assert loaded.drive.vector.speed_hz == seen[0].drive.vector.speed_hz
    assert seen[0].duration_s == pytest.approx(tian_dynamic.AT_S + what.after_s)
    assert what.after_s > 2 * tian_dynamic.SETTLED_S
