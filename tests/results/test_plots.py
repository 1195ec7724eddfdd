# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Plot pages of synthetic runs."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import Scenario, load_motor, load_scenario
from fluxlock.results.metrics import Analysis
from fluxlock.results.plots import overview_page, vector_overview_page, vector_zoom_page, write_plots
from fluxlock.theory.six_step.machine import Machine
from fluxlock.theory.six_step.override import SampleTiming
from fluxlock.theory.six_step.plots import soa_figure, spectrum_figure
from fluxlock.theory.six_step.soa import SafeMap, TorqueLimits
from fluxlock.theory.six_step.soa_study import Settings, Study
from fluxlock.theory.six_step.spectrum_study import alignment_spectrum
from tests.results.synthetic import Drive, make_run, make_vector_run


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


def test_errors_beyond_the_axis(scenario: Scenario) -> None:
    """Errors that the windows' range leaves out are marked at the edge on their side; without any there is no mark.

    Verifies: FRONT-09
    """

    def marks(drive: Drive) -> dict[object, np.ndarray]:
        errors = overview_page(Analysis(make_run(drive)), scenario).axes[1]
        return {line.get_label(): line.get_ydata() / errors.get_ylim()[1] for line in errors.lines}

    assert not any("beyond" in str(label) for label in marks(Drive(crossing_error=lambda k: 1.5)))
    # The first window begins after 30 crossings.
    early = marks(
        Drive(crossing_error=lambda k: 20.0 if k in (5, 6) else 1.5, commutation_error=lambda k: -9.0 * (k == 7))
    )
    assert np.allclose(early["beyond the axis, up to 20 deg"], [0.97, 0.97, -0.97])


@pytest.mark.parametrize("phases", [3, 5])
def test_pages_of_a_vector_run(tmp_path: Path, phases: int) -> None:
    """Speed, the angle's error at its samples, i_d and i_q of the run, zoomed phase currents; two PNG files.

    Verifies: VCONF-06
    """
    scenario = load_scenario(
        ROOT / "scenarios" / "vector" / "start.toml",
        [
            "duration_s=0.02",
            "event=[{at_s=0.001,speed_rpm=60000}]",
            'window=[{name="steady",from_s=0.005,to_s=0.01}]',
            "expect=[]",
        ],
    )
    span = scenario.zoom_window_s()
    analysis = Analysis(make_vector_run(Drive(zoom_s=span), np.array([1.5]), d_a=-2.0, q_a=11.0, phases=phases))
    speed, errors, currents, of_phases = vector_overview_page(analysis, scenario).axes
    assert all(axes.get_ylabel() and axes.get_xlabel() for axes in (speed, errors, currents, of_phases))
    assert np.allclose({line.get_label(): line for line in speed.lines}["speed"].get_ydata(), 60.0)
    samples = errors.lines[0]
    assert np.allclose(samples.get_ydata(), 1.5, atol=0.01)
    assert len(samples.get_xdata()) == pytest.approx(0.02 * 40e3, abs=2)
    assert errors.get_ylim()[1] == pytest.approx(1.5 * 1.5, abs=0.02)
    lines = {line.get_label(): line for line in currents.lines}
    assert np.allclose(lines["d"].get_ydata(), -2.0) and np.allclose(lines["q"].get_ydata(), 11.0)
    assert of_phases.get_xlim() == tuple(t * 1e3 for t in span)
    assert [line.get_label() for line in of_phases.lines] == [f"phase {x}" for x in "ABCDE"[:phases]]
    *_, gates = vector_zoom_page(analysis, scenario).axes
    assert [x.get_text() for x in gates.get_yticklabels()][::2] == [f"{x} upper" for x in "ABCDE"[:phases]]
    paths = write_plots(tmp_path, analysis, scenario)
    assert [p.name for p in paths] == ["overview.png", "zoom.png"]
    assert all(p.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" for p in paths)


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


def test_lines_stand_clear_of_the_frame() -> None:
    """The lines of the highest order, -17 and 19, and the crosses of their gates lie inside the axis.

    Verifies: THEORY-11
    """
    spectrum = alignment_spectrum("CSC", Fraction(25, 8), 0.5, 0.0, 19.0)
    axes = spectrum_figure("", [spectrum], 19.0, 0.0).axes[0]
    low, high = axes.get_xlim()
    assert low < -19.3 and high > 19.3
    assert {-17.0, 19.0} <= set(np.round(axes.lines[0].get_xdata(), 9).tolist())


def test_legend_of_the_safe_area() -> None:
    """A limit that no current of the map reaches has no line and no entry; one that is reached has both.

    Verifies: THEORY-11
    """
    machine = Machine.from_motor(load_motor(ROOT / "motors" / "pump-4pp.toml"))
    speed, current = np.array([1000.0, 2000.0]), np.array([0.0, 5.0, 10.0])
    settings = Settings(2000.0, 10.0, 20e3, 0.0, SampleTiming(2e-6, 1e-6, 1e-6))
    nothing = np.full(2, np.nan)
    for steepest_deg, reached in ((20.0, False), (60.0, True)):
        angle = np.linspace(0.0, steepest_deg, 3)[:, np.newaxis] * np.ones(2)
        bound = SafeMap(speed, current, angle, 0.5 * np.ones((3, 2)), np.full((3, 2), 40.0))
        torque = TorqueLimits(speed, *(2 * [0.1 * np.ones(2) if reached else nothing]), nothing, np.ones(2))
        study = Study(machine, 24.0, settings, bound, np.full(2, 9.0), speed, np.zeros(2), limits={"ON-PWM": torque})
        area, limits = (page for page in soa_figure(study).axes if page.get_legend() is not None)
        shown = [text.get_text() for page in (area, limits) for text in page.get_legend().get_texts()]
        some = ["bound 25°", "bound 30°", "bound, crossing computed back"]
        assert shown == [
            *(some if reached else []),
            "supply (duty 1)",
            *(["ON-PWM, 30°"] if reached else []),
            "ON-PWM, largest",
        ]
