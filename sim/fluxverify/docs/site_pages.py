# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Pages that only the site has: folders of the RTL, public modules, commands, settings by name."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxverify.docs.navigation import Entry

BLOCKS = Path("docs/blocks/index.md")
PYTHON = Path("docs/reference/python.md")
UNDERSTAND = Path("docs/understand/index.md")
REFERENCE = Path("docs/reference/index.md")
FILES = Path("docs/reference/files.md")

# What the folders of the RTL do, in the words of the tabs.
FOLDERS = {
    "sense": "Samples and their instants",
    "zcd": "Zero crossings and commutation",
    "foc": "Vector control",
    "encoder": "Encoder",
    "injection": "Injection",
    "pwm": "Carrier and chopping",
    "safety": "Gates and protection",
    "can": "CAN controller",
    "soc": "The chip",
    "board": "Boards",
    "common": "Shared parts",
}
UNIT = re.compile(r"m?s|us|m?a|m?v|rpm|deg|k?hz|ohm|h|k|kgm2|vs|m?nm|w|f|kib|pct|percent|c|rad|per")
TABLE_ROW = re.compile(r"^\| `(\w+)` \|(.*)\|$")


@dataclass(frozen=True)
class Extra:
    """Additions below a page: entries, and the pages that they take over from it."""

    entries: tuple[Entry, ...] = ()
    replaced: frozenset[Path] = frozenset()


def block_folders(text: str) -> dict[str, list[tuple[str, str]]]:
    """Modules of each folder of the RTL with what they do, from the table of the block pages."""
    found: dict[str, list[tuple[str, str]]] = {}
    folder = ""
    for line in text.splitlines():
        match = re.match(r"\| (?:`rtl/(\w+)`)? ?\| \[(\w+)\]\(\w+\.md\) \| (.*) \|$", line)
        if match:
            folder = match[1] or folder
            found.setdefault(folder, []).append((match[2], match[3]))
    return found


def _blocks(text: str, audience: str) -> tuple[Extra, dict[str, str]]:
    """A page per folder of the RTL, above the pages of its modules."""
    entries, pages, replaced = [], {}, set[Path]()
    for folder, modules in block_folders(text).items():
        title = FOLDERS.get(folder, folder)
        files = [Path("docs/blocks") / f"{module}.md" for module, _ in modules]
        lines = [f"# {title}\n", f"{audience}\n", f"Modules in `rtl/{folder}`:\n"]
        lines += [f"- [{module}]({module}.md): {words}" for module, words in modules]
        lines += ["\n```{toctree}\n:hidden:\n", *(module for module, _ in modules), "```"]
        pages[f"blocks/rtl-{folder}.md"] = "\n".join(lines) + "\n"
        entries.append(Entry(title, Path(f"docs/blocks/rtl-{folder}.md")))
        replaced.update(files)
    return Extra(tuple(entries), frozenset(replaced)), pages


def modules_of(text: str) -> list[str]:
    """Public modules that the page of the package names."""
    return re.findall(r"^\| \[`([\w.]+)`\]\(", text, re.MULTILINE)


def _python(text: str, audience: str) -> tuple[Extra, dict[str, str]]:
    """A page per public module from its docstrings."""
    entries, pages = [], {}
    for module in modules_of(text):
        name = module.replace(".", "-")
        body = f".. automodule:: {module}\n   :members:\n   :member-order: bysource\n"
        pages[f"reference/python/{name}.md"] = f"# {module}\n\n{audience}\n\n```{{eval-rst}}\n{body}```\n"
        entries.append(Entry(module.removeprefix("fluxlock."), Path(f"docs/reference/python/{name}.md")))
    return Extra(tuple(entries)), pages


def commands_page(audience: str) -> str:
    """All commands with their options, as the command line itself describes them."""
    texts = []
    for name in ("fluxlock", "fluxverify"):
        command = [sys.executable, "-m", "typer", f"{name}.cli", "utils", "docs", "--name", name]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        text = done.stdout.replace("```console\n$ ", "```\n")
        texts.append(re.sub(rf"^(#+) `{name} (.+)`$", rf"\1 {name} \2", text, flags=re.MULTILINE))
    product, verification = texts
    # Its commands go on where those of the product end.
    head = re.sub(r"\A# .*\n", f"# Commands\n\n{audience}\n", product, count=1)
    return head + verification[verification.index("## ") :]


def words_of(key: str) -> str:
    """The name of a key in words, without its unit."""
    parts = key.split("_")
    while len(parts) > 1 and UNIT.fullmatch(parts[-1]):
        parts.pop()
    return " ".join(parts)


def settings(text: str) -> dict[str, list[tuple[str, str, list[str]]]]:
    """Settings by their name in words: key, place and cells of its row in the tables of the input files."""
    found: dict[str, list[tuple[str, str, list[str]]]] = {}
    file = section = ""
    for line in text.splitlines():
        if match := re.match(r"(##|###) (.*)", line):
            file, section = (match[2], "") if match[1] == "##" else (file, match[2])
        elif row := TABLE_ROW.match(line):
            cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", row[2])]
            if len(cells) == 5:
                found.setdefault(words_of(row[1]), []).append((row[1], f"{file}, {section.partition(' (')[0]}", cells))
    return found


def settings_page(text: str, audience: str) -> str:
    """The settings of the input files in the order of their names."""
    lines = [
        "# Settings by name\n",
        f"{audience}\n",
        "Every key of the [input files](files.md) by its name. A key under *scenario file* also works after `--set`;\n"
        "the keys of the motor and inverter files need `motor.` or `inverter.` before them there.\n",
    ]
    for words, places in sorted(settings(text).items()):
        lines.append(f"## {words[0].upper()}{words[1:]}\n")
        for key, place, (kind, unit, permitted, default, meaning) in places:
            facts = [kind, unit, f"permitted: {permitted}" if permitted else "", f"default: {default}"]
            lines.append(
                f"`{key}` · {place.rstrip(', ').lower()}  \n{meaning}  \n{' · '.join(x for x in facts if x)}\n"
            )
    return "\n".join(lines)


def _reference(root: Path, audience: str) -> tuple[Extra, dict[str, str]]:
    """Commands and settings."""
    pages = {
        "reference/settings.md": settings_page((root / FILES).read_text(encoding="utf-8"), audience),
        "reference/commands.md": commands_page(audience),
    }
    return Extra(
        (
            Entry("Settings by name", Path("docs/reference/settings.md")),
            Entry("Commands", Path("docs/reference/commands.md")),
        )
    ), pages


def added_pages(page: Path, text: str, audience: str) -> tuple[Extra, Mapping[str, str]]:
    """What the site adds below a page: entries of the navigation, and the pages' files below its sources."""
    if page == BLOCKS:
        return _blocks(text, audience)
    if page == PYTHON:
        return _python(text, audience)
    if page == UNDERSTAND:
        return Extra((Entry("Figures by their scripts", Path("docs/gallery/index.md")),)), {}
    if page == REFERENCE:
        return _reference(ROOT, audience)
    return Extra(), {}
