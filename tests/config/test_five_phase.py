# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Files of five-phase machines and their inverters, saturation, faults of legs."""

from __future__ import annotations

from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_inverter, load_motor, load_scenario
from fluxlock.config.info import derived_values
from fluxlock.config.motor import machine_params
from fluxlock.cosim.convert import action_of, plant_params
from fluxlock.plant import SaturationParams, ThirdParams
from tests.config.test_files import DEMO, copy, edit, errors

__all__ = ["copy"]

TIAN, YU = ROOT / "motors" / "five-phase-tian.toml", ROOT / "motors" / "five-phase-yu.toml"
LEGS_200, LEGS_350 = (ROOT / "inverters" / f"five-leg-{v}v.toml" for v in (200, 350))
FIVE = ROOT / "scenarios" / "five-phase" / "yu.toml"


def problems(path: Path) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_motor(path)
    return [f"{p.key}: {p.message}" for p in caught.value.problems]


def test_machines() -> None:
    """The plant gets the values of the papers, five times where they are those of a phase.

    Verifies: FRONT-44
    """
    tian = machine_params(load_motor(TIAN))
    assert (tian.phases, tian.pole_pairs, tian.r_ohm, tian.psi_vs) == (5, 4, (1.3,) * 5, (0.535872,) * 5)
    assert (tian.l_h, tian.l_q_h) == ((6.54e-3,) * 5, 8.32e-3)
    assert tian.third == ThirdParams(1.34e-3, 2.06e-3, mutual_h=0.3e-3, psi_vs=0.033492)
    assert tian.saturation is None
    motor = load_motor(YU)
    yu = machine_params(motor)
    assert yu.saturation == SaturationParams(5.0, -0.10, 0.05, (0.018, -0.025, 0.0, -0.0015), angle_current_a=5.0)
    assert yu.third == ThirdParams(2e-3, 2e-3)
    values = {v.key: v.value for v in derived_values(motor)}
    assert values["rated_torque_nm"] == pytest.approx(11.025)
    assert values["emf_harmonic_3_percent"] == 0.0
    harmonic = next(v.value for v in derived_values(load_motor(TIAN)) if v.key == "emf_harmonic_3_percent")
    assert harmonic == pytest.approx(18.75)


@pytest.mark.parametrize(("motor", "inverter"), [(TIAN, LEGS_200), (YU, LEGS_350)])
def test_plant_of_five_legs(motor: Path, inverter: Path) -> None:
    """Machine and inverter make a plant with five dividers and 13 channels, whose converter covers both.

    Verifies: FRONT-44
    """
    machine, converter = load_motor(motor), load_inverter(inverter)
    changed = load_scenario(DEMO).model_copy(update={"motor": machine, "inverter": converter})
    params = plant_params(changed, 1, ())
    assert params.sensing.divider_gain == (1.0,) * 5 and len(params.sensing.offset_lsb) == 13
    assert params.inverter.supply_v < params.sensing.v_full_scale_v
    assert machine.rated_current_a < converter.protection.phase_current_a


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("phases = 5", "phases = 4", "phases: 4 is not permitted, permitted: 3, 5"),
        ("phases = 5", "phases = 6", "phases: 6 is out of range, permitted 3 to 5"),
        ("phases = 5", "phases = 3", "third: belongs to phases = 5; leave it out, or set phases"),
        ("phases = 5\n", "", "third: belongs to phases = 5; leave it out, or set phases"),
        ("mutual_h = 0.3e-3  # L_13", "mutal_h = 0.3e-3", 'third.mutal_h: unknown key, did you mean "mutual_h"?'),
        (
            "mutual_h = 0.3e-3  # L_13",
            "mutual_h = -3e-3",
            "third.mutual_h: -0.003 H gives an inductance matrix that is not positive definite, permitted: less than "
            "0.00296 H, the root of the inductances that it couples",
        ),
        ("inductance_d_h = 1.34e-3", "inductance_d_h = -1e-3", "third.inductance_d_h: -0.001 H is out of range"),
        (
            "resistance_ohm = 1.3",
            "resistance_ohm = [1.3, 1.3, 1.4]",
            "resistance_ohm: [1.3, 1.3, 1.4] must be one number",
        ),
        ('emf = "sinusoidal"', 'emf = "trapezoidal"', 'emf: must be "sinusoidal" with phases = 5'),
        (
            "psi_vs = 0.535872",
            "psi_vs = 0.535872\nmutual_h = -1e-4",
            "mutual_h: -0.0001 H does not go with inductance_q_h",
        ),
        ("[third]\n", "[hall]\noffset_deg = 1.0\n\n[third]\n", "hall: does not go with phases = 5"),
    ],
)
def test_machine_is_checked(copy: Path, old: str, new: str, expected: str) -> None:
    """What makes no five-phase machine is refused by key, with what is permitted.

    Verifies: FRONT-03, FRONT-44
    """
    path = copy / "motors" / TIAN.name
    edit(path, old, new)
    found = problems(path)
    assert len(found) == 1 and expected in found[0], found


def test_third_plane_is_needed(copy: Path) -> None:
    """Five phases without their third plane.

    Verifies: FRONT-44
    """
    path = copy / "motors" / TIAN.name
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: text.index("[third]")], encoding="utf-8")
    assert problems(path) == ["third: required table is missing for phases = 5"]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("plus = -0.10", "plus = -0.9", "saturation.plus: -0.9 is out of range, permitted -0.8 to 0.8"),
        ("current_a = 10.0\nplus", "plus", "saturation.current_a: required key is missing"),
        (
            "angle_rad = [0.0, -0.015]",
            "angle_rad = 0.1",
            "saturation.angle_rad: must be an array of one to four numbers",
        ),
        (
            "angle_rad = [0.0, -0.015]",
            "angle_rad = [0.0, -0.1]",
            "saturation: angle_rad = (0.0, -0.1, 0.0, 0.0): must be within ±0.7 rad up to angle_current_a",
        ),
        (
            "angle_rad = [0.0, -0.015]",
            "angle_rad = [0.0, -0.06]",
            "must be positive definite at any current",
        ),
        ("psi_vs = 14.5e-3", "psi_vs = [14e-3, 14e-3, 15e-3]", "psi_vs: [0.014, 0.014, 0.015] must be one number with"),
        ('emf = "sinusoidal"', 'emf = "trapezoidal"', 'emf: must be "sinusoidal" with [saturation]'),
    ],
)
def test_saturation_is_checked(copy: Path, old: str, new: str, expected: str) -> None:
    """What no machine's saturation can be is refused by key, with what is permitted.

    Verifies: FRONT-03, FRONT-45
    """
    path = copy / "motors" / "ipm-4pp-saturated.toml"
    edit(path, old, new)
    found = problems(path)
    assert len(found) == 1 and expected in found[0], found


def test_saturated_three_phases() -> None:
    """The plant of a scenario gets the saturation; a curve of two coefficients has zeros for the others.

    Verifies: FRONT-45
    """
    changes = {"motor": load_motor(ROOT / "motors" / "ipm-4pp-saturated.toml")}
    machine = plant_params(load_scenario(DEMO).model_copy(update=changes), 1, ()).machine
    assert machine.phases == 3 and machine.third is None
    assert machine.saturation == SaturationParams(10.0, -0.10, 0.05, (0.0, -0.015, 0.0, 0.0), angle_current_a=10.0)


def test_legs_fit_the_machine() -> None:
    """A scenario refuses another number of legs than phases, and five phases without injection.

    Verifies: FRONT-44
    """
    (text,) = errors(f"inverter={LEGS_200}")
    assert "legs: 5 does not fit the motor (" in text and text.endswith("motor-1.toml), which has 3 phases")
    found = errors(f"motor={TIAN}", f"inverter={LEGS_200}")
    assert len(found) == 1 and "phases: 5 needs drive.method" in found[0]
    assert "legs: 4 is not permitted, permitted: 3, 5" in errors("inverter.legs=4")[0]
    text = errors(f"inverter={LEGS_200}", "inverter.sensing.divider_gain=[1.0, 1.1, 1.0]")[0]
    assert "sensing.divider_gain: must be one number with legs = 5" in text


@pytest.mark.parametrize("kind", ["open_phase", "stuck_high", "stuck_low"])
def test_faults_of_legs(kind: str) -> None:
    """The plant gets a leg's fault with its phases; without phases, or with what belongs to others, it is refused.

    Verifies: FRONT-46
    """

    def event(keys: str) -> str:
        return f'event[0]={{at_s=0.1,fault={{kind="{kind}"{keys}}}}}'

    scenario = load_scenario(DEMO, [event(',phases=["C","A"]'), "window=[]", "expect=[]"])
    assert action_of(scenario, scenario.event[0]).arguments == {"kind": kind, "phases": (2, 0)}
    five = load_scenario(FIVE, [event(',phases=["E","B"]'), "window=[]", "expect=[]"])
    assert action_of(five, five.event[0]).arguments == {"kind": kind, "phases": (4, 1)}
    text = errors(event(',phases=["D"]'))[0]
    assert "event[0].fault.phases: D is no phase of the motor, permitted: A, B, C" in text
    assert f'event[0].fault.phases: required key is missing for kind = "{kind}"' in errors(event(""))[0]
    text = errors(event(',phases=["A"],turns_fraction=0.1'))[0]
    assert f'event[0].fault.turns_fraction: does not belong to kind = "{kind}"' in text
