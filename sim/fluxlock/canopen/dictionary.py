# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The object dictionary: `sw/canopen/objects.toml` spread out into entries, one an index and sub-index."""

from __future__ import annotations

import tomllib
import zlib
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.generated import SourceError
from fluxlock.interface import settings
from fluxlock.interface.settings import Setting

OBJECTS_FILE = ROOT / "sw" / "canopen" / "objects.toml"
STRING_MAX_BYTES = 32
# Name in the source: code of the data type in CANopen, bytes (0: as long as it is), signed.
TYPES: dict[str, tuple[int, int, bool]] = {
    "i8": (0x02, 1, True),
    "i16": (0x03, 2, True),
    "i32": (0x04, 4, True),
    "u8": (0x05, 1, False),
    "u16": (0x06, 2, False),
    "u32": (0x07, 4, False),
    "string": (0x09, 0, False),
    "domain": (0x0F, 0, False),
}
NODE_PREFIX = "$NODEID+"


class DictionaryError(SourceError):
    """The source of the object dictionary contradicts itself."""


@dataclass(frozen=True)
class Entry:
    """One index and sub-index."""

    index: int
    sub: int
    name: str  # object and sub-index, unique
    sub_name: str  # within the object
    type: str
    access: str  # const, ro, rw
    default: int | str | None  # None: the drive gives it, or 0
    node_relative: bool  # the node-ID is added to the default
    min: int
    max: int
    choices: tuple[int, ...]
    map: str  # "", rx, tx, both
    store: bool
    limit: bool  # where what is stored is lost its least value holds
    live: bool
    unit: str
    scale: float
    text: str

    @property
    def type_code(self) -> int:
        """Data type as the standard counts."""
        return TYPES[self.type][0]

    @property
    def bytes(self) -> int:
        """Size of a number, 0 of a string or a domain."""
        return TYPES[self.type][1]

    @property
    def signed(self) -> bool:
        """Whether a number has a sign."""
        return TYPES[self.type][2]

    @property
    def receivable(self) -> bool:
        """May be mapped into an RPDO."""
        return self.map in {"rx", "both"}

    @property
    def sendable(self) -> bool:
        """May be mapped into a TPDO."""
        return self.map in {"tx", "both"}

    @property
    def mapping(self) -> int:
        """How a mapping object names it: index, sub-index, length in bits."""
        return self.index << 16 | self.sub << 8 | 8 * self.bytes

    def value(self, node: int) -> int | str | None:
        """Default with the node-ID."""
        return self.default + node if self.node_relative and isinstance(self.default, int) else self.default


@dataclass(frozen=True)
class Object:
    """One index."""

    index: int
    name: str
    kind: str  # var, array, record
    text: str
    entries: tuple[Entry, ...]


@dataclass(frozen=True)
class Dictionary:
    """All objects by rising index."""

    version: int
    vendor: str
    product: str
    objects: tuple[Object, ...]

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All entries by index and sub-index."""
        return tuple(entry for item in self.objects for entry in item.entries)

    @cached_property
    def stored(self) -> tuple[Entry, ...]:
        """What 0x1010 keeps, in the order of the stored image."""
        return tuple(entry for entry in self.entries if entry.store)

    @cached_property
    def store_word(self) -> int:
        """Version in the upper half, checksum of what is stored in the lower one."""
        layout = ";".join(f"{e.index:04X}:{e.sub}:{e.type}" for e in self.stored)
        return self.version << 16 | zlib.crc32(layout.encode()) & 0xFFFF

    def __getitem__(self, name: str) -> Entry:
        for entry in self.entries:
            if entry.name == name:
                return entry
        raise KeyError(name)

    def at(self, index: int, sub: int = 0) -> Entry:
        """Entry of an index and sub-index."""
        for entry in self.entries:
            if (entry.index, entry.sub) == (index, sub):
                return entry
        raise KeyError(f"{index:#06x}:{sub}")


def _entry(item: dict[str, Any], index: int, object_name: str, sub: int, suffix: str, cob_offset: int) -> Entry:
    kind = item["type"]
    if kind not in TYPES:
        raise DictionaryError(f"{object_name}: unknown type {kind}")
    _, size, signed = TYPES[kind]
    low, high = (-(1 << 8 * size - 1), (1 << 8 * size - 1) - 1) if signed else (0, (1 << 8 * size) - 1)
    default = item.get("default")
    relative = isinstance(default, str) and default.startswith(NODE_PREFIX)
    if relative:
        default = int(str(default).removeprefix(NODE_PREFIX), 0) + cob_offset
    entry = Entry(
        index=index,
        sub=sub,
        name=object_name if "index" in item else f"{object_name}_{item['name']}{suffix}",
        sub_name=object_name if "index" in item else f"{item['name']}{suffix}",
        type=kind,
        access=item["access"],
        default=default,
        node_relative=relative,
        min=item.get("min", low),
        max=item.get("max", high),
        choices=tuple(item.get("choices", ())),
        map=item.get("map", ""),
        store=item.get("store", False),
        limit=item.get("limit", False),
        live=item.get("live", False),
        unit=item.get("unit", ""),
        scale=float(item.get("scale", 1.0)),
        text=item.get("text", ""),
    )
    if size and not low <= entry.min <= entry.max <= high:
        raise DictionaryError(f"{entry.name}: range beyond its type")
    if isinstance(entry.default, int) and not entry.node_relative and not entry.min <= entry.default <= entry.max:
        raise DictionaryError(f"{entry.name}: default out of range")
    if any(not 0 <= choice <= 15 for choice in entry.choices):
        raise DictionaryError(f"{entry.name}: a choice is not within 0..15")
    return entry


def _setting(setting: Setting) -> dict[str, Any]:
    """Sub-index of a setting, as the source would list it."""
    item: dict[str, Any] = {
        "n": setting.object,
        "name": setting.name,
        "type": "u8" if setting.kind != "number" else "i32" if setting.signed else "u32",
        "access": "rw",
        "live": True,
        "unit": setting.unit,
        "scale": 10.0**-setting.decimals,
        "text": setting.sentences,
    }
    if setting.kind != "number":
        item["choices"] = list(range(len(setting.choices) or 2))
    elif setting.min is not None and setting.max is not None and not setting.zero:
        item |= {"min": setting.min, "max": setting.max}
    return item


def _subs(item: dict[str, Any], index: int, name: str, cob_offset: int) -> list[Entry]:
    found: list[Entry] = []
    for sub in map(_setting, settings.objects()) if item.get("settings") else item["sub"]:
        count = sub.get("count")
        for k in range(count or 1):
            suffix = f"_{k + 1}" if count else ""
            found.append(_entry(sub, index, name, sub["n"] + k, suffix, cob_offset))
    if found[0].sub != 0:
        highest = {"type": "u8", "access": "const", "default": found[-1].sub, "name": "count"}
        found.insert(0, _entry(highest, index, name, 0, "", 0))
    return found


def _spread(item: dict[str, Any]) -> list[Object]:
    """The objects that one table of the source stands for."""
    result = []
    for k in range(item.get("repeat", 1)):
        name, index = item["name"].format(n=k + 1), item["index"] + k
        cob_offset = k * item.get("cob_step", 0)
        entries = (
            _subs(item, index, name, cob_offset)
            if "sub" in item or "settings" in item
            else [_entry(item, index, name, 0, "", 0)]
        )
        result.append(Object(index, name, item.get("kind", "var"), item.get("text", ""), tuple(entries)))
    return result


def _with_mapping(item: Object, mapped: list[Entry]) -> Object:
    values = {0: len(mapped), **{i + 1: entry.mapping for i, entry in enumerate(mapped)}}
    entries = (Entry(**{**entry.__dict__, "default": values.get(entry.sub, 0)}) for entry in item.entries)
    return Object(item.index, item.name, item.kind, item.text, tuple(entries))


@cache
def load_dictionary(path: Path = OBJECTS_FILE) -> Dictionary:
    """Read the source; DictionaryError if it contradicts itself."""
    with path.open("rb") as file:
        data = tomllib.load(file)
    objects: list[Object] = []
    mapped: dict[str, list[str]] = {}
    for item in data["object"]:
        spread = _spread(item)
        objects += spread
        mapped |= {o.name: names for o, names in zip(spread, item.get("map_defaults", ()), strict=False)}
    by_name = {entry.name: entry for o in objects for entry in o.entries}
    places = [(entry.index, entry.sub) for o in objects for entry in o.entries]
    if len(by_name) != len(places):
        raise DictionaryError(f"{path}: names are not unique")
    if places != sorted(set(places)):
        raise DictionaryError(f"{path}: objects are not in the order of their indices")
    missing = sorted({name for names in mapped.values() for name in names} - set(by_name))
    if missing:
        raise DictionaryError(f"{path}: mapped objects that are not there: {', '.join(missing)}")
    objects = [_with_mapping(o, [by_name[n] for n in mapped[o.name]]) if o.name in mapped else o for o in objects]
    return Dictionary(int(data["version"]), data["vendor"], data["product"], tuple(objects))
