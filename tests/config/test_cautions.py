# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What is said before a run: permitted, and will probably not work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_scenario
from fluxlock.config.motor import COMMUTATION_LEAST, COMMUTATION_USUAL
from fluxlock.config.reach import required_voltage
from fluxlock.cosim.cautions import cautions
from fluxlock.theory.six_step.switched import real_inverter, steady_operation
from tests.firmware import machines

SCENARIOS = ROOT / "scenarios"
DEMO, START, IPM = (
    SCENARIOS / "demo.toml",
    SCENARIOS / "vector" / "start.toml",
    SCENARIOS / "vector" / "ipm-injection.toml",
)
ENCODER = SCENARIOS / "vector" / "encoder.toml"
SPINDLE = SCENARIOS / "own-spindle.toml"


def said(path: Path, *overrides: str) -> list[str]:
    """Key and message of each caution."""
    return [f"{p.key}: {p.message}" for p in cautions(load_scenario(path, overrides))]


def targets(*rpm: float) -> str:
    return f"event=[{','.join(f'{{at_s=0.01,speed_rpm={x}}}' for x in rpm)}]"


ALONE = ("window=[]", "expect=[]", "accept=[]")
WEAKENED = (
    *("drive.vector.weakening=true", "inverter.supply_v=12", "inverter.protection.under_voltage_v=6"),
    *("load.fan_torque_nm=0.005", "load.fan_speed_rpm=94_000"),
)
LINK = ("inverter.dc_link_f=1e-4", "inverter.supply_resistance_ohm=0.01")
# Motor file without the table, as a data sheet gives it.
UNSATURATED = ROOT / "motors" / "ipm-4pp.toml"


@pytest.mark.parametrize(
    ("path", "overrides", "expected"),
    [
        (DEMO, ["inverter.supply_v=13.5"], "event[2].load_factor: 60000 r/min with 0.025 N*m needs about 13.8 V"),
        (DEMO, [targets(800), *ALONE], "event[0].speed_rpm: 800 r/min is below the least speed of the drive, "),
        (START, [targets(900), *ALONE], "900 r/min is below 7722 r/min, under which the voltage of rated current"),
        (START, [targets(5000), *ALONE], "5000 r/min is below the least speed of the drive, 9400 r/min, at which "),
        (
            IPM,
            [f"motor={UNSATURATED}", "drive.vector.injection.search_current_a=10"],
            "drive.vector.injection.search: the machine of the motor file does not saturate, so the search cannot tell",
        ),
        (
            START,
            [targets(94_000), *ALONE, *WEAKENED],
            "event[0].speed_rpm: 94000 r/min has a line EMF of 17 V at its peak, above over_voltage_v of the inverter "
            "(15 V): when the gates turn off, the diodes ",
        ),
        (
            START,
            [targets(94_000), *ALONE, *WEAKENED, "inverter.sensing.voltage_full_scale_v=16", *LINK],
            "above over_voltage_v of the inverter (15 V) and its converter's range (16 V): when the gates turn off, "
            "the diodes charge the DC link to it",
        ),
        (
            DEMO,
            [targets(9000), *ALONE, "motor.inertia_kgm2=2e-9"],
            "event[0].speed_rpm: 9000 r/min is below 25204 r/min, under which the speed changes between two crossings",
        ),
        (
            ENCODER,
            [targets(20), *ALONE, "motor.encoder.index=false"],
            "20 r/min is below 37 r/min, under which the EMF is too small to show that an encoder counts wrongly",
        ),
        (
            SPINDLE,
            ["inverter.sensing.divider_pole_s=3e-6"],
            "inverter.sensing.divider_pole_s: samples of a crossing count from 19 us after an edge, but from 16 us on "
            "after a diode lets the terminal go: crossings may come early there; take a quicker filter "
            "(fluxlock inverter advise) or slower samples",
        ),
    ],
)  # fmt: skip
def test_caution(path: Path, overrides: list[str], expected: str) -> None:
    """Each at its key, with the numbers.

    Verifies: FRONT-68
    """
    lines = said(path, *overrides)
    assert any(expected in line for line in lines), lines


@pytest.mark.parametrize(("path", "text"), [(START, "needs a phase voltage of "), (DEMO, "needs at least ")])
def test_a_later_load_is_checked(path: Path, text: str) -> None:
    """A load factor that comes later asks for voltage and current as a target does, by its own key, with any method.

    Verifies: FRONT-04
    """
    late = 'event=[{at_s=0.01,speed_rpm=30000},{at_s=0.02,command="start"},{at_s=0.5,load_factor=60}]'
    with pytest.raises(ConfigError) as refused:
        load_scenario(path, [late, *ALONE])
    (problem,) = refused.value.problems
    assert problem.key == "event[2].load_factor"
    assert text in problem.message
    assert "permitted by drive.current_limit_a" in problem.message


def test_a_load_before_the_first_target_says_nothing() -> None:
    """A rotor at rest needs no voltage: its load may change before a speed is asked for.

    Verifies: FRONT-68
    """
    events = "event=[{at_s=0.0,load_factor=0.5},{at_s=0.01,speed_rpm=60000}]"
    assert said(DEMO, events, *ALONE) == []


@pytest.mark.parametrize("path", sorted(SCENARIOS.rglob("*.toml")), ids=lambda path: path.stem)
def test_shipped_scenarios_are_without_caution(path: Path) -> None:
    """But for one, whose load drives the supply to its limit.

    Verifies: FRONT-68
    """
    assert [line.partition(": ")[0] for line in said(path)] == (
        ["event[2].load_factor"] if path.stem == "torque-limit" else []
    )


def test_an_encoder_and_injection_run_slowly() -> None:
    """No least speed where the angle does not come from the EMF.

    Verifies: FRONT-68
    """
    assert said(ENCODER, targets(20), *ALONE) == []
    assert said(IPM, targets(20), *ALONE) == []


@pytest.mark.parametrize("emf", ["sinusoidal", "trapezoidal"])
@pytest.mark.parametrize("inductance_h", [10e-6, 40e-6, 120e-6])
@pytest.mark.parametrize("over", [1.05, 1.2])
def test_least_and_usual_voltage(emf: str, inductance_h: float, over: float) -> None:
    """The switched model at full duty needs more than the least voltage for its torque, and no more than the usual.

    Verifies: FRONT-04, FRONT-68
    """
    rpm = 60_000.0
    motor = machines.motor(emf=emf, inductance_h=inductance_h)
    supply_v = over * motor.line_flux_vs * motor.omega_e(rpm)
    inverter = machines.inverter(supply_v=supply_v, voltage_full_scale_v=1.5 * supply_v)
    carrier_hz = 60 * motor.electrical_hz(rpm)
    state = steady_operation(motor, real_inverter(inverter), rpm, 1.0, carrier_hz=carrier_hz, settle_turns=20)
    assert required_voltage(motor, inverter, rpm, state.torque_nm, COMMUTATION_LEAST) < supply_v
    assert required_voltage(motor, inverter, rpm, state.torque_nm, COMMUTATION_USUAL) > 0.995 * supply_v
    assert np.isfinite(state.freewheel_deg).all()


def test_start_follows_the_load_factor() -> None:
    """A load that comes later does not keep a vector drive from its start, one that is there from the beginning does.

    Verifies: FRONT-04
    """
    heavy = "load.coulomb_nm=0.02"

    def events(*entries: str) -> str:
        start = '{at_s=0.01,speed_rpm=30000},{at_s=0.02,command="start"}'
        return f"event=[{','.join([*entries, start])}]"

    def start_problems(*entries: str) -> list[str]:
        try:
            load_scenario(START, [heavy, events(*entries), *ALONE])
        except ConfigError as error:
            return [p.key for p in error.problems if p.key.startswith("drive.vector.start")]
        return []

    unloaded = "{at_s=0,load_factor=0.1}"
    assert start_problems() == ["drive.vector.start_current_a"]
    assert start_problems(unloaded) == []
    assert start_problems(unloaded, "{at_s=0.8,load_factor=1}") == []
    assert start_problems(unloaded, "{at_s=0.03,load_factor=1}") == ["drive.vector.start_current_a"]
    assert start_problems("{at_s=0,load_factor=1,ramp_s=0.8}") == ["drive.vector.start_current_a"]
