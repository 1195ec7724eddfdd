"""Plot pages of synthetic runs."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from fluxlock.analysis.metrics import Analysis
from fluxlock.analysis.plots import overview_page, write_plots
from fluxlock.config import Scenario, load_scenario
from fluxlock.paths import ROOT
from tests.analysis.synthetic import Drive, make_run


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario(
        ROOT / "scenarios" / "demo.toml",
        [
            "duration_s=0.02",
            "event=[{at_s=0.001,speed_rpm=60000},{at_s=0.015,speed_rpm=20000}]",
            'window=[{name="steady",from_s=0.005,to_s=0.01},{name="loaded",from_s=0.012,to_s=0.018}]',
            "expect=[]",
        ],
    )


def test_pages_are_written(tmp_path: Path, scenario: Scenario) -> None:
    """Both pages are PNG files of readable size, the same bytes for the same run.

    Verifies: FRONT-09
    """
    drive = Drive(zoom_s=scenario.zoom_window_s(), late=frozenset({30}), trip_at_s=0.019, trip_mask=1)
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        paths = write_plots(tmp_path / folder, Analysis(make_run(drive)), scenario)
        assert [p.name for p in paths] == ["overview.png", "zoom.png"]
        for path in paths:
            data = path.read_bytes()
            assert data[:8] == b"\x89PNG\r\n\x1a\n"
            width, height = struct.unpack(">II", data[16:24])
            assert width >= 1200 and height >= 1200
    for name in ("overview.png", "zoom.png"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_panels_show_what_they_say(scenario: Scenario) -> None:
    """Every axis has a label with unit; speed, target, errors and crossings are the run's.

    Verifies: FRONT-09
    """
    drive = Drive(zoom_s=scenario.zoom_window_s(), crossing_error=lambda k: 1.5, commutation_error=lambda k: -1.0)
    analysis = Analysis(make_run(drive))
    speed, errors, voltages, currents, gates = overview_page(analysis, scenario).axes
    assert all(axes.get_ylabel() for axes in (speed, errors, voltages, currents, gates))
    lines = {line.get_label(): line for line in speed.lines}
    assert np.allclose(lines["speed"].get_ydata(), 60.0)
    assert lines["target"].get_ydata().tolist() == [0.0, 60.0, 20.0, 20.0]
    lines = {line.get_label(): line for line in errors.lines}
    assert np.allclose(lines["zero crossing"].get_ydata(), 1.5, atol=0.01)
    assert np.allclose(lines["commutation"].get_ydata(), -1.0, atol=0.01)
    assert errors.get_ylim()[1] == pytest.approx(1.5 * 1.5, abs=0.02)
    low, high = (t * 1e3 for t in scenario.zoom_window_s())
    marks = np.concatenate([line.get_xdata() for line in voltages.lines if line.get_marker() == "o"])
    # 2.5 turns hold 15 crossings.
    assert marks.size == 15 and low <= marks.min() and marks.max() <= high
    assert voltages.get_xlim() == currents.get_xlim() == gates.get_xlim() == (low, high)


def test_pages_of_a_run_without_events(tmp_path: Path, scenario: Scenario) -> None:
    """A rotor at rest, gates off, nothing recorded in the zoom span: the pages still come.

    Verifies: FRONT-09
    """
    data = make_run(Drive())
    data.log = data.log[:0]
    data.plant_events = data.plant_events[:0]
    assert len(write_plots(tmp_path, Analysis(data), scenario)) == 2


def test_target_by_console_line() -> None:
    """A reversal by the console is in the speed panel.

    Verifies: FRONT-09
    """
    reversal = load_scenario(
        ROOT / "scenarios" / "demo.toml",
        [
            "duration_s=0.02",
            'event=[{at_s=0.001,speed_rpm=60000},{at_s=0.015,command="set speed_rpm -20000"}]',
            'window=[{name="steady",from_s=0.005,to_s=0.01}]',
            "expect=[]",
        ],
    )
    analysis = Analysis(make_run(Drive(zoom_s=reversal.zoom_window_s())))
    speed = overview_page(analysis, reversal).axes[0]
    (target,) = (line for line in speed.lines if line.get_label() == "target")
    assert target.get_ydata().tolist() == [0.0, 60.0, -20.0, -20.0]
