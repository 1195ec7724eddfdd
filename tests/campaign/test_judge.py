# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The campaign's judge on made-up runs: each way to end wrong is found, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_scenario
from fluxlock.plant.trajectory import wave_dtype
from fluxlock.results.rundata import RECORD_DTYPE, LogKind, RunData
from fluxverify.campaign.grid import ANY, Fault
from fluxverify.campaign.judge import HALTED, RIDDEN, STOPPED, WRONG, judge

FIVE = load_scenario(ROOT / "scenarios" / "campaign" / "five-phase.toml")
SCENARIO = load_scenario(ROOT / "scenarios" / "campaign" / "six-step.toml")
CLOCK_HZ, STEP, ROWS = 50e6, 500, 4000  # 40 ms
SINCE = 1000 * STEP
PIN = Fault("pin", (), frozenset({"fault_pin"}))


def made(state: str = "running", fault: str = "none") -> RunData:
    """A run at 40 000 r/min with 10 A that nothing has happened to; upper A, lower B are on throughout."""
    records = np.zeros(ROWS, RECORD_DTYPE)
    records["t_cycle"] = STEP * np.arange(ROWS)
    records["omega_e"] = 40_000 / 60 * 2 * np.pi
    records["ia"], records["ib"], records["torque_nm"], records["gates"] = 10.0, -10.0, 0.02, 0b1001
    log = np.array([[100, LogKind.GATES, 0b1001, 0]], np.int64)
    uart = ["ok", f"state {state}", f"fault {fault}", "ok"]
    return RunData(
        log=log, records=records, plant_events=np.zeros(0), zoom=records[:0], clock_hz=CLOCK_HZ, pole_pairs=1,
        cycles=ROWS * STEP, wall_s=1.0, seed=1, uart=uart, isr={}, overruns=0, rejected=[],
    )  # fmt: skip


def ended(data: RunData, fault: Fault = PIN) -> tuple[str, tuple[str, ...]]:
    """Outcome and reasons."""
    verdict = judge(data, SCENARIO, fault, SINCE)
    return verdict.outcome, verdict.reasons


def stopped(fault: str) -> RunData:
    """A run whose gates opened at the disturbance."""
    data = made("fault", fault)
    data.records["gates"][1010:] = 0
    return replace(data, log=np.array([[100, 1, 0b1001, 0], [SINCE + 9, 1, 0, 0]], np.int64))


def test_right_ends() -> None:
    """Riding through, and stopping by the right name.

    Verifies: CAMP-02
    """
    assert ended(made()) == (RIDDEN, ())
    assert ended(stopped("fault_pin")) == (STOPPED, ())


HALT = Fault("halt", (), frozenset(), off_s=2e-6, silent=True)


def enabled(data: RunData, *edges: tuple[int, int]) -> RunData:
    """The run with levels of the drivers' enable at clocks."""
    rows = [[at, LogKind.ENABLE, level, 0] for at, level in edges]
    return replace(data, log=np.concatenate([data.log, np.array(rows, np.int64)]))


def test_halted() -> None:
    """Gates and enable off in time for good, and no console: a right end where the chip's clock stands.

    Verifies: CAMP-02, CAMP-13
    """
    off = replace(stopped("none"), uart=[])
    assert ended(off, HALT) == (HALTED, ())
    assert ended(enabled(off, (100, 1), (SINCE + 50, 0)), HALT) == (HALTED, ())
    assert ended(replace(off, log=off.log[:0]), HALT) == (HALTED, ())
    assert ended(off, replace(HALT, silent=False))[1] == ("console silent",)
    # Named, in time.
    assert ended(stopped("fault_pin"), replace(PIN, off_s=2e-6)) == (STOPPED, ())


def test_not_off_in_time() -> None:
    """A gate that stays on, goes off late or on again, an enable that toggles on or stays high.

    Verifies: CAMP-02, CAMP-13
    """
    off = replace(stopped("none"), uart=[])
    for gate in (9, 101):
        again = np.array([[SINCE + gate, 1, 0b1001, 0], [SINCE + gate + 500, 1, 0, 0]], np.int64)
        _, reasons = ended(replace(off, log=np.concatenate([off.log, again])), HALT)
        assert reasons[0].startswith("a gate on"), gate
    assert ended(replace(off, log=off.log[:1]), HALT)[1][0].startswith("a gate on")
    assert ended(enabled(off, (100, 1), (SINCE + 101, 0)), HALT)[1] == (
        "enable of the drivers toggles 1 times after the time for it",
    )
    assert ended(enabled(off, (100, 1)), HALT)[1] == ("enable of the drivers stays high",)
    assert ended(stopped("fault_pin"), replace(PIN, off_s=1e-7))[1][0].startswith("a gate on 0.08 us")


def five(rpm: float = 300.0) -> RunData:
    """A run of the five-phase machine at a speed, with 3 A and 6 N*m that way."""
    data = made()
    records = np.zeros(ROWS, wave_dtype(5))
    records["t_cycle"], records["ie"] = data.records["t_cycle"], 3.0
    records["omega_e"] = rpm / 60 * 2 * np.pi * FIVE.motor.pole_pairs
    records["torque_nm"], records["gates"] = 6.0 * np.sign(rpm), 0b01_0101_0101
    return replace(data, records=records, pole_pairs=FIVE.motor.pole_pairs)


def test_all_phases() -> None:
    """Over-current in phase E alone, both gates of leg E, and its dead time of 2 us cut short.

    Verifies: CAMP-02
    """
    assert judge(five(), FIVE, PIN, SINCE).outcome == RIDDEN
    over = five()
    over.records["ie"][1500:1512] = -9.9
    assert "current above the limit" in judge(over, FIVE, PIN, SINCE).reasons[0]
    both = np.array([[100, 1, 1 << 8, 0], [SINCE, 1, 3 << 8, 0], [SINCE + 200, 1, 2 << 8, 0]], np.int64)
    assert "both gates of a leg on" in judge(replace(five(), log=both), FIVE, PIN, SINCE).reasons[0]
    short = np.array([[100, 1, 1 << 8, 0], [SINCE, 1, 0, 0], [SINCE + 99, 1, 2 << 8, 0]], np.int64)
    assert judge(replace(five(), log=short), FIVE, PIN, SINCE).reasons == ("dead time 1980 ns",)


@pytest.mark.parametrize(("sign", "torque_nm", "wrong"), [(-1, 2.0, True), (-1, -2.0, False), (1, 2.0, False)])
def test_torque_backwards(sign: int, torque_nm: float, wrong: bool) -> None:
    """Where a negative speed is asked for, positive torque is against the command at such a speed, not on the way.

    Verifies: CAMP-02
    """
    data = five(300.0 * sign)
    data.records["t_cycle"] += 0.73 * CLOCK_HZ
    data.records["torque_nm"] = torque_nm
    verdict = judge(data, FIVE, PIN, round(0.73 * CLOCK_HZ))
    assert (verdict.outcome == WRONG) == wrong


def test_driven_ahead_of_the_slope() -> None:
    """A rotor at -300 r/min while the slope has led to -30 may be braked for as long as that lasts.

    Verifies: CAMP-02
    """
    data = five(-300.0)
    data.records["t_cycle"] += 0.63 * CLOCK_HZ
    data.records["torque_nm"] = 2.0
    assert judge(data, FIVE, PIN, round(0.63 * CLOCK_HZ)).outcome == RIDDEN


def test_told_by_the_node() -> None:
    """A name that the CANopen node has sent, with open gates, is a stop; one that runs on has not stopped for it.

    Verifies: CAMP-08
    """
    bus = Fault("bus", (), frozenset({"command_timeout"}), must_stop=True)
    off = replace(stopped("none"), uart=["state ready", "fault none"])
    assert judge(off, SCENARIO, bus, SINCE, ["command_timeout"]).outcome == STOPPED
    assert judge(off, SCENARIO, bus, SINCE, ["bus_off"]).reasons == ("stopped as bus_off",)
    assert judge(off, SCENARIO, replace(bus, must_stop=False), SINCE).reasons == ("stopped without a name",)
    assert judge(made(), SCENARIO, bus, SINCE, ["command_timeout"]).reasons == ("running, had to stop",)


def test_refused_by_boot() -> None:
    """State init with the name of a fault is a stop, without one it is not.

    Verifies: CAMP-02
    """
    block = Fault("block", (), frozenset({"parameter_crc"}), must_stop=True)
    off = stopped("none")
    assert ended(replace(off, uart=["state init", "fault parameter_crc"]), block) == (STOPPED, ())
    assert ended(replace(off, uart=["state init", "fault chip"]), block)[0] == WRONG
    assert ended(replace(off, uart=["state init", "fault none"]), block)[0] == WRONG


def test_wrong_names() -> None:
    """Another name, running on where only a stop is right, no word, gates on in the fault state; upsets may do so.

    Verifies: CAMP-02
    """
    silent = replace(made(), uart=[])
    wrong = (stopped("overspeed"), silent, made("fault", "fault_pin"))
    assert [ended(data)[0] for data in wrong] == [WRONG] * 3
    assert ended(made(), replace(PIN, must_stop=True))[0] == WRONG
    # A restart cuts the line that the console was in.
    cut = replace(
        stopped("overspeed"), uart=["state running", "fault none", "hall_offset_deg 0.state fault", "fault overspeed"]
    )
    assert ended(cut)[0] == WRONG
    upset = Fault("upset", (), ANY)
    assert {ended(data, upset)[0] for data in wrong} <= {RIDDEN, STOPPED}


@pytest.mark.parametrize(("rows", "gates", "wrong"), [(12, 0b1001, True), (9, 0b1001, False), (500, 0, False)])
def test_current(rows: int, gates: int, wrong: bool) -> None:
    """Above the limit for more than 100 us with a gate on; a row is 10 us.

    Verifies: CAMP-02
    """
    data = made()
    data.records["ic"][1500 : 1500 + rows] = 50.0
    data.records["gates"][1500 : 1500 + rows] = gates
    assert (ended(data)[0] == WRONG) == wrong
    assert (ended(data, Fault("upset", (), ANY))[0] == WRONG) == wrong
    before = made()
    before.records["ic"][500 : 500 + rows] = 50.0
    assert ended(before)[0] == RIDDEN


@pytest.mark.parametrize(("pause", "wrong"), [(1, True), (5, True), (8, False)])
def test_pauses_between_pulses(pause: int, wrong: bool) -> None:
    """Current above the limit through 160 us of pulses with short pauses; after 80 us of open gates time starts anew.

    Verifies: CAMP-02
    """
    data = made()
    data.records["ic"][1500:1516] = 50.0
    data.records["gates"][1508 : 1508 + pause] = 0
    assert (ended(data)[0] == WRONG) == wrong


@pytest.mark.parametrize(
    ("rows", "rpm", "wrong"),
    [(1200, 40_000, True), (800, 40_000, False), (1200, 100, False), (1200, 56_000, True), (1200, 62_000, False)],
)
def test_torque(rows: int, rpm: float, wrong: bool) -> None:
    """Braking for more than 10 ms below what the slope to 60 000 r/min has reached; above it is what was asked for.

    Verifies: CAMP-02
    """
    data = made()
    data.records["omega_e"] = rpm / 60 * 2 * np.pi
    data.records["torque_nm"][1500 : 1500 + rows] = -0.02
    assert (ended(data)[0] == WRONG) == wrong


def test_gates() -> None:
    """Both gates of a leg, and a dead time cut short.

    Verifies: CAMP-02
    """
    overlap = np.array([[100, 1, 0b0001, 0], [SINCE, 1, 0b0011, 0], [SINCE + 1, 1, 0b0010, 0]], np.int64)
    short = np.array([[100, 1, 0b0001, 0], [SINCE, 1, 0, 0], [SINCE + 9, 1, 0b0010, 0]], np.int64)
    right = np.array([[100, 1, 0b0001, 0], [SINCE, 1, 0, 0], [SINCE + 10, 1, 0b0010, 0]], np.int64)
    for log, outcome in ((overlap, WRONG), (short, WRONG), (right, RIDDEN)):
        assert ended(replace(made(), log=log))[0] == outcome
