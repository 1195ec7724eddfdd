# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The host twin of the chip with injection: it does what the chip was recorded to do."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor, load_scenario
from fluxlock.native.injection_run import InjectionRun
from fluxlock.results.rundata import SimulationFault
from tests.injection.injection_bench import MACHINES, SCENARIOS, scenario_of

RECORD = ROOT / "docs" / "verification" / "record.json"
SETTLED_S = 0.08  # 60 ms after the command of the scenarios


def test_reversal_within_the_chips_record() -> None:
    """Three phases with dead time: mean, rms and maximum of the reversal lie in the bands of the chip's rows.

    Verifies: INJC-14
    """
    row = json.loads(RECORD.read_text())["rows"]["five-phase/ipm-reversal"]["values"]
    life = InjectionRun(load_scenario(ROOT / "scenarios" / "vector" / "ipm-injection.toml"))
    assert life.start()
    life.run(0.18 - life.chip.now)
    life.aim(-400)
    life.run(0.24)
    error = life.window(SETTLED_S)["error_deg"]
    found = {"mean": error.mean(), "rms": math.sqrt(np.mean(error**2)), "max": np.abs(error).max()}
    for name, value in found.items():
        low, high = row[f"angle_error_deg.{name}"]["band"]
        assert low <= value <= high, (name, value, low, high)
    assert life.chip.rpm == pytest.approx(-400, abs=20)


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


def test_load_written_in_python() -> None:
    """Viscous and constant load in Python slow a rotor of the injection twin down as the scenario's own do.

    Verifies: PACKAGE-11
    """
    scenario = load_scenario(ROOT / "scenarios" / "vector" / "ipm-injection.toml")
    start_rpm, length_s = 400.0, 0.02
    omega = start_rpm * math.pi / 30
    constant, viscous = (0.1 * scenario.motor.inertia_kgm2 * omega / length_s * x for x in (1.0, 1.0 / omega))
    shaft = scenario.shaft_load

    def load_nm(speed_rad_s: float, angle_rad: float, time_s: float) -> float:
        assert angle_rad > 0.0 and time_s > 0.0
        return constant + viscous * speed_rad_s

    of_file, of_python = (InjectionRun(scenario, begun_rpm=start_rpm, load_nm=f) for f in (None, load_nm))
    more = {"constant_nm": shaft.constant_nm + constant, "viscous_nm_s_per_rad": shaft.viscous_nm_s_per_rad + viscous}
    of_file.chip.set_load(shaft.model_copy(update=more))
    for life in (of_file, of_python):
        life.run(length_s)
    lost_rpm = start_rpm - of_file.chip.rpm
    print("difference over the speed lost", abs(of_python.chip.rpm - of_file.chip.rpm) / lost_rpm)
    assert lost_rpm > 0.15 * start_rpm
    assert abs(of_python.chip.rpm - of_file.chip.rpm) < 1e-3 * lost_rpm
    with pytest.raises(SimulationFault, match="load_nm returned nan N m"):
        InjectionRun(scenario, load_nm=lambda *_: math.nan).run(1e-3)


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
