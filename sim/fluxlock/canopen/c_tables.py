# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""C tables of the object dictionary: `canopen_objects.h`, included by `sw/canopen/dictionary.c`."""

from __future__ import annotations

import re

from fluxlock.base.paths import ROOT
from fluxlock.canopen.dictionary import STRING_MAX_BYTES, Dictionary, DictionaryError, Entry
from fluxlock.interface import settings

READER = ROOT / "sw" / "canopen" / "drive_link.c"  # of the live objects: link_read

FLAG_NAMES = (
    "OD_READ",
    "OD_WRITE",
    "OD_RECEIVABLE",
    "OD_SENDABLE",
    "OD_STORED",
    "OD_LIVE",
    "OD_NODE_RELATIVE",
    "OD_LIMIT",
)


def _flags(entry: Entry) -> str:
    flags = (
        True,
        entry.access == "rw",
        entry.receivable,
        entry.sendable,
        entry.store,
        entry.live,
        entry.node_relative,
        entry.limit,
    )
    return " | ".join(name for name, there in zip(FLAG_NAMES, flags, strict=True) if there)


def _row(entry: Entry) -> str:
    default = entry.default if isinstance(entry.default, int) else 0
    numbers = (entry.min, entry.max, default) if entry.bytes else (0, 0, 0)
    words = ", ".join(f"0x{number & 0xFFFFFFFF:X}u" for number in numbers)
    choices = sum(1 << choice for choice in entry.choices)
    place = f"0x{entry.index:04X}u, {entry.sub}u, OD_{entry.type.upper()}"
    return f"  {{{place}, {_flags(entry)}, 0x{choices:X}u, {words}}}, \\"


def check_reads(dictionary: Dictionary, reader: str) -> None:
    """DictionaryError names the live objects that the C function does not read. The compiler names the reverse.

    reader: text of the C source. An object is read if the function names its number, or a range that holds it. The
    objects of the settings are read by their table.
    """
    body = reader[reader.index("uint32_t link_read(") :].partition("\n}\n")[0]
    numbers = {f"OD_{entry.name.upper()}": number for number, entry in enumerate(dictionary.entries)}
    read = {numbers[name] for name in re.findall(r"\b(?:case|number ==) (OD_\w+)", body) if name in numbers}
    for first, last in re.findall(r"number >= (OD_\w+) && number <= (OD_\w+)", body):
        if first in numbers and last in numbers:
            read |= set(range(numbers[first], numbers[last] + 1))
    by_table = {f"setting_{setting.name}" for setting in settings.objects()}
    entries = enumerate(dictionary.entries)
    left = [e.name for number, e in entries if e.live and number not in read and e.name not in by_table]
    if left:
        raise DictionaryError(f"{READER}: link_read does not read the object {', '.join(left)}")


def c_header(dictionary: Dictionary) -> str:
    """Numbers of the entries, table of the entries, constant strings."""
    entries = dictionary.entries
    lines = [
        "// Generated from sw/canopen/objects.toml. Do not edit.",
        "#ifndef FL_CANOPEN_OBJECTS_H",
        "#define FL_CANOPEN_OBJECTS_H",
        "",
        "// Numbers of the entries, by index and sub-index.",
        "typedef enum {",
        *(f"  OD_{entry.name.upper()} = {number}," for number, entry in enumerate(entries)),
        "} od_number_t;",
        "",
        f"#define OD_COUNT {len(entries)}u",
        f"#define OD_STRING_MAX {STRING_MAX_BYTES}u",
        f"#define OD_STORED_COUNT {len(dictionary.stored)}u",
        f"#define OD_STORE_WORD 0x{dictionary.store_word:08X}u",
        "",
        "// Entries of the settings, and which setting each is.",
        f"#define OD_SETTINGS_FIRST ((uint32_t)OD_SETTING_{settings.objects()[0].name.upper()})",
        f"#define OD_SETTINGS_END (OD_SETTINGS_FIRST + {len(settings.objects())}u)",
        f"#define OD_SETTINGS {{{', '.join(s.number for s in settings.objects())}}}",
        "",
        "// index, sub-index, type, flags, choices, min, max, default",
        "#define OD_ENTRIES { \\",
        *map(_row, entries),
        "}",
        "",
        "// number, text",
        "#define OD_STRINGS { \\",
        *(f'  {{OD_{e.name.upper()}, "{e.default}"}}, \\' for e in entries if isinstance(e.default, str)),
        "}",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)
