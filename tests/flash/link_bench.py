# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The loader's C link in this process: a model of the registers that it uses, and frames made from the page alone.

UART, CAN controller and SPI flash as the register reference describes them; the clock goes on with every access.
"""

from __future__ import annotations

import struct
import zlib
from collections import deque
from functools import cache
from pathlib import Path
from typing import NamedTuple

from fluxlock.firmware.toolchain import SW, build_link_library, host_headers
from fluxlock.headers import CData, bind

REGISTERS = Path(__file__).with_name("link_registers.c")
SYS_TIME, UART, CAN, SPI = 0x8000000C, 0x80003000, 0x8000F000, 0x80010000
EXTENDED, REMOTE = 1 << 31, 1 << 30
TO_LOADER, TO_HOST = 0x1FB00000, 0x1FB00100
FLASH_CAN_SETUP = 0x3A0C00
FIFO = 32


class Sent(NamedTuple):
    """A frame that the controller was given to send."""

    identifier: int  # as the register has it: bit 31 extended
    data: bytes


def packed(code: int, payload: bytes) -> bytes:
    """Frame of docs/reference/boot.md without what its line adds."""
    body = bytes([code, len(payload) & 0xFF, len(payload) >> 8]) + payload
    return body + zlib.crc32(body).to_bytes(4, "little")


def segmented(code: int, payload: bytes, mark: int) -> list[bytes]:
    """Data of the CAN frames that carry it."""
    whole, found = packed(code, payload), []
    while whole:
        found.append(bytes([mark << 6 | len(found)]) + whole[:7])
        whole = whole[7:]
    return found


class Chip:
    """Registers: UART, CAN controller, SPI flash, clock."""

    def __init__(self, setup: bytes = b"", clocks_an_access: int = 100) -> None:
        self.clock, self.clocks_an_access = 0, clocks_an_access
        self.to_uart: deque[int] = deque()
        self.from_uart = bytearray()
        self.flash = {FLASH_CAN_SETUP + i: byte for i, byte in enumerate(setup)}
        self.control = self.bit_timing = self.pending = 0
        self.filters = [[0, 0] for _ in range(8)]
        self.fifo: deque[tuple[int, bytes]] = deque()
        self.waiting: dict[int, Sent] = {}  # by buffer
        self.sent: list[Sent] = []
        self.dead = False  # the bus carries nothing
        self._tx = [0, 0, 0]
        self._spi: list[int] = []
        self._spi_rx = 0

    def hear(self, identifier: int, data: bytes) -> None:
        """A frame on the bus, kept if a filter matches it; identifier as the register has it."""
        for wanted, mask in self.filters:
            if mask >> 29 & 1 and not (identifier ^ wanted) & mask & ~(1 << 29):
                if len(self.fifo) < FIFO:
                    self.fifo.append((identifier, data))
                return

    def read(self, address: int) -> int:
        """A register."""
        self.clock += self.clocks_an_access
        if address == SYS_TIME:
            return self.clock & 0xFFFFFFFF
        if address == UART + 8:
            return 1 << 8 | self.to_uart.popleft() if self.to_uart else 0
        if address == UART + 12:
            return 0b101
        if address == SPI + 8:
            return self._spi_rx
        if address == CAN + 8:
            return sum(1 << buffer for buffer in self.waiting)
        if CAN + 0x30 <= address <= CAN + 0x3C:
            if not self.fifo:
                return 0
            identifier, data = self.fifo[0]
            words = struct.unpack("<2I", data.ljust(8, b"\0"))
            return (identifier, *words, 1 << 31 | len(data))[(address - CAN - 0x30) // 4]
        raise AssertionError(f"read of {address:#x}")

    def write(self, address: int, value: int) -> None:
        """A register."""
        self.clock += self.clocks_an_access
        place = address - CAN
        if address == UART + 4:
            self.from_uart.append(value)
        elif address == SPI:
            self._spi = [] if value & 1 else self._spi
        elif address == SPI + 4:
            self._spi.append(value)
            at = int.from_bytes(bytes(self._spi[1:4]), "big") + len(self._spi) - 5
            self._spi_rx = self.flash.get(at, 0xFF) if self._spi[0] == 3 and len(self._spi) > 4 else 0xFF
        elif place == 0:
            self.control = value
        elif place == 4:
            self.bit_timing = value
        elif 0x20 <= place <= 0x28:
            self._tx[(place - 0x20) // 4] = value
        elif place == 0x2C:
            self._command(value)
        elif place == 0x44:
            self.fifo.popleft()
        elif 0x80 <= place < 0xC0:
            self.filters[(place - 0x80) % 0x20 // 4][place >= 0xA0] = value
        else:
            assert address == UART, f"write of {address:#x}"

    def _command(self, value: int) -> None:
        data = struct.pack("<2I", *self._tx[1:])[: value >> 8 & 15]
        for buffer in range(3):
            if value >> buffer & 1:
                assert buffer not in self.waiting, "a put into a waiting buffer"
                self.waiting[buffer] = Sent(self._tx[0], data)
            if value >> 4 + buffer & 1:
                self.waiting.pop(buffer, None)
        if not self.dead:
            self.sent += [self.waiting.pop(buffer) for buffer in sorted(self.waiting)]

    def answers(self) -> list[Sent]:
        """What was sent since they were last taken."""
        found, self.sent = self.sent, []
        return found


class Received(NamedTuple):
    """A frame as the loader has it."""

    code: int
    payload: bytes
    on_can: bool
    mark: int  # 0 to 3


@cache
def types() -> CData:
    """Of the link, and of the registers that this module plays."""
    return bind([*host_headers(), REGISTERS.with_suffix(".h")], SW)


@cache
def library() -> CData:
    """The link's functions."""
    return types().dlopen(str(build_link_library(REGISTERS)))


class Link:
    """sw/images/boot/link.c on a chip."""

    def __init__(self, chip: Chip) -> None:
        self.chip = chip
        self.lib = library()
        self._calls = types().callback("reader_t", chip.read), types().callback("writer_t", chip.write)
        self.lib.fl_link_registers(*self._calls)
        self._link = types().new("link_t *")
        self.lib.link_configure(self._link)

    def receive(self, limit_ms: int = 1) -> Received | None:
        """The next frame."""
        frame = types().new("link_frame_t *")
        if not self.lib.link_receive(self._link, frame, limit_ms):
            return None
        return Received(frame.code, bytes(frame.payload[0 : frame.length]), frame.on_can, frame.mark >> 6)

    def send(self, answer: Received) -> None:
        """An answer."""
        fields = {"code": answer.code, "length": len(answer.payload), "on_can": answer.on_can, "mark": answer.mark << 6}
        frame = types().new("link_frame_t *", fields | {"payload": answer.payload})
        self.lib.link_send(self._link, frame)

    def leave(self) -> None:
        """As before the firmware starts."""
        self.lib.link_leave()
