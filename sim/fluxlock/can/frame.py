# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""CAN frames as bits on the wire: layout, checksum, stuffing."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

POLYNOMIAL = 0b1100_0101_1001_1001  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
CRC_BITS = 15
STANDARD_HEADER, EXTENDED_HEADER = 19, 39  # bits from start of frame to data length code
IDE_PLACE = 13  # bits before the one that tells the formats apart


@dataclass(frozen=True)
class Frame:
    """A data or remote frame; `dlc` is the code on the wire, above 8 it means 8 bytes."""

    id: int
    ext: bool = False
    rtr: bool = False
    dlc: int = 0
    data: bytes = b""

    def __post_init__(self) -> None:
        if not 0 <= self.id < 1 << (29 if self.ext else 11):
            raise ValueError(f"identifier {self.id:#x} out of range")
        if not 0 <= self.dlc <= 15 or len(self.data) != (0 if self.rtr else min(self.dlc, 8)):
            raise ValueError(f"{len(self.data)} bytes do not go with the length code {self.dlc}")

    @classmethod
    def draw(cls, rng: random.Random) -> Frame:
        """A random frame of any kind; long runs of equal bits are frequent."""
        ext, rtr, dlc = rng.random() < 0.5, rng.random() < 0.15, rng.choice([*range(9), rng.randrange(16)])
        width = 29 if ext else 11
        identifier = rng.choice([rng.getrandbits(width), 0, (1 << width) - 1, 0x0F83E0F8 & ((1 << width) - 1)])
        fill = rng.choice([None, None, 0x00, 0xFF, 0x0F, 0x83])
        count = 0 if rtr else min(dlc, 8)
        return cls(identifier, ext, rtr, dlc, rng.randbytes(count) if fill is None else bytes([fill]) * count)


class WireBit(NamedTuple):
    """A bit that a transmitter sends between start of frame and checksum."""

    level: int
    arbitration: bool = False  # identifier and remote bit: whoever sends recessive may be overruled
    stuff: bool = False


def number(bits: Sequence[int]) -> int:
    """Bits, most significant first, as a number."""
    value = 0
    for bit in bits:
        value = 2 * value + bit
    return value


def bits_of(value: int, width: int) -> list[int]:
    """A number as bits, most significant first."""
    return [value >> place & 1 for place in reversed(range(width))]


def checksum(bits: Sequence[int]) -> int:
    """Remainder of the bits, shifted up by fifteen places, divided by the polynomial."""
    rest = number(bits) << CRC_BITS
    for place in reversed(range(len(bits))):
        if rest >> (place + CRC_BITS) & 1:
            rest ^= POLYNOMIAL << place
    return rest


def header(frame: Frame) -> list[WireBit]:
    """Start of frame to data length code, without stuff bits."""
    remote = int(frame.rtr)
    fixed: list[tuple[list[int], bool]]
    if frame.ext:
        high, low = bits_of(frame.id >> 18, 11), bits_of(frame.id & 0x3FFFF, 18)
        fixed = [([0], False), ([*high, 1, 1, *low, remote], True), ([0, 0], False)]
    else:
        fixed = [([0], False), ([*bits_of(frame.id, 11), remote], True), ([0, 0], False)]
    fixed.append((bits_of(frame.dlc, 4), False))
    return [WireBit(level, arbitration) for levels, arbitration in fixed for level in levels]


def wire(frame: Frame) -> list[WireBit]:
    """Start of frame to the last bit of the checksum, or the stuff bit behind it."""
    plain = header(frame) + [WireBit(bit) for byte in frame.data for bit in bits_of(byte, 8)]
    plain += [WireBit(bit) for bit in bits_of(checksum([bit.level for bit in plain]), CRC_BITS)]
    sent: list[WireBit] = []
    for place, bit in enumerate(plain):
        sent.append(bit)
        if len(sent) >= 5 and len({other.level for other in sent[-5:]}) == 1:
            following = place + 1 < len(plain) and plain[place + 1].arbitration
            sent.append(WireBit(1 - bit.level, following, True))
    return sent


def length(bits: Sequence[int]) -> int | None:
    """Bits from start of frame to checksum, without stuff bits, as far as the bits tell; None: not yet."""
    if len(bits) <= IDE_PLACE:
        return None
    ext = bits[IDE_PLACE]
    top = EXTENDED_HEADER if ext else STANDARD_HEADER
    if len(bits) < top:
        return None
    remote = bits[32 if ext else 12]
    count = 0 if remote else min(number(bits[top - 4 : top]), 8)
    return top + 8 * count + CRC_BITS


def parse(bits: Sequence[int]) -> tuple[Frame, bool]:
    """The frame in the bits from start of frame to checksum, without stuff bits, and whether the checksum is right."""
    ext = bits[IDE_PLACE] == 1
    top = EXTENDED_HEADER if ext else STANDARD_HEADER
    identifier = number([*bits[1:12], *bits[14:32]]) if ext else number(bits[1:12])
    body = bits[top:-CRC_BITS]
    data = bytes(number(body[i : i + 8]) for i in range(0, len(body), 8))
    good = checksum(bits[:-CRC_BITS]) == number(bits[-CRC_BITS:])
    return Frame(identifier, ext, bits[32 if ext else 12] == 1, number(bits[top - 4 : top]), data), good
