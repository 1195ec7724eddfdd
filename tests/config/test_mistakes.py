# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The usual mistakes between a data sheet and a motor file: planted ones are named, right files are quiet."""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, Motor, load_motor
from fluxlock.config.constants import constants, torque_factors
from fluxlock.config.info import warnings
from fluxlock.config.mistakes import mistakes
from fluxlock.config.stated import DataSheet

SHIPPED = sorted(path for path in (ROOT / "motors").rglob("*.toml") if load_motor(path).phases == 3)
SEED = 20261127
EMF_OF_SUPPLY = 0.8

Change = dict[str, object]


def scaled(motor: Motor, key: str, factor: float) -> Change:
    """A key of the file multiplied."""
    value = getattr(motor, key)
    return {key: tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value}


def sheet_of(motor: Motor, **changes: object) -> DataSheet:
    """What a sheet of this machine states, in every term."""
    ohm = sum(motor.resistance_ohm) / 3
    stated = {
        "poles": 2 * motor.pole_pairs,
        "terminal_resistance_ohm": 2 * ohm,
        "terminal_inductance_h": 2 * motor.mean_inductance_h,
        "rated_torque_nm": motor.rated_torque_nm,
        "voltage_v": motor.line_flux_vs * motor.omega_e(motor.max_speed_rpm) / EMF_OF_SUPPLY,
        "rotor_inertia_gcm2": 1e7 * motor.inertia_kgm2,
        "electrical_time_constant_s": motor.mean_inductance_h / ohm,
        "mechanical_time_constant_s": 2 * ohm * motor.inertia_kgm2 / motor.torque_per_amp_nm**2,
        **constants(motor),
    }
    return DataSheet.model_validate({k: v for k, v in stated.items() if k in DataSheet.model_fields} | changes)


def stated(path: Path, *only: str) -> Motor:
    """A shipped motor with the sheet of itself. only: keys of the sheet, default all."""
    motor = load_motor(path)
    sheet = sheet_of(motor)
    if only:
        sheet = DataSheet.model_validate({key: getattr(sheet, key) for key in only})
    return motor.model_copy(update={"datasheet": sheet})


def torque(motor: Motor, kind: str) -> float:
    """Kt of a kind over psi."""
    return torque_factors(motor.emf, motor.flat_top_deg)[kind] * motor.pole_pairs


# Name of a mistake: what it makes of a file, and what the line says.
MISTAKES: dict[str, tuple[Callable[[Motor], Change], str, str]] = {
    "terminal resistance": (lambda m: scaled(m, "resistance_ohm", 2), "resistance_ohm", "between two terminals"),
    "delta resistance": (lambda m: scaled(m, "resistance_ohm", 3), "resistance_ohm", "of a winding in delta"),
    "resistance halved twice": (lambda m: scaled(m, "resistance_ohm", 0.5), "resistance_ohm", "halved twice"),
    "terminal inductance": (lambda m: scaled(m, "inductance_h", 2), "inductance_h", "between two terminals"),
    "poles": (lambda m: {"pole_pairs": 2 * m.pole_pairs}, "pole_pairs", "these are the poles"),
    "mechanical flux": (lambda m: scaled(m, "psi_vs", m.pole_pairs), "psi_vs", "per mechanical rad/s"),
    "Kt peak": (lambda m: scaled(m, "psi_vs", torque(m, "peak")), "psi_vs", "Kt per peak ampere"),
    "Kt rms": (lambda m: scaled(m, "psi_vs", torque(m, "rms")), "psi_vs", "Kt per rms ampere"),
    "Kt DC": (lambda m: scaled(m, "psi_vs", torque(m, "dc")), "psi_vs", "Kt per DC ampere"),
    "line flux": (lambda m: scaled(m, "psi_vs", math.sqrt(3)), "psi_vs", "of the line"),
    "rms flux": (lambda m: scaled(m, "psi_vs", math.sqrt(0.5)), "psi_vs", "rms"),
    "flux of poles": (lambda m: scaled(m, "psi_vs", 0.5), "psi_vs", "of poles in place of pole pairs"),
    "J up a decade": (lambda m: scaled(m, "inertia_kgm2", 10), "inertia_kgm2", "off by 10^1"),
    "J down a decade": (lambda m: scaled(m, "inertia_kgm2", 0.1), "inertia_kgm2", "off by 10^-1"),
    "J of another unit": (lambda m: scaled(m, "inertia_kgm2", 1e-3), "inertia_kgm2", "off by 10^-3"),
    "J too small": (lambda m: scaled(m, "inertia_kgm2", 0.4), "inertia_kgm2", "a load only adds"),
    "rms current": (lambda m: scaled(m, "rated_current_a", math.sqrt(0.5)), "rated_current_a", "rms for peak"),
}


def plants(motor: Motor, name: str) -> bool:
    """Whether a mistake changes this machine: one pole pair has one speed; the inductance of a salient one turns."""
    if name == "mechanical flux":
        return motor.pole_pairs > 1
    return not (name == "terminal inductance" and motor.inductance_q_h is not None)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_planted_mistake_is_named(path: Path) -> None:
    """Every mistake on every machine, alone, is one line with its key and its name; the right file has none.

    Verifies: FRONT-71
    """
    motor = stated(path)
    assert mistakes(motor) == []
    for name, (change, key, says) in MISTAKES.items():
        if not plants(motor, name):
            continue
        found = mistakes(motor.model_copy(update=change(motor)))
        assert len(found) == 1, (name, found)
        assert found[0].partition(":")[0].split(", ")[0] == key, (name, found)
        assert says in found[0], (name, found)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
@pytest.mark.parametrize(
    ("only", "name"),
    [
        ("electrical_time_constant_s", "terminal resistance"),
        ("electrical_time_constant_s", "resistance halved twice"),
        ("mechanical_time_constant_s", "J up a decade"),
        ("mechanical_time_constant_s", "J down a decade"),
        ("voltage_v", "Kt peak"),
        ("voltage_v", "line flux"),
        ("kv_dc_rpm_per_v", "Kt DC"),
        ("kt_rms_nm_per_a", "Kt rms"),
    ],
)
def test_one_figure_is_enough(path: Path, only: str, name: str) -> None:
    """A sheet that states one thing beside the file shows the mistake that touches it.

    Verifies: FRONT-71
    """
    motor = stated(path, only)
    assert mistakes(motor) == []
    if only == "voltage_v" and motor.inductance_q_h is not None:
        return  # weakens its field
    change, key, _ = MISTAKES[name]
    found = mistakes(motor.model_copy(update=change(motor)))
    assert len(found) == 1, found
    assert key in found[0]


def test_tolerances_of_makers_are_no_mistakes() -> None:
    """R, L, psi, J and the rated current of 20 files of each machine off by up to 10 %: no line.

    Verifies: FRONT-71
    """
    draw = random.Random(SEED)
    for path in SHIPPED:
        for _ in range(20):
            motor = stated(path)
            for key in ("resistance_ohm", "inductance_h", "psi_vs", "inertia_kgm2", "rated_current_a"):
                motor = motor.model_copy(update=scaled(motor, key, draw.uniform(0.9, 1.1)))
            assert mistakes(motor) == [], (SEED, path.stem)


def test_a_load_on_the_shaft_is_no_mistake() -> None:
    """An inertia above the rotor's is a load's, unless it is a power of ten.

    Verifies: FRONT-71
    """
    motor = stated(ROOT / "motors" / "outrunner-7pp.toml", "rotor_inertia_gcm2")
    for factor in (1.3, 3.0, 7.0, 25.0):
        assert mistakes(motor.model_copy(update=scaled(motor, "inertia_kgm2", factor))) == []


def test_check_tells_and_five_phases_have_no_sheet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command warns on the error output and ends with 0; a sheet of five phases is refused by its key.

    Verifies: FRONT-71
    """
    path = tmp_path / "mine.toml"
    text = (ROOT / "motors" / "outrunner-7pp.toml").read_text(encoding="utf-8")
    path.write_text(text + "\n[datasheet]\nterminal_resistance_ohm = 0.06\npoles = 14\n", encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["fluxlock", "motor", "check", str(path)])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    out, err = capsys.readouterr()
    assert not caught.value.code
    assert "ok" in out
    assert "resistance_ohm: 0.06 Ohm is 2 times half of the terminals' 0.06 Ohm: the value between two" in err
    text = (ROOT / "motors" / "five-phase-yu.toml").read_text(encoding="utf-8")
    path.write_text(text + "\n[datasheet]\npoles = 14\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="datasheet: does not go with phases = 5"):
        load_motor(path)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_without_a_sheet_the_file_is_judged_as_before(path: Path) -> None:
    """A shipped motor without the table gives no line of these rules.

    Verifies: FRONT-71
    """
    assert warnings(load_motor(path)) == []
