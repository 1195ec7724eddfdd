# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The table of what the console reads, `sw/console/values.toml`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache

from fluxlock.base.paths import ROOT
from fluxlock.interface.names import c_strings, words

VALUES_FILE = ROOT / "sw" / "console" / "values.toml"


@dataclass(frozen=True)
class Value:
    """One value: a word, or numbers in the unit, blanks between them."""

    name: str
    text: str
    unit: str = ""
    words: str = ""  # list of names that it is one of

    @property
    def sentences(self) -> str:
        """What it is, with the words that it may be."""
        return (
            f"{self.text} One of {', '.join(f'`{word}`' for word in words(self.words))}." if self.words else self.text
        )


@cache
def load_values() -> tuple[Value, ...]:
    """All values in the order in which the console prints them."""
    return tuple(Value(**entry) for entry in tomllib.loads(VALUES_FILE.read_text(encoding="utf-8"))["value"])


def c_header() -> str:
    """`values_table.h`: numbers and names."""
    names = [value.name for value in load_values()]
    lines = [
        "// Generated from sw/console/values.toml. Do not edit.",
        "#ifndef FL_VALUES_TABLE_H",
        "#define FL_VALUES_TABLE_H",
        "",
        *(
            "typedef enum {",
            *(f"  ITEM_{value.name.upper()}," for value in load_values()),
            "  ITEM_COUNT,",
            "} item_t;",
        ),
        "",
        f"#define ITEM_NAMES {c_strings(names)}",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)
