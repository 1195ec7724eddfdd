# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fluxlock from Python."""

from __future__ import annotations

import doctest
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import fluxlock
from fluxlock.base.paths import ROOT

OWN = ROOT / "scenarios" / "own-spindle.toml"
SHORT = {"duration_s": 0.3, "window": [{"name": "end", "from_s": 0.25, "to_s": 0.3}], "expect": []}


@pytest.fixture(scope="module")
def run() -> fluxlock.Run:
    return fluxlock.simulate(OWN, twin=True, **SHORT)


def test_public_names() -> None:
    """Every public name is there, has a docstring, and `import fluxlock` alone loads nothing slow.

    Verifies: PACKAGE-7
    """
    for name in fluxlock.__all__:
        assert getattr(fluxlock, name).__doc__, name
    assert set(fluxlock.__all__) == set(fluxlock._HOME)
    with pytest.raises(AttributeError, match="no_such"):
        _ = fluxlock.no_such


@pytest.mark.parametrize("name", fluxlock.__all__)
def test_public_name_on_the_site(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Docstring with errors, where a function raises them, and an example, which runs if it is quick; on the site.

    Verifies: PACKAGE-7
    """
    public = getattr(fluxlock, name)
    module = fluxlock._HOME[name]
    page = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    assert f"[`{module}`]" in page
    assert f"`{name}" in (ROOT / "docs" / "howto" / "python-and-sweeps.md").read_text(encoding="utf-8")
    if name in ("UNITS", "Motor", "Inverter", "Scenario"):  # each key of a file is on the page of the files
        return
    text = public.__doc__
    assert ">>> " in text and (isinstance(public, type) or "Raises ConfigError" in text)
    if "+SKIP" in text or name in ("simulate", "sweep"):
        return
    monkeypatch.chdir(ROOT)
    home = sys.modules[module]
    example = doctest.DocTestParser().get_doctest(text, vars(home).copy(), name, None, 0)
    assert doctest.DocTestRunner(verbose=False).run(example).failed == 0


def test_traces(run: fluxlock.Run) -> None:
    """Traces have one length and a unit each; speed is the derivative of the angle; the table holds the same.

    Verifies: PACKAGE-7
    """
    assert set(run.traces) == set(fluxlock.UNITS)
    t_s, theta = run.traces["t_s"], run.traces["theta_e_rad"]
    assert {len(trace) for trace in run.traces.values()} == {len(t_s)} and t_s[-1] == pytest.approx(0.3, abs=1e-3)
    turned = np.trapezoid(run.traces["speed_rpm"], t_s) / 60 * run.scenario.motor.pole_pairs * 2 * np.pi
    assert turned == pytest.approx(theta[-1] - theta[0], rel=1e-3)
    table = run.to_dataframe()
    assert table.index.name == "t_s" and table.attrs["units"]["ia"] == "A"
    np.testing.assert_array_equal(table["ia"], run.traces["ia"])
    assert run.metrics["end"]["speed_rpm"]["mean"] > 1000


def test_plot(run: fluxlock.Run) -> None:
    """A panel a trace; a name that is none is refused with those that are.

    Verifies: PACKAGE-7
    """
    mpl.use("Agg")
    panels = run.plot("speed_rpm", "ia")
    assert [panel.get_ylabel() for panel in panels] == ["speed_rpm / r/min", "ia / A"]
    with pytest.raises(fluxlock.ConfigError, match="permitted: t_s"):
        run.plot("current")


def test_changed_in_code() -> None:
    """Keys changed on a loaded scenario give what the file with the same `--set` gives; problems name the key.

    Verifies: PACKAGE-7
    """
    texts = ["motor.resistance_ohm=0.2", "drive.commutation=CSC", "window.steady.to_s=1.16"]
    keys = {"motor.resistance_ohm": 0.2, "drive__commutation": "CSC", "window.steady.to_s": 1.16}
    of_file = fluxlock.load_scenario(OWN, texts)
    assert fluxlock.scenario_of(OWN, keys) == of_file
    assert fluxlock.scenario_of(fluxlock.load_scenario(OWN), keys) == of_file
    with pytest.raises(fluxlock.ConfigError, match=r"motor\.resistance_ohm: .*out of range"):
        fluxlock.scenario_of(fluxlock.load_scenario(OWN), {"motor.resistance_ohm": -1.0})
    with pytest.raises(fluxlock.ConfigError, match="unknown key"):
        fluxlock.simulate(OWN, twin=True, drive__no_such=1)


def test_whole_motor() -> None:
    """A motor that code made replaces that of the file, with keys of it changed in the same call.

    Verifies: PACKAGE-7
    """
    motor = fluxlock.load_motor(ROOT / "motors" / "spindle-2pp.toml").model_copy(update={"name": "mine"})
    made = fluxlock.scenario_of(OWN, {"motor": motor, "motor.load.coulomb_nm": 1e-3})
    assert made.motor.name == "mine" and made.motor.load.coulomb_nm == 1e-3
    with pytest.raises(fluxlock.ConfigError, match="must be a Motor"):
        fluxlock.scenario_of(fluxlock.load_scenario(OWN), {"motor": 3})


def test_chip(tmp_path: Path) -> None:
    """On the chip, with results kept in a folder: trace, result and plots as `fluxlock run` writes them.

    Verifies: PACKAGE-7
    """
    run = fluxlock.simulate(
        "scenarios/spinning.toml", folder=tmp_path, duration_s=0.002, event=[], window=[], expect=[]
    )
    assert run.data.cycles == 100_000 and run.verdict.passed
    assert {"trace.npz", "result.json", "overview.png"} <= {path.name for path in tmp_path.iterdir()}
