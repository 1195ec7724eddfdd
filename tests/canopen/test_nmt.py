# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Network management, heartbeat, process data, SYNC and EMCY."""

from __future__ import annotations

import struct

import pytest

from fluxlock.native.node import EXTENDED, REMOTE
from tests.canopen.node_bench import NODE, Aborted, NodeBench

CALM_S = 2.1  # after which nothing is wrong with an RPDO any more
HEARTBEAT, EMCY, SYNC = 0x700 + NODE, 0x80 + NODE, 0x80
MASTER = 0x20
STOPPED, OPERATIONAL, PRE_OPERATIONAL = 4, 5, 127


def emcy(bench: NodeBench) -> list[tuple[int, int, int, int]]:
    """Code, register, fault and detail of what was told."""
    return [struct.unpack("<HBBI", data) for data in bench.taken(EMCY)]


def map_pdo(bench: NodeBench, pdo: str, names: list[str], kind: int = 255, inhibit: int | None = None) -> None:
    """Map objects as a master does."""
    cob_id = bench.read(f"{pdo}_cob_id")
    bench.write(f"{pdo}_cob_id", cob_id | 1 << 31)
    bench.write(f"{pdo}_type", kind)
    bench.write(f"{pdo}_mapping_count", 0)
    for k, name in enumerate(names, 1):
        bench.write(f"{pdo}_mapping_object_{k}", bench.entry(name).mapping)
    bench.write(f"{pdo}_mapping_count", len(names))
    if inhibit is not None:
        bench.write(f"{pdo}_inhibit_time", inhibit)
    bench.write(f"{pdo}_cob_id", cob_id)


def test_boot_up_and_states() -> None:
    """Boot-up frame first; NMT commands to the node or to all, the state in the heartbeat; others are ignored.

    Verifies: CO-05
    """
    bench = NodeBench()
    bench.idle(0.001)
    assert [(f.id, f.data) for f in bench.frames] == [(HEARTBEAT, b"\0")]
    bench.frames.clear()
    for command, node, state in (
        (1, NODE, OPERATIONAL),
        (128, 0, PRE_OPERATIONAL),
        (2, NODE, STOPPED),
        (1, NODE + 1, STOPPED),
        (7, NODE, STOPPED),
        (1, 0, OPERATIONAL),
    ):
        bench.nmt(command, node)
        bench.idle(1.001)
        assert bench.taken(HEARTBEAT)[-1] == bytes([state])
    bench.send(0, bytes([2]))
    bench.send(0, bytes([2, NODE, 0]))
    bench.send(0, bytes([2, NODE]), REMOTE)
    bench.send(0, bytes([2, NODE]), EXTENDED)
    bench.idle(1.001)
    assert bench.taken(HEARTBEAT)[-1] == bytes([OPERATIONAL])


def test_services_by_state(bench: NodeBench) -> None:
    """SDO in pre-operational and operational only, PDO in operational only.

    Verifies: CO-05
    """
    target = struct.pack("<Hi", 6, 20_000)
    bench.send(0x400 + NODE, target)
    assert bench.node.value("target_velocity") == 0
    bench.nmt(2)
    bench.send(0x600 + NODE, bytes.fromhex("4041600000000000"))
    bench.send(0x400 + NODE, target)
    bench.idle(0.1)
    assert bench.taken(0x580 + NODE) == []
    assert bench.node.value("target_velocity") == 0
    assert not bench.taken(0x180 + NODE)
    bench.nmt(1)
    bench.send(0x400 + NODE, target)
    bench.idle(0.01)
    assert bench.node.value("target_velocity") == 20_000
    assert bench.taken(0x180 + NODE)


@pytest.mark.parametrize("period_ms", [0, 20, 250])
def test_heartbeat_period(bench: NodeBench, period_ms: int) -> None:
    """The period of the producer, 0: none.

    Verifies: CO-05
    """
    bench.write("heartbeat_producer", period_ms)
    bench.idle(0.3)
    bench.frames.clear()
    bench.idle(1.0)
    expected = 1000 // period_ms if period_ms else 0
    assert len(bench.taken(HEARTBEAT)) in {expected, expected - 1, expected + 1} - {-1}


def test_resets(bench: NodeBench) -> None:
    """Reset of communication renews the objects below 0x2000 only, reset of the node all; both boot up again.

    Verifies: CO-05
    """
    bench.write("heartbeat_producer", 50)
    bench.write("velocity_window", 7)
    bench.nmt(130)
    bench.idle(0.002)
    assert bench.taken(HEARTBEAT)[0] == b"\0"
    assert (bench.node.value("heartbeat_producer"), bench.node.value("velocity_window")) == (1000, 7)
    bench.nmt(129)
    bench.idle(0.002)
    assert bench.taken(HEARTBEAT)[0] == b"\0"
    assert bench.node.value("velocity_window") == 300


def test_heartbeat_consumer(bench: NodeBench) -> None:
    """A watched node that falls silent is told by EMCY, moves NMT to pre-operational, and its return clears it.

    Verifies: CO-06
    """
    bench.write("heartbeat_consumer_node_2", MASTER << 16 | 100)
    bench.nmt(1)
    bench.idle(1.0)
    assert emcy(bench) == []
    for _ in range(20):
        bench.send(0x700 + MASTER, bytes([5]))
        bench.idle(0.05)
    assert emcy(bench) == []
    bench.idle(0.1)
    assert emcy(bench) == [(0x8130, 0x11, 0, MASTER)]
    assert bench.taken(HEARTBEAT)[-1] == bytes([PRE_OPERATIONAL])
    assert bench.read("error_register") == 0x11
    assert bench.read("error_field_error_1") == 0x8130
    bench.send(0x700 + MASTER, bytes([5]))
    bench.idle(0.02)
    assert emcy(bench) == [(0, 0, 0, 0x8130)]
    with pytest.raises(Aborted) as refused:
        bench.write("heartbeat_consumer_node_1", MASTER << 16 | 50)
    assert refused.value.args[0] == 0x06040043
    with pytest.raises(Aborted) as refused:
        bench.write("heartbeat_consumer_node_1", NODE << 16 | 50)
    assert refused.value.args[0] == 0x06090030, "a node hears no heartbeat of its own"


def test_each_lost_node_and_each_loss_is_told(bench: NodeBench) -> None:
    """Two watched nodes, and one that never comes: every loss and every return is told, in list and register too.

    Verifies: CO-06
    """
    other, never = MASTER + 1, MASTER + 2
    for k, node in enumerate((MASTER, other, never), 1):
        bench.write(f"heartbeat_consumer_node_{k}", node << 16 | 100)

    def alive(*nodes: int) -> None:
        for _ in range(8):
            for node in nodes:
                bench.send(0x700 + node, bytes([5]))
            bench.idle(0.05)

    alive(MASTER, other)
    assert emcy(bench) == []
    alive(MASTER)
    assert emcy(bench) == [(0x8130, 0x11, 0, other)]
    alive()
    assert emcy(bench) == [(0x8130, 0x11, 0, MASTER)]
    alive(other)
    assert emcy(bench) == [(0, 0x11, 0, 0x8130)]
    alive(MASTER, other)
    assert emcy(bench) == [(0, 0, 0, 0x8130)]
    alive(other)
    assert emcy(bench) == [(0x8130, 0x11, 0, MASTER)]
    assert bench.read("error_field_count") == 3
    bench.write("heartbeat_consumer_node_1", 0)
    bench.idle(0.02)
    assert emcy(bench) == [(0, 0, 0, 0x8130)]


@pytest.mark.parametrize("watches", [False, True])
def test_heartbeat_of_the_own_node_id(bench: NodeBench, watches: bool) -> None:
    """A heartbeat of another node with this node-ID is told once, and its end 2 s after the last one.

    Verifies: CO-06
    """
    bench.write("heartbeat_consumer_node_1", (MASTER << 16 | 100) if watches else 0)
    assert any((HEARTBEAT ^ can_id) & mask == 0 for can_id, mask in bench.node.wanted())
    for _ in range(3):
        bench.send(HEARTBEAT, bytes([5]))
        bench.idle(1.5)
    assert emcy(bench) == [(0x8150, 0x11, 0, NODE)]
    bench.idle(1.0)
    assert emcy(bench) == [(0, 0, 0, 0x8150)]


def test_pdo_by_event(bench: NodeBench) -> None:
    """A TPDO is sent at the start of operational, on a change, not before its inhibit time, and by its event timer.

    Verifies: CO-07
    """
    map_pdo(bench, "tpdo1", ["modes_of_operation_display", "statusword"], inhibit=500)
    bench.idle(0.05)
    bench.nmt(1)
    bench.idle(0.2)
    assert bench.taken(0x180 + NODE) == [struct.pack("<bH", 3, 0x1250)]
    for mode in (9, 3, 9, 0):
        bench.write("modes_of_operation", mode)
        bench.idle(0.010)
    assert len(bench.taken(0x180 + NODE)) == 1
    bench.idle(0.1)
    assert bench.taken(0x180 + NODE)[-1][0] == 0
    bench.write("tpdo1_event_timer", 60)
    bench.idle(0.6)
    assert len(bench.taken(0x180 + NODE)) in {9, 10, 11}


def test_pdo_by_sync(bench: NodeBench) -> None:
    """Types 0 and n: after a change, at every n-th SYNC; an RPDO of type 0 waits for the next one.

    Verifies: CO-07
    """
    map_pdo(bench, "tpdo1", ["modes_of_operation_display"], 0)
    map_pdo(bench, "tpdo2", ["modes_of_operation_display"], 3)
    map_pdo(bench, "rpdo1", ["modes_of_operation"], 0)
    bench.nmt(1)
    bench.idle(0.02)
    assert bench.taken(0x180 + NODE) == bench.taken(0x280 + NODE) == []
    for _ in range(7):
        bench.send(SYNC)
        bench.idle(0.002)
    assert len(bench.taken(0x180 + NODE)) == 1
    assert len(bench.taken(0x280 + NODE)) == 2
    bench.send(0x200 + NODE, b"\x09")
    bench.idle(0.01)
    assert bench.node.value("modes_of_operation") == 3
    bench.send(SYNC, b"\x01")
    assert bench.node.value("modes_of_operation") == 9
    bench.idle(0.002)
    bench.send(SYNC)
    assert bench.taken(0x180 + NODE) == [b"\x09"]


def test_mapping_rules(bench: NodeBench) -> None:
    """Mapping needs the PDO off and the count 0; what cannot be mapped, or is too long, has its abort code.

    Verifies: CO-07
    """

    def refuse(name: str, value: int, code: int) -> None:
        before = bench.read(name)
        with pytest.raises(Aborted) as refused:
            bench.write(name, value)
        assert refused.value.args[0] == code, (name, hex(value))
        assert bench.read(name) == before

    refuse("rpdo1_mapping_count", 0, 0x08000022)
    refuse("rpdo1_cob_id", 0x300 + NODE, 0x08000022)
    refuse("rpdo1_type", 245, 0x06090030)
    bench.write("rpdo1_cob_id", 1 << 31 | 0x200 + NODE)
    bench.write("tpdo1_cob_id", 1 << 31 | 0x180 + NODE)
    refuse("rpdo1_mapping_object_1", 0x60710010, 0x08000022)
    bench.write("rpdo1_mapping_count", 0)
    bench.write("tpdo1_mapping_count", 0)
    refuse("rpdo1_mapping_object_1", 0x60410010, 0x06040041)  # cannot be received
    refuse("rpdo1_mapping_object_1", 0x60710008, 0x06040041)  # wrong length
    refuse("rpdo1_mapping_object_1", 0x50000010, 0x06020000)
    refuse("rpdo1_mapping_object_1", 0x60710110, 0x06090011)
    refuse("tpdo1_mapping_object_1", 0x60A90020, 0x06040041)
    refuse("tpdo1_mapping_object_1", 0x00050008, 0x06020000)  # dummies are for receiving
    bench.write("rpdo1_mapping_object_1", 0x00070020)
    bench.write("rpdo1_mapping_object_2", 0x60FF0020)
    bench.write("rpdo1_mapping_object_3", 0x60600008)
    refuse("rpdo1_mapping_count", 3, 0x06040042)
    refuse("rpdo1_mapping_count", 9, 0x06090031)
    bench.write("rpdo1_mapping_count", 2)
    refuse("rpdo1_cob_id", 0x123, 0x06090030)
    refuse("rpdo1_cob_id", 1 << 29 | 0x205, 0x06090030)
    bench.write("rpdo1_cob_id", 0x321)
    bench.nmt(1)
    bench.send(0x321, struct.pack("<Ii", 0xFFFFFFFF, -12_345))
    assert bench.node.value("target_velocity") == -12_345


def test_ids_in_use(bench: NodeBench) -> None:
    """No CAN-ID twice among SYNC, EMCY and PDOs in use; EMCY's ID and a TPDO's inhibit time stay while they are valid.

    Verifies: CO-07
    """

    def refuse(name: str, value: int, code: int) -> None:
        with pytest.raises(Aborted) as refused:
            bench.write(name, value)
        assert refused.value.args[0] == code, (name, hex(value))

    refuse("tpdo1_inhibit_time", 500, 0x08000022)
    refuse("emcy_cob_id", 0x90, 0x08000022)
    for used in (0x200 + NODE, 0x180 + NODE, EMCY, 0, 0x580 + NODE, 0x700 + NODE):
        refuse("sync_cob_id", used, 0x06090030)
    for name, own in (("emcy_cob_id", EMCY), ("rpdo2_cob_id", 0x300 + NODE), ("tpdo2_cob_id", 0x280 + NODE)):
        bench.write(name, 1 << 31 | own)
        for used in (SYNC, 0x200 + NODE, 0x180 + NODE, 0x600 + NODE):
            refuse(name, used, 0x06090030)
    bench.write("sync_cob_id", 0x300 + NODE)
    refuse("rpdo2_cob_id", 0x300 + NODE, 0x06090030)
    bench.write("sync_cob_id", SYNC)
    bench.write("rpdo2_cob_id", 0x280 + NODE)
    refuse("tpdo2_cob_id", 0x280 + NODE, 0x06090030)
    bench.write("tpdo2_inhibit_time", 500)
    bench.write("tpdo2_cob_id", 0x300 + NODE)
    bench.write("emcy_cob_id", EMCY)


def test_refused_pdos(bench: NodeBench) -> None:
    """Too short, too long, or with a value out of range: told once, and all or nothing is taken.

    Verifies: CO-08
    """
    bench.write("emcy_inhibit_time", 0)
    bench.nmt(1)
    for _ in range(3):
        bench.send(0x400 + NODE, struct.pack("<Hh", 6, 1))
        bench.idle(0.002)
    assert emcy(bench) == [(0x8210, 0x11, 0, 3)]
    assert bench.state == "disabled"
    bench.send(0x400 + NODE, struct.pack("<Hi", 6, 1_000_001))
    bench.idle(0.002)
    assert emcy(bench) == [(0x8200, 0x11, 0, 0x60FF0003)]
    assert bench.state == "disabled"
    bench.send(0x300 + NODE, struct.pack("<Hb", 6, 10))  # torque without the current loop
    bench.send(0x400 + NODE, struct.pack("<Hih", 6, 777, -1))
    bench.idle(0.005)
    assert bench.node.value("modes_of_operation") == 3
    assert emcy(bench) == [(0x8220, 0x11, 0, 3), (0x8200, 0x11, 0, 0x60600002)]
    assert (bench.state, bench.node.value("target_velocity")) == ("ready", 777)
    bench.send(0x400 + NODE, struct.pack("<Hi", 0, 0))
    bench.idle(0.002)
    assert emcy(bench) == [], "good and bad ones may take turns"
    bench.idle(CALM_S)
    bench.send(0x400 + NODE, struct.pack("<Hi", 0, 0))
    bench.idle(0.005)
    assert sorted(emcy(bench)) == [(0, 0x11, 0, 0x8200), (0, 0x11, 0, 0x8210), (0, 0x11, 0, 0x8220)], "not RPDO2's"
    bench.send(0x300 + NODE, struct.pack("<Hb", 0, 3))
    bench.idle(0.002)
    assert emcy(bench) == [(0, 0, 0, 0x8200)]
    assert bench.read("counter_pdos_refused") == 5
    assert [bench.read(f"error_field_error_{k}") for k in (1, 2, 3, 4)] == [0x8220, 0x8200, 0x8200, 0x8210]
    bench.write("error_field_count", 0)
    assert [bench.read(f"error_field_error_{k}") for k in (1, 2, 3)] == [0, 0, 0]


def test_a_good_pdo_does_not_end_the_error_of_another(bench: NodeBench) -> None:
    """A short RPDO beside a good one, 50 a second each, is told once; switched off it is in order.

    Verifies: CO-08
    """
    bench.nmt(1)
    for _ in range(100):
        bench.send(0x400 + NODE, struct.pack("<H", 6))
        bench.send(0x200 + NODE, struct.pack("<H", 6))
        bench.idle(0.02)
    assert emcy(bench) == [(0x8210, 0x11, 0, 3)]
    bench.write("rpdo3_cob_id", 1 << 31 | 0x400 + NODE)
    bench.idle(0.02)
    assert emcy(bench) == [(0, 0, 0, 0x8210)]


def test_a_pdo_that_is_good_and_bad_in_turn(bench: NodeBench) -> None:
    """One RPDO, short every second time, is told once; the others' errors and lost frames are told in time beside it.

    Verifies: CO-08
    """
    bench.nmt(1)
    told = []
    for k in range(1500):
        bench.send(0x200 + NODE, b"\6")
        bench.idle(0.001)
        bench.send(0x200 + NODE, b"\6\0")
        bench.idle(0.001)
        if k == 100:
            bench.send(0x500 + NODE, struct.pack("<Hhb", 0, 0, 0))
        if k == 200:
            bench.node.overrun()
        told += [(k, code, ended) for code, _, _, ended in emcy(bench)]
    assert [(code, ended) for _, code, ended in told] == [(0x8210, 1), (0x8220, 4), (0x8110, 0), (0, 0x8110)]
    assert [k for k, code, _ in told if code][1] < 110 and [k for k, code, _ in told if code][2] < 210


def test_emcy_inhibit(bench: NodeBench) -> None:
    """Between two EMCY lies the inhibit time; what came and went meanwhile is still told.

    Verifies: CO-08
    """
    bench.write("emcy_inhibit_time", 2000)
    bench.nmt(1)
    for data in (b"", struct.pack("<Hi", 6, 1_000_001)):
        bench.send(0x400 + NODE, data)
    bench.write("rpdo3_cob_id", 1 << 31 | 0x400 + NODE)
    bench.idle(0.05)
    assert [code for code, *_ in emcy(bench)] == [0x8210]
    bench.idle(0.2)
    assert [code for code, *_ in emcy(bench)] == [0x8200]
    bench.idle(0.4)
    assert [(code, ended) for code, _, _, ended in emcy(bench)] == [(0, 0x8210), (0, 0x8200)]
    bench.write("emcy_cob_id", 1 << 31 | EMCY)
    bench.send(0x400 + NODE, b"")
    bench.idle(1.0)
    assert emcy(bench) == []


def test_queue_keeps_room_for_answers(bench: NodeBench) -> None:
    """With no frame taken off, PDOs stop first; SDO answers still find room.

    Verifies: CO-08
    """
    map_pdo(bench, "tpdo1", ["modes_of_operation"], inhibit=0)
    bench.nmt(1)
    for k in range(40):
        bench.node.lib.fl_can_receive(0x300 + NODE, 0, 3, bytes([0, 0, 3 if k % 2 else 9]))
        bench.drive.now_us += 1000
        bench.node.step(bench.now_us)
    bench.node.lib.fl_can_receive(0x600 + NODE, 0, 8, bytes.fromhex("4041600000000000"))
    bench.collect()
    assert len(bench.frames) <= 16
    assert bench.frames[-1].id == 0x580 + NODE
    assert bench.read("counter_frames_dropped") > 0
