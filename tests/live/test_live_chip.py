# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The Verilated chip as a source: steps to the clock, gates, and the play that the chip repeats bit for bit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, load_scenario
from fluxlock.config.scenario import Fault
from fluxlock.cosim.run import run_scenario
from fluxlock.live import messages
from fluxlock.live.chip import BrokenError, Chip, ChipPlan
from fluxlock.live.cli import shown_of
from fluxlock.live.estimate import Estimate
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import GATES, MARKS, NAMES
from fluxlock.results.rundata import RECORD_DTYPE, LogKind

SPINDLE = Path("scenarios/own-spindle.toml")
READY_S, STARTED_S = 0.003, 0.008  # the rotor is being put in place: 0.4 million clocks


@pytest.fixture(scope="module")
def chip() -> Iterator[Chip]:
    """A chip before its first clock."""
    made = Chip(ChipPlan(load_scenario(SPINDLE)), 1)
    yield made
    made.end()


def test_steps_and_repeats(chip: Chip, tmp_path: Path) -> None:
    """A clock is a clock, a tick ends in the log's row; the export makes the same gates at the same clocks.

    Gate lanes and true angle are there, and the drive's start is an instant. An open phase is taken, what this
    motor lacks is refused in one line.

    Verifies: LIVE-13, LIVE-15
    """
    assert chip.hello()["source"] == "chip" and chip.hello()["steps"][0][0] == "a clock"
    while chip.now < READY_S:
        chip.advance(READY_S - chip.now)
    for action in (
        messages.Set(kind="set", name="speed_rpm", value="15000"),
        messages.Drive(kind="drive", do="start"),
        messages.LoadFactor(kind="load", factor=0.5),
        messages.Break(kind="fault", fault=Fault(kind="open_phase", phases=["B"])),
    ):
        chip.act(action)
    with pytest.raises(RefusedError, match=r"^this motor has the phases ABC$"):
        chip.act(messages.Break(kind="fault", fault=Fault(kind="open_phase", phases=["E"])))
    while chip.now < STARTED_S:
        chip.advance(STARTED_S - chip.now)
    before = chip.now
    chip.advance(1.0 / CLOCK_HZ)
    assert chip.now - before == pytest.approx(1.0 / CLOCK_HZ, rel=1e-6)
    assert chip.advance(1e-3, "tick")
    assert chip.now * CLOCK_HZ == pytest.approx(round(chip.now * CLOCK_HZ), abs=1e-3)
    time_s, rows = chip.take()
    place = NAMES.index
    assert 0.0 < chip.status()["core_load"] < 100.0
    gates = rows[[place(name) for name in GATES[:6]]].astype(int)
    assert set(np.unique(gates)) == {0, 1} and not (gates[0::2] & gates[1::2]).any()
    assert np.isfinite(rows[place("theta_deg")]).all()
    assert {MARKS[number] for _, number in chip.marks()} >= {"state change"}
    assert {("set speed_rpm 15000", "ok"), ("start", "ok")} <= {(entry["text"], entry["answer"]) for entry in chip.said}
    for name, text in chip.export("my-play").items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    scenario = load_scenario(tmp_path / "my-play.toml")
    again = run_scenario(scenario, tmp_path / "run", scenario.seed).rows(LogKind.GATES)
    assert len(again) > 20
    packed = (gates << np.arange(6)[:, None]).sum(axis=0)
    edges = np.flatnonzero(np.diff(packed)) + 1
    live = np.column_stack([np.round(time_s[edges] * CLOCK_HZ), packed[edges]]).astype(np.int64)
    changed = again[np.flatnonzero(np.diff(again[:, 2], prepend=0))][:, [0, 2]]
    assert np.array_equal(live, changed[changed[:, 0] <= live[-1, 0]])


def test_dies_by_name(chip: Chip) -> None:
    """A simulator that is gone ends the source with one line.

    Verifies: LIVE-13
    """
    chip.process.kill()
    with pytest.raises(BrokenError, match=r"^the simulator has ended: [^\n]+$"):
        chip.advance(1e-3)


def test_bad_input() -> None:
    """A board and a recording have no chip, and a bus has no master here: one line each.

    Verifies: LIVE-09
    """
    for arguments, text in (
        ((SPINDLE, Path("/dev/null"), (), None, False, True), "--chip"),
        ((Path("tests"), None, (), None, False, True), "--chip"),
        ((Path("scenarios/demo.toml"), None, ("can={}",), None, False, True), r"leave \[can\] out"),
    ):
        with pytest.raises(ConfigError, match=text):
            shown_of(*arguments)


def test_estimate() -> None:
    """Six-step: the field is 30 degrees ahead behind a commutation in time. Vector: the published angle from the true.

    Verifies: LIVE-13
    """
    records = np.zeros(100, RECORD_DTYPE)
    records["t_cycle"], records["omega_e"] = np.arange(100) * 100.0, 1.0
    records["theta_e"] = np.radians(np.arange(100) * 0.6)  # a sector
    records["gates"][10:] = 1
    log = np.array([[1000, LogKind.COMMUTATION, 2, 0]], np.int64)
    six = Estimate("six-step", 20_000.0)
    error = six.error_deg(records[:50], log)
    assert np.isnan(error[:11]).sum() == 10 and error[10] == pytest.approx(0.0 + 330.0 + 120.0 - 96.0 - 360.0)
    later = six.error_deg(records[50:], log[:0])
    assert later[0] == pytest.approx(error[-1] - 0.6)
    angle = np.array([[5000, LogKind.ANGLE, round(25.0 / 360.0 * 2**32), round(7.0 / 360.0 * 2**32)]], np.int64)
    error = Estimate("vector", 20_000.0).error_deg(records, angle)
    assert np.isnan(error[:50]).all() and error[50:] == pytest.approx(2.0, abs=1e-6)
