# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""From a data sheet to a motor file: conventions against closed forms, contradictions by name."""

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
from fluxlock.config.constants import constants, emf_factors, torque_factors
from fluxlock.config.info import warnings
from fluxlock.datasheet.convert import Sheet, motor_text
from fluxlock.datasheet.entries import BY_OPTION, Value, read_value

# EMF over p psi Omega and torque over p psi I, by hand: of a sine, and of a trapezoid with a flat top of 120 degrees.
SINE = {
    "dc": 3 * math.sqrt(3) / math.pi,
    "line-peak": math.sqrt(3),
    "line-rms": math.sqrt(1.5),
    "phase-peak": 1.0,
    "phase-rms": math.sqrt(0.5),
}
TRAPEZOID = {
    "dc": 2.0,
    "line-peak": 2.0,
    "line-rms": math.sqrt(20) / 3,
    "phase-peak": 1.0,
    "phase-rms": math.sqrt(7) / 3,
}
SEED = 20261127


def sheet(**texts: str) -> Sheet:
    """A sheet from options as typed, `_` for `-`."""
    values: dict[str, Value] = {}
    for key, text in texts.items():
        option = key.replace("_", "-")
        values[option] = read_value(BY_OPTION[option], text)
    return Sheet("of a sheet", values)


def made(folder: Path, of: Sheet) -> Motor:
    """The motor of the file that a sheet gives."""
    path = folder / "made.toml"
    path.write_text(motor_text(of), encoding="utf-8")
    return load_motor(path)


OUTRUNNER = {
    "poles": "14",
    "kv": "1000",
    "resistance": "0.12 ohm",
    "inductance": "60 uH",
    "inertia": "150 gcm2",
    "rated_current": "20 A dc",
    "max_speed": "12000",
}


@pytest.mark.parametrize(("shape", "by_hand"), [("sinusoidal", SINE), ("trapezoidal", TRAPEZOID)])
def test_every_convention_is_the_closed_form(shape: str, by_hand: dict[str, float]) -> None:
    """Kinds of Ke and Kt against integrals by hand, and against what a motor file says of itself.

    Verifies: FRONT-69
    """
    assert emf_factors(shape) == pytest.approx(by_hand, rel=2e-6)
    motor = load_motor(ROOT / "motors" / "spindle-2pp.toml").model_copy(update={"emf": shape})
    fundamental = 1.0 if shape == "sinusoidal" else 12 / math.pi**2 * 2 * math.sin(math.pi / 6)
    assert torque_factors(shape) == pytest.approx(
        {"peak": 1.5 * fundamental, "rms": 1.5 * math.sqrt(2) * fundamental, "dc": by_hand["dc"]}, rel=2e-6
    )
    shown = constants(motor)
    assert shown["kt_dc_nm_per_a"] == pytest.approx(motor.torque_per_amp_nm, rel=2e-6)
    assert shown["kt_peak_nm_per_a"] * motor.rated_current_a == pytest.approx(motor.rated_torque_nm, rel=2e-6)
    assert shown["ke_dc_v_per_krpm"] * shown["kv_dc_rpm_per_v"] == pytest.approx(1000.0)


def test_any_sheet_of_a_machine_gives_the_machine(tmp_path: Path) -> None:
    """200 machines, each written as a sheet in kinds and units drawn at random: the file has the machine's values.

    Verifies: FRONT-69
    """
    draw = random.Random(SEED)
    for _ in range(200):
        pairs, psi = draw.randint(1, 23), 10 ** draw.uniform(-4, -1)
        ohm, henry, inertia = (10 ** draw.uniform(*span) for span in ((-2, 1), (-5, -2), (-7, -2)))
        amplitude, speed = 10 ** draw.uniform(0, 2), 10 ** draw.uniform(2, 4.5)
        delta = draw.random() < 0.3
        p_psi, rad_s = pairs * psi, 2 * math.pi / 60
        emf, unit = draw.choice(list(SINE)), draw.choice(["V/rpm", "mV/rpm", "V/krpm", "V/1000rpm", "Vs/rad"])
        # A winding in delta has the line's EMF.
        of_winding = math.sqrt(3) if delta and emf.startswith("phase") else 1.0
        ke = SINE[emf] * p_psi * of_winding
        factor = {"V/rpm": 1, "mV/rpm": 1e3, "V/krpm": 1e3, "V/1000rpm": 1e3, "Vs/rad": 1 / rad_s}[unit] * rad_s
        kt, per_amp = draw.choice([("peak", 1.5), ("rms", 1.5 * math.sqrt(2)), ("dc", SINE["dc"])])
        current = {"peak": 1.0, "rms": math.sqrt(0.5), "dc": 1.5 / SINE["dc"]}[kt] * amplitude
        line = draw.random() < 0.5
        texts = {
            draw.choice(["poles", "pole_pairs"]): "",
            "resistance": f"{1e3 * ohm * (2 if line else 3 if delta else 1)!r} mΩ {'line' if line else 'phase'}",
            "inductance": f"{1e6 * henry * (2 if line else 3 if delta else 1)!r} µH {'line' if line else 'phase'}",
            "inertia": draw.choice(
                [
                    f"{1e7 * inertia!r} gcm²",
                    f"{1e4 * inertia!r} kg cm^2",
                    f"{inertia / 7.06155181422604e-3!r} oz-in-s^2",
                ]
            ),
            "rated_current": f"{current!r} A {kt}",
            "max_speed": draw.choice([f"{speed!r}", f"{speed!r} r/min", f"{speed * rad_s!r} rad/s"]),
        }
        texts |= {"poles": str(2 * pairs)} if "poles" in texts else {"pole_pairs": str(pairs)}
        either = draw.random()
        if either < 0.67:
            texts["ke"] = f"{ke * factor!r} {unit} {emf}"
        if either > 0.33:
            texts["kt"] = draw.choice([f"{per_amp * p_psi!r} N·m/A {kt}", f"{1e3 * per_amp * p_psi!r} mNm/A {kt}"])
        stated = sheet(**texts)
        motor = made(tmp_path, Sheet(stated.name, stated.values, winding="delta" if delta else "star"))
        found = (motor.resistance_ohm[0], motor.inductance_h[0], motor.psi_vs[0], motor.inertia_kgm2)
        assert found == pytest.approx((ohm, henry, psi, inertia), rel=6e-4), (SEED, texts)
        assert motor.pole_pairs == pairs
        assert (motor.rated_current_a, motor.max_speed_rpm) == pytest.approx((amplitude, speed), rel=6e-4), texts


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"kt": "0.0105 Nm/A peak"}, ["--kv 1000", "--kt 0.0105 Nm/A peak", "factor of 1.21"]),
        ({"kt": "0.0124 Nm/A peak"}, ["--kt as rms would agree"]),
        ({"ke": "1.74 V/krpm dc"}, ["--ke 1.74 V/krpm dc", "--kv 1000", "factor of 1.74"]),
        ({"ke": "0.74 V/krpm dc"}, ["--ke as line-rms would agree"]),
        ({"voltage": "14.8 V", "no_load_speed": "7000"}, ["--kv 1000", "--no-load-speed 7000"]),
        ({"voltage": "14.8 V", "no_load_speed": "14500", "max_speed": "30000"}, ["--max-speed", "--no-load-speed"]),
        ({"voltage": "7.4 V"}, ["--voltage", "12 V"]),
        ({"rated_torque": "0.4 Nm"}, ["--rated-torque 0.4 Nm"]),
        ({"peak_current": "10 A dc"}, ["--peak-current", "--rated-current"]),
        ({"pole_pairs": "14"}, ["14 poles are 7 pole pairs", "--pole-pairs says 14"]),
        ({"poles": "13"}, ["--poles", "even"]),
        ({"voltage": "1 V", "no_load_speed": "12000", "no_load_current": "20 A"}, ["--no-load-current"]),
    ],
)
def test_a_contradiction_is_refused_by_name(change: dict[str, str], names: list[str]) -> None:
    """Each value that disagrees is named with what would agree.

    Verifies: FRONT-70
    """
    motor_text(sheet(**OUTRUNNER))
    with pytest.raises(ConfigError) as caught:
        motor_text(sheet(**(OUTRUNNER | change)))
    for name in names:
        assert name in str(caught.value)


@pytest.mark.parametrize(
    ("option", "text", "says"),
    [
        ("kt", "0.05 Nm/A", "does not say its kind"),
        ("kt", "0.05", "has no unit"),
        ("kt", "0.05 Nm/Arms peak", "says rms at its unit and peak behind it"),
        ("ke", "5 Vrms/krpm", "does not say its kind"),
        ("resistance", "0,12 Ohm", "with a decimal point"),
        ("kv", "1000-1100", "is no value"),
        ("kt", "5 V dc", "is not in N*m/A"),
        ("rated-current", "20 A rsm", 'did you mean "rms"'),
        ("inertia", "48", "has no unit"),
        ("inductance", "60 uF", "is not in H"),
        ("max-speed", "200 Hz", "is not in rpm"),
        ("voltage", "-5", "must be above 0"),
        ("voltage", "nan", "is no value"),
        ("voltage", "1e400", "must be above 0"),
        ("ke", "9**9**9**9 dc", "is not in V/rpm"),
        ("ke", "__import__('os').system('true') dc", "is no value"),
        ("kv", "9 m^99999", "is not in rpm/V"),
        ("kv", "1" * 100_000, "is no value"),
        ("resistance", "", "is no value"),
    ],
)
def test_what_is_no_value_is_said_with_what_would_be_one(option: str, text: str, says: str) -> None:
    """Units, kinds and numbers that are none.

    Verifies: FRONT-70
    """
    with pytest.raises(ConfigError) as caught:
        read_value(BY_OPTION[option], text)
    assert says in str(caught.value)
    assert str(caught.value).startswith(f"--{option}: ")


@pytest.mark.parametrize(
    ("option", "text", "number", "kind"),
    [
        ("rated-current", "2.6 Arms", 2.6, "rms"),
        ("rated-current", "7.1 Apk", 7.1, "peak"),
        ("kt", "0.49 Nm/Arms", 0.49, "rms"),
        ("ke", "4.64 Vpk/krpm line-peak", 4.64e-3, "line-peak"),
        ("ke", "17.4 mV/(r/min) phase-rms", 17.4e-3, "phase-rms"),
        ("ke", "4.64 V/krpm ±10 % line-peak", 4.64e-3, "line-peak"),
        ("resistance", "0.72 Ohm +/- 10%", 0.72, "line"),
        ("inertia", "0.277E-4 kg-m2", 2.77e-5, ""),
        ("inertia", "0.05 kg·cm²", 5e-6, ""),
        ("inertia", "0.00009 oz-in-s2", 6.3554e-7, ""),
        ("inertia", "0.00012 lb-in-s2", 1.35582e-5, ""),
        ("rated-torque", "10 lb-in", 1.12985, ""),
        ("rated-torque", "0.36 kgf-cm", 0.0353039, ""),
        ("max-speed", "6000 tr/min", 6000.0, ""),
    ],
)
def test_the_spellings_of_makers(option: str, text: str, number: float, kind: str) -> None:
    """Kinds at the unit, tolerances, imperial units and squares without a sign, as sheets have them.

    Verifies: FRONT-69
    """
    value = read_value(BY_OPTION[option], text)
    assert (value.number, value.kind) == (pytest.approx(number, rel=1e-4), kind)


def test_the_file_repeats_the_sheet(tmp_path: Path) -> None:
    """`[datasheet]` has each value in the maker's terms, and the check finds a file that is edited wrongly.

    Verifies: FRONT-69, FRONT-71
    """
    motor = made(tmp_path, sheet(**OUTRUNNER, voltage="14.8 V", no_load_speed="14500", no_load_current="0.9 A"))
    assert motor.datasheet is not None
    shown = {k: v for k, v in motor.datasheet.model_dump().items() if v}
    assert shown == {
        "poles": 14,
        "terminal_resistance_ohm": 0.12,
        "terminal_inductance_h": 60e-6,
        "kv_dc_rpm_per_v": 1000.0,
        "voltage_v": 14.8,
        "no_load_speed_rpm": 14500.0,
        "no_load_current_a": 0.9,
        "rotor_inertia_gcm2": 150.0,
    }
    wrong = motor.model_copy(update={"psi_vs": tuple(7 * psi for psi in motor.psi_vs)})
    assert "per mechanical rad/s (7 pole pairs)" in warnings(wrong)[0]


def test_a_missing_inertia_is_guessed_and_says_so(tmp_path: Path) -> None:
    """Many sheets have no inertia: the file then says that it is a guess, which no warning calls unusual.

    Verifies: FRONT-69
    """
    texts = {key: text for key, text in OUTRUNNER.items() if key != "inertia"}
    motor = made(tmp_path, sheet(**texts))
    assert "GUESSED" in (tmp_path / "made.toml").read_text(encoding="utf-8")
    assert not warnings(motor)
    run_up_s = motor.inertia_kgm2 * motor.max_speed_rpm * math.pi / 30 / motor.rated_torque_nm
    assert run_up_s == pytest.approx(0.1, rel=1e-3)


def test_friction_is_what_the_current_without_load_makes(tmp_path: Path) -> None:
    """Current without load times the torque constant is the load at that speed.

    Verifies: FRONT-69
    """
    motor = made(tmp_path, sheet(**OUTRUNNER, voltage="14.8 V", no_load_speed="14500", no_load_current="0.9 A"))
    assert motor.load.torque_nm(14_500) == pytest.approx(0.9 * motor.torque_per_amp_nm, rel=1e-3)


def call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Exit code and both outputs of a command."""
    monkeypatch.setattr(sys, "argv", ["fluxlock", "motor", "new", *arguments])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    return int(caught.value.code or 0), *capsys.readouterr()


def test_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Writes once, never over a file; what is missing comes as one list; a bad end is exit code 2.

    Verifies: FRONT-69, FRONT-70
    """
    path = tmp_path / "mine.toml"
    arguments = [word for key, text in OUTRUNNER.items() for word in (f"--{key.replace('_', '-')}", text)]
    code, out, err = call(monkeypatch, capsys, str(path), *arguments)
    assert (code, out) == (0, path.read_text(encoding="utf-8"))
    assert load_motor(path).psi_vs[0] == pytest.approx(60 / (2 * math.pi * 7 * 1000 * SINE["dc"]), rel=1e-3)
    before = path.read_text(encoding="utf-8")
    code, out, err = call(monkeypatch, capsys, str(path), *arguments)
    assert (code, out) == (2, "")
    assert "exists" in err
    assert path.read_text(encoding="utf-8") == before
    code, _, err = call(monkeypatch, capsys, str(tmp_path / "other.toml"), "--kv", "1000")
    assert code == 2
    assert all(
        option in err for option in ("--poles", "--resistance", "--inductance", "--rated-current", "--max-speed")
    )
    for option, text, says in (
        ("electrical", "1 ms", "inductance_h, resistance_ohm: electrical time constant 0.0005 s, 0.5 times"),
        ("mechanical", "1 s", "inertia_kgm2, resistance_ohm, psi_vs: mechanical time constant"),
    ):
        constant = (f"--{option}-time-constant", text)
        code, _, err = call(monkeypatch, capsys, str(tmp_path / "other.toml"), *arguments, *constant)
        assert (code, len(err.splitlines())) == (2, 1)
        assert f"the values contradict each other: {says}" in err
    code, _, err = call(monkeypatch, capsys, str(tmp_path / "other.toml"), *arguments, "--kt", "5 V dc", "--ke", "x")
    assert (code, len(err.splitlines())) == (2, 2)
    assert not (tmp_path / "other.toml").exists()


def test_it_asks(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    answers: Callable[[list[str]], None],
) -> None:
    """At a terminal it asks for each value, and again after a wrong answer.

    Verifies: FRONT-70
    """
    # poles, kv (wrong first), ke, kt, resistance, inductance, q, inertia, rated, peak, torque, without load, speed
    told = ["14", "1000 V", "1000", "", "", "0.12 ohm", "60 uH", "", "150 gcm2", "20 A dc", "", "", "", "", "", "12000"]
    told += ["", ""]  # time constants
    answers(told)
    code, _, err = call(monkeypatch, capsys, str(tmp_path / "asked.toml"))
    assert code == 0, err
    assert "is not in rpm/V" in err
    typed = [word for key, text in OUTRUNNER.items() for word in (f"--{key.replace('_', '-')}", text)]
    assert call(monkeypatch, capsys, str(tmp_path / "typed.toml"), *typed, "--name", "asked")[0] == 0
    files = [(tmp_path / f"{name}.toml").read_text(encoding="utf-8") for name in ("asked", "typed")]
    assert files[0] == files[1]


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> Callable[[list[str]], None]:
    """A terminal that types these lines."""

    def take(lines: list[str]) -> None:
        left = iter(lines)
        monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
        monkeypatch.setattr("typer.prompt", lambda *_args, **_options: next(left))

    return take
