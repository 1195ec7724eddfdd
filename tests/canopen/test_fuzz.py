# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Random frames: the node stays whole whatever comes, and nonsense does not touch a running motor."""

from __future__ import annotations

import os
import random
import struct
from collections.abc import Callable

import pytest

from fluxlock.canopen.dictionary import Dictionary
from fluxlock.native.node import EXTENDED, REMOTE, Frame
from tests.canopen.node_bench import NODE, NodeBench

# Abort codes of the standard that the server may send.
ABORTS = {
    *(0x05030000, 0x05040001, 0x06010002, 0x06020000, 0x06040041, 0x06040042, 0x06040043, 0x06060000),
    *(0x06070012, 0x06070013, 0x06090011, 0x06090030, 0x06090031, 0x06090032, 0x08000020, 0x08000022, 0x08000024),
}
SDO, REPLY, BOOT_UP = 0x600 + NODE, 0x580 + NODE, 0x700 + NODE
FRAMES = 20_000
# At 1 Mbit/s a frame with eight bytes takes some 120 bits.
FRAMES_A_MS = 8
NONSENSE = 5_000
# Frames and as many console lines, in blocks that seed and number make: "count", or "count,first,seed" to go on.
NOISE = os.environ.get("FLUXLOCK_NOISE", "2000").split(",")
BLOCK = 100
RPM = 60_000


@pytest.fixture
def rng() -> random.Random:
    seed = random.SystemRandom().getrandbits(32)
    print(f"seed {seed}")
    return random.Random(seed)


def random_frame(rng: random.Random, bench: NodeBench) -> Frame:
    """Half of the frames go where the node listens, half of the SDOs to objects that there are."""
    data = rng.randbytes(rng.choice((8, 8, 8, rng.randrange(9))))
    kind = rng.random()
    if kind < 0.45:
        command = rng.choice(
            (0x22, 0x23, 0x27, 0x2B, 0x2F, 0x20, 0x21, 0x40, 0x60, 0x70, 0x00, 0x10, rng.randrange(256))
        )
        # Another node-ID would end the talk at the next reset.
        e = rng.choice([e for e in bench.node.dictionary.entries if e.name != "device_node_id"])
        place = rng.random()
        index = e.index if place < 0.9 else rng.randrange(1 << 16)
        sub = e.sub if place < 0.8 else rng.randrange(256)
        value = rng.choice((rng.randrange(16), rng.getrandbits(32), e.min & 0xFFFFFFFF, e.max & 0xFFFFFFFF))
        whole = struct.pack("<BHBI", command, index, sub, value)
        return Frame(SDO, whole if rng.random() < 0.95 else whole[: len(data)])
    if kind < 0.5:
        return Frame(0, bytes([rng.choice((1, 1, 1, 2, 128, 129, 130, rng.randrange(256))), rng.choice((0, NODE, 9))]))
    if kind < 0.75:
        return Frame(rng.choice((0x200, 0x300, 0x400, 0x500)) + NODE, data)
    if kind < 0.85:
        return Frame(rng.choice((0x80, 0x80 + NODE, SDO, 0x701 + rng.randrange(127), 0x7FF)), data)
    flags = rng.choice((0, 0, EXTENDED, REMOTE, EXTENDED | REMOTE))
    return Frame(rng.randrange(1 << 29 if flags & EXTENDED else 1 << 11), data, flags)


def nonsense(rng: random.Random, dictionary: Dictionary) -> Frame:
    """A frame that asks for nothing: every one of it must be refused or be of no concern."""
    data = rng.randbytes(8)
    unknown = struct.pack("<HB", rng.randrange(0x3000, 0x6000), rng.randrange(256))
    constant = rng.choice([e for e in dictionary.entries if e.access != "rw" and e.bytes])
    e = rng.choice([e for e in dictionary.entries if e.access == "rw" and e.bytes == 4 and e.max < 1 << 30])
    beyond = struct.pack("<BHBi", 0x23, e.index, e.sub, e.max + 1 + rng.randrange(1 << 20))
    read_only = struct.pack("<BHBI", 0x23, constant.index, constant.sub, rng.getrandbits(32))
    short = rng.choice(((0x200, 2), (0x300, 3), (0x400, 6), (0x500, 4)))
    makers: list[Callable[[], Frame]] = [
        lambda: Frame(SDO, bytes([rng.randrange(0xA0, 0x100)]) + data[1:]),
        lambda: Frame(SDO, bytes([rng.choice((0x40, 0x23, 0x21))]) + unknown + data[4:]),
        lambda: Frame(SDO, beyond),
        lambda: Frame(SDO, read_only),
        lambda: Frame(SDO, data[: rng.randrange(8)]),
        lambda: Frame(short[0] + NODE, data[: rng.randrange(short[1])]),
        lambda: Frame(0x400 + NODE, struct.pack("<Hi", rng.getrandbits(16), rng.randrange(1_000_001, 1 << 31))),
        lambda: Frame(0, bytes([rng.choice((2, 128, 129, 130)), NODE + 1 + rng.randrange(120)])),
        lambda: Frame(0, bytes([2, NODE, *data[: rng.randrange(1, 7)]])),
        lambda: Frame(0, bytes([rng.randrange(3, 128), NODE])),
        lambda: Frame(rng.choice((0, SDO, 0x200 + NODE)), bytes([2, NODE]), rng.choice((EXTENDED, REMOTE))),
        lambda: Frame(rng.randrange(0x680, 0x6E0), data),
        lambda: Frame(0x700 + rng.randrange(1, 128), bytes([rng.randrange(256)])),
    ]
    return rng.choice(makers)()


def test_any_frames(rng: random.Random) -> None:
    """After random frames every value is in its range, each SDO had at most one answer, and a reset brings all back.

    Verifies: CO-16
    """
    bench = NodeBench()
    assert bench.until("disabled", 0.1)
    # The range of the error list's count is that of a write.
    entries = [e for e in bench.node.dictionary.entries if e.bytes and e.name != "error_field_count"]
    numbers = [e for e in entries if not e.live]
    power_up = {e.name: bench.node.value(e.name) for e in numbers}
    told: set[int] = set()
    for k in range(FRAMES):
        bench.frames.clear()
        frame = random_frame(rng, bench)
        bench.send(frame.id, frame.data, frame.flags)
        answers = bench.taken(REPLY)
        assert len(answers) <= (frame.id == SDO and not frame.flags), (k, frame)
        for answer in answers:
            assert len(answer) == 8
            if answer[0] == 0x80:
                (code,) = struct.unpack_from("<I", answer, 4)
                assert code in ABORTS, (k, frame, hex(code))
                told.add(code)
        if k % 64 == 0:
            bench.run(0.001)
            for e in entries:
                assert e.min <= bench.node.value(e.name) <= e.max, (k, e.name)
    assert told >= {0x05040001, 0x06010002, 0x06020000, 0x06070012, 0x06090011, 0x06090030, 0x06090031}
    bench.node.memory = bytes(len(bench.node.memory))
    bench.nmt(129, 0)
    bench.idle(0.002)
    if bench.state == "fault":
        # Of the motor that it had started.
        bench.write("controlword", 0x80)
    assert bench.until("disabled", 2.0)
    changing = {"statusword", "dc_link_voltage", "current_actual", "torque_actual"}
    for name, value in power_up.items():
        assert name in changing or bench.node.value(name) == value, name
    bench.enable()


def test_nonsense_does_not_touch_the_motor(rng: random.Random) -> None:
    """At full bus load of refused frames the motor holds 60 000 r/min, no control tick is missed, commands act at once.

    Verifies: CO-16
    """
    b = NodeBench(speed_rpm=20_000)
    b.enable()
    b.turn(RPM)
    b.run(0.2)
    ticks, refused = b.bench.ticks, 0
    speeds = []
    written = [e.name for e in b.node.dictionary.entries if e.access == "rw" and e.name != "error_field_count"]
    kept = {name: b.node.value(name) for name in written}
    for k in range(NONSENSE):
        frame = nonsense(rng, b.node.dictionary)
        b.send(frame.id, frame.data, frame.flags)
        if k % FRAMES_A_MS == FRAMES_A_MS - 1:
            b.run(0.001)
            speeds.append(b.bench.model.rpm)
            refused += sum(answer[0] == 0x80 for answer in b.taken(REPLY))
            assert b.state == "enabled"
    assert refused > NONSENSE // 4
    assert b.bench.fw.state == "running"
    assert b.read("fault_total") == 0
    assert (min(speeds), max(speeds)) == (pytest.approx(RPM, rel=0.005), pytest.approx(RPM, rel=0.005))
    assert b.bench.fw.telemetry().tick % (1 << 16) == b.bench.ticks % (1 << 16)
    assert b.bench.ticks - ticks == NONSENSE // FRAMES_A_MS * 10
    assert kept == {name: b.node.value(name) for name in kept}
    b.write("target_velocity", RPM // 2)
    b.run(0.002)
    assert b.node.value("velocity_demand") < RPM


def crc8(data: bytes) -> int:
    """x^8 + x^2 + x + 1, begins with 0."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x107 if crc & 0x80 else 0)) & 0xFF
    return crc


def noisy_line(rng: random.Random) -> tuple[bytes, bool]:
    """A line that changes nothing, and whether it must be carried out."""
    text = rng.choice((b"get state", b"get fault", b"get measured_rpm", b"get vdc_v", b"faults"))
    line = text + b"*%02X" % crc8(text)
    kind = rng.random()
    if kind < 0.3:
        return line, True
    letters = [c for c in range(1, 256) if c not in b"\r\n\t *"]
    if kind < 0.7:
        at = rng.randrange(len(line))
        return line[:at] + bytes([rng.choice([c for c in letters if c != line[at]])]) + line[at + 1 :], False
    return bytes(rng.choices(letters, k=rng.randrange(1, 120))), False


def test_noise_on_bus_and_console() -> None:
    """Nonsense on the bus and a noisy console while the motor runs: every line has its answer, lost ones by name.

    Verifies: CO-16, FW-53
    """
    count, first, seed = (*map(int, NOISE), 0, random.SystemRandom().getrandbits(32))[:3]
    assert count >= BLOCK, f"FLUXLOCK_NOISE is COUNT or COUNT,FIRST,SEED, and {BLOCK} at least"
    b = NodeBench(speed_rpm=20_000)
    b.enable()
    b.turn(RPM)
    b.run(0.2)
    fw = b.bench.fw
    fw.replies()
    for block in range(first, first + count // BLOCK):
        print(f"seed {seed}, block {block}")
        rng = random.Random(f"{seed}/{block}")
        for _ in range(BLOCK):
            frame = nonsense(rng, b.node.dictionary)
            b.send(frame.id, frame.data, frame.flags)
            line, right = noisy_line(rng)
            lost = rng.randrange(1, 4) if rng.random() < 0.1 else 0
            if lost:
                fw.lib.fl_host_uart_lose(lost, False)
            fw.lib.fl_host_uart_send(line + b"\n", len(line) + 1)
            fw.poll()
            answers = [a.split("*")[0] for a in fw.replies()]
            answers = [a for a in answers if a == "ok" or a.startswith("error: ")]
            assert answers[:lost] == ["error: bytes lost"] * lost, (line, answers)
            assert len(answers) == lost + 1, (line, answers)
            assert (answers[-1] == "ok") == right, (line, answers)
        b.run(0.001)
        b.taken(REPLY)
        assert (b.state, fw.state) == ("enabled", "running")
        assert b.bench.model.rpm == pytest.approx(RPM, rel=0.005)
    assert b.read("fault_total") == 0
