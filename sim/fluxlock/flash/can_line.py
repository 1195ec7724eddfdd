# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The loader's frames on CAN (docs/reference/boot.md): segments of up to 8 bytes between two identifiers."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Protocol

from fluxlock.can.can_bus import has_taken
from fluxlock.flash.loader import LoaderError, pack, unpack

if TYPE_CHECKING:
    import can

# Of sw/images/boot/link.h; extended, the node-ID is added.
ID_TO_LOADER, ID_TO_HOST = 0x1FB00000, 0x1FB00100
NODE_DEFAULT, NODE_MAX = 0, 127
KBIT_PER_S_DEFAULT = 500
SEGMENT_BYTES = 7
PLACES, MARKS = 64, 4  # values of the two parts of a segment's first byte
# For the rest of an answer that has begun: frames of others go first, at 10 kbit/s each takes 15 ms.
SEGMENT_S = 0.3
# How long a sender waits for room, and how often it looks.
ROOM_S, RETRY_S = 0.1, 0.001


class Frames(Protocol):
    """Extended data frames on a bus."""

    def send(self, identifier: int, data: bytes) -> bool:
        """False: the bus takes none."""

    def receive(self, identifier: int, timeout_s: float) -> bytes | None:
        """Data of the next frame with an identifier; None: there is none in time."""

    def trouble(self) -> str:
        """What is wrong with the bus; empty: nothing is known."""


def segments(code: int, payload: bytes, mark: int) -> list[bytes]:
    """Data of the frames that carry a command or an answer. mark: of the attempt, 0 to 3."""
    packed = pack(code, payload)
    parts = [packed[i : i + SEGMENT_BYTES] for i in range(0, len(packed), SEGMENT_BYTES)]
    return [bytes([mark * PLACES + place]) + part for place, part in enumerate(parts)]


class CanLine:
    """The loader of a board on a bus. node: what is stored in the board's flash, 0 where nothing is."""

    def __init__(self, frames: Frames, node: int = NODE_DEFAULT) -> None:
        self.frames, self.node = frames, node
        self._mark = 0

    def send(self, code: int, payload: bytes) -> None:
        """See `fluxlock.flash.loader.Line`: each attempt has a mark of its own."""
        self._mark = (self._mark + 1) % MARKS
        for data in segments(code, payload, self._mark):
            if not self.frames.send(ID_TO_LOADER + self.node, data):
                return

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """See `fluxlock.flash.loader.Line`; what does not carry the mark of the last attempt is passed over."""
        packed, place = b"", 0
        while data := self.frames.receive(ID_TO_HOST + self.node, timeout_s):
            mark, number = divmod(data[0], PLACES)
            if mark != self._mark:
                continue
            timeout_s = max(timeout_s, SEGMENT_S)
            if number == 0:
                packed = b""
            elif number != place:
                packed, place = b"", PLACES
                continue
            packed, place = packed + data[1:], number + 1
            if found := unpack(packed):
                return found
        return None

    def trouble(self) -> str:
        """See `fluxlock.flash.loader.Line`."""
        hint = f"the bus shows no errors: is {self.node} the node-ID in the board's flash (0: none is)?"
        return self.frames.trouble() or hint


class PythonCan:
    """A bus of python-can; other traffic on it is passed over."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.errors = 0  # error frames that the interface has told of
        self.full = False  # the last frame found no room

    def send(self, identifier: int, data: bytes) -> bool:
        """See `Frames`: an interface whose bus carries nothing is full soon."""
        import can

        message = can.Message(arbitration_id=identifier, is_extended_id=True, data=data)
        end = time.monotonic() + ROOM_S
        try:
            while not has_taken(self.bus, message):
                if time.monotonic() > end:
                    self.full = True
                    return False
                time.sleep(RETRY_S)
        except (can.CanError, OSError) as error:
            # What has no number is a sender that has waited in vain.
            if getattr(error, "error_code", error) is not None:
                raise LoaderError(f"bus: {error}") from None
            self.full = True
            return False
        self.full = False
        return True

    def receive(self, identifier: int, timeout_s: float) -> bytes | None:
        """See `Frames`."""
        import can

        end = time.monotonic() + timeout_s
        while (left := end - time.monotonic()) > 0:
            try:
                message = self.bus.recv(left)
            except (can.CanError, OSError) as error:
                raise LoaderError(f"bus: {error}") from None
            if message is None:
                break
            if message.is_error_frame:
                self.errors += 1
            elif message.is_extended_id and message.arbitration_id == identifier and message.data:
                return bytes(message.data)
        return None

    def trouble(self) -> str:
        """See `Frames`."""
        if self.full or self.errors:
            return "the bus does not carry frames: is the bit rate that of the board, and the board on the bus?"
        return ""
