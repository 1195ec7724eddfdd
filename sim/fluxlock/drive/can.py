# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A master beside the chip on its CAN bus: frames, and objects of the CANopen node by SDO."""

from __future__ import annotations

import struct

from fluxlock.can.frame import Frame
from fluxlock.can.timing import chip_timing
from fluxlock.clock import CLOCK_HZ
from fluxlock.config.can import Can
from fluxlock.cosim.plan import CanPlace
from fluxlock.cosim.session import LISTEN_CYCLES, Session

NMT, SDO_ANSWER, SDO_REQUEST = 0x000, 0x580, 0x600
OPERATIONAL = 1
UPLOAD, ABORT = 0x40, 0x80
ANSWER_S = 0.02


class CanError(AssertionError):
    """The node on the bus did not answer, or refused; the text says what."""


class CanMaster:
    """A node that acknowledges, keeps what it hears in `heard`, and sends. The drive's node is `node_id`."""

    def __init__(self, session: Session, bus: Can) -> None:
        self.node_id = bus.node_id
        self.heard: list[Frame] = []
        self._session = session
        self._node = session.native.open_can(chip_timing(CLOCK_HZ, bus.bit_rate_kbit_per_s), CanPlace())

    def send(self, identifier: int, data: bytes = b"") -> None:
        """Queue a data frame of up to 8 bytes with an identifier of 11 bits."""
        self._node.send(Frame(identifier, dlc=len(data), data=data))

    def take(self) -> list[Frame]:
        """Frames of the chip since the last call."""
        self._listen()
        taken, self.heard = self.heard, []
        return taken

    async def receive(self, identifier: int, within_s: float = ANSWER_S) -> Frame:
        """The next frame with this identifier, taken out of `heard`. Raises CanError if none comes."""
        session = self._session
        end = session.cycle + round(within_s * session.plan.clock_hz)
        while True:
            self._listen()
            for frame in self.heard:
                if frame.id == identifier:
                    self.heard.remove(frame)
                    return frame
            if session.cycle >= end:
                raise CanError(f"no frame {identifier:#x} within {within_s:g} s")
            await session.wait_until(session.cycle + LISTEN_CYCLES)

    def operate(self) -> None:
        """Tell the node to go operational (NMT)."""
        self.send(NMT, bytes([OPERATIONAL, self.node_id]))

    async def write(self, index: int, sub: int, value: int, size: int) -> None:
        """Write an object of 1 to 4 bytes (SDO, expedited)."""
        await self._request(
            struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub), value.to_bytes(size, "little", signed=value < 0)
        )

    async def read(self, index: int, sub: int = 0, signed: bool = False) -> int:
        """Read an object of up to 4 bytes (SDO, expedited)."""
        answer = await self._request(struct.pack("<BHB", UPLOAD, index, sub), b"")
        size = 4 - (answer[0] >> 2 & 3)
        return int.from_bytes(answer[4 : 4 + size], "little", signed=signed)

    async def _request(self, head: bytes, value: bytes) -> bytes:
        self.send(SDO_REQUEST + self.node_id, head + value.ljust(4, b"\0"))
        answer = (await self.receive(SDO_ANSWER + self.node_id)).data
        if answer[0] == ABORT:
            index, sub = struct.unpack("<HB", answer[1:4])
            raise CanError(
                f"the node refused object {index:#06x}:{sub}, abort code {struct.unpack('<I', answer[4:])[0]:#010x}"
            )
        return answer

    def _listen(self) -> None:
        while (frame := self._node.take()) is not None:
            self.heard.append(frame)
