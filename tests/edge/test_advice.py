# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock inverter advise`: its budget against the chip's recorded errors, and what it refuses."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fluxlock.base.paths import ROOT
from fluxlock.cli import app
from fluxlock.config import ConfigError, load_inverter, load_motor, load_scenario
from fluxlock.config.drive import Drive
from fluxlock.edge.advice import AGREED, Parts, advised, budget, choose, left_v, slope_v_per_rad
from fluxlock.plant.edge_params import EdgeParams

MOTOR = ROOT / "motors" / "spindle-2pp.toml"
INVERTER = ROOT / "inverters" / "drive-48v.toml"
EXACT = Parts(0.0, 0.0)


def recorded_deg(row: str) -> float:
    """Commutation error of the chip, rms, mean of the seeds of the record."""
    rows = json.loads((ROOT / "docs" / "verification" / "record.json").read_text(encoding="utf-8"))["rows"]
    return float(rows[f"six-step/edges/{row}"]["values"]["commutation_error_deg.rms"]["value"])


@pytest.mark.parametrize("speed_rpm", [6000, 13000])
@pytest.mark.parametrize(("preset", "factor"), [("clean", 1.5), ("T", 2), ("G", 2), ("cable", 2), ("divider", 2)])
def test_budget_is_what_the_chip_has(preset: str, factor: float, speed_rpm: int) -> None:
    """White noise within 1.5, edges within 2 of the rms errors that runs of the chip have.

    Verifies: FRONT-94
    """
    s = load_scenario(ROOT / "scenarios" / "own-spindle.toml", (f"inverter.sensing.edge.preset={preset}",))
    found = budget(s.motor, s.inverter, s.drive, speed_rpm, EXACT)
    assert found.samples == 4
    assert 1 / factor <= found.total_deg / recorded_deg(f"{preset}-{speed_rpm}") <= factor


@pytest.mark.parametrize("preset", ["clean", "T", "G"])
def test_lobe_of_the_last_pulse(preset: str) -> None:
    """With 40 kHz a gap is short, and the lobe at its begin is in the samples behind it: within 2 of the chip's error.

    Verifies: FRONT-94
    """
    s = load_scenario(ROOT / "scenarios" / "own-outrunner.toml", (f"inverter.sensing.edge.preset={preset}",))
    found = budget(s.motor, s.inverter, s.drive, 8000, EXACT)
    assert 0.5 <= found.total_deg / recorded_deg(f"own-outrunner-{preset}-8000") <= 2
    assert (found.edges_deg > 0.1) == (preset == "G")
    longer = s.drive.model_copy(update={"carrier_hz": 20e3})
    assert budget(s.motor, s.inverter, longer, 8000, EXACT).edges_deg < 0.5 * found.edges_deg + 1e-3


def test_slope_of_a_ramp() -> None:
    """A trapezoid rises to its peak over half of what its flat top leaves; a sine has 3/2 of its peak per radian."""
    sine = load_motor(MOTOR)
    peak_v = 5e-3 * sine.omega_e(6000)
    assert slope_v_per_rad(sine, 6000) == pytest.approx(1.5 * peak_v)
    flat = sine.model_copy(update={"emf": "trapezoidal", "flat_top_deg": 120.0})
    assert slope_v_per_rad(flat, 6000) == pytest.approx(peak_v / math.radians(30))


def test_what_is_left_of_an_edge() -> None:
    """A ring behind the pole against its equation, integrated step by step; long after the edge nothing is left."""
    import numpy as np

    edge = EdgeParams(reference_v=48.0, coupling=1.0, own=0.0, ring_v=1.2, ring_hz=7e5, ring_tau_s=4e-6)
    pole_s, step_s = 0.8e-6, 1e-10
    times = np.arange(0, 6e-6, step_s)
    ring = 2.0 * 1.2 * np.exp(-times / 4e-6) * np.cos(2 * np.pi * 7e5 * times)
    value, own = 0.0, -0.5 * 96.0 * np.exp(-times / pole_s)
    for k in range(times.size - 1):
        value += step_s / pole_s * (0.5 * (ring[k] + ring[k + 1]) - value)
    assert left_v(edge, pole_s, 96.0, times)[-1] - own[-1] == pytest.approx(value, abs=2e-3)
    assert abs(left_v(edge, pole_s, 96.0, np.array([1e-3]))[0]) < 1e-9


def test_the_longest_pole_that_costs_nothing() -> None:
    """It is within the stated share of the least error, and stretches no carrier that the present one leaves.

    Verifies: FRONT-94
    """
    motor, inverter = load_motor(MOTOR), load_inverter(INVERTER)
    now, runs = choose(motor, inverter, Drive(carrier_hz=20e3), (4400.0, 22000.0), Parts(0.001, 0.05))
    best = advised(now, runs)
    least = min(c.worst_deg for c in runs)
    assert best.worst_deg <= AGREED * least and best.pole_s > now.pole_s
    assert best.stretched_rpm <= max(now.stretched_rpm, 4400.0)
    # A filter of no use: the tolerance of its capacitor alone is worse than the noise.
    now, runs = choose(motor, inverter, Drive(carrier_hz=20e3), (20000.0, 22000.0), Parts(0.0, 0.05))
    _, loose = choose(motor, inverter, Drive(carrier_hz=20e3), (20000.0, 22000.0), Parts(0.0, 0.5))
    assert advised(now, loose).pole_s < advised(now, runs).pole_s


def test_command(tmp_path: Path) -> None:
    """Table, capacitor, picture and JSON.

    Verifies: FRONT-94
    """
    line = ["inverter", "advise", str(MOTOR), str(INVERTER), "--divider-ohm", "4700", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, line)
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "advise.json").read_text(encoding="utf-8"))
    assert f"{data['advised']['pole_s'] / 4700 * 1e12:.0f} pF" in result.output
    assert (tmp_path / "advise.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--to-rpm", "90000"], "--to-rpm: 90000 r/min needs more than the supply of 48 V: permitted up to"),
        (["--from-rpm", "22000"], "--from-rpm: 22000 r/min is not below the highest speed of 22000 r/min"),
        (["--from-rpm", "0"], "--from-rpm: 0 r/min is not below"),
        (["--from-rpm", "nan"], "--from-rpm: nan r/min is not below"),
        (["--to-rpm", "inf"], "--to-rpm: inf r/min needs more than the supply"),
    ],
)
def test_refused(tmp_path: Path, options: list[str], named: str) -> None:
    """One line that says what is permitted; nothing is written.

    Verifies: FRONT-94
    """
    with pytest.raises(ConfigError) as refused:
        CliRunner().invoke(
            app,
            ["inverter", "advise", str(MOTOR), str(INVERTER), *options, "--out", str(tmp_path / "out")],
            catch_exceptions=False,
        )
    assert named in str(refused.value)
    assert not (tmp_path / "out" / "advise.png").exists()


def test_no_pole_and_no_present_one(tmp_path: Path) -> None:
    """Where the present pole leaves no samples the table says so; where none does, nothing is advised.

    Verifies: FRONT-94
    """
    text = INVERTER.read_text(encoding="utf-8")
    slow = tmp_path / "slow.toml"
    slow.write_text(text.replace("sample_period_s = 1e-6", "sample_period_s = 2e-6"), encoding="utf-8")
    line = ["inverter", "advise", str(MOTOR), "--carrier-hz", "200000", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, [*line, str(INVERTER)])
    assert result.exit_code == 0 and "leaves no samples of a crossing here" in result.output, result.output
    with pytest.raises(ConfigError, match="no pole leaves samples of a crossing at 22000 r/min and 200000 Hz"):
        CliRunner().invoke(app, [*line, str(slow)], catch_exceptions=False)


def test_five_phases_are_refused(tmp_path: Path) -> None:
    """Six-step has three phases."""
    files = [str(ROOT / "motors" / "five-phase-yu.toml"), str(ROOT / "inverters" / "five-leg-200v.toml")]
    with pytest.raises(ConfigError, match="must be 3 for six-step"):
        CliRunner().invoke(app, ["inverter", "advise", *files, "--out", str(tmp_path)], catch_exceptions=False)
