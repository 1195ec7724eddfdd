# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""DBC of the frames of one node: PDOs as mapped after power-up, and the fixed services."""

from __future__ import annotations

from dataclasses import dataclass

from fluxlock.canopen.dictionary import Dictionary, Entry

MASTER, DRIVE = "Master", "Drive"
CAN_ID_MASK = 0x7FF
PDOS = tuple(f"{kind}pdo{n}" for kind in "rt" for n in range(1, 5))


@dataclass(frozen=True)
class Signal:
    """Bits of a frame, little endian."""

    name: str
    start: int
    bits: int
    signed: bool = False
    scale: float = 1.0
    unit: str = ""

    def line(self, receiver: str) -> str:
        """Its line of the file; the limits 0|0 mean none."""
        sign = "-" if self.signed else "+"
        return f' SG_ {self.name} : {self.start}|{self.bits}@1{sign} ({self.scale!r},0) [0|0] "{self.unit}" {receiver}'


@dataclass(frozen=True)
class Message:
    """A frame."""

    name: str
    can_id: int
    bytes: int
    sender: str
    signals: tuple[Signal, ...]


def _signals(mapped: list[Entry]) -> tuple[Signal, ...]:
    found, start = [], 0
    for entry in mapped:
        unit = entry.unit.replace("·", "")
        found.append(Signal(entry.name, start, 8 * entry.bytes, entry.signed, entry.scale, unit))
        start += 8 * entry.bytes
    return tuple(found)


def mapped(dictionary: Dictionary, name: str) -> list[Entry]:
    """Entries that a PDO, `rpdo1` to `tpdo4`, carries after power-up."""
    by_mapping = {entry.mapping: entry for entry in dictionary.entries if entry.bytes}
    count = dictionary[f"{name}_mapping_count"].default
    words = [dictionary[f"{name}_mapping_object_{i + 1}"].default for i in range(int(count or 0))]
    return [by_mapping[int(word or 0)] for word in words]


def messages(dictionary: Dictionary, node: int) -> list[Message]:
    """Every frame that a node sends or takes."""

    def can_id(name: str) -> int:
        return int(dictionary[name].value(node) or 0) & CAN_ID_MASK

    found = []
    for name in PDOS:
        entries = mapped(dictionary, name)
        sender = MASTER if name.startswith("r") else DRIVE
        size = sum(entry.bytes for entry in entries)
        found.append(Message(name.upper(), can_id(f"{name}_cob_id"), size, sender, _signals(entries)))
    sdo = (Signal("command", 0, 8), Signal("index", 8, 16), Signal("sub_index", 24, 8), Signal("data", 32, 32))
    emcy = (Signal("code", 0, 16), Signal("register", 16, 8), Signal("fault", 24, 8), Signal("detail", 32, 32))
    found += [
        Message("NMT", 0, 2, MASTER, (Signal("nmt_command", 0, 8), Signal("nmt_node", 8, 8))),
        Message("SYNC", can_id("sync_cob_id"), 0, MASTER, ()),
        Message("EMCY", can_id("emcy_cob_id"), 8, DRIVE, emcy),
        Message("SDO_request", can_id("sdo_server_request_cob_id"), 8, MASTER, sdo),
        Message("SDO_response", can_id("sdo_server_response_cob_id"), 8, DRIVE, sdo),
        Message("heartbeat", 0x700 + node, 1, DRIVE, (Signal("nmt_state", 0, 8),)),
    ]
    return found


def dbc(dictionary: Dictionary, node: int) -> str:
    """Text of the DBC file for a node-ID."""
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", f"BU_: {MASTER} {DRIVE}", ""]
    for message in messages(dictionary, node):
        receiver = DRIVE if message.sender == MASTER else MASTER
        lines.append(f"BO_ {message.can_id} {message.name}: {message.bytes} {message.sender}")
        lines += [signal.line(receiver) for signal in message.signals]
        lines.append("")
    return "\n".join(lines)
