# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The loader's frames on CAN and UART: its C on a model of the registers, against frames made from the page alone."""

from __future__ import annotations

import random
import struct
import zlib

import pytest

from fluxlock.flash.can_line import segments
from tests.flash.link_bench import EXTENDED, REMOTE, TO_HOST, TO_LOADER, Chip, Link, Received, Sent, packed, segmented

MINE = TO_LOADER | EXTENDED
CLOCKS_A_MS = 50_000


def stored(node: int, kbit_per_s: int) -> bytes:
    """Node-ID and bit rate as the flash holds them."""
    words = struct.pack("<2I", node, kbit_per_s)
    return words + struct.pack("<I", zlib.crc32(words))


def bit_cycles(word: int) -> int:
    """Clocks a bit, of the bit timing register."""
    return ((word & 0xFF) + 1) * ((word >> 8 & 0x3F) + (word >> 16 & 0xF) + 3)


def draw(rng: random.Random) -> Received:
    """A command as the loader must have it."""
    length = rng.choice([0, 4, 5, 259, 260, rng.randrange(261)])
    return Received(rng.randrange(256), rng.randbytes(length), True, rng.randrange(4))


def parts_of(wanted: Received) -> list[bytes]:
    """Its segments, which the host's code makes too."""
    parts = segmented(wanted.code, wanted.payload, wanted.mark)
    assert parts == segments(wanted.code, wanted.payload, wanted.mark)
    return parts


def foreign(rng: random.Random, chip: Chip, own: int = MINE) -> None:
    """A frame that is not for this loader."""
    near = TO_LOADER + rng.choice([0, 1, 2, 64, 127, 256])
    kinds = [near | EXTENDED, TO_HOST | EXTENDED, own | REMOTE, rng.randrange(0x800), rng.getrandbits(29)]
    if (kind := rng.choice(kinds)) != own:
        chip.hear(kind, rng.randbytes(rng.randrange(9)))


def take(link: Link, chip: Chip, parts: list[bytes], rng: random.Random | None = None) -> list[Received]:
    """What the loader makes of segments, with foreign frames between them."""
    found = []
    for part in parts:
        if rng is not None and rng.random() < 0.5:
            foreign(rng, chip)
        chip.hear(MINE, part)
        found.append(link.receive())
    return [frame for frame in found if frame is not None]


def test_frames_pass() -> None:
    """Every command arrives as it was sent, between foreign frames; answers carry the mark and the node's identifier.

    Verifies: BOOT-07
    """
    seed = random.randrange(1 << 32)
    print("seed", seed)
    rng = random.Random(seed)
    for node in (0, 1, 127):
        chip = Chip(stored(node, 500) if node else b"")
        link = Link(chip)
        for _ in range(20):
            wanted = draw(rng)
            own = (TO_LOADER + node) | EXTENDED
            found = []
            for place, part in enumerate(parts_of(wanted)):
                for _ in range(rng.randrange(3)):
                    foreign(rng, chip, own)
                chip.hear(((TO_LOADER + 64) | EXTENDED), part)  # for another loader
                chip.hear(own, part)
                if place % 30 == 29:  # as many as the FIFO holds wait there
                    found.append(link.receive())
            assert [frame for frame in [*found, link.receive()] if frame is not None] == [wanted]
            payload = rng.randbytes(rng.choice([0, 4, 8]))
            link.send(Received(wanted.code, payload, True, wanted.mark))
            identifier = (TO_HOST + node) | EXTENDED
            assert chip.answers() == [Sent(identifier, part) for part in segmented(wanted.code, payload, wanted.mark)]
        assert not chip.from_uart


def test_longest_frame() -> None:
    """A whole page with its address, longer than the controller's FIFO, at the pace of a bus.

    Verifies: BOOT-07
    """
    rng = random.Random(1)
    chip = Chip()
    link = Link(chip)
    for mark in range(4):
        wanted = Received(3, rng.randbytes(260), True, mark)
        assert take(link, chip, parts_of(wanted), rng) == [wanted]


def test_broken_frames() -> None:
    """Segments lost, twice, in another order, with a flipped bit, from another attempt, cut short: never taken.

    The next whole frame is.

    Verifies: BOOT-07
    """
    seed = random.randrange(1 << 32)
    print("seed", seed)
    rng = random.Random(seed)
    chip = Chip()
    link = Link(chip)
    for _ in range(60):
        wanted = draw(rng)
        parts = parts_of(wanted)
        kind = rng.choice(["lost", "twice", "order", "bit", "mark", "short"] if len(parts) > 2 else ["bit", "short"])
        at = rng.randrange(1, len(parts) - 1) if len(parts) > 2 else rng.randrange(len(parts))
        if kind == "lost":
            del parts[rng.randrange(len(parts))]
        elif kind == "twice":
            parts.insert(at, parts[at])
        elif kind == "order":
            other = rng.choice([i for i in range(len(parts)) if i != at])
            parts[at], parts[other] = parts[other], parts[at]
        elif kind == "bit":
            broken = bytearray(parts[at])
            broken[rng.randrange(1, len(broken))] ^= 1 << rng.randrange(8)
            parts[at] = bytes(broken)
        elif kind == "mark":
            parts[at] = bytes([parts[at][0] ^ rng.choice([0x40, 0x80, 0xC0])]) + parts[at][1:]
        else:
            parts[at] = parts[at][:-1]
        assert take(link, chip, parts, rng) == [], f"{kind}, segment {at} of {len(parts)}"
        good = draw(rng)
        assert take(link, chip, parts_of(good), rng) == [good]


def test_both_lines() -> None:
    """Bytes of a frame on the UART and segments of one on CAN come by turns: both are taken, each with its line.

    Verifies: BOOT-07
    """
    rng = random.Random(3)
    chip = Chip()
    link = Link(chip)
    for _ in range(10):
        on_can, on_uart = draw(rng), draw(rng)._replace(on_can=False)
        left, found = list(b"\xa5" + packed(on_uart.code, on_uart.payload)), []
        for part in parts_of(on_can):
            chip.to_uart.extend(left[:4])
            del left[:4]
            chip.hear(MINE, part)
            found.append(link.receive())
        chip.to_uart.extend(left)
        found.append(link.receive(limit_ms=20))
        got = [frame for frame in found if frame is not None]
        assert on_can in got and [f._replace(mark=on_uart.mark) for f in got if not f.on_can] == [on_uart]
        link.send(on_uart._replace(payload=b"1234"))
        assert chip.from_uart == b"\xa5" + packed(on_uart.code, b"1234") and not chip.answers()
        chip.from_uart.clear()


@pytest.mark.parametrize(
    ("setup", "node", "kbit_per_s"),
    [
        (b"", 0, 500),
        (stored(5, 1000), 5, 1000),
        (stored(127, 10), 127, 10),
        (stored(5, 1000)[:-1] + b"\x00", 0, 500),
        (stored(0, 1000), 0, 500),
        (stored(128, 1000), 0, 500),
        (stored(5, 333), 5, 500),
        (bytes(12), 0, 500),
    ],
)
def test_setup(setup: bytes, node: int, kbit_per_s: int) -> None:
    """Node-ID and bit rate are those of the flash if its CRC holds and such a bit can be, else the defaults.

    Verifies: BOOT-08
    """
    chip = Chip(setup)
    link = Link(chip)
    assert bit_cycles(chip.bit_timing) == 50_000 // kbit_per_s
    assert chip.control == 0b1001, "enabled, bus-off ends by itself"
    assert [mask >> 29 & 1 for _, mask in chip.filters] == [1, 0, 0, 0, 0, 0, 0, 0]
    chip.hear((TO_LOADER + node) | EXTENDED, segmented(1, b"", 2)[0])
    assert link.receive() == Received(1, b"", True, 2)


def test_dead_bus() -> None:
    """On a bus that carries nothing an answer and the leave end in time, nothing is left to be sent later.

    Verifies: BOOT-08
    """
    chip = Chip()
    link = Link(chip)
    chip.dead = True
    for _ in range(3):
        start = chip.clock
        link.send(Received(0, bytes(8), True, 1))
        assert chip.clock - start < 105 * CLOCKS_A_MS and len(chip.waiting) == 3
    start = chip.clock
    link.leave()
    assert chip.clock - start < 105 * CLOCKS_A_MS
    assert not chip.waiting and chip.control == 0b1000, "as after a reset"
