# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Objects of a drive's CANopen node by their names, over SDO."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol, TypeVar

from fluxlock.canopen.dictionary import load_dictionary

if TYPE_CHECKING:
    import can

# Answer of the node: a simulated one may be slow.
SDO_S = 2.0
# CiA 402: state bits of the statusword, controlwords, mode of operation.
STATE_BITS, ENABLED, FAULT = 0x6F, 0x27, 0x08
DISABLE_VOLTAGE, SHUTDOWN, DISABLE_OPERATION, ENABLE, FAULT_RESET = 0x00, 0x06, 0x07, 0x0F, 0x80
PROFILE_VELOCITY = 3
Result = TypeVar("Result")


class NodeError(RuntimeError):
    """A node that does not answer, or a bus that does not carry; the message says which, and what to look at."""


class AbortedError(NodeError):
    """A node that answers and refuses."""


class Client(Protocol):
    """Of SDOs: `SdoClient` of the package `canopen`, with what it raises."""

    def upload(self, index: int, subindex: int) -> bytes:
        """Read an object."""

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""


class Objects:
    """Of one node."""

    def __init__(self, sdo: Client, node_id: int) -> None:
        self._sdo, self._node_id = sdo, node_id
        self._entries = load_dictionary()

    def has(self, name: str) -> bool:
        """Whether there is an object of this name."""
        return any(entry.name == name for entry in self._entries.entries)

    def read(self, name: str) -> bytes:
        """Its bytes. Raises NodeError."""
        entry = self._entries[name]
        return self._asked(lambda: bytes(self._sdo.upload(entry.index, entry.sub)))

    def number(self, name: str) -> int:
        """As a number. Raises NodeError."""
        return int.from_bytes(self.read(name), "little", signed=self._entries[name].signed)

    def write(self, name: str, value: int) -> None:
        """Write a number. Raises NodeError, of a value that the object cannot hold too."""
        entry = self._entries[name]
        try:
            data = value.to_bytes(entry.bytes, "little", signed=entry.signed)
        except OverflowError:
            raise AbortedError(f"{name} holds {entry.min} to {entry.max}") from None
        self._asked(lambda: self._sdo.download(entry.index, entry.sub, data))

    def _asked(self, ask: Callable[[], Result]) -> Result:
        # Slow to import, and not needed by other commands.
        import can
        import canopen

        try:
            return ask()
        except canopen.SdoAbortedError as error:
            raise AbortedError(f"node {self._node_id} refuses: {error}") from None
        except canopen.SdoCommunicationError as error:
            text = f"node {self._node_id} does not answer: {error}; are node-ID and bit rate right?"
            raise NodeError(text) from None
        except (can.CanError, OSError) as error:
            raise NodeError(f"bus: {error}") from None


@contextmanager
def objects_of(bus: can.BusABC, node_id: int) -> Iterator[Objects]:
    """The node of a board on a bus, which is closed at the end."""
    # Slow to import, and not needed by other commands.
    import canopen

    network = canopen.Network(bus)
    node = network.add_node(node_id)
    node.sdo.RESPONSE_TIMEOUT = SDO_S
    network.connect()
    try:
        yield Objects(node.sdo, node_id)
    finally:
        network.disconnect()
