# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The verdict over a run: wrongs that are planted in synthetic runs are named, and what is no wrong passes."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, Scenario, load_scenario
from fluxlock.config.fields import with_unit
from fluxlock.results.metrics import Analysis, largest_current, run_metrics
from fluxlock.results.rundata import LogKind, Rejection, RunData, load_trace, save_trace
from fluxlock.results.verdict import Verdict, expectation_failures, judge_run, say
from tests.results.synthetic import Drive, make_run, make_vector_run

RPM = 6_000.0
DURATION_S = 0.1
DUTY_MIN, VOLTAGE, CURRENT = 2, 1, 3
READY, STARTING, RUNNING, STOPPING, FAULT = 1, 2, 3, 4, 5
OK = ["state running", "fault none", "ok"]
# A speed loop of 100 Hz: settled 16 ms after the drive runs.
BASE = (
    f"duration_s={DURATION_S}",
    'event=[{at_s=0.001,speed_rpm=6000},{at_s=0.001,command="start"}]',
    'window=[{name="steady",from_s=0.05,to_s=0.08}]',
    "expect=[]",
    "drive.speed_bandwidth_hz=100",
    "accept=[]",
)


def scenario(*overrides: str, file: str = "demo.toml", base: tuple[str, ...] = BASE) -> Scenario:
    return load_scenario(ROOT / "scenarios" / file, (*base, *overrides))


def verdict(data: RunData, of: Scenario, **options: Any) -> Verdict:
    analysis, metrics = run_metrics(data, of)
    return judge_run(data, of, analysis, metrics, **options)


def run(**changes: Any) -> RunData:
    """A run of the base scenario that nothing is wrong with but the changes."""
    data = make_run(Drive(**{"speed_rpm": RPM, "duration_s": DURATION_S, "target_rpm": RPM} | changes))
    data.uart = OK
    return data


def events(*entries: str) -> str:
    return f"event=[{','.join(entries)}]"


@pytest.mark.parametrize(
    ("value", "low", "high", "text"),
    [
        (15012.3, 15050, 15075, "is 15012, expected min 15050 and max 15075"),
        (15049.7, 15050, None, "is 15049.7, expected min 15050"),
        (0.300012, -0.3, 0.3, "is 0.30001, expected min -0.3 and max 0.3"),
        (1.0004, None, 0.3, "is 1, expected max 0.3"),
        (-2.5e-7, 1e-7, None, "is -2.5e-07, expected min 1e-07"),
        (1234568.0, None, 1234567.5, "is 1234568, expected max 1234567.5"),
        (None, 1, None, "is no value, expected min 1"),
    ],
)
def test_missed_limit_is_seen(value: float | None, low: float | None, high: float | None, text: str) -> None:
    """A value that misses a limit has the digits that show it.

    Verifies: FRONT-35
    """
    entry = {"window": "steady", "metric": "speed_rpm.mean", "value": value, "min": low, "max": high, "pass": False}
    assert expectation_failures([entry]) == [f"steady: speed_rpm.mean {text}"]


def test_sound_run_passes_and_says_its_speed() -> None:
    """Speed and target of each window and of the end are the first line.

    Verifies: FRONT-35
    """
    found = verdict(run(), scenario())
    assert found.passed and found.failures == []
    assert found.lines == ["6000.0 r/min for 6000 r/min in steady, 6000.0 r/min for 6000 r/min at the end"]
    assert found.as_json() == {"passed": True, "lines": found.lines}


@pytest.mark.parametrize(("measures", "lost"), [(1.3, False), (1.6, True)])
def test_a_slow_speed_is_late_by_its_turn(measures: float, lost: bool) -> None:
    """A six-step drive measures over an electrical turn, 77 ms of it: 0.1 s apart is lag. Of 63 ms it is a lost angle.

    Verifies: FRONT-35
    """
    found = verdict(run(speed_rpm=600.0, measures=measures), scenario("motor.max_speed_rpm=7000"))
    assert any("the angle was lost" in line for line in found.lines) == lost, found.lines


WRONGS: dict[str, tuple[dict[str, Any], tuple[str, ...], str]] = {
    "wrong speed": (
        {"speed_rpm": 6_100.0},
        (),
        r"6100\.0 r/min for 6000 r/min in steady \(\+1\.7 %\), 6100\.0 at the end, "
        r"and no limit of the drive was active",
    ),
    "over-speed by duty_min": (
        {"speed_rpm": 6_700.0, "account": ((0.0, RUNNING, 0), (0.02, RUNNING, DUTY_MIN))},
        (),
        r"6700\.0 r/min for 6000 r/min in steady \(\+11\.7 %\), 6700\.0 at the end: "
        r"limit duty_min active for 0\.080 s \(the least pulse drives the rotor faster, nothing brakes it\); "
        r"load the motor, set drive\.sync_rect = true, .*, or state it: \[\[accept\]\] what = \"duty_min\"$",
    ),
    "too little voltage": (
        {"speed_rpm": 5_500.0, "account": ((0.0, RUNNING, VOLTAGE),)},
        (),
        r"5500\.0 r/min for 6000 r/min in steady \(-8\.3 %\), .*: limit voltage active for 0\.100 s .*lower the target",
    ),
    "too little current": (
        {"speed_rpm": 5_500.0, "account": ((0.0, RUNNING, CURRENT),)},
        (),
        r"limit current active for 0\.100 s .*lower the load or drive\.accel_rpm_per_s",
    ),
    "wrong direction": (
        {"speed_rpm": -RPM},
        ("drive.accel_rpm_per_s=1e6",),
        r"-6000\.0 r/min for 6000 r/min in steady \(-200\.0 %\)",
    ),
    "stands after the ramp, in less than it takes to settle": (
        {"speed_rpm": 100.0, "accel_rpm_per_s": 0.0},
        ("drive.speed_bandwidth_hz=25", "window=[]", "drive.accel_rpm_per_s=1e6"),
        r"100\.0 r/min for 6000 r/min at the end \(-98\.3 %\), and no limit of the drive was active",
    ),
    "lost line": (
        {"target_rpm": 5_990.0},
        (),
        r"the drive's target is 5990 r/min, it was given 6000 r/min",
    ),
    "lost angle": (
        {"commutation_error": lambda k: 120.0},
        (),
        r"the angle was lost: from 0\.0\d+ s on the commutation is up to 120 deg from the rotor while the drive runs",
    ),
    "slipping rotor": (
        {"commutation_error": lambda k: -20.0 * k},
        (),
        r"the angle was lost: from 0\.0\d+ s on the commutation is up to \d{3,} deg from the rotor",
    ),
    "stall": (
        {"measures": 1.6},
        (),
        r"the angle was lost: from 0\.0000 s on the drive measures 9600 r/min, the rotor has 6000",
    ),
    "lost lock": (
        {"lost_locks": 2},
        (),
        r"the drive lost its lock at 0\.000 s, 2 in all",
    ),
    "ends in starting": (
        {"account": ((0.0, RUNNING, 0), (0.07, STARTING, 0))},
        (),
        r"the drive ended in starting, since 0\.070 s: it has not found its lock; run longer or see drive\.start",
    ),
    "gave up": (
        {"account": ((0.0, RUNNING, 0), (0.07, READY, 0))},
        (),
        r"the drive was told to start and ended in ready",
    ),
    "never started": (
        {"account": ((0.0, READY, 0),)},
        (events("{at_s=0.001,speed_rpm=6000}"),),
        r"the drive was given a speed and never told to start: it ended in ready; add command = \"start\"",
    ),
    "does not stop": (
        {},
        (events("{at_s=0.001,speed_rpm=6000}", '{at_s=0.002,command="start"}', '{at_s=0.09,command="stop"}'),),
        r"the drive was told to stop and ended in running",
    ),
    "stop that accelerates": (
        {"account": ((0.0, RUNNING, 0), (0.03, STOPPING, 0)), "accel_rpm_per_s": 1e4},
        (events("{at_s=0.001,speed_rpm=6000}", '{at_s=0.002,command="start"}', '{at_s=0.03,command="stop"}'),),
        r"the drive has been stopping since 0\.030 s and the rotor is no slower: 69\d\d r/min, 6[23]\d\d then",
    ),
    "fault without a name": (
        {"account": ((0.0, RUNNING, 0), (0.09, FAULT, 0))},
        (),
        r"the drive ended in a fault that its console does not name",
    ),
    "trip": (
        {"trip_at_s": 0.05, "trip_mask": 1},
        (),
        r"trip at 0\.050000 s: phase_current",
    ),
}


@pytest.mark.parametrize("name", WRONGS)
def test_planted_wrong_is_named(name: str) -> None:
    """One line with cause, place and size, without any limit of the scenario.

    Verifies: FRONT-35
    """
    changes, overrides, line = WRONGS[name]
    found = verdict(run(**changes), scenario(*overrides))
    assert not found.passed
    assert len(found.lines) == 1, found.lines
    assert re.search(line, found.lines[0]), found.lines[0]


def test_swinging_speed_is_named() -> None:
    """The mean is right, the speed is not.

    Verifies: FRONT-35
    """
    data = run()
    steady = (data.records["t_cycle"] > 0.05 * data.clock_hz) & (data.records["t_cycle"] < 0.08 * data.clock_hz)
    swing = np.where(np.arange(np.count_nonzero(steady)) % 2 == 0, 0.4, 1.6)
    data.records["omega_e"][steady] *= swing
    (line,) = verdict(data, scenario()).failures
    assert re.fullmatch(r"6000\.\d r/min for 6000 r/min in steady, but it swings from 2400\.0 to 9600\.0 r/min", line)
    data = run()
    data.records["omega_e"][steady] *= 1.0 + 0.4 * (swing - 1.0)
    assert verdict(data, scenario()).passed


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {"rejected": [Rejection(0.012, "set sped 1", "unknown name")]},
            'console at 0.012000 s: "set sped 1" was rejected: unknown name',
        ),
        (
            {"rejected": [Rejection(0.012, "start", "no reply")]},
            'console at 0.012000 s: "start" was rejected: no reply',
        ),
        ({"uart": ["state fault", "fault start_failed", "ok"]}, "the drive ended in fault start_failed"),
        (
            {"uart": ["phase ramp", "ok", "fault start_failed", "ok", "now start_failed", "phase lock", "ok"]},
            "the drive ended in fault start_failed: its last attempt failed in lock",
        ),
        (
            {"uart": ["fault overspeed", "ok", "now overspeed", "fault overspeed tick 7", "ok", "phase none"]},
            "the drive ended in fault overspeed",
        ),
        ({"log": np.zeros((0, 4), np.int64)}, "the drive has reported no state: its program did not run"),
    ],
)
def test_console_and_fault_are_named(changes: dict[str, Any], line: str) -> None:
    """A refused line, one without answer, a final fault, a program that does not run: one line each.

    The speed that follows from it is not listed as well.

    Verifies: FRONT-35
    """
    found = verdict(replace(run(speed_rpm=6_700.0), **changes), scenario())
    assert not found.passed and found.lines == [line]


def test_broken_run_has_one_cause() -> None:
    """A simulation that broke off is the cause; a drive that is not running then follows from it.

    Verifies: FRONT-35
    """
    found = verdict(run(account=((0.0, STARTING, 0),)), scenario(), broken="the plant stopped")
    assert found.lines == ["simulation: the plant stopped"]


VECTOR = (
    "duration_s=0.02",
    'event=[{at_s=0.001,speed_rpm=60000},{at_s=0.001,command="start"}]',
    "window=[]",
    "expect=[]",
)


@pytest.mark.parametrize(
    ("errors_deg", "lost"),
    [
        (np.zeros(1), False),
        (np.full(1, 60.0), False),
        (np.full(1, 180.0), True),  # the wrong polarity
        (np.where(np.arange(800) > 400, 95.0, 3.0), True),
        (np.where(np.arange(800) == 400, 95.0, 3.0), False),  # one sample
        (np.arange(800) * 15.0, True),  # a rotor that stands while the frame turns
    ],
)
def test_angle_of_the_vector_drive(errors_deg: np.ndarray, lost: bool) -> None:
    """A published angle beyond 90 deg from the rotor for a millisecond is a lost angle.

    Verifies: FRONT-35
    """
    data = make_vector_run(Drive(), errors_deg)
    data.uart = OK
    found = verdict(data, scenario(file="vector/start.toml", base=VECTOR))
    assert found.passed is not lost, found.lines
    assert not lost or found.lines[0].startswith("the angle was lost: from 0."), found.lines


@pytest.mark.parametrize(("every", "late"), [(2, True), (8, True), (20, False)])
def test_late_steps(every: int, late: bool) -> None:
    """A vector drive whose sets miss their update in more than a tenth of the ticks cannot be vouched for.

    Verifies: FRONT-35
    """
    data = make_vector_run(Drive(speed_rpm=60_000.0, duration_s=DURATION_S), np.zeros(1))
    update = data.log[:, 1] == LogKind.UPDATE
    data = replace(data, log=data.log[~(update & (np.cumsum(update) % every == 0))], uart=OK)
    lines = verdict(data, scenario(f"duration_s={DURATION_S}", file="vector/start.toml", base=VECTOR)).lines
    found = [line for line in lines if "the control step is too late" in line]
    assert bool(found) is late, lines
    assert not late or re.search(
        r"from 0\.0\d\d s on \d+ % of its voltages missed their update; .*observer_every", found[0]
    )


def test_a_lagging_speed_is_no_lost_angle() -> None:
    """A vector drive whose angle is right has lost nothing while its filtered speed lags.

    Verifies: FRONT-35
    """
    data = make_vector_run(Drive(speed_rpm=60_000.0, duration_s=DURATION_S, measures=0.5), np.zeros(1))
    data.uart = OK
    found = verdict(data, scenario(f"duration_s={DURATION_S}", file="vector/start.toml", base=VECTOR))
    assert not [line for line in found.lines if "lost" in line], found.lines


NOT_JUDGED: dict[str, tuple[dict[str, Any], tuple[str, ...], str]] = {
    # The rotor passes 6000 r/min at 100 000 r/min per s; the target is 40 000.
    "ramp still running": (
        {"accel_rpm_per_s": 1e5, "target_rpm": 40_000.0},
        (events("{at_s=0.001,speed_rpm=40000}", '{at_s=0.001,command="start"}'), "drive.accel_rpm_per_s=1e5"),
        "the speed has had no time to settle",
    ),
    "stopped": (
        {"account": ((0.0, RUNNING, 0), (0.03, STOPPING, 0), (0.04, READY, 0))},
        (events("{at_s=0.001,speed_rpm=6000}", '{at_s=0.002,command="start"}', '{at_s=0.03,command="stop"}'),),
        "no speed was asked for",
    ),
    "frozen": (
        {"speed_rpm": 6_700.0},
        (events("{at_s=0.001,speed_rpm=6000}", '{at_s=0.002,command="start"}', '{at_s=0.01,command="set freeze 1"}'),),
        "no speed was asked for",
    ),
    "torque": (
        {"speed_rpm": 5_000.0},
        ("drive.current_loop=true", "drive.mode=torque"),
        "no speed was asked for",
    ),
    "load step in the window": (
        {},
        (events("{at_s=0.001,speed_rpm=6000}", '{at_s=0.001,command="start"}', "{at_s=0.06,load_factor=1.5}"),),
        "the speed has had no time to settle",
    ),
    "imposed speed": (
        {"speed_rpm": 6_700.0},
        ("mechanics.mode=imposed", "mechanics.profile=[[0,6700],[1,6700]]"),
        "the speed is not the drive's: mechanics.mode = imposed",
    ),
}


@pytest.mark.parametrize("name", NOT_JUDGED)
def test_what_is_no_miss_passes(name: str) -> None:
    """No target, or no time to reach it: the run passes and says that it has judged no speed, and why.

    Verifies: FRONT-35
    """
    changes, overrides, reason = NOT_JUDGED[name]
    found = verdict(run(**changes), scenario(*overrides))
    assert found.passed, found.lines
    assert any(reason in line for line in found.lines[1:]), found.lines


def test_window_that_ends_with_a_new_target() -> None:
    """It is judged by the target before, right or wrong.

    Verifies: FRONT-35
    """
    turned = scenario(
        events(
            "{at_s=0.001,speed_rpm=6000}",
            '{at_s=0.001,command="start"}',
            '{at_s=0.08,command="set speed_rpm -6000"}',
        )
    )
    found = verdict(run(target_rpm=-RPM), turned)
    assert found.passed and found.lines[0] == "6000.0 r/min for 6000 r/min in steady", found.lines
    (line,) = verdict(run(speed_rpm=6_100.0, target_rpm=-RPM), turned).failures
    assert line.startswith("6100.0 r/min for 6000 r/min in steady (+1.7 %)")


def test_ramp_that_should_have_finished_is_a_miss() -> None:
    """The same rotor off its target is a miss once the slope has had its time, and not before.

    Verifies: FRONT-35
    """
    slow = run(speed_rpm=5_000.0)
    for accel, passed in ((200_000.0, False), (12_000.0, True)):
        assert verdict(slow, scenario(f"drive.accel_rpm_per_s={accel:g}")).passed is passed, accel


def test_accepted_limit_passes_with_its_reason() -> None:
    """`[[accept]]` names limit and reason; another limit, or another window, still fails.

    Verifies: FRONT-36
    """
    data = run(speed_rpm=6_700.0, account=((0.0, RUNNING, DUTY_MIN),))
    for what in ("duty_min", "speed"):
        found = verdict(data, scenario(f'accept=[{{what="{what}",why="no load"}}]'))
        assert found.passed and "accepted duty_min: no load" in found.lines, found.lines
        assert found.lines[0].startswith("6700.0 r/min for 6000 r/min in steady")
    assert not verdict(data, scenario('accept=[{what="voltage",why="no load"}]')).passed
    found = verdict(data, scenario('accept=[{what="duty_min",window="steady",why="no load"}]'))
    assert not found.passed and found.lines[0].startswith("6700.0 r/min for 6000 r/min at the end")


@pytest.mark.parametrize(
    ("what", "changes"),
    [
        ("lost_angle", {"commutation_error": lambda k: 120.0}),
        ("lost_lock", {"lost_locks": 1}),
        ("end_state", {"account": ((0.0, STARTING, 0),)}),
        ("trip", {"trip_at_s": 0.099, "trip_mask": 1}),
    ],
)
def test_accepted_event_passes(what: str, changes: dict[str, Any]) -> None:
    """Each kind is accepted under its own name and under no other.

    Verifies: FRONT-36
    """
    data = run(**changes)
    assert verdict(data, scenario(f'accept=[{{what="{what}",why="shown here"}}]')).passed
    other = "lost_lock" if what != "lost_lock" else "end_state"
    assert not verdict(data, scenario(f'accept=[{{what="{other}",why="shown here"}}]')).passed


def test_lock_that_the_drive_lost_itself_has_one_name() -> None:
    """An angle that was lost until the drive noticed: its lost lock is the cause, and an expected one passes.

    Verifies: FRONT-35
    """
    account = ((0.0, RUNNING, 0), (0.039, STARTING, 0), (0.05, RUNNING, 0))
    data = run(account=account, commutation_error=lambda k: 120.0 if k < 24 else 0.0, trip_at_s=0.039, trip_mask=8)
    lost = Analysis(data).commutations.error_deg
    assert abs(lost[10]) == pytest.approx(120.0, abs=1.0) and abs(lost[-5]) < 1.0
    assert verdict(data, scenario()).lines == ["trip at 0.039000 s: lost_lock"]
    assert verdict(data, scenario('expect_trip=["lost_lock"]')).passed


def test_accept_is_checked() -> None:
    """A window that there is none of, or that does not belong, and a missing reason are refused by their keys.

    Verifies: FRONT-36
    """
    for entry, text in (
        ('{what="duty_min",window="stedy",why="x"}', r'no window is named "stedy".*steady'),
        ('{what="rejected",window="steady",why="x"}', r"window: does not belong to what"),
        ('{what="duty_min"}', r"why"),
        ('{what="duty",why="x"}', r"what"),
    ):
        with pytest.raises(ConfigError, match=text):
            scenario(f"accept=[{entry}]")


def test_drive_on_a_bus_is_judged_by_its_own_target() -> None:
    """Commanded from outside, the drive's own target counts, while its reference is there.

    Verifies: FRONT-35
    """
    idle = scenario("event=[]", "window=[]")
    assert verdict(run(), idle, by_bus=True).passed
    found = verdict(run(speed_rpm=6_700.0), idle, by_bus=True)
    assert found.lines == ["6700.0 r/min for 6000 r/min at the end (+11.7 %), and no limit of the drive was active"]
    moving = run(speed_rpm=6_700.0)
    updates = moving.log[:, 1] == LogKind.UPDATE
    moving.log[updates, 3] -= 512 * 256  # the reference is 512 r/min below the target
    assert verdict(moving, idle, by_bus=True).passed


def test_trace_keeps_what_the_verdict_needs(tmp_path: Path) -> None:
    """Read from its trace, a run has the same verdict, also for a refused line.

    Verifies: FRONT-35
    """
    for data in (run(lost_locks=1), replace(run(), rejected=[Rejection(0.012, "clear", "no fault to clear")])):
        save_trace(tmp_path / "trace.npz", data)
        before, after = (verdict(d, scenario()) for d in (data, load_trace(tmp_path / "trace.npz")))
        assert before == after and not after.passed


def test_say(capsys: pytest.CaptureFixture[str]) -> None:
    """The verdict's first line: `ok:` on stdout, each reason as `failed:` on stderr.

    Verifies: FRONT-35
    """
    say(Verdict(True, ["a", "b"]))
    assert capsys.readouterr() == ("ok: a\n  b\n", "")
    say(Verdict(False, ["a", "b"]))
    assert capsys.readouterr() == ("", "failed: a\nfailed: b\n")
    say(Verdict(True, ["a"], ("n",)))
    assert capsys.readouterr() == ("ok: a\n  n\n", "")
    say(Verdict(False, ["a"], ("n",)))
    assert capsys.readouterr() == ("", "note: n\nfailed: a\n")


def test_overload_on_purpose_is_named() -> None:
    """A load beyond the limit of the current stands in the verdict, passed or not, and only where there is one.

    Verifies: FRONT-67
    """
    demo = ROOT / "scenarios" / "demo.toml"
    heavy = load_scenario(demo, [*BASE, "drive.current_limit_a=0.1"], allow_overload=True)
    at_limit = run(speed_rpm=5_500.0, account=((0.0, RUNNING, CURRENT),))
    for data, passed in ((at_limit, True), (run(lost_locks=1), False)):
        found = verdict(data, heavy)
        assert found.passed is passed, found.lines
        note, current = found.notes
        assert note.startswith("overload on purpose: event[0].speed_rpm: 6000 r/min with ")
        assert current.startswith("current: ")
        assert found.as_json()["notes"] == [note, current]
    assert "accepted current: --allow-overload" in verdict(at_limit, heavy).lines
    light = load_scenario(demo, BASE, allow_overload=True)
    assert verdict(run(), light).notes == () and "notes" not in verdict(run(), light).as_json()


def test_current_above_its_limit_is_told() -> None:
    """A millisecond's mean above 1.15 times the limit stands in the verdict; not if the limit is set on the way.

    Verifies: FRONT-67
    """
    demo = ROOT / "scenarios" / "demo.toml"
    data = run()
    pair = 0.5 * sum(np.abs(data.records[name]) for name in ("ia", "ib", "ic"))
    limit_a = float(np.mean(pair)) / 2
    of = load_scenario(demo, [*BASE, f"drive.current_limit_a={limit_a}"], allow_overload=True)
    (note,) = [line for line in verdict(data, of).notes if line.startswith("current: ")]
    assert note.endswith(f"% of its limit of {with_unit(limit_a, 'A')}") and " A for a millisecond from " in note
    assert verdict(data, scenario()).notes == ()
    told = load_scenario(
        demo,
        [*BASE, f"drive.current_limit_a={limit_a}", events('{at_s=0.001,command="set current_limit_a 30"}')],
        allow_overload=True,
    )
    assert not [line for line in verdict(data, told).notes if line.startswith("current: ")]


@pytest.mark.parametrize("rows", [2, 3, 7])
def test_current_of_a_run_shorter_than_its_mean(rows: int) -> None:
    """Less than a millisecond has one mean, from its begin on."""
    data = run()
    data.records = data.records[:rows]
    data.records["ia"] = np.arange(rows)
    data.records["ib"], data.records["ic"] = -data.records["ia"], 0.0
    for vector in (False, True):
        most_a, at_s = largest_current(data, vector)
        assert at_s == data.records["t_cycle"][0] / data.clock_hz and 0.0 < most_a <= 2.0 * rows
    assert largest_current(data, False)[0] == pytest.approx((rows - 1) / 2)
