# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The table of the drive's settings, `sw/drive/settings.toml`: read once, for the console, CANopen, files and pages."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.generated import SourceError
from fluxlock.interface.names import c_strings, constant, words

SETTINGS_FILE = ROOT / "sw" / "drive" / "settings.toml"
KINDS = ("switch", "choice", "number")
METHODS = words("method")  # by their bits
KEYS = (
    *("name", "kind", "choices", "unit", "decimals", "min", "max", "zero", "permitted"),
    *("methods", "stored", "functions", "group", "parameter", "file", "default", "object", "text"),
)


class SettingsError(SourceError):
    """The table contradicts itself or the firmware."""


@dataclass(frozen=True)
class Setting:
    """One setting. Its number, in `unit` / 10^decimals, is what C and CANopen exchange."""

    name: str
    kind: str
    text: str
    choices: tuple[str, ...] = ()
    unit: str = ""
    decimals: int = 0
    min: int | None = None  # None: the firmware's own
    max: int | None = None
    zero: bool = False  # 0 is permitted besides
    permitted: str = ""  # for the page, where the range depends on the parameters
    methods: tuple[str, ...] = METHODS[:1]
    stored: tuple[str, ...] | None = None  # members of settings_t; None: the setting itself
    functions: tuple[str, ...] = ()
    group: str = ""
    parameter: str = ""  # that it begins with
    own_parameter: bool = False  # the parameter is made from this table
    file: str = ""  # key below [drive] of a scenario, dotted
    default: bool | int | str | None = None  # of that key; None: the model has the key itself
    object: int | None = None  # sub-index

    @property
    def number(self) -> str:
        """Its number in C."""
        return f"SETTING_{self.name.upper()}"

    @property
    def members(self) -> tuple[str, ...]:
        """Declarations of its members of settings_t."""
        if self.stored is not None:
            return self.stored
        return (f"{'int32_t' if self.kind == 'number' else 'uint8_t' if self.choices else 'bool'} {self.name}",)

    @property
    def member(self) -> str:
        """The member that is read for it, "" if it is computed."""
        if "get" in self.functions:
            return ""
        name = self.members[0].split()[-1]
        return f"{self.group}.{name}" if self.group else name

    @property
    def signed(self) -> bool:
        """Whether its number may be negative."""
        return self.min is None or self.min < 0

    @property
    def range(self) -> tuple[int, int]:
        """The table's range, as far as it says."""
        return (-(2**31) if self.min is None else self.min, 2**31 - 1 if self.max is None else self.max)

    @property
    def sentences(self) -> str:
        """What it is, with the numbers of its choices."""
        numbered = ", ".join(f"{k} {word}" for k, word in enumerate(self.choices))
        return f"{self.text} {numbered}." if numbered else self.text

    def number_of(self, value: bool | int | str) -> int:
        """Number of a value as a file states it."""
        return self.choices.index(value) if isinstance(value, str) else int(value)

    def constant_of(self, choice: int) -> str:
        """A choice as a C constant."""
        return constant(self.name, self.choices[choice])


def _setting(entry: dict[str, Any]) -> Setting:
    name = entry.get("name", "?")
    if unknown := sorted(set(entry) - set(KEYS)):
        raise SettingsError(f"setting {name}: unknown key {unknown[0]}")
    if missing := [key for key in ("name", "kind", "text") if key not in entry]:
        raise SettingsError(f"setting {name}: no {missing[0]}")
    kind, choices = entry["kind"], tuple(entry.get("choices", ()))
    if kind not in KINDS:
        raise SettingsError(f"setting {name}: kind {kind}, permitted {', '.join(KINDS)}")
    if bool(choices) != (kind == "choice"):
        raise SettingsError(f"setting {name}: choices belong to the kind choice")
    if unknown := sorted(set(entry.get("methods", ())) - set(METHODS)):
        raise SettingsError(f"setting {name}: unknown method {unknown[0]}")
    low, high = entry.get("min"), entry.get("max")
    if kind != "number":
        low, high = 0, len(choices) - 1 if choices else 1
    parameter = entry.get("parameter", "")
    if "file" in entry and (parameter is not True or entry.get("decimals")):
        raise SettingsError(f"setting {name}: a key of the file needs parameter = true, and no decimals")
    return Setting(
        name=name,
        kind=kind,
        text=entry["text"],
        choices=choices,
        unit=entry.get("unit", ""),
        decimals=entry.get("decimals", 0),
        min=low,
        max=high,
        zero=entry.get("zero", False),
        permitted=entry.get("permitted", ""),
        methods=tuple(entry.get("methods", METHODS[:1])),
        stored=tuple(entry["stored"]) if "stored" in entry else None,
        functions=tuple(entry.get("functions", ())),
        group=entry.get("group", ""),
        parameter=name if parameter is True else parameter,
        own_parameter=parameter is True,
        file=entry.get("file", ""),
        default=entry.get("default"),
        object=entry.get("object"),
    )


@cache
def load_settings(path: Path = SETTINGS_FILE) -> tuple[Setting, ...]:
    """All settings in the order of their numbers; SettingsError names the one that is wrong."""
    with path.open("rb") as file:
        settings = tuple(_setting(entry) for entry in tomllib.load(file)["setting"])
    for kind, count in (("name", Counter(s.name for s in settings)), ("object", Counter(s.object for s in settings))):
        if twice := [key for key, times in count.items() if key is not None and times > 1]:
            raise SettingsError(f"{path}: the {kind} {twice[0]} stands twice")
    return settings


def choices(name: str) -> tuple[str, ...]:
    """Words of a setting, by their numbers."""
    return next(setting.choices for setting in load_settings() if setting.name == name)


def objects() -> list[Setting]:
    """Settings that have a CANopen object, by sub-index."""
    return sorted((s for s in load_settings() if s.object), key=lambda s: s.object or 0)


def check_uses(sources: Iterable[Path], settings: tuple[Setting, ...] | None = None) -> None:
    """SettingsError names the settings that no C source takes from settings_t. The compiler names the reverse."""
    uses: set[tuple[str, str]] = set()  # a struct or a pointer to it, and its member
    for path in sources:
        if path.suffix == ".c" and path.name != "settings.c":
            uses.update(re.findall(r"\b(\w+)(?=(?:\.|->)(\w+))", path.read_text(encoding="utf-8")))
    unused = []
    for setting in settings or load_settings():
        members = [declaration.split()[-1] for declaration in setting.members]
        holders = ("settings", "s", setting.group or "s")
        if members and uses.isdisjoint((holder, member) for holder in holders for member in members):
            unused.append(setting.name)
    if unused:
        raise SettingsError(f"{SETTINGS_FILE}: no C source uses the setting {', '.join(unused)}")


def _group_types(settings: tuple[Setting, ...]) -> list[str]:
    lines = []
    for group in dict.fromkeys(s.group for s in settings if s.group):
        lines += ["typedef struct {"]
        lines += [f"  {member};  // {s.text}" for s in settings if s.group == group for member in s.members]
        lines += [f"}} {group}_settings_t;", ""]
    return lines


def _row(s: Setting) -> str:
    low, high = s.range
    place = f"offsetof(settings_t, {s.member}), sizeof(((settings_t *)0)->{s.member})" if s.member else "0, 0"
    parameter = f"offsetof(parameters_t, {s.parameter}) / 4u" if s.parameter else "SETTING_NO_PARAMETER"
    flags = sum(1 << METHODS.index(method) for method in s.methods) | (4 if s.decimals else 0) | (8 if s.zero else 0)
    choices = f"(const char *const[]){c_strings(s.choices)}" if s.choices else "0"
    limits = ", ".join("INT32_MIN" if limit == -(2**31) else str(limit) for limit in (low, high))
    return f'  [{s.number}] = {{"{s.name}", {choices}, {limits}, {parameter}, {place}, {flags}u}}, \\'


def c_header(settings: tuple[Setting, ...] | None = None) -> str:
    """`settings_table.h`: numbers, `settings_t`, the words of the choices, the rows of `sw/drive/settings.c`."""
    settings = load_settings() if settings is None else settings
    listed = [s for s in settings if s.choices]
    members = [f"  {m};" for s in settings if not s.group for m in s.members]
    members.sort(key=lambda member: "32_t" not in member)  # no gaps between them
    groups = [f"  {g}_settings_t {g};" for g in dict.fromkeys(s.group for s in settings if s.group)]

    def calls(kind: str) -> list[str]:
        named = [f"  X({s.number}, {kind}_{s.name}) \\" for s in settings if kind in s.functions]
        return [f"#define SETTINGS_{kind.upper()}(X) \\", *named, ""]

    lines = [
        "// Generated from sw/drive/settings.toml. Do not edit.",
        "#ifndef FL_SETTINGS_TABLE_H",
        "#define FL_SETTINGS_TABLE_H",
        "",
        "#include <stdbool.h>",
        "#include <stdint.h>",
        "",
        *("typedef enum {", *(f"  {s.number}," for s in settings), "  SETTING_COUNT,", "} setting_t;", ""),
        *(f"enum {{ {', '.join(s.constant_of(k) for k in range(len(s.choices)))} }};" for s in listed),
        "",
        *_group_types(settings),
        *("typedef struct {", *members, *groups, "} settings_t;", ""),
        "// Functions of settings.c that set and get what is not stored as it is.",
        *calls("set"),
        *calls("get"),
        "#define SETTING_NO_PARAMETER 0xFFFFu",
        "// name, choices, min, max, word of its parameter, place and size of its member, flags",
        *("#define SETTING_ROWS { \\", *map(_row, settings), "}", "", "#endif", ""),
    ]
    return "\n".join(lines)
