# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The CANopen node of the host library: frames in and out, time from outside.

The drive behind it is the library's firmware (`fluxlock.firmware.host.HostFirmware` on the same library) and must have
booted. One node a process.
"""

from __future__ import annotations

from dataclasses import dataclass

from fluxlock.canopen.dictionary import Dictionary, load_dictionary
from fluxlock.firmware.binding import new, types
from fluxlock.headers import CData

EXTENDED, REMOTE = 1, 2
FILTERS = 8
NO_FILTER = 0xFFFFFFFF


@dataclass(frozen=True)
class Frame:
    """A CAN frame; flags: EXTENDED, REMOTE."""

    id: int
    data: bytes = b""
    flags: int = 0


class HostNode:
    """The node of a loaded library."""

    def __init__(self, library: CData, node_id: int) -> None:
        self.lib, self.node_id = library, node_id
        self.dictionary: Dictionary = load_dictionary()
        self._numbers = {entry.name: number for number, entry in enumerate(self.dictionary.entries)}

    def boot(self, now_us: int = 0) -> None:
        """Power-up: defaults, then what is stored."""
        self.lib.fl_can_boot(self.node_id, now_us & 0xFFFFFFFF)

    def receive(self, frame: Frame) -> None:
        """A frame from the bus."""
        self.lib.fl_can_receive(frame.id, frame.flags, len(frame.data), frame.data)

    def step(self, now_us: int) -> None:
        """Timers, drive profile, process data."""
        self.lib.fl_can_step(now_us & 0xFFFFFFFF)

    def sent(self) -> list[Frame]:
        """Frames that the node has sent since they were last taken."""
        found: list[Frame] = []
        can_id, data = new("uint32_t"), new("uint8_t[8]")
        while (length := self.lib.fl_can_next(can_id, data)) != self.lib.HOST_NO_FRAME:
            found.append(Frame(can_id[0], bytes(data[0:length])))
        return found

    def value(self, name: str) -> int:
        """Value of an object by its name, as an SDO upload would read it."""
        entry = self.dictionary[name]
        raw = int(self.lib.fl_can_value(self._numbers[name]))
        return raw - (1 << 32) if entry.signed and raw >> 31 else raw

    def bus_off(self) -> None:
        """The controller has gone bus-off."""
        self.lib.fl_can_bus_off()

    def bus_back(self) -> None:
        """Bus-off is over."""
        self.lib.fl_can_bus_back()

    def overrun(self) -> None:
        """Frames were lost before they were read."""
        self.lib.fl_can_overrun()

    def wanted(self) -> list[tuple[int, int]]:
        """Identifiers and masks of the frames that the node receives, as it gives them to a controller's filters."""
        mask = new("uint32_t")
        found = [(self.lib.fl_can_wanted(k, mask), mask[0]) for k in range(FILTERS)]
        return [(can_id, bits) for can_id, bits in found if can_id != NO_FILTER]

    @property
    def memory(self) -> bytes:
        """The non-volatile memory: the flash's sectors of both slots."""
        return bytes(types().buffer(self.lib.fl_can_memory(), self.lib.fl_can_memory_bytes()))

    @memory.setter
    def memory(self, data: bytes) -> None:
        types().memmove(self.lib.fl_can_memory(), data, self.lib.fl_can_memory_bytes())

    def fail_memory(self, failing: bool) -> None:
        """Writes to the non-volatile memory fail from now on, or work again."""
        self.lib.fl_flash_protect(int(failing))

    def cut_power(self, after_bytes: int, seed: int) -> None:
        """The flash loses its power when so many more bytes have been erased or programmed, within the next."""
        self.lib.fl_flash_cut(after_bytes, seed)

    def restore_power(self) -> None:
        """The flash answers again."""
        self.lib.fl_flash_power_up()
