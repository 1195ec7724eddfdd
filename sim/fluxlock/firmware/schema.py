# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The parameter schema: `sw/params.toml` read once, from which C header, block writer and documentation come."""

from __future__ import annotations

import tomllib
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.interface.settings import Setting, load_settings

SCHEMA_FILE = ROOT / "sw" / "params.toml"
MAGIC = 0x464C5850  # "FLXP"
HEADER_WORDS = 4  # magic, version, payload bytes, CRC-32 of the payload
SHIFT_MIN, SHIFT_MAX = 4, 62


@dataclass(frozen=True)
class Parameter:
    """One entry of the schema."""

    name: str
    kind: str  # "i32" or "gain"
    count: int
    unit: str
    min: int
    max: int
    description: str
    member: str = ""  # of a group, `group.member`: of its first word

    @property
    def group(self) -> str:
        """The record of `control/` that it is a part of, if it is."""
        return self.member.partition(".")[0]

    @property
    def words(self) -> int:
        """Number of 32-bit words in the block."""
        return self.count * (2 if self.kind == "gain" else 1)


@dataclass(frozen=True)
class Group:
    """Parameters, one after the other, that are a record of `control/`, which takes them as they lie in the block."""

    name: str
    record: str  # type in C
    header: str


@dataclass(frozen=True)
class Schema:
    """All parameters in block order."""

    version: int
    parameters: tuple[Parameter, ...]
    groups: tuple[Group, ...] = ()

    @cached_property
    def words(self) -> int:
        """Payload length in words."""
        return sum(p.words for p in self.parameters)

    @cached_property
    def version_word(self) -> int:
        """Version in the upper half, checksum of the layout in the lower: neither can be forgotten."""
        layout = ";".join(f"{p.name}:{p.kind}:{p.count}:{p.unit}" for p in self.parameters)
        return (self.version << 16) | (zlib.crc32(layout.encode()) & 0xFFFF)

    @cached_property
    def offsets(self) -> dict[str, int]:
        """First word of every parameter in the payload."""
        result: dict[str, int] = {}
        position = 0
        for p in self.parameters:
            result[p.name] = position
            position += p.words
        return result

    def __getitem__(self, name: str) -> Parameter:
        for p in self.parameters:
            if p.name == name:
                return p
        raise KeyError(name)


def _of_setting(setting: Setting) -> dict[str, Any]:
    """The parameter that a setting begins with, as the schema would list it."""
    return {
        "name": setting.parameter,
        "unit": setting.unit or {"switch": "bool", "choice": "enum"}.get(setting.kind, ""),
        "min": setting.range[0],
        "max": setting.range[1],
        "description": f"Setting at the start. {setting.sentences}",
    }


def _entries(listed: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    for entry in listed:
        if entry.get("settings"):
            yield from (_of_setting(setting) for setting in load_settings() if setting.own_parameter)
        else:
            yield entry


@cache
def load_schema(path: Path = SCHEMA_FILE) -> Schema:
    """Read the schema file."""
    with path.open("rb") as file:
        data = tomllib.load(file)
    parameters = tuple(
        Parameter(
            name=entry["name"],
            kind=entry.get("kind", "i32"),
            count=int(entry.get("count", 1)),
            unit=entry["unit"],
            min=int(entry.get("min", SHIFT_MIN) if entry.get("kind") == "gain" else entry["min"]),
            max=int(entry.get("max", SHIFT_MAX) if entry.get("kind") == "gain" else entry["max"]),
            description=entry["description"],
            member=entry.get("member", ""),
        )
        for entry in _entries(data["parameter"])
    )
    names = [p.name for p in parameters]
    if len(set(names)) != len(names):
        raise ValueError(f"{path}: parameter names are not unique")
    groups = tuple(Group(entry["name"], entry["record"], entry["header"]) for entry in data["group"])
    runs = [group for group, _ in groupby(p.group for p in parameters) if group]
    if sorted(runs) != sorted(group.name for group in groups):
        raise ValueError(f"{path}: each group is one run of parameters: {runs}")
    return Schema(int(data["version"]), parameters, groups)


def _fields(schema: Schema) -> Iterator[str]:
    """Members of the struct."""
    records = {group.name: group.record for group in schema.groups}
    for group, parameters in groupby(schema.parameters, lambda p: p.group):
        if group:
            yield f"  {records[group]} {group};"
            continue
        for p in parameters:
            c_type = "gain_t" if p.kind == "gain" else "int32_t"
            suffix = f"[{p.count}]" if p.count > 1 else ""
            yield f"  {c_type} {p.name}{suffix};  // {p.unit}: {p.description}"


def _places(schema: Schema) -> Iterator[str]:
    """Every member of a group lies where the block has it."""
    for p in schema.parameters:
        if p.group:
            place = f"offsetof(parameters_t, {p.member}) == {4 * schema.offsets[p.name]}u"
            yield f'_Static_assert({place}, "{p.name}");'


def _range(p: Parameter) -> tuple[int, int]:
    """Least and greatest value, of a gain the greatest shift and the least."""
    return (p.max, p.min) if p.kind == "gain" else (p.min, p.max)


def c_header(schema: Schema) -> str:
    """The generated `params.h`: struct, block header and range tables."""
    of_value = [r for p in schema.parameters for r in [_range(p)] * p.count]
    ranges = list(dict.fromkeys(of_value))
    lines = [
        "// Generated from sw/params.toml. Do not edit.",
        "#ifndef FL_PARAMS_H",
        "#define FL_PARAMS_H",
        "",
        "#include <stddef.h>",
        "#include <stdint.h>",
        "",
        '#include "control/fixed.h"',
        *sorted({f'#include "{group.header}"' for group in schema.groups}),
        "",
        f"#define PARAMETER_MAGIC 0x{MAGIC:08X}u",
        f"#define PARAMETER_VERSION 0x{schema.version_word:08X}u",
        f"#define PARAMETER_WORDS {schema.words}u",
        "",
        "typedef struct {",
        *_fields(schema),
        "} parameters_t;",
        "",
        "typedef struct {",
        "  uint32_t magic;",
        "  uint32_t version;",
        "  uint32_t length_bytes;",
        "  uint32_t crc;",
        "  parameters_t parameters;",
        "} parameter_block_t;",
        "",
        '_Static_assert(sizeof(parameters_t) == 4u * PARAMETER_WORDS, "parameter layout");',
        *_places(schema),
        "",
        "// Range of one value of the block. min above max: a gain, two words, the second within max..min.",
        "typedef struct {",
        "  int32_t min;",
        "  int32_t max;",
        "} parameter_range_t;",
        "",
        f"#define PARAMETER_VALUES {len(of_value)}u",
        "// Number of each value's range, in block order, and the ranges: many values share one.",
        "#define PARAMETER_RANGE_OF { \\",
        *(f"  {ranges.index(r)}, \\" for r in of_value),
        "}",
        "#define PARAMETER_RANGES { \\",
        *(f"  {{{low}, {high}}}, \\" for low, high in ranges),
        "}",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def markdown_table(schema: Schema) -> str:
    """The parameter reference as a Markdown table."""
    rows = ["| parameter | unit | range | meaning |", "|---|---|---|---|"]
    for p in schema.parameters:
        name = f"`{p.name}`" + (f" × {p.count}" if p.count > 1 else "")
        limits = "gain" if p.kind == "gain" else f"{p.min} … {p.max}"
        rows.append(f"| {name} | {p.unit} | {limits} | {p.description} |")
    return "\n".join(rows) + "\n"
