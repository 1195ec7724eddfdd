# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The Verilated chip as a source: steps to the clock, gates, and the play that the chip repeats bit for bit."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, load_scenario
from fluxlock.config.scenario import Fault
from fluxlock.cosim.cautions import checked
from fluxlock.cosim.run import run_scenario
from fluxlock.live import messages
from fluxlock.live.bus import BusLoad
from fluxlock.live.chip import BrokenError, Chip, ChipPlan
from fluxlock.live.cli import shown_of
from fluxlock.live.estimate import Estimate
from fluxlock.live.freewheel import Freewheel
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import COMPARATORS, GATES, MARKS, NAMES
from fluxlock.results.angles import FLOATING_PHASE
from fluxlock.results.rundata import RECORD_DTYPE, LogKind

SPINDLE = Path("scenarios/own-spindle.toml")
MASKED_S = 0.025
BUS_S = 0.031  # the drive has been asked three times
MISSED_S = 0.015  # the drive is asked every 10 ms
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
    above, volts = (rows[[place(name) for name in wanted]] for wanted in (COMPARATORS, ("va", "vb", "vc")))
    far = np.abs(volts - volts.mean(axis=0)) > 1e-3
    assert np.array_equal(above[far] == 1.0, (volts > volts.mean(axis=0))[far]) and set(np.unique(above)) == {0.0, 1.0}
    assert {*chip.hello()["without"]} >= {"bus_load", "gate_dh"} and "margin_deg" not in chip.hello()["without"]
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
    """A board and a recording have no chip: one line each.

    Verifies: LIVE-09
    """
    for arguments, text in (
        ((SPINDLE, Path("/dev/null"), (), None, False, True), "--chip"),
        ((Path("tests"), None, (), None, False, True), "--chip"),
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


def turned(sector: int, from_deg: float, to_deg: float, current_a: float, until_deg: float) -> np.ndarray:
    """Records of a turn forwards; angles from the true crossing of a sector, whose open phase conducts until one."""
    late = np.linspace(from_deg, to_deg, 601)
    records = np.zeros(late.size, RECORD_DTYPE)
    records["omega_e"], records["t_cycle"] = 1.0, (late + 360.0 * 10) * 100.0
    records["theta_e"] = np.radians(late + 60.0 * sector - 120.0)
    records[("ia", "ib", "ic")[FLOATING_PHASE[sector]]] = np.where(late < until_deg, current_a, 0.0)
    return records


@pytest.mark.parametrize("sector", range(6))
@pytest.mark.parametrize(("until_deg", "hidden"), [(-10.0, False), (5.0, True)])
def test_freewheel(sector: int, until_deg: float, hidden: bool) -> None:
    """The margin is what lies between the end of freewheeling and the true crossing; one that it hides is an instant.

    In two stretches as in one.

    Verifies: LIVE-18
    """
    records = turned(sector, -30.0, 29.9, 3.0, until_deg)
    crossing = float(records["t_cycle"][np.flatnonzero(records["theta_e"] >= np.radians(60.0 * sector - 120.0))[0]])
    log = np.array([[round(records["t_cycle"][0]) - 1, LogKind.COMMUTATION, sector, 0]], np.int64)
    for cut in (records.size, 150, 320):
        freewheel = Freewheel()
        first, found = freewheel.follow(records[:cut], log)
        second, more = freewheel.follow(records[cut:], log[:0])
        margin = np.concatenate([first, second])
        assert np.isnan(margin[0]) and margin[-1] == pytest.approx(-until_deg, abs=0.11)
        assert found + more == ([pytest.approx(crossing, abs=11.0)] if hidden else [])


def test_masked_crossings() -> None:
    """High current behind H_PWM-L_ON hides crossings: the plant's truth agrees with what the chip flags as late.

    Verifies: LIVE-18
    """
    hiding = ("drive.freewheel_limit=false", 'drive.pattern="H_PWM-L_ON"', "drive.zcd.compute_back=true")
    scenario = checked(Path("scenarios/spinning.toml"), (*hiding, "load.fan_torque_nm=0.06"), True)
    chip = Chip(ChipPlan(scenario), 1)
    marks: list[tuple[float, int]] = []
    margins: list[float] = []
    try:
        while chip.now < MASKED_S:
            chip.advance(MASKED_S - chip.now)
            _, rows = chip.take()
            marks += chip.marks()
            margins += rows[NAMES.index("margin_deg")].tolist()
    finally:
        chip.end()
    numbers = [MARKS.index(name) for name in ("crossing masked", "crossing late")]
    masked, late = (np.array([at_s for at_s, number in marks if number == wanted]) for wanted in numbers)
    assert len(masked) > 20 and abs(len(masked) - len(late)) <= 2
    behind = late[np.searchsorted(late, masked[:-1])] - masked[:-1]
    assert np.all((behind >= 0.0) & (behind < 2e-4)), "each is found once freewheeling has ended, within its sector"
    assert -30.0 < np.nanmin(margins) < 0.0 < np.nanmax(margins) < 30.0


def test_bus_load() -> None:
    """A frame is busy to the end of its intermission; a window of two frames of 100 bits in a thousand is a fifth busy.

    Verifies: LIVE-19
    """
    bit = 50
    load = BusLoad(bit)
    rows: list[tuple[int, int, int, int]] = []
    for begin in (100 * bit, 5000 * bit):
        for k in range(0, 88, 4):  # dominant and recessive, two bits each; the last dominant bit is number 89
            rows += [(begin + k * bit, LogKind.CAN, 0, 0), (begin + (k + 2) * bit, LogKind.CAN, 3, 0)]
        rows += [(begin + 88 * bit, LogKind.CAN, 0, 0), (begin + 89 * bit, LogKind.CAN, 3, 0)]
    log = np.array(rows, np.int64)
    assert np.isnan(load.percent)
    half = len(rows) // 2
    load.follow(log[: half - 3], int(log[half - 3, 0]))
    load.follow(log[half - 3 :], 10_000 * bit)
    assert load.percent == pytest.approx(100.0 * 200 / 10_000)
    load.follow(log[:0], 20_000 * bit)
    assert load.percent == 0.0


def run(chip: Chip, seconds: float) -> None:
    """So much simulated time."""
    end_s = chip.now + seconds
    while chip.now < end_s - 0.5 / CLOCK_HZ:
        chip.advance(end_s - chip.now)


def test_bus() -> None:
    """A scenario with [can] has a node beside the drive: it boots, is started and heard, and the bus has a load.

    The console's start still works; an export is refused, since no run has that node. The button *Silent bus* takes the
    node away, which the drive misses.

    Verifies: LIVE-19
    """
    scenario = load_scenario("scenarios/can.toml")
    chip = Chip(ChipPlan(scenario), 1)
    try:
        run(chip, BUS_S)
        chip.act(messages.Set(kind="set", name="speed_rpm", value="15000"))
        chip.act(messages.Drive(kind="drive", do="start"))
        for _ in range(10):
            chip.advance(5e-4)
        _, rows = chip.take()
        loads = rows[NAMES.index("bus_load")]
        assert "bus_load" not in chip.hello()["without"] and chip.settings[0]["value"]
        assert 0.0 < chip.status()["bus_load"] < 50.0 and loads[-1] == pytest.approx(chip.status()["bus_load"])
        assert ("start", "ok") in {(entry["text"], entry["answer"]) for entry in chip.said}, chip.said
        with pytest.raises(RefusedError, match=r"leave \[can\] out"):
            chip.export("my-play")
        buttons = {entry["name"]: entry["order"] for entry in chip.hello()["faults"]}
        chip.act(messages.Set(kind="set", name="command_timeout_ms", value=str(round(1e3 * MISSED_S))))
        run(chip, 2 * MISSED_S)
        assert chip.status()["fault"] == "none", "the node is heard"
        order = messages.parse(json.dumps(buttons["Silent bus"]))
        assert isinstance(order, messages.Bus)
        chip.act(order)
        run(chip, 2 * MISSED_S)
        assert chip.status()["fault"] == "command_timeout"
    finally:
        chip.end()
