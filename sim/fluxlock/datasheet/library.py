# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machines of `motors/library`: their files from `library.toml`, by the options of `motor new`."""

from __future__ import annotations

import functools
import tomllib
from dataclasses import dataclass
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.datasheet.convert import Sheet, motor_text
from fluxlock.datasheet.entries import BY_OPTION, read_value

TABLE = Path(__file__).with_name("library.toml")
FOLDER = ROOT / "motors" / "library"
HEADER = """\
# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

# Made by `python -m fluxverify.docs.library` from sim/fluxlock/datasheet/library.toml; edit that.
"""


@dataclass(frozen=True)
class Machine:
    """One machine. supply_v: DC link that it is meant for; options: of `motor new`, as typed."""

    stem: str
    name: str
    kind: str
    supply_v: float
    source: str
    notes: tuple[str, ...]
    options: tuple[tuple[str, str], ...]

    @property
    def path(self) -> Path:
        """Its file."""
        return FOLDER / f"{self.stem}.toml"

    @property
    def text(self) -> str:
        """Contents of its file. Raises ConfigError for options that `motor new` refuses."""
        values = {option: read_value(BY_OPTION[option], text) for option, text in self.options}
        return HEADER + motor_text(Sheet(self.name, values, source=self.source, notes=self.notes))


@functools.cache
def machines() -> tuple[Machine, ...]:
    """All machines, in the order of the table."""
    found = []
    for stem, keys in tomllib.loads(TABLE.read_text(encoding="utf-8")).items():
        options = tuple((key, str(value)) for key, value in keys.items() if key in BY_OPTION)
        notes = tuple(str(note) for note in keys.get("note", ()))
        found.append(Machine(stem, keys["name"], keys["kind"], float(keys["supply-v"]), keys["source"], notes, options))
    return tuple(found)


def write_files() -> list[Path]:
    """Write every file of the library; their paths."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for machine in machines():
        machine.path.write_text(machine.text, encoding="utf-8")
    return [machine.path for machine in machines()]
