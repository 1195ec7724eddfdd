# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A load written in Python: on the twins and on the chip, beside the loads of a motor file."""

from __future__ import annotations

import math
import pickle
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

import fluxlock
from fluxlock import sweeps
from fluxlock.base.paths import ROOT
from fluxlock.python_load import PythonLoad

SPINNING = ROOT / "scenarios" / "spinning.toml"
VECTOR = ROOT / "scenarios" / "vector" / "load-step.toml"
SHORT_S, LONG_S = 0.004, 0.1
START_RPM = {SPINNING: 14_000.0, VECTOR: 3_000.0}
OMEGA = START_RPM[SPINNING] * math.pi / 30
# What the held torque may change of the speed that the load takes: with the chip every 20 us, with a twin every tick.
CHIP_SHARE, TWIN_SHARE = 1e-4, 1e-3


def coasting(path: Path = SPINNING, length_s: float = SHORT_S) -> dict[str, Any]:
    """A rotor that turns, and a drive that rests."""
    keys = {"duration_s": length_s, "event": [], "window": [], "expect": [], "initial.speed_rpm": START_RPM[path]}
    return keys | {"record.period_s": 2e-5, "mechanics.mode": "free", "mechanics.profile": []}


def error_share(path: Path, twin: bool, length_s: float) -> float:
    """Largest difference of the speed, of a motor file's loads and the same in Python, over the speed they take."""
    start_rpm = START_RPM[path]
    omega = start_rpm * math.pi / 30
    stop_nm = fluxlock.load_scenario(path).motor.inertia_kgm2 * omega / length_s
    fan, viscous, coulomb = 0.1 * stop_nm / omega**2, 0.03 * stop_nm / omega, 0.05 * stop_nm
    file = {"fan_torque_nm": 0.1 * stop_nm, "fan_speed_rpm": start_rpm, "coulomb_nm": coulomb}

    def load_nm(speed_rad_s: float, angle_rad: float, time_s: float) -> float:
        return (fan * abs(speed_rad_s) + viscous) * speed_rad_s + math.copysign(coulomb, speed_rad_s)

    loads = ({"load": file | {"viscous_nm_s_per_rad": viscous}}, {"load": {"constant_nm": 0.0}, "load_nm": load_nm})
    of_file, of_python = (
        fluxlock.simulate(path, twin=twin, **coasting(path, length_s), **load).traces["speed_rpm"] for load in loads
    )
    assert len(of_file) == len(of_python) and start_rpm - of_file[-1] > 0.05 * start_rpm
    return float(np.abs(of_file - of_python).max() / (start_rpm - of_file[-1]))


@pytest.mark.parametrize("path", START_RPM, ids=lambda path: path.stem)
def test_as_the_files_loads_on_the_twin(path: Path) -> None:
    """Fan, viscous and Coulomb load in Python slow a rotor down as those of a motor file.

    Verifies: PACKAGE-11
    """
    assert error_share(path, True, LONG_S) < TWIN_SHARE


def test_as_the_files_loads_on_the_chip() -> None:
    """The same on the chip, whose clock waits for the function every 20 us.

    Verifies: PACKAGE-11
    """
    assert error_share(SPINNING, False, SHORT_S) < CHIP_SHARE


def test_sees_shaft_and_time() -> None:
    """Speed and angle are mechanical, the angle is unwrapped; all three are those of the middle of a held period.

    Verifies: PACKAGE-11
    """
    seen: list[tuple[float, float, float]] = []

    def load_nm(speed_rad_s: float, angle_rad: float, time_s: float) -> float:
        seen.append((speed_rad_s, angle_rad, time_s))
        return 0.0

    free = {"load": {"constant_nm": 0.0}, "initial.theta_deg": 0.0}
    fluxlock.simulate(SPINNING, twin=True, load_nm=load_nm, **coasting(length_s=LONG_S), **free)
    speed, angle, time_s = np.array(seen).T
    np.testing.assert_allclose(speed, OMEGA, rtol=1e-9)
    np.testing.assert_allclose(angle, OMEGA * time_s, rtol=1e-6)
    period_s = time_s[1] - time_s[0]
    assert time_s[0] == pytest.approx(period_s / 2) and angle[-1] > 2 * math.pi
    assert len(seen) == pytest.approx(LONG_S / period_s, abs=1.5)


def test_jump_at_standstill() -> None:
    """A load that jumps with the sign of the speed keeps the rotor within 1.5 times what it changes in a period.

    Verifies: PACKAGE-11
    """
    coulomb = 1e-3
    keys = coasting() | {"initial.speed_rpm": 100.0, "load": {"constant_nm": 0.0}, "duration_s": 0.02}
    run = fluxlock.simulate(SPINNING, twin=True, load_nm=lambda w, _angle, _time: math.copysign(coulomb, w), **keys)
    calm = run.traces["speed_rpm"][run.traces["t_s"] > 0.01]
    tick_s = run.traces["t_s"][1] - run.traces["t_s"][0]
    period_rpm = coulomb * tick_s / run.scenario.motor.inertia_kgm2 * 30 / math.pi
    assert 0.0 < np.abs(calm).max() <= 1.5 * period_rpm * (1 + 1e-9)


def test_compiled_function() -> None:
    """A function that numba compiles gives the bits of the plain one.

    Verifies: PACKAGE-11
    """

    def load_nm(speed_rad_s: float, angle_rad: float, time_s: float) -> float:
        return 1e-6 * speed_rad_s + 1e-3 * math.sin(angle_rad)

    plain, compiled = (
        fluxlock.simulate(SPINNING, twin=True, load_nm=function, **coasting())
        for function in (load_nm, numba.njit(load_nm))
    )
    np.testing.assert_array_equal(plain.traces["speed_rpm"], compiled.traces["speed_rpm"])
    assert compiled.traces["speed_rpm"][-1] < START_RPM[SPINNING]


def broken(text: str) -> Callable[[float, float, float], Any]:
    """A load of one expression."""
    made: Callable[[float, float, float], Any] = eval(f"lambda speed, angle, time: {text}")
    return made


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("float('nan')", r"returned nan N m, permitted -10000 to 10000"),
        ("float('inf')", r"returned inf N m, permitted .*"),
        ("-1e5", r"returned -100000.0 N m, permitted .*"),
        ("None", r"must return a number, N m, not None"),
        ("'0.1'", r"must return a number, N m, not '0.1'"),
        ("True", r"must return a number, N m, not True"),
        ("1 / (speed - speed)", r"raised ZeroDivisionError: .*\(<string>, line 1\)"),
    ],
)
def test_bad_values(text: str, message: str) -> None:
    """What is no torque ends the run with the function's name, its value and what it was called with.

    Verifies: PACKAGE-11
    """
    with pytest.raises(fluxlock.SimulationFault, match=rf"^load_nm {message}; called with speed_rad_s=\d.* time_s=\d"):
        fluxlock.simulate(SPINNING, twin=True, load_nm=broken(text), **coasting())


def test_bad_value_on_the_chip() -> None:
    """On the chip the same line comes out of the simulator's process.

    Verifies: PACKAGE-11
    """
    late = broken("1 / 0 if time > 0.001 else 0.0")
    with pytest.raises(fluxlock.SimulationFault, match=r"^load_nm raised ZeroDivisionError: .* time_s=0\.00101$"):
        fluxlock.simulate(SPINNING, load_nm=late, **coasting())


@pytest.mark.parametrize(
    ("function", "keys", "message"),
    [
        (0.1, {}, "load_nm: must be a function, not 0.1"),
        (lambda speed: speed, {}, "load_nm: must take speed_rad_s, angle_rad and time_s"),
        (broken("0.0"), {"mechanics.mode": "locked"}, r'mechanics\.mode: a rotor that is "locked" has no load'),
    ],
)
def test_bad_functions(function: Any, keys: dict[str, Any], message: str) -> None:
    """What is no load is refused before anything runs.

    Verifies: PACKAGE-11
    """
    with pytest.raises(fluxlock.ConfigError, match=message):
        fluxlock.simulate(SPINNING, twin=True, load_nm=function, **coasting() | keys)


def test_goes_to_other_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A function goes by value, with what it uses of a module that the other process does not have.

    Verifies: PACKAGE-11
    """
    (tmp_path / "my_load.py").write_text(
        "FACTOR = 3.0\n\ndef load_nm(speed, angle, time):\n    return FACTOR * speed\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    packed = pickle.dumps(PythonLoad(import_module("my_load").load_nm))
    monkeypatch.delitem(sys.modules, "my_load")
    (tmp_path / "my_load.py").unlink()
    assert pickle.loads(packed).torque_nm(0.0, 2.0, 0.0, 1e-5) == 6.0
    with (tmp_path / "open.txt").open("w") as file, pytest.raises(fluxlock.ConfigError, match="another process"):
        pickle.dumps(PythonLoad(lambda speed, angle, time: file.write("")))


def test_in_a_sweep(tmp_path: Path) -> None:
    """A sweep takes a function, also to its workers; one whose results are kept by content refuses it.

    Verifies: PACKAGE-11
    """
    scenario = fluxlock.scenario_of(SPINNING, coasting())
    grid = {"motor.inertia_kgm2": [5e-7, 6e-7]}
    made = fluxlock.sweep(scenario, grid, twin=True, load_nm=broken("1 / 0 if time > 0.001 else 0.0"))
    assert made.count("broken") == 2 and "load_nm raised ZeroDivisionError" in made.rows[0]["reason"]
    work = partial(sweeps.run_point, None, True, sweeps.sources(), PythonLoad(broken("1e-6 * speed")))
    point = sweeps.Grid.of(scenario, [sweeps.Axis("seed", (1,))]).points[0]
    assert pickle.loads(pickle.dumps(work))(point) == work(point) and work(point)["status"] == "right"
    with pytest.raises(fluxlock.ConfigError, match=r"load_nm: results are kept by content.*leave out folder"):
        fluxlock.sweep(scenario, grid, twin=True, load_nm=broken("0.0"), folder=tmp_path)
