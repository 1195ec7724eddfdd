# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A sample of the fault campaign on the chip."""

from __future__ import annotations

import fcntl
import random
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cocotb_tests.board import test_fl_board
from fluxlock.base.paths import ROOT, RTL
from fluxlock.config import ConfigError
from fluxlock.cosim.chip import OSCILLATOR_KHZ
from fluxlock.plant import channel_names
from fluxverify.campaign import run
from fluxverify.campaign.board import OSC_STOP_TO_OFF, STOP_TO_OFF
from fluxverify.campaign.faults import LOOP_S, NODE_S, plant_faults
from fluxverify.campaign.grid import DRIVES, Drive, Fault
from fluxverify.campaign.judge import HALTED, RIDDEN, STOPPED, WRONG
from fluxverify.campaign.run import grid, run_drive
from fluxverify.campaign.upsets import actions_of, upsets
from tests.docs.constants import constant

SEED = 1


# Of these every pin, sensor and part of the machine is disturbed; of the others the boot, or the clocks of a board.
CHIPS = [drive for drive in DRIVES if not drive.moments[0].boot and not drive.board]


def drive_of(name: str) -> Drive:
    """Drive of a name."""
    return next(drive for drive in DRIVES if drive.name == name)


def test_sample() -> None:
    """Six-step operation: every other run of the quick grid ends right; the grid is the campaign's.

    Verifies: CAMP-01
    """
    print(f"seed {SEED}")
    rows = run_drive(DRIVES[0], SEED, quick=True, jobs=1, every=2)
    assert len(rows) >= 10
    for row in rows:
        print(row)
    assert not [(row["disturbance"], row["reasons"]) for row in rows if row["outcome"] == WRONG]


def test_upsets_before_boot() -> None:
    """A bit of the parameter block that has flipped: boot names it and starts nothing.

    Verifies: CAMP-04
    """
    print(f"seed {SEED}")
    (drive,) = (d for d in DRIVES if d.moments[0].boot)
    rows = run_drive(drive, SEED, quick=True, jobs=2)
    assert rows
    for row in rows:
        print(row)
        assert row["outcome"] == STOPPED
        assert row["fault"].startswith("parameter_")


def test_hangs_last_as_long_as_the_firmware_waits() -> None:
    """The windows of the grid are those that the firmware supervises by.

    Verifies: CAMP-10
    """
    assert constant("sw/app/app.h", "WINDOW_LOOP_MS") == 1e3 * LOOP_S
    assert constant("sw/app/app.h", "WINDOW_NODE_MS") == 1e3 * NODE_S


def test_the_grid_is_large_enough() -> None:
    """2200 runs or more, every fault in six-step operation and with vector control.

    Verifies: CAMP-05
    """
    runs = {drive.name: grid(drive, SEED, quick=False) for drive in DRIVES}
    assert sum(map(len, runs.values())) >= 2200
    for name in ("six-step", "vector", "five-phase"):
        assert {fault.name for fault in plant_faults(drive_of(name))} <= {run.fault.name for run in runs[name]}


def arguments_of(faults: list[Fault], kind: str) -> list[dict[str, Any]]:
    """Arguments of the faults' changes of a kind."""
    return [dict(arguments) for fault in faults for _, changed, arguments in fault.changes if changed == kind]


@pytest.mark.parametrize("name", ["six-step", "start", "vector", "five-phase"])
def test_every_phase_is_reached(name: str) -> None:
    """Each phase opens, each leg's switch sticks, each channel sticks and has a glitch; no other channel is named.

    Verifies: CAMP-07
    """
    drive = drive_of(name)
    phases, faults = drive.load().motor.phases, plant_faults(drive)
    broken = arguments_of(faults, "fault")
    alone = [(x["kind"], x["phases"][0]) for x in broken if "phases" in x and len(x["phases"]) == 1]
    assert {x for kind, x in alone if kind == "open_phase"} == set(range(phases))
    assert {x for kind, x in alone if kind in ("stuck_high", "stuck_low")} == set(range(phases))
    stuck = [fault for fault in faults if len(fault.changes) == 1]
    glitches = [fault for fault in faults if fault.name.endswith("for 1 us")]
    for some in (stuck, glitches):
        assert {x["channel"] for x in arguments_of(some, "fault") if "channel" in x} == set(channel_names(phases))
    assert {x["channel"] for x in arguments_of(faults, "sensor") if "channel" in x} <= set(channel_names(phases))


def inputs_of_the_top() -> set[str]:
    """Inputs of the chip, bit by bit but for the converter's codes, as its source declares them.

    Without the debug bus: dead in the plain core, as test_fl_soc.py shows.
    """
    text = (RTL / "soc" / "fl_soc.sv").read_text()
    declared = re.findall(r"^\s*input\s+(?:logic|adc_code_t)\s*(\[[^\]]*\])?\s*(\w+)\s*,", text, re.MULTILINE)
    assert len(declared) == len(re.findall(r"^\s*input\b", text, re.MULTILINE))
    found = set()
    for span, name in declared:
        if name.startswith("debug_"):
            continue
        top = re.fullmatch(r"\[\s*(\d+):0\]", span)
        found |= {f"{name}[{bit}]" for bit in range(int(top[1]) + 1)} if top else {name}
    return found


def test_every_pin_is_reached() -> None:
    """Each input of the chip is forced for 1 us in every drive; clock and reset are not, channels have the codes.

    Verifies: CAMP-07
    """
    for drive in CHIPS:
        faults = [fault for fault in plant_faults(drive) if fault.name.endswith("for 1 us")]
        forced = {str(x["pin"]) for x in arguments_of(faults, "pin")}
        assert forced == inputs_of_the_top() - {"clk_i", "rst_i", "adc_code_i"}, drive.name
        ports = [fault for fault in plant_faults(drive) if fault.name.endswith("for 1 clock")]
        assert {str(x["pin"]) for x in arguments_of(ports, "pin")} == forced
        assert {x["cycles"] for x in arguments_of(ports, "pin")} == {1}


def test_pins_of_the_simulator() -> None:
    """The simulator's main drives and forces all of them, under the same names; on a board its clocks and the lock.

    Verifies: CAMP-07
    """
    text = (ROOT / "sim" / "native" / "cosim_main.cpp").read_text()
    board, chip = (set(re.findall(r'"([^"]+)"', x)) for x in re.findall(r"PIN_NAMES\[\] = \{(.*?)\};", text, re.DOTALL))
    assert chip == inputs_of_the_top() - {"clk_i", "rst_i", "adc_code_i"}
    wired = {"adc_valid_i", "adc_fault_i", "clock_fault_i"}
    assert board - {"-"} == chip - wired | {"clk_i", "osc_i", "locked_i"}


def run_some(monkeypatch: pytest.MonkeyPatch, drive: Drive, wanted: dict[str, tuple[str, str]]) -> None:
    """The wanted disturbances of a drive's first moment end as they should: outcome and fault."""
    print(f"seed {SEED}")
    first = replace(drive, moments=drive.moments[:1])
    monkeypatch.setattr(run, "grid", lambda *asked: [one for one in grid(*asked) if one.fault.name in wanted])
    rows = run_drive(first, SEED, quick=False, jobs=1)
    for row in rows:
        print(row)
    assert {row["disturbance"]: (row["outcome"], row["fault"]) for row in rows} == wanted


def test_forced_pins(monkeypatch: pytest.MonkeyPatch) -> None:
    """A forced pin is the chip's: faults of driver and converters and missing sets are named, an unused bus is not.

    Verifies: CAMP-01
    """
    wanted = {
        "fault_pin_i wrong for 1 clock": (STOPPED, "fault_pin"),
        "adc_valid_i at 0 for 1 ms": (STOPPED, "no_samples"),
        "adc_fault_i wrong for 1 clock": (STOPPED, "converter"),
        "clock_fault_i held": (STOPPED, "clock"),
        "uart_rx_i wrong for 1 us": (RIDDEN, "none"),
        "can_rx_i wrong for 1 us": (RIDDEN, "none"),
    }
    run_some(monkeypatch, DRIVES[0], wanted)


def test_phases_beyond_three(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five phases while the rest position is searched: faults of the last leg, winding and channels are named.

    Verifies: CAMP-01
    """
    wanted = {
        "ie stuck at 4095": (STOPPED, "phase_over_current"),
        "id at 4095 for 1 us": (STOPPED, "phase_over_current"),
        "upper switch E stuck": (STOPPED, "fault_pin"),
        "ve at 4095 for 1 us": (RIDDEN, "none"),
    }
    # The chip of the other tests.
    run_some(monkeypatch, replace(drive_of("five-phase"), can=False), wanted)


def test_the_node_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bus without commands for longer than the timeout stops the drive, the node tells why; a short one does not.

    Verifies: CAMP-08
    """
    wanted = {
        "CAN bus dominant for 1 us": (RIDDEN, "none"),
        "CAN bus dominant for 30 ms": (STOPPED, "command_timeout"),
    }
    run_some(monkeypatch, drive_of("can"), wanted)


def run_at(monkeypatch: pytest.MonkeyPatch, name: str, moment: str, wanted: dict[str, tuple[str, str]]) -> None:
    """The wanted disturbances of a drive at a moment end as they should: outcome and fault."""
    drive = drive_of(name)
    run_some(monkeypatch, replace(drive, moments=tuple(m for m in drive.moments if m.name == moment)), wanted)


def test_broken_firmware(monkeypatch: pytest.MonkeyPatch) -> None:
    """While a rotor is caught: exceptions in either level, a stack at its end.

    Verifies: CAMP-10
    """
    wanted = {
        "illegal instruction in the main loop": (STOPPED, "exception"),
        "jump out of the memory in the control interrupt": (STOPPED, "exception"),
        "stack overflow": (STOPPED, "stack_overflow"),
    }
    run_at(monkeypatch, "six-step", "catching", wanted)


def test_console_floods(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines, noise and a line without an end while a rotor is caught: it runs on.

    Verifies: CAMP-11
    """
    kinds = ("status", "all values", "line without an end", "noise")
    run_at(monkeypatch, "six-step", "catching", {f"console flood: {kind}": (RIDDEN, "none") for kind in kinds})


def test_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A winding that is shorted by the next start is named then, a whole one runs.

    Verifies: CAMP-12
    """
    wanted = {
        "windings A, B shorted, 10 % of the turns left, started again": (STOPPED, "shorted_winding"),
        "winding A to star, 20 % of the turns left, started again": (STOPPED, "shorted_winding"),
        "over-current, whole winding started again": (RIDDEN, "none"),
    }
    run_at(monkeypatch, "six-step", "catching", wanted)


def test_bus_floods(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another node fills the bus: ahead of the commands it keeps them away, which has a name, behind them it does not.

    Verifies: CAMP-10, CAMP-11
    """
    wanted = {
        "CAN flood: foreign, ahead of the commands": (STOPPED, "command_timeout"),
        "CAN flood: foreign, behind the commands": (RIDDEN, "none"),
        "CAN flood: commands that are too short": (RIDDEN, "none"),
        "CANopen node hangs": (STOPPED, "can_node"),
    }
    run_at(monkeypatch, "can", "accelerating", wanted)


def test_every_drive_has_broken_firmware_and_floods() -> None:
    """But those that only boot; what has to be at work is left out where nothing is.

    Verifies: CAMP-10, CAMP-11
    """
    for drive in CHIPS:
        runs = grid(drive, SEED, quick=False)
        for moment in drive.moments:
            names = {one.fault.name for one in runs if one.moment == moment}
            assert sum("console flood" in name for name in names) == 4
            assert sum("in the main loop" in name or "in the control interrupt" in name for name in names) == 6
            assert ("main loop hangs" in names) == moment.active
            assert ("CAN flood: SYNC" in names) == (drive.load().can is not None)


def test_a_board_loses_its_clocks_in_every_state() -> None:
    """Six-step operation and vector control: both clocks and the lock, by the times that the board's own test holds.

    Verifies: CAMP-13
    """
    assert (STOP_TO_OFF, OSC_STOP_TO_OFF) == (test_fl_board.STOP_TO_OFF, test_fl_board.OSC_STOP_TO_OFF)
    assert abs(1e6 / test_fl_board.OSC_NS - OSCILLATOR_KHZ) < 0.01 * OSCILLATOR_KHZ
    boards = [drive for drive in DRIVES if drive.board]
    assert {drive.load().drive.method for drive in boards} == {"six-step", "vector"}
    for drive in boards:
        states = {moment.name for moment in drive.moments}
        assert states == {"ready", "starting", "accelerating", "running", "stopping", "fault"}
        runs = grid(drive, SEED, quick=False)
        for name in states:
            faults = [one.fault for one in runs if one.moment.name == name]
            assert {str(x["pin"]) for x in arguments_of(faults, "pin")} == {"clk_i", "osc_i", "locked_i", "fault_pin_i"}
            # Of a stop that no monitor has to find nothing is asked but gates, currents and the name.
            assert all(fault.off_s is not None for fault in faults if "200 ns" not in fault.name)


def test_clocks_of_a_board(monkeypatch: pytest.MonkeyPatch) -> None:
    """While a rotor is caught: a chip that lives names its clock, one that stands or begins anew has open gates.

    Verifies: CAMP-13
    """
    wanted = {
        "clock stops": (HALTED, ""),
        "clock stops for 5 us": (STOPPED, "clock"),
        "oscillator stops": (STOPPED, "clock"),
        "lock goes for 1 clock": (HALTED, "none"),
        "driver reports a fault for 1 clock": (STOPPED, "fault_pin"),
    }
    run_at(monkeypatch, "board", "starting", wanted)


def test_a_register_by_name() -> None:
    """An upset that names its register becomes the share by which the simulator finds it.

    Verifies: CAMP-05
    """
    (fault,) = upsets(random.Random(SEED), 0, 0, 1)
    name = str(fault.changes[0][2]["name"])
    registers = [f"fl_soc__DOT__{x}" for x in ("a_q", "b_q", name, "c_q", "d_q", "e_q", "f_q")]
    (action,) = actions_of(fault, 7, registers, Path())
    assert (action.cycle, action.kind) == (7, "register")
    assert registers[int(action.arguments["share"] * len(registers))].endswith(name)
    assert 0 <= action.arguments["bit_share"] < 1


def test_the_seed_decides() -> None:
    """Runs follow from the seed; another one gives other upsets.

    Verifies: CAMP-03
    """
    for drive in DRIVES:
        assert grid(drive, 5, quick=False) == grid(drive, 5, quick=False)
        assert drive.board or grid(drive, 5, quick=False) != grid(drive, 6, quick=False)
        names = [one.folder for one in grid(drive, 5, quick=False)]
        assert len(set(names)) == len(names)


def test_runs_repeat(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same runs end the same, in another folder and without what has been kept of the first: faults and an upset.

    Verifies: CAMP-03
    """
    print(f"seed {SEED}")
    drive = replace(DRIVES[0], moments=DRIVES[0].moments[:1])
    short = ("vdc stuck at 0", "upper switch A stuck", "register upset 0")
    monkeypatch.setattr(run, "grid", lambda *asked: [one for one in grid(*asked) if one.fault.name in short])
    rows = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        monkeypatch.setattr(run, "FOLDER", folder)
        rows.append(run_drive(drive, SEED, quick=False, jobs=1))
    print(rows[0])
    assert rows[0] == rows[1]
    assert [row["disturbance"] for row in rows[0]] == list(short) and rows[0][-1]["upsets"]


def test_one_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second campaign of a drive is refused: it would clear the folders in which the first one's runs write.

    Verifies: CAMP-01
    """
    monkeypatch.setattr(run, "FOLDER", tmp_path)
    (tmp_path / "boot").mkdir()
    with (tmp_path / "boot" / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        with pytest.raises(ConfigError, match="another campaign is using it"):
            run.run_drive(DRIVES[-1], SEED, quick=True, jobs=1)


def test_progress_of_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A campaign whose runs have all ended before shows all of them as ended, without a chip.

    Verifies: CAMP-01
    """

    class Kept:
        def find(self, one: run.Run) -> dict[str, Any]:
            return {"fault": one.fault.name}

    monkeypatch.setattr(run, "FOLDER", tmp_path)
    monkeypatch.setattr(run, "open_book", lambda *_: Kept())
    seen: list[tuple[int, int]] = []
    rows = run.run_drive(DRIVES[-1], SEED, quick=True, jobs=1, done=lambda ended, count: seen.append((ended, count)))
    assert seen == [(len(rows), len(rows))] and rows
