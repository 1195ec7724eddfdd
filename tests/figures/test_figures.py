# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The figures of a thesis: registry, command, document, page, formulas. Runs are not made here."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_scenario
from fluxlock.results.metrics import Analysis
from fluxlock.results.verdict import Verdict
from fluxlock.theory.six_step.patterns import gate_sequence
from fluxlock.theory.six_step.switched import ideal_inverter, steady_operation, waveforms
from fluxverify import cli
from fluxverify.docs import figures as docs_page
from fluxverify.figures import FIGURES, Drawing, Entry, command, figure
from fluxverify.figures.command import draw, of_family, run_figures, select
from fluxverify.figures.panels import page, save_small
from fluxverify.figures.six_step import chapter_2, chapter_3, chapter_5, chapter_6, support
from fluxverify.figures.six_step.support import motor_1
from fluxverify.regression import origin
from fluxverify.regression import runner as regression_runner
from fluxverify.regression.runner import RunFailed, Runner
from tests.results.synthetic import Drive, make_run

# Issue: 2.5, 2.10-2.14, 3.3, 3.10-3.13, 4.8-4.17, 5.4, 5.7, 5.10, 5.12, 5.14-5.16, 6.9-6.14.
ASKED = [
    *("2.5", "2.10", "2.11", "2.12", "2.13", "2.14", "3.3", "3.10", "3.11", "3.12", "3.13"),
    *(f"4.{k}" for k in range(8, 18)),
    *("5.4", "5.7", "5.10", "5.12", "5.14", "5.15", "5.16"),
    *(f"6.{k}" for k in range(9, 15)),
]
PAGE = ROOT / "docs" / "verification" / "figures-six-step.md"
IMAGES = ROOT / "docs" / "images" / "six-step"


def test_registry() -> None:
    """All figures, in the thesis's order, each with a title of one line.

    Verifies: FIG-01
    """
    found = of_family("six-step")
    assert [f.number for f in found] == ASKED
    assert all(len(f.title) > 10 and not f.title.endswith(".") for f in found)
    assert len({f.stem for f in found}) == len(found)
    with pytest.raises(ValueError, match="twice"):
        figure("six-step", "2.5")(chapter_2.sampling)
    with pytest.raises(ValueError, match="family"):
        figure("seven-step", "1.1")(chapter_2.sampling)


def test_selection() -> None:
    """Numbers and chapters; what does not exist is refused with what does.

    Verifies: FIG-02
    """
    assert [f.number for f in select("six-step", ["3", "2.5"])] == ["2.5", "3.3", "3.10", "3.11", "3.12", "3.13"]
    assert len(select("six-step", [])) == len(ASKED)
    for wanted in ("2.1", "7", "x", "2.5.1"):
        with pytest.raises(ConfigError, match=r"no such figure of six-step.*2\.10"):
            select("six-step", ["2.5", wanted])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["figures", "six-stp"], "'six-stp' is no family, did you mean \"six-step\"?"),
        (["figures", "six-step", "9.9"], "9.9: no such figure of six-step"),
        (["figures"], "missing argument 'family'"),
        (["figures", "six-step", "--jobs", "0"], "--jobs"),
        (["figures", "six-step", "2.5", "--out", "README.md"], "--out"),
    ],
)
def test_wrong_usage(
    arguments: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line, exit code 2.

    Verifies: FIG-02
    """
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["fluxverify", *arguments])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    err = capsys.readouterr().err.strip()
    assert caught.value.code == 2 and message in err and len(err.splitlines()) == 1


def _drawing(text: str) -> Drawing:
    drawn, ((axes,),) = page(text, 1, 1, (3, 2))
    axes.plot([0, 1], [0, 1])
    return Drawing("At rest.", drawn, (Entry("a | b", "1", text, "no run", False, "because"),))


def _good(runner: Runner) -> Drawing:
    """A figure that works."""
    return _drawing("quick" if runner.quick else "full")


def _broken(runner: Runner) -> Drawing:
    """A run that breaks off."""
    raise RunFailed("run x, seed 1: plant fault 3")


def _wrong(runner: Runner) -> Drawing:
    """A defect."""
    return _drawing(str(1 // int(runner.quick)))


@pytest.fixture
def three(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only three figures, drawn in this process."""
    of_family("six-step")
    monkeypatch.setattr(command, "FIGURES", {})
    for number, body in (("1.2", _good), ("1.3", _broken), ("1.10", _wrong)):
        command.FIGURES[f"six-step/{number}"] = type(FIGURES["six-step/2.5"])("six-step", number, body)

    def one_by_one(
        work: Callable[[str], Any],
        names: Sequence[str],
        jobs: int,
        done: Callable[[str, Any], None],
        shares_build: bool,
    ) -> None:
        assert shares_build
        for name in names:
            done(name, work(name))

    monkeypatch.setattr(command, "side_by_side", one_by_one)
    monkeypatch.setattr(command, "prepare_runs", lambda quick: None)


def test_command(three: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A failing figure is named, the others are drawn; what was drawn before stays, of the same length of run.

    Verifies: FIG-02, FIG-03
    """
    assert not run_figures("six-step", [], tmp_path, False, 1, 1)
    out = capsys.readouterr().out
    assert "failed: 1.3: run x, seed 1: plant fault 3" in out and "ZeroDivisionError" in out
    path = tmp_path / "six-step" / "figures.json"
    document = json.loads(path.read_text())
    assert [f["figure"] for f in document["figures"]] == ["1.2", "1.3", "1.10"]
    assert (tmp_path / "six-step" / "fig-1-2.png").read_bytes()[:4] == b"\x89PNG"
    row = {"quantity": "a | b", "printed": "1", "here": "full", "speed": "no run", "agrees": False, "why": "because"}
    assert document["figures"][0]["table"] == [row]

    assert run_figures("six-step", ["1.2"], tmp_path, False, 1, 1)
    assert len(json.loads(path.read_text())["figures"]) == 3
    assert run_figures("six-step", ["1.2", "1.10"], tmp_path, True, 1, 1)
    assert [f["figure"] for f in json.loads(path.read_text())["figures"]] == ["1.2", "1.10"]


def test_figures_keep_their_revision(
    three: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A figure drawn before stays with its revision and seed, also on the page; gone or of unknown origin: dropped.

    Verifies: FIG-02, FIG-03
    """
    folder, pages = tmp_path / "figures", tmp_path / "pages"
    pages.mkdir()
    path = folder / "six-step" / "figures.json"
    monkeypatch.setattr(origin, "git_revision", lambda: "aaa")
    hashes = dict.fromkeys(("chip", "firmware", "plant"), "0123456789ab")
    monkeypatch.setattr(origin, "source_hashes", lambda: hashes)
    told = "chip `0123456789ab`, firmware `0123456789ab`, plant `0123456789ab`"
    run_figures("six-step", ["1.2", "1.3"], folder, False, 1, 1)
    docs_page.write_pages(folder, pages, tmp_path / "images")
    text = (pages / "figures-six-step.md").read_text()
    assert text.count("Revision") == 1 and f"\nRevision aaa, seed 1, {told}, full length.\n" in text
    monkeypatch.setattr(origin, "git_revision", lambda: "bbb")
    run_figures("six-step", ["1.3"], folder, False, 2, 1)
    figures = json.loads(path.read_text())["figures"]
    assert [(f["figure"], f["git_revision"], f["seed"]) for f in figures] == [("1.2", "aaa", 1), ("1.3", "bbb", 2)]
    docs_page.write_pages(folder, pages, tmp_path / "images")
    text = (pages / "figures-six-step.md").read_text()
    assert "\nFull length; revision and seed stand at each figure.\n" in text
    assert f"## Figure 1.2: A figure that works\n\nRevision aaa, seed 1, {told}.\n" in text
    assert f"## Figure 1.3: A run that breaks off\n\nRevision bbb, seed 2, {told}.\n" in text

    document = json.loads(path.read_text())
    del document["figures"][0]["seed"]
    document["figures"].append({**document["figures"][1], "figure": "9.9"})
    path.write_text(json.dumps(document))
    capsys.readouterr()
    run_figures("six-step", ["1.3"], folder, False, 2, 1)
    assert [f["figure"] for f in json.loads(path.read_text())["figures"]] == ["1.3"]
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("dropped")]
    assert lines == [
        f"dropped from {path}: 1.2: its revision and seed were not recorded",
        f"dropped from {path}: 9.9: no figure of this name any more",
    ]


def test_page(three: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Image, condition and table of each figure; a failure is stated; nothing drawn is an error.

    Verifies: FIG-03
    """
    folder, pages, images = tmp_path / "figures", tmp_path / "pages", tmp_path / "images"
    assert docs_page.write_pages(folder, pages, images) == 1
    run_figures("six-step", ["1.2", "1.3"], folder, False, 1, 1)
    pages.mkdir()
    assert docs_page.write_pages(folder, pages, images) == 0
    text = (pages / "figures-six-step.md").read_text()
    assert "## Figure 1.2: A figure that works" in text and "At rest." in text
    assert "![Figure 1.2](../images/six-step/fig-1-2.png)" in text
    assert "| a \\| b | 1 | full | no run | because |" in text
    assert "Not drawn: run x, seed 1: plant fault 3" in text
    assert (images / "six-step" / "fig-1-2.png").exists()
    assert "full length" in text and "seed 1" in text


class Learning:
    """Runner that gives a synthetic run for figure 3.12, with the thresholds that were asked for on the console."""

    quick = True

    def drive(self, scenario: str, name: str, *overrides: str, **_: Any) -> Any:
        data = make_run(Drive(speed_rpm=18_000.0, duration_s=0.34))
        asked = [line for line in load_scenario(ROOT / "scenarios" / scenario, overrides).event if line.command]
        part = np.linspace(0.0, 0.05, sum(line.command == "get threshold_pu" for line in asked))
        data.uart = [
            f"threshold_pu {' '.join(f'{0.5 + d * x:.4f}' for x in (-1, 0, 1, -0.9, -0.1, 0.9))}" for d in part
        ]
        return SimpleNamespace(
            data=data,
            analysis=Analysis(data),
            result={"trips": [], "rejected": []},
            console=lambda: "\n".join(data.uart),
        )


def test_legend_beside_the_curves() -> None:
    """The thresholds of figure 3.12 fill their panel: the legend stands above it.

    Verifies: FIG-03
    """
    runner: Any = Learning()
    drawing = chapter_3.convergence(runner)
    FigureCanvasAgg(drawing.page).draw()
    level = drawing.page.axes[2]
    legend = level.get_legend()
    assert legend is not None and legend.get_window_extent().y0 >= level.get_window_extent().y1


def test_images(tmp_path: Path) -> None:
    """The same page gives the same bytes, with a palette.

    Verifies: FIG-04
    """
    for name in ("a.png", "b.png"):
        save_small(_drawing("x").page, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    with Image.open(tmp_path / "a.png") as image:
        assert image.format == "PNG" and image.mode == "P"
    assert isinstance(_drawing("x").page, Figure)


def test_documentation() -> None:
    """The page has every figure with its image; images are below 60 KB each, 2.5 MB together.

    Verifies: FIG-04
    """
    text = PAGE.read_text()
    for entry in of_family("six-step"):
        assert f"## Figure {entry.number}: {entry.title}\n" in text
        assert f"(../images/six-step/{entry.stem}.png)" in text
    sizes = [path.stat().st_size for path in IMAGES.glob("fig-*.png")]
    assert len(sizes) == len(ASKED)
    assert max(sizes) < 60_000 and sum(sizes) < 2_500_000


def test_failure_of_a_run(three: None, tmp_path: Path) -> None:
    """A run that breaks off gives the reason instead of a picture.

    Verifies: FIG-02
    """
    part = draw("six-step", tmp_path, "1.3", False, 1)
    assert part["failure"] == "run x, seed 1: plant fault 3" and part["image"] == "" and part["table"] == []


def test_runs_are_shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that another case finished with the same inputs is read from there, another one is made.

    Verifies: FIG-06
    """
    made: list[Path] = []

    @dataclass
    class Found:
        folder: Path
        verdict: Verdict = field(default_factory=lambda: Verdict(True, []))

    def simulate(loaded: Any, folder: Path, seed: int, plots: bool) -> None:
        made.append(folder)

    monkeypatch.setattr(regression_runner, "FOLDER", tmp_path)
    monkeypatch.setattr(regression_runner, "KEYS", tmp_path / "keys")
    monkeypatch.setattr(regression_runner, "simulate", simulate)
    monkeypatch.setattr(regression_runner, "image_of", lambda loaded: Path())
    monkeypatch.setattr(regression_runner, "_key", lambda loaded, seed, image: f"{loaded.drive.commutation}-{seed}")
    monkeypatch.setattr(regression_runner, "read_outcome", lambda loaded, folder: Found(folder))
    scenario, other = "six-step/spectrum.toml", "drive.commutation=RSC"
    first, second = Runner("six-step/a"), Runner("figures/six-step/6.9", quick=True)
    assert first.drive(scenario, "x").folder == made[0]
    assert first.drive(scenario, "x").folder == second.drive(scenario, "y").folder == made[0]
    assert len(made) == 1
    assert second.drive(scenario, "z", other).folder == made[1]
    assert first.drive(scenario, "x", seed=2).folder == made[2] == made[0]
    # Its folder holds the run with another seed now: the first one is made again.
    assert second.drive(scenario, "y").folder == made[3]
    assert len(made) == 4


def test_position_error_formula() -> None:
    """Shift of the third harmonic by unequal inductances, from the circuit's equations solved at the crossing.

    v_H - v_N = L_H di/dt + e_H, v_L - v_N = -L_L di/dt + e_L, v_SM the mean of the terminals less half the link.

    Verifies: FIG-05
    """
    speed_rpm, l_h, l_l = 20_060.0, 27e-6, 22e-6
    omega, psi, supply = speed_rpm * np.pi / 30, 1e-3, 15.0

    def third_harmonic(angle: float) -> float:
        e_o, e_h, e_l = psi * omega * np.sin(np.radians(angle + np.array([0.0, 120.0, -120.0])))
        slope = (supply - e_h + e_l) / (l_h + l_l)
        neutral = supply - e_h - l_h * slope
        return float((supply + neutral + e_o) / 3 - supply / 2)

    angles = np.linspace(-40.0, 40.0, 801)
    crossing = float(np.interp(0.0, [third_harmonic(a) for a in angles], angles))
    formula = float(chapter_2.position_error_deg((l_h - l_l) / (l_h + l_l), np.array([speed_rpm]))[0])
    # The formula takes the slope at the crossing.
    assert abs(crossing) == pytest.approx(formula, rel=0.05)
    zero_rpm = supply / np.sqrt(3.0) / psi * 30 / np.pi
    assert chapter_2.position_error_deg(0.1, np.array([zero_rpm]))[0] == pytest.approx(0.0, abs=1e-9)


def test_divider_formula() -> None:
    """Shift of a divider whose resistors are off in opposite directions, from the voltages themselves.

    Verifies: FIG-05
    """
    psi_omega = chapter_3.SUPPLY_V / np.sqrt(3.0) * 0.5
    low, high = 3.0 * 1.05, 12.0 * 0.95
    measured = low / (low + high) * 5.0
    shift_v = (measured - 1.0) * chapter_3.SUPPLY_V / 2
    expected = np.degrees(shift_v / (1.5 * psi_omega))
    assert chapter_3.divider_error_deg(0.05, np.array([0.5]))[0] == pytest.approx(float(expected), rel=1e-9)
    assert chapter_3.divider_error_deg(0.0, np.array([0.5]))[0] == 0.0


def test_waveforms() -> None:
    """Sampled waveforms of the circuit: torque of the periodic state, CSC's current on orders 1 + 6 k only.

    Verifies: FIG-05
    """
    motor, circuit = motor_1(), ideal_inverter(25.0)
    duty, samples = 0.55, 126
    sequence = gate_sequence("CSC", 25 / 8, duty, turns=10)
    records = waveforms(motor, circuit, 64_000, sequence, settle_turns=8, samples=samples)
    assert records.size == 2 * samples and records["t_cycle"][0] == 0.0
    state = steady_operation(motor, circuit, 64_000, duty, carrier_hz=20e3, commutation="CSC")
    assert records["torque_nm"].mean() == pytest.approx(state.torque_nm, rel=0.01)
    lines = chapter_6._regular_lines(chapter_6.space_vector_a(records), 2, 10.0)
    assert chapter_6.sideband_rms(lines) < 1e-3 * abs(lines.fundamental)


def test_distortion_of_csc() -> None:
    """Continuous in N; at N = 3.3 below both neighbours, not between them as the thesis says.

    Verifies: FIG-05
    """
    at = {n: chapter_5.csc_distortion(n) for n in (2.99, 3.0, 3.01, 3.3, 4.0)}
    assert at[3.0] == pytest.approx(at[2.99], rel=0.02) and at[3.0] == pytest.approx(at[3.01], rel=0.02)
    assert at[3.3] < min(at[3.0], at[4.0])


def _outcome(drive: Drive) -> Any:
    """A synthetic run as the figures take it."""
    data = make_run(drive)
    return SimpleNamespace(data=data, analysis=Analysis(data), result={"trips": [], "rejected": []})


def test_pulses_are_counted() -> None:
    """CSC at N = 10/3: four pulses a sector, the last one cut; samples in a pulse of 20 us.

    Verifies: FIG-05
    """
    run = _outcome(Drive(duration_s=0.012, carrier_hz=20e3, duty=0.4))
    counts = chapter_5.pulses_a_sector(run, 0.002, 0.010)
    assert counts.size > 40 and set(counts.tolist()) == {4}
    samples, on_s, carrier_s = chapter_2.samples_a_pulse(run, 0.002, 0.010)
    assert on_s == pytest.approx(20e-6, abs=1e-7) and carrier_s == pytest.approx(50e-6, abs=1e-6)
    period_s = float(np.median(np.diff(run.data.records["t_cycle"]))) / run.data.clock_hz
    assert abs(samples.mean() - on_s / period_s) < 0.5


def test_spectrogram() -> None:
    """A current vector at 1 kHz with a line at 3.5 times of a tenth: seen there, and beside the trajectories.

    Verifies: FIG-05
    """
    run = _outcome(Drive(duration_s=0.04))
    records = run.data.records
    angle = records["theta_e"]
    vector = 10.0 * np.exp(1j * angle) + 1.0 * np.exp(3.5j * angle) + 2.0 * np.exp(-5j * angle)
    for k, name in enumerate(("ia", "ib", "ic")):
        records[name] = np.real(vector * np.exp(-2j * np.pi / 3 * k))
    hertz, fundamental, size = chapter_6.spectrogram(run, 0.0)
    assert fundamental == pytest.approx(1000.0, rel=1e-3)
    row = size[0]
    for at, expected in ((1000.0, 10.0), (3500.0, 1.0), (-5000.0, 2.0)):
        assert row[np.argmin(np.abs(hertz - at))] == pytest.approx(expected, rel=0.05)
    assert chapter_6.trajectory_share(hertz, fundamental, size) == pytest.approx(0.1, rel=0.05)


def test_learning() -> None:
    """Time until thresholds settle; shifts of (3.12) sum to about zero and follow the inductances' differences.

    Verifies: FIG-05
    """
    time_s = np.arange(0.0, 1.0, 0.01)
    values = np.stack([0.5 + 0.05 * (1 - np.exp(-time_s / 0.05)), np.full(time_s.size, 0.5)], axis=1)
    # 0.05 exp(-t / 0.05) = 0.002 at 0.161 s.
    assert chapter_3.settling_s(time_s, values, 0.0, 1.0) == pytest.approx(0.17, abs=0.011)
    a, b, c = chapter_3.shift_pu(18_000.0)
    assert abs(a + b + c) < 0.02 * max(abs(a), abs(b), abs(c)) and a > 0 > b
    # At the speed where the line EMF is the supply nothing is left to share.
    assert max(map(abs, chapter_3.shift_pu(15.0 / np.sqrt(3) / 1.27e-3 * 30 / np.pi))) < 1e-9


def test_runs_that_cannot_be_used() -> None:
    """A console line that was not carried out, or a trip where none is expected, fails the figure.

    Verifies: FIG-02
    """
    good = _outcome(Drive())
    line = {"time_s": 0.1, "line": "set balance both", "reason": "no reply"}
    trips = [{"cause": "dc_current", "time_s": 0.2}]

    class Fake:
        def __init__(self, **result: Any) -> None:
            self.found = SimpleNamespace(result={"trips": [], "rejected": []} | result, folder=Path("x"))

        def drive(self, *_: str, **__: Any) -> Any:
            return self.found

    assert support.drive(Fake(), "a.toml", "x").result["trips"] == []
    with pytest.raises(RunFailed, match=r"set balance both.*no reply"):
        support.drive(Fake(rejected=[line]), "a.toml", "x")
    with pytest.raises(RunFailed, match=r"dc_current.*0\.200 s"):
        support.whole(Fake(trips=trips).found)
    assert support.whole(good) is good


@dataclass
class Ramps:
    """Runner that gives a synthetic run of each ramp, cut to its short version: RSC trips at 0.06 s."""

    quick: bool
    from_rpm: dict[str, float]
    accel_rpm_per_s: float = 120_000.0

    def drive(self, scenario: str, name: str, *overrides: str, **_: Any) -> Any:
        loaded = load_scenario(ROOT / "scenarios" / scenario, overrides)
        commutation = loaded.drive.commutation
        ramp = Drive(
            speed_rpm=self.from_rpm[commutation], accel_rpm_per_s=self.accel_rpm_per_s, duration_s=0.08, carrier_hz=20e3
        )
        data = make_run(ramp)
        trips = [{"cause": "phase_current", "time_s": 0.06}] if commutation == "RSC" else []
        result = {"trips": trips, "rejected": []}
        return SimpleNamespace(scenario=loaded, data=data, analysis=Analysis(data), result=result, folder=Path(name))


def test_ramps_that_miss_the_compared_frequency() -> None:
    """CSC begins above 800 Hz in the short run: figure 5.16 says so, and what slope was run; both pass it: two numbers.

    Verifies: FIG-02, FIG-05
    """
    short: Any = Ramps(True, {"RSC": 46_000.0, "CSC": 65_000.0})
    drawing = chapter_5.acceleration(short)
    currents = {entry.quantity: entry.measured for entry in drawing.table if "current" in entry.quantity}
    quantity = "largest current near 800 Hz: RSC, CSC (A)"
    assert currents == {quantity: "10.0, not in the short run"}
    assert "from 49 500 and 65 000 r/min, slope 30 000 and 100 000 r/min/s" in drawing.condition
    # The trip is at 46 000 + 120 000 * 0.06 = 53 200 r/min.
    assert drawing.table[0].measured.startswith("887 Hz (N = 3.76), trip (phase_current) at 0.060 s")
    full: Any = Ramps(False, {"RSC": 46_000.0, "CSC": 46_000.0})
    drawing = chapter_5.acceleration(full)
    (row,) = (entry for entry in drawing.table if "current" in entry.quantity)
    assert row.measured == "10.0, 10.0" and row.agrees is False
    assert "from 40 000 r/min, slope 12 000 r/min/s" in drawing.condition


@pytest.mark.parametrize(("quick", "slope"), [(True, "slope 30 000 r/min/s"), (False, "slope 12 000 r/min/s")])
def test_failures_say_what_was_run(quick: bool, slope: str) -> None:
    """Figure 5.12 states the slope of the runs that it shows.

    Verifies: FIG-03
    """
    runner: Any = Ramps(quick, {"RSC": 46_000.0})
    assert slope in chapter_5.failures(runner).condition
