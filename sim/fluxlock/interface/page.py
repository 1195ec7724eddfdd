# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The generated tables of docs/reference/console.md: `python -m fluxlock.interface --check` compares them."""

from __future__ import annotations

from fluxlock.base.paths import ROOT
from fluxlock.interface.names import load_faults
from fluxlock.interface.settings import Setting, load_settings
from fluxlock.interface.values import load_values

PAGE = ROOT / "docs" / "reference" / "console.md"


def _number(value: int) -> str:
    """A number as the page writes it: with spaces, a true minus, a power of ten."""
    digits = str(value)
    if value >= 10_000_000 and digits.rstrip("0") == "1":
        return "10" + str(len(digits) - 1).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{value:,}".replace(",", " ").replace("-", "−") if abs(value) >= 100_000 else digits.replace("-", "−")


def _permitted(s: Setting) -> str:
    if s.permitted:
        return s.permitted
    if s.kind == "switch":
        return "0, 1"
    if s.choices:
        numbers = "0, 1" if len(s.choices) == 2 else f"0…{len(s.choices) - 1}"
        return f"{', '.join(f'`{word}`' for word in s.choices)} or {numbers}"
    low, high = s.range
    if s.zero:
        return f"0 or from {_number(low)}"
    return f"{_number(low)}…{_number(high)}"


def settings_table() -> str:
    """Settings: name, unit, what is permitted, methods of driving, meaning."""
    rows = ["| name | unit | permitted | methods | |", "|---|---|---|---|---|"]
    rows += [
        f"| `{s.name}` | {s.unit} | {_permitted(s)} | {', '.join(s.methods)} | {s.text} |" for s in load_settings()
    ]
    return "\n".join(rows) + "\n"


def faults_table() -> str:
    """Faults and their causes."""
    return "\n".join(["| name | cause |", "|---|---|", *(f"| `{f.name}` | {f.text} |" for f in load_faults())]) + "\n"


def values_table() -> str:
    """Values: name, unit, meaning."""
    rows = [
        "| name | unit | |",
        "|---|---|---|",
        *(f"| `{v.name}` | {v.unit} | {v.sentences} |" for v in load_values()),
    ]
    return "\n".join(rows) + "\n"


TABLES = {"values": values_table, "settings": settings_table, "faults": faults_table}


def page_text() -> str:
    """The page with its tables renewed, each between two comments."""
    text = PAGE.read_text(encoding="utf-8")
    for name, table in TABLES.items():
        before, begin, rest = text.partition(f"<!-- {name} begin (python -m fluxlock.interface) -->\n")
        _, end, after = rest.partition(f"<!-- {name} end -->\n")
        if not end:
            raise ValueError(f"{PAGE}: the comments about the table of {name} are missing")
        text = f"{before}{begin}\n{table()}\n{end}{after}"
    return text
