# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive profile on the averaged motor: state machine, modes, limits, stops, faults, lost master."""

from __future__ import annotations

import struct

import pytest

from tests.canopen.node_bench import DRIVE, NODE, Aborted, NodeBench

TIMEOUT_MS = 50
DEFAULT_TIMEOUT_MS = 1000
QUICK = 0x0B  # controlword: quick stop, bit 2 is 0

# Controlword, and the state that follows from each state with the gates off.
TRANSITIONS = {
    0x06: {"disabled": "ready", "ready": "ready", "switched on": "ready", "enabled": "ready"},
    0x07: {"disabled": "disabled", "ready": "switched on", "switched on": "switched on", "enabled": "switched on"},
    0x0F: {"disabled": "disabled", "ready": "enabled", "switched on": "enabled", "enabled": "enabled"},
    0x00: dict.fromkeys(("disabled", "ready", "switched on", "enabled"), "disabled"),
    0x02: dict.fromkeys(("disabled", "ready", "switched on", "enabled"), "disabled"),
    0x80: dict.fromkeys(("disabled", "ready", "switched on", "enabled"), "disabled"),
}


def control(bench: NodeBench, word: int) -> str:
    """State after a controlword."""
    bench.write("controlword", word)
    bench.idle(0.001)
    return bench.state


@pytest.fixture
def turning() -> NodeBench:
    """A motor at 20 000 r/min, operation enabled; the rotor was spinning and has been caught."""
    found = NodeBench(speed_rpm=20_000)
    found.enable()
    found.turn(20_000)
    found.frames.clear()
    return found


@pytest.mark.parametrize("word", TRANSITIONS)
def test_transitions(bench: NodeBench, word: int) -> None:
    """Every controlword in every state leads where the profile says.

    Verifies: CO-09
    """
    way = {"disabled": [0], "ready": [0, 6], "switched on": [0, 6, 7], "enabled": [0, 6, 7, 15]}
    for state, words in way.items():
        for step in words:
            control(bench, step)
        assert bench.state == state
        assert control(bench, word) == TRANSITIONS[word][state], state


def test_profile_velocity(turning: NodeBench) -> None:
    """The speed follows the target by the ramps, through standstill for the other sign; 0 stops with the gates off.

    Verifies: CO-10
    """
    b = turning
    assert abs(b.node.value("velocity_actual") - b.bench.model.rpm) < 300
    assert b.read("modes_of_operation_display") == 3
    b.write("profile_deceleration", 100_000)
    b.write("target_velocity", 12_000)
    start = b.node.value("velocity_actual")
    b.run(0.05)
    assert start - b.node.value("velocity_actual") == pytest.approx(5_000, abs=600)
    assert not b.node.value("statusword") & 0x400
    b.run(0.1)
    assert b.node.value("statusword") & 0x1400 == 0x400
    assert b.bench.model.rpm == pytest.approx(12_000, rel=0.01)
    b.turn(-12_000)
    assert b.bench.model.rpm == pytest.approx(-12_000, rel=0.03)
    assert b.node.value("torque_actual") < 0
    b.write("target_velocity", 0)
    assert b.run(2.0, lambda: b.bench.fw.state == "ready")
    b.run(0.02)
    assert b.state == "enabled"
    assert b.node.value("statusword") & 0x1400 == 0x1400


def test_velocity_limits(turning: NodeBench) -> None:
    """Targets beyond the profile's or the motor's speed are held at it, with the bit for an active limit.

    Verifies: CO-11
    """
    b = turning
    b.write("max_profile_velocity", 24_000)
    b.write("target_velocity", 40_000)
    b.run(0.1)
    assert b.bench.model.rpm == pytest.approx(24_000, rel=0.01)
    assert b.node.value("statusword") & 0x0C00 == 0x0800
    b.write("target_velocity", 24_000)
    b.run(0.02)
    assert b.node.value("statusword") & 0x0C00 == 0x0400


def test_current_limit(turning: NodeBench) -> None:
    """The lower one of 0x6072 and 0x6073 limits the current while the motor accelerates.

    Verifies: CO-11
    """
    b = turning
    b.write("max_torque", 400)
    b.write("profile_acceleration", 10_000_000)
    b.write("target_velocity", 60_000)
    b.run(0.02)
    for _ in range(5):
        b.run(0.004)
        assert b.node.value("current_actual") == pytest.approx(400, abs=20)
    assert b.bench.fw.command("get current_limit_a")[0] == "current_limit_a 9.000"
    b.write("max_current", 300)
    b.run(0.002)
    assert b.bench.fw.command("get current_limit_a")[0] == "current_limit_a 6.750"


def test_cyclic_velocity(turning: NodeBench) -> None:
    """Set points by RPDO and SYNC every 2 ms are followed on a line through them.

    Verifies: CO-10
    """
    b = turning
    for pdo in ("rpdo3", "tpdo3"):
        b.write(f"{pdo}_type", 1)
    b.write("modes_of_operation", 9)
    b.write("max_acceleration", 2_000_000)
    b.frames.clear()
    for k in range(150):
        b.send(0x400 + NODE, struct.pack("<Hi", 15, 20_000 + 70 * k))
        b.send(0x80)
        b.run(0.002)
        assert b.state == "enabled"
    last = 20_000 + 70 * 149
    assert b.bench.model.rpm == pytest.approx(last, rel=0.01)
    assert b.node.value("statusword") & 0x1000
    told = b.taken(0x380 + NODE)
    assert len(told) == 150
    assert struct.unpack("<Hi", told[-1])[1] == pytest.approx(last, rel=0.02)


def test_cyclic_torque() -> None:
    """The set torque is made, in both directions and against the rotor; 0 lets it coast and stop.

    Verifies: CO-10
    """
    b = NodeBench(drive=DRIVE.model_copy(update={"current_loop": True}), speed_rpm=15_000)
    assert b.until("disabled", 0.1)
    b.write("modes_of_operation", 10)
    b.enable()
    b.write("target_torque", 250)
    assert b.run(2.0, lambda: b.bench.model.rpm > 20_000)
    b.run(0.02)
    assert b.node.value("torque_actual") == pytest.approx(250, abs=25)
    faster = b.bench.model.rpm
    b.write("target_torque", -50)
    b.run(0.05)
    assert b.bench.model.rpm < faster - 1_000
    b.write("target_torque", -300)
    assert b.run(2.0, lambda: b.bench.model.rpm < -12_000)
    b.run(0.02)
    assert b.node.value("torque_actual") == pytest.approx(-300, abs=30)
    b.write("target_torque", 0)
    assert b.run(4.0, lambda: b.bench.fw.state == "ready")
    assert b.state == "enabled"


def test_torque_needs_the_current_loop(bench: NodeBench) -> None:
    """Without it the mode is refused; 0x6502 shows what the method has.

    Verifies: CO-10
    """
    assert bench.read("supported_drive_modes") == 1 << 2 | 1 << 8 | 1 << 9
    with pytest.raises(Aborted):
        bench.write("modes_of_operation", 10)
    bench.write("setting_current_loop", 1)
    bench.write("modes_of_operation", 10)
    assert bench.read("modes_of_operation") == 10


@pytest.mark.parametrize(
    ("option", "deceleration", "state"),
    [(0, None, "disabled"), (1, 100_000, "disabled"), (2, 200_000, "disabled"), (6, 200_000, "quick stop")],
)
def test_quick_stop(turning: NodeBench, option: int, deceleration: int | None, state: str) -> None:
    """Each option's ramp, then its state; out of quick stop active the operation can be enabled again.

    Verifies: CO-12
    """
    b = turning
    b.write("profile_deceleration", 100_000)
    b.write("quick_stop_deceleration", 200_000)
    b.write("quick_stop_option", option)
    before = b.node.value("velocity_actual")
    b.write("controlword", QUICK)
    b.run(0.03)
    if deceleration is None:
        assert (b.state, b.bench.fw.state) == ("disabled", "ready")
        return
    assert b.state == "quick stop"
    assert before - b.node.value("velocity_actual") == pytest.approx(deceleration * 0.03, rel=0.2)
    assert b.run(2.0, lambda: b.bench.fw.state == "ready")
    b.run(0.01)
    assert b.state == state
    if option == 6:
        b.write("controlword", 15)
        b.idle(0.002)
        assert b.state == "enabled"


@pytest.mark.parametrize(
    ("word", "ramp", "state"),
    [(0x10F, True, "enabled"), (0x07, True, "switched on"), (0x06, False, "ready"), (0x00, False, "disabled")],
)
def test_ways_out_of_operation(turning: NodeBench, word: int, ramp: bool, state: str) -> None:
    """Halt and disable operation by the ramp, shutdown and disable voltage with the gates off at once.

    Verifies: CO-12
    """
    b = turning
    b.write("controlword", word)
    b.run(0.005)
    if ramp:
        assert (b.state, b.bench.fw.state) == ("enabled", "stopping")
    assert b.run(0.5, lambda: b.bench.fw.state == "ready")
    b.run(0.002)
    assert b.state == state
    assert (b.bench.model.rpm > 15_000) != ramp
    if word == 0x10F:
        b.write("controlword", 0x0F)
        assert b.run(1.0, lambda: b.bench.fw.state == "starting")


def test_fault_and_reset(turning: NodeBench) -> None:
    """A trip leads to fault with its code in EMCY and 0x603F; a rising bit 7 clears it, once its cause has gone.

    Verifies: CO-13
    """
    b = turning
    b.bench.trip(b.bench.fw.lib.TRIP_PHASE_CURRENT)
    b.run(0.005)
    assert b.state == "fault"
    assert b.read("error_code") == 0x2310
    assert b.read("error_register") == 0x03
    assert [struct.unpack("<HBB", f[:4]) for f in b.taken(0x80 + NODE)] == [(0x2310, 3, 8)]
    assert (b.read("fault_present"), b.read("fault_total"), b.read("fault_number_1")) == (8, 1, 8)
    for word in (0x00, 0x06, 0x0F):
        b.write("controlword", word)
        b.run(0.002)
        assert b.state == "fault"
    b.write("target_velocity", 0)
    b.write("controlword", 0x80)
    assert b.until("disabled", 0.1)
    b.run(0.05)
    assert (b.read("error_code"), b.read("error_register")) == (0, 0)
    assert b.taken(0x80 + NODE) == [struct.pack("<4xI", 0x2310)]
    b.enable()


def test_fault_that_stays(bench: NodeBench) -> None:
    """A reset while the cause is there leads back to fault; without a rising edge nothing is cleared.

    Verifies: CO-13
    """
    bench.bench.sampling = False
    bench.run(0.01)
    assert bench.state == "fault"
    assert bench.read("error_code") == 0x5200
    bench.write("controlword", 0x80)
    bench.run(0.05)
    assert bench.state == "fault"
    bench.bench.sampling = True
    bench.write("controlword", 0x80)
    bench.run(0.05)
    assert bench.state == "fault"
    assert bench.bench.fw.command("clear") == ["ok"]
    bench.run(0.05)
    assert (bench.state, bench.bench.fw.state) == ("fault", "ready"), "the console does not reset the profile's fault"
    bench.write("controlword", 0x00)
    bench.write("controlword", 0x80)
    assert bench.until("disabled", 0.1)


@pytest.mark.parametrize(
    ("reaction", "state", "error"),
    [(0, "enabled", 0), (1, "fault", 0x8100), (2, "disabled", 0), (3, "disabled", 0)],
)
def test_command_timeout(turning: NodeBench, reaction: int, state: str, error: int) -> None:
    """A master that falls silent for longer than 0x2010 sets off its reaction; one that speaks in time does not.

    Verifies: CO-14
    """
    b = turning
    b.write("command_timeout_reaction", reaction)
    b.write("command_timeout_time", TIMEOUT_MS)
    for _ in range(3):
        b.send(0x200 + NODE, b"\x0f\x00")
        b.run(0.8e-3 * TIMEOUT_MS)
    assert b.state == "enabled"
    assert b.taken(0x80 + NODE) == []
    b.run(0.4e-3 * TIMEOUT_MS)
    assert struct.unpack_from("<H", b.taken(0x80 + NODE)[0])[0] == 0x8100
    assert b.until(state, 0.5)
    assert b.read("error_code") == error
    assert b.bench.fw.state == ("running" if reaction == 0 else "ready")
    if reaction == 1:
        b.write("controlword", 0)
        b.write("controlword", 0x80)
        assert b.until("disabled", 0.1)


def silent_by_default(**keys: int) -> NodeBench:
    """A motor that a master turns who has written nothing but controlword and target."""
    b = NodeBench(speed_rpm=20_000, **keys)
    b.enable(patient=False)
    b.turn(20_000)
    assert b.read("command_timeout_time") == DEFAULT_TIMEOUT_MS
    b.frames.clear()
    return b


@pytest.mark.parametrize("lives", ["RPDO", "write", "read", "console"])
def test_silent_master_stops_by_default(lives: str) -> None:
    """A master that has set nothing and falls silent is told and the motor stops; each way of speaking keeps it on.

    What is refused, SYNC, NMT to all and a foreign heartbeat do not keep the motor on.

    Verifies: CO-14
    """
    b = silent_by_default()
    for _ in range(3):
        b.run(0.8e-3 * DEFAULT_TIMEOUT_MS)
        assert b.state == "enabled"
        if lives == "RPDO":
            b.send(0x200 + NODE, b"\x0f\x00")
        elif lives == "write":
            b.write("max_acceleration", 100_000)
        elif lives == "read":
            b.read("velocity_actual")
        else:
            b.bench.fw.command("get state")
    assert b.taken(0x80 + NODE) == []
    for _ in range(9):
        b.run(0.1e-3 * DEFAULT_TIMEOUT_MS)
        b.send(0x200 + NODE, b"\x0f")
        b.send(0x80)
        b.send(0, b"\x01\x00")
        b.send(0x720, b"\x05")
        with pytest.raises(Aborted):
            b.upload(0x5000)
    assert b.state == "enabled"
    b.taken(0x80 + NODE)
    b.run(0.15e-3 * DEFAULT_TIMEOUT_MS)
    assert struct.unpack_from("<H", b.taken(0x80 + NODE)[0])[0] == 0x8100
    assert b.until("disabled", 0.5)
    assert b.bench.fw.state == "ready"


def test_no_timeout_where_nobody_has_enabled() -> None:
    """A motor that the console turns may be left alone however long the bus is silent; a master can write none.

    Verifies: CO-14
    """
    b = NodeBench(speed_rpm=20_000)
    assert b.until("disabled", 0.1)
    for line in ("set speed_rpm 20000", "start"):
        assert b.bench.fw.command(line) == ["ok"]
    b.run(2e-3 * DEFAULT_TIMEOUT_MS)
    assert (b.state, b.bench.fw.state) == ("disabled", "running")
    assert b.bench.fw.command("get command_timeout_ms") == ["command_timeout_ms 0", "ok"]
    b = silent_by_default()
    b.write("command_timeout_time", 0)
    b.run(2e-3 * DEFAULT_TIMEOUT_MS)
    assert (b.state, b.bench.fw.state) == ("enabled", "running")
    assert b.taken(0x80 + NODE) == []


def test_console_and_master_speak_for_each_other(turning: NodeBench) -> None:
    """A line of the console keeps the timeout of the master off, and a command of the master that of the console.

    Verifies: CO-14
    """
    b = turning
    b.write("command_timeout_reaction", 1)
    b.write("command_timeout_time", TIMEOUT_MS)
    assert b.bench.fw.command(f"set command_timeout_ms {TIMEOUT_MS}") == ["ok"]
    assert b.read("setting_command_timeout_ms") == TIMEOUT_MS
    for k in range(6):
        if k % 2:
            b.send(0x200 + NODE, b"\x0f\x00")
        else:
            b.bench.fw.command("get state")
        b.run(0.8e-3 * TIMEOUT_MS)
        assert (b.state, b.bench.fw.state) == ("enabled", "running")
    b.run(0.4e-3 * TIMEOUT_MS)
    assert b.state == "fault"


@pytest.mark.parametrize(
    ("how", "option", "state"),
    [
        *((how, 1, "fault") for how in ("heartbeat", "bus off", "stopped", "pre-operational", "reset communication")),
        *(("heartbeat", option, state) for option, state in ((0, "enabled"), (2, "disabled"), (3, "disabled"))),
        ("stopped", 3, "disabled"),
        ("reset", 0, "disabled"),
    ],
)
def test_connection_lost(turning: NodeBench, how: str, option: int, state: str) -> None:
    """What 0x6007 says happens when the master is lost or leaves operational; a reset of the node stops in any case.

    Verifies: CO-06, CO-14
    """
    b = turning
    b.write("abort_connection_option", option)
    commands = {"stopped": 2, "pre-operational": 128, "reset": 129, "reset communication": 130}
    if how == "heartbeat":
        b.write("heartbeat_consumer_node_1", 0x20 << 16 | 20)
        b.send(0x720, b"\x05")
        b.run(0.03)
        assert b.node.value("error_register") == 0x11
    elif how == "bus off":
        b.node.bus_off()
    else:
        b.nmt(commands[how])
    assert b.until(state, 0.5)
    b.run(0.01)
    assert b.bench.fw.state == ("running" if state == "enabled" else "ready")
    # The connection is there again: over, but for an operation that waits for its reset.
    if how == "heartbeat":
        b.send(0x720, b"\x05")
    elif how == "bus off":
        assert b.node.value("error_register") == 0x11
        b.node.bus_back()
    b.run(0.01)
    assert b.node.value("error_register") == (1 if state == "fault" else 0)


def told(bench: NodeBench) -> list[tuple[int, int, int, int]]:
    """Emergencies: code, error register, fault of the drive, code that has ended."""
    return [struct.unpack("<HBBI", data) for data in bench.taken(0x80 + NODE)]


def test_a_fault_that_the_console_clears(turning: NodeBench) -> None:
    """Its end is told, the operation waits for its reset; the same fault again, and another one, are told as new ones.

    Verifies: CO-08
    """
    b, lib = turning, turning.bench.fw.lib
    over_current, link = lib.TRIP_PHASE_CURRENT, lib.TRIP_FAULT_PIN
    b.bench.trip(over_current)
    b.run(0.05)
    (first,) = told(b)
    code, number = first[0], first[2]
    assert first[1] & 1 and b.read("error_field_count") == 1
    for count, cause in ((2, over_current), (3, link)):
        assert b.bench.fw.command("clear") == ["ok"]
        b.run(0.25)
        assert told(b) == [(0, 1, 0, code)] and (b.state, b.node.value("error_register")) == ("fault", 1)
        assert b.bench.fw.command("start") == ["ok"]
        assert b.run(2.0, lambda: b.bench.fw.state == "running")
        b.bench.trip(cause)
        b.run(0.05)
        (again,) = told(b)
        assert (again[0] == code) == (again[2] == number) == (cause == over_current)
        assert b.read("error_field_count") == count and b.node.value("error_register") == again[1]
        code = again[0]
    b.write("controlword", 0)
    b.write("controlword", 0x80)
    assert b.until("disabled", 0.5)
    b.run(0.2)
    assert told(b) == [(0, 0, 0, code)] and b.node.value("error_register") == 0


def test_a_cause_that_comes_back_before_its_end_was_told(bench: NodeBench) -> None:
    """Within the inhibit time: first the end of what was told, then the new beginning.

    Verifies: CO-08
    """
    bench.write("emcy_inhibit_time", 2000)
    bench.nmt(1)
    bench.node.bus_off()
    bench.idle(0.05)
    assert [code for code, *_ in told(bench)] == [0x8140]
    bench.node.bus_back()
    bench.idle(0.01)
    bench.node.bus_off()
    bench.idle(1.0)
    assert [(code, ended) for code, _, _, ended in told(bench)] == [(0, 0x8140), (0x8140, 0)]


def test_console_keeps_its_motor() -> None:
    """A motor that the console has started turns on while the profile is not enabled, and disabling leaves it.

    Verifies: CO-09
    """
    bench = NodeBench(speed_rpm=20_000)
    assert bench.until("disabled", 0.1)
    assert bench.bench.fw.command("set speed_rpm 20000") == ["ok"]
    assert bench.bench.fw.command("start") == ["ok"]
    assert bench.run(2.0, lambda: bench.bench.fw.state == "running")
    for word in (0, 6, 7, 0):
        bench.write("controlword", word)
        bench.run(0.01)
        assert bench.bench.fw.state == "running"
    for word in (6, 7, 15):
        bench.write("controlword", word)
    assert bench.run(2.0, lambda: bench.bench.fw.state == "ready"), "the target of the profile is 0"


@pytest.mark.parametrize(("line", "ramp"), [("stop", True), ("stop now", False)])
def test_stop_at_the_console_ends_the_operation(turning: NodeBench, line: str, ramp: bool) -> None:
    """The motor stops as the console says and stays off: the master enables the operation anew to start it.

    Verifies: CO-09
    """
    b = turning
    assert b.bench.fw.command(line) == ["ok"]
    b.run(0.005)
    assert (b.state, b.bench.fw.state) == (("enabled", "stopping") if ramp else ("disabled", "ready"))
    b.write("target_velocity", 25_000)
    assert b.run(0.5, lambda: b.bench.fw.state == "ready")
    assert (b.bench.model.rpm < 15_000) == ramp
    b.run(0.1, lambda: b.bench.fw.state != "ready")
    assert (b.state, b.bench.fw.state) == ("disabled", "ready")
    b.write("controlword", 0x0F)
    b.run(0.01)
    assert (b.state, b.bench.fw.state) == ("disabled", "ready")
    b.write("controlword", 0x06)
    b.write("controlword", 0x0F)
    assert b.run(0.1, lambda: b.bench.fw.state == "starting")


def test_stop_at_the_console_just_after_the_start(bench: NodeBench) -> None:
    """Also a start that the node has not seen yet is not made again.

    Verifies: CO-09
    """
    bench.enable()
    bench.write("target_velocity", 20_000)
    bench.idle(0.001)
    bench.bench.fw.command("stop now")  # replaces the start that waits for the control tick
    for _ in range(100):
        bench.run(0.001)
        assert bench.bench.fw.state == "ready"
    assert bench.state == "disabled"


def test_wrong_parameters() -> None:
    """A drive without a valid parameter block is in fault for good, and every object can still be read.

    Verifies: CO-13
    """
    b = NodeBench()
    b.bench.fw.load(bytes(1024))
    b.bench.fw.boot()
    b.node.boot(b.now_us)
    b.idle(0.01)
    assert b.state == "fault"
    assert b.read("error_code") == 0x6320
    b.write("controlword", 0x80)
    b.run(0.02)
    assert b.state == "fault"
    for e in b.node.dictionary.entries:
        if e.bytes:
            assert len(b.upload(e.index, e.sub)) == e.bytes
    with pytest.raises(Aborted):
        b.write("setting_commutation", 1)
