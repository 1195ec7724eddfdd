# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The host twin of the chip with injection: it does what the chip was recorded to do."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor, load_scenario
from fluxlock.native.injection_run import InjectionRun
from tests.injection.injection_bench import MACHINES, SCENARIOS, scenario_of

SETTLED_S = 0.08  # 60 ms after the command of the scenarios


@pytest.mark.parametrize(("dead_time_s", "most_deg"), [(2e-6, 4.0), (0.0, 0.8)])
def test_five_phases_as_the_scenario_says(dead_time_s: float, most_deg: float) -> None:
    """Separator, double update, five phases: within what the scenario says of the chip, 4 and 0.7 degrees.

    Verifies: INJC-14
    """
    life = InjectionRun(
        load_scenario(ROOT / "scenarios" / "five-phase" / "yu.toml", [f"inverter.dead_time_s={dead_time_s:g}"])
    )
    assert life.start()
    life.run(0.35)
    assert np.abs(life.window(SETTLED_S)["error_deg"]).max() < most_deg
    assert life.fault == "none"


@pytest.mark.parametrize("method", ["lock-in", "conventional"])
def test_filtered_demodulation(method: str) -> None:
    """Tian's machine by both filtered methods from a known rest: the angle arrives and stays.

    Verifies: INJC-14
    """
    overrides = ("drive.vector.injection.search=false", f"drive.vector.injection.method={method}")
    scenario = load_scenario(ROOT / "scenarios" / "five-phase" / "tian.toml", overrides)
    life = InjectionRun(scenario, theta_deg=10.0, target_rpm=50.0)
    assert life.start()
    life.run(0.4)
    assert life.fault == "none"
    assert life.rms_deg(0.3) < 20.0


def test_dead_machine() -> None:
    """A wave that makes no current is named: the twin's machine has ten thousand times the inductance.

    Verifies: INJC-14
    """
    scenario = scenario_of("ebike")
    open_machine = scenario.motor.model_copy(update={"inductance_h": (1.0, 1.0, 1.0), "inductance_q_h": 1.3})
    life = InjectionRun(scenario, machine=open_machine)
    assert not life.start()
    assert life.fault == "injection_signal"


def test_machines_have_scenarios() -> None:
    """Ten machines, of three and five phases, none of which the defaults were made for.

    Verifies: INJC-14
    """
    phases = [load_motor(SCENARIOS.parent / "motors" / f"{name}.toml").phases for name in MACHINES]
    assert (phases.count(3), phases.count(5)) == (8, 2)
