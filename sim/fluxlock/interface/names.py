# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Names that the drive counts, `sw/drive/names.toml`, its faults, `sw/drive/faults.toml`, and the C made from both."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.generated import SourceError

NAMES_FILE = ROOT / "sw" / "drive" / "names.toml"
FAULTS_FILE = ROOT / "sw" / "drive" / "faults.toml"


class NamesError(SourceError):
    """The tables contradict themselves or the firmware."""


@dataclass(frozen=True)
class Names:
    """A list: the name of a number stands at that place."""

    words: tuple[str, ...]
    constants: tuple[str, ...]
    type: str
    bits: bool


@dataclass(frozen=True)
class Fault:
    """A fault of the drive. bit: of the CANopen error register, beside bit 0. trip: the cause that means it, if any."""

    name: str
    emcy: int
    bit: int
    text: str
    trip: str = ""

    @property
    def constant(self) -> str:
        """Its number in C."""
        return f"FAULT_{self.name.upper()}"


def constant(prefix: str, word: str) -> str:
    """Name of a C constant for a word."""
    return re.sub(r"[^A-Z0-9]", "_", f"{prefix}_{word}".upper())


@cache
def load_names() -> dict[str, Names]:
    """All lists."""
    lists = tomllib.loads(NAMES_FILE.read_text(encoding="utf-8"))
    return {
        name: Names(
            words=tuple(entry["words"]),
            constants=tuple(constant(entry["prefix"], word) for word in entry.get("constants", entry["words"])),
            type=entry.get("type", ""),
            bits=entry.get("bits", False),
        )
        for name, entry in lists.items()
    }


def words(name: str) -> tuple[str, ...]:
    """The words of a list."""
    return load_names()[name].words


@cache
def load_faults(path: Path = FAULTS_FILE) -> tuple[Fault, ...]:
    """All faults by their numbers, from 1 on; NamesError names the one that is wrong."""
    faults: list[Fault] = []
    for entry in tomllib.loads(path.read_text(encoding="utf-8"))["fault"]:
        name = entry.get("name", "?")
        if missing := [key for key in ("name", "emcy", "bit", "text") if key not in entry]:
            raise NamesError(f"fault {name}: no {missing[0]}")
        if unknown := sorted(set(entry) - {"name", "trip", "emcy", "bit", "text"}):
            raise NamesError(f"fault {name}: unknown key {unknown[0]}")
        if entry.get("trip", "") not in ("", *words("trip")):
            raise NamesError(f"fault {name}: unknown trip {entry['trip']}")
        if name in [fault.name for fault in faults]:
            raise NamesError(f"fault {name} stands twice")
        faults.append(Fault(**entry))
    return tuple(faults)


def fault_names() -> tuple[str, ...]:
    """Names of the faults by their numbers, without `none`."""
    return tuple(fault.name for fault in load_faults())


def trip_fault(cause: str) -> str:
    """Fault that a trip cause means."""
    return next(fault.name for fault in load_faults() if fault.trip == cause)


def check_uses(sources: Iterable[Path], faults: tuple[Fault, ...] | None = None) -> None:
    """NamesError names the faults that no C source reports. The compiler names the reverse."""
    words: set[str] = set()
    for path in sources:
        if path.suffix == ".c":
            words.update(re.findall(r"\w+", path.read_text(encoding="utf-8")))
    unused = [fault.name for fault in faults or load_faults() if not fault.trip and fault.constant not in words]
    if unused:
        raise NamesError(f"{FAULTS_FILE}: no C source reports the fault {', '.join(unused)}")


def _enumeration(names: Names) -> str:
    values = [f"{c} = {f'1u << {k}' if names.bits else k}" for k, c in enumerate(names.constants)]
    return f"{'typedef ' if names.type else ''}enum {{ {', '.join(values)} }}{f' {names.type}' if names.type else ''};"


def c_strings(words: Iterable[str]) -> str:
    """An initialiser of texts."""
    return "{" + ", ".join(f'"{word}"' for word in words) + "}"


def c_header() -> str:
    """`names.h`: enumerations, the words for people, the faults."""
    faults = load_faults()
    lines = [
        "// Generated from sw/drive/names.toml and sw/drive/faults.toml. Do not edit.",
        "#ifndef FL_NAMES_H",
        "#define FL_NAMES_H",
        "",
        *(_enumeration(names) for names in load_names().values()),
        "",
        *(f"#define {name.upper()}_COUNT {len(names.words)}" for name, names in load_names().items()),
        *(f"#define {name.upper()}_WORDS {c_strings(names.words)}" for name, names in load_names().items()),
        "",
        "typedef enum {",
        "  FAULT_NONE,",
        *(f"  {fault.constant}," for fault in faults),
        "  FAULT_COUNT,",
        "} fault_t;",
        "",
        f"#define FAULT_WORDS {c_strings(['none', *fault_names()])}",
        "// Trip, the fault that it means; the most dangerous one first.",
        "#define FAULT_TRIPS { \\",
        *(f"  {{{constant('TRIP', fault.trip)}, {fault.constant}}}, \\" for fault in faults if fault.trip),
        "}",
        "// By number of the fault: EMCY code, error register.",
        "#define FAULT_ERRORS { \\",
        *(f"  [{fault.constant}] = {{0x{fault.emcy:04X}u, 0x{1 << fault.bit | 1:02X}u}}, \\" for fault in faults),
        "}",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)
