# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Python accessors of the object dictionary: text of a module with a property an entry, in its unit.

The module needs nothing but Python: it reads and writes through two callbacks, which any CANopen master provides, for
example `sdo.upload` and `sdo.download` of the package `canopen`.
"""

from __future__ import annotations

from fluxlock.canopen.dictionary import Dictionary, Entry

HEAD = '''"""Object dictionary of the drive. Generated from sw/canopen/objects.toml. Do not edit."""

from __future__ import annotations

from collections.abc import Callable

Read = Callable[[int, int], bytes]
Write = Callable[[int, int, bytes], object]


class Objects:
    """Reads and writes objects by name, numbers in their unit."""

    def __init__(self, read: Read, write: Write) -> None:
        self._read, self._write = read, write

    def _number(self, index: int, sub: int, signed: bool) -> int:
        return int.from_bytes(self._read(index, sub), "little", signed=signed)

    def _put(self, index: int, sub: int, size: int, signed: bool, value: int) -> None:
        self._write(index, sub, value.to_bytes(size, "little", signed=signed))
'''


def _documentation(entry: Entry) -> str:
    unit = f" ({entry.unit})" if entry.unit else ""
    text = f" {entry.text}" if entry.text else ""
    return f"0x{entry.index:04X}:{entry.sub} {entry.type}{unit}.{text}"


def _property(entry: Entry) -> list[str]:
    scaled = entry.scale != 1.0
    kind = "float" if scaled else "int"
    place = f"0x{entry.index:04X}, {entry.sub}"
    number = f"self._number({place}, {entry.signed})"
    value = f"round(value / {entry.scale!r})" if scaled else "value"
    if entry.type == "string":
        kind, number = "str", f'self._read({place}).decode("ascii", "replace")'
    elif entry.type == "domain":
        kind, number = "bytes", f"self._read({place})"
    elif scaled:
        number = f"{number} * {entry.scale!r}"
    lines = [
        "",
        "    @property",
        f"    def {entry.name}(self) -> {kind}:",
        f'        """{_documentation(entry)}"""',
        f"        return {number}",
    ]
    if entry.access != "rw":
        return lines
    put = f"self._put({place}, {entry.bytes}, {entry.signed}, {value})"
    if entry.type == "string":
        put = f'self._write({place}, value.encode("ascii"))'
    return [
        *lines,
        "",
        f"    @{entry.name}.setter",
        f"    def {entry.name}(self, value: {kind}) -> None:",
        f"        {put}",
    ]


def accessors(dictionary: Dictionary) -> str:
    """Text of the module."""
    lines = [line for entry in dictionary.entries for line in _property(entry)]
    return HEAD + "\n".join(lines) + "\n"
