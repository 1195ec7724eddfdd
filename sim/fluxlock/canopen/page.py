# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The generated part of docs/reference/objects.md: `python -m fluxlock.canopen --check` compares it."""

from __future__ import annotations

from fluxlock.base.paths import ROOT
from fluxlock.canopen.dbc import PDOS, mapped
from fluxlock.canopen.dictionary import NODE_PREFIX, Dictionary, Entry
from fluxlock.interface.names import load_faults

PAGE = ROOT / "docs" / "reference" / "objects.md"
MARKER = "<!-- From here on generated: python -m fluxlock.canopen. -->\n"


def _range(entry: Entry) -> str:
    if entry.access != "rw" or not entry.bytes:
        return ""
    return ", ".join(map(str, entry.choices)) if entry.choices else f"{entry.min} … {entry.max}"


def _default(entry: Entry) -> str:
    if not isinstance(entry.default, int):
        return entry.default or ""
    if entry.node_relative:
        return f"{NODE_PREFIX}0x{entry.default:X}"
    return f"0x{entry.default:08X}" if entry.default >= 0x10000 else str(entry.default)


def _row(entry: Entry, text: str) -> str:
    marks = [
        {"rx": "RPDO", "tx": "TPDO", "both": "RPDO, TPDO"}.get(entry.map, ""),
        "stored" if entry.store else "",
        "limit" if entry.limit else "",
    ]
    unit = f"{entry.scale:g} {entry.unit}" if entry.scale != 1.0 else entry.unit
    words = " ".join(word for word in (text, entry.text) if word)
    cells = (f"0x{entry.index:04X}:{entry.sub}", f"`{entry.name}`", entry.type, entry.access, _default(entry))
    return "| " + " | ".join((*cells, _range(entry), unit, ", ".join(filter(None, marks)), words)) + " |"


def tables(dictionary: Dictionary) -> str:
    """PDOs, objects and error codes as Markdown."""
    lines = ["## PDOs after power-up", "", "| PDO | mapped |", "|---|---|"]
    pdos = {name: mapped(dictionary, name) for name in PDOS}
    lines += [f"| {name.upper()} | {', '.join(f'`{e.name}`' for e in found)} |" for name, found in pdos.items()]
    head = ("object", "name", "type", "access", "default", "range", "unit", "PDO, stored", "meaning")
    lines += ["", "## Objects", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for item in dictionary.objects:
        single = item.entries[0].text == item.text
        for i, entry in enumerate(item.entries):
            lines.append(_row(entry, item.text if i == 0 and not single else ""))
    lines += ["", "## Error codes of the drive's faults", "", "| fault | EMCY | error register |", "|---|---|---|"]
    lines += [f"| `{f.name}` | 0x{f.emcy:04X} | 0x{1 << f.bit | 1:02X} |" for f in load_faults()]
    return "\n".join(lines) + "\n"


def page_text(dictionary: Dictionary) -> str:
    """The page with its generated part renewed."""
    head, marker, _ = PAGE.read_text(encoding="utf-8").partition(MARKER)
    if not marker:
        raise ValueError(f"{PAGE}: the line that starts the generated part is missing")
    return f"{head}{MARKER}\n{tables(dictionary)}"
