# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers of the pages against the code that has them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from tests.docs.constants import (
    MARK,
    MARKED,
    NAMED,
    Unknown,
    agrees,
    constant,
    parameter_value,
    parameters_of,
    plain_type,
    ports_of,
    printed,
    source_of,
)
from tests.docs.test_pages import BLOCKS, MODULES, PAGES, SHARED

GENERATED = ("docs/verification/", "docs/reference/synthesis.md", "docs/reference/parameters.md")
WRITTEN = [page for page in PAGES if not page.relative_to(ROOT).as_posix().startswith(GENERATED)]
# Columns of tables whose every number comes from the code.
TIMED = ("clocks", "gates off", "after")
ROW = re.compile(r"^\| `(\w+)` \| (.*?) \|(.*)\|$", re.MULTILINE)


def section_of(module: str) -> str:
    """The tables of a module on its page."""
    page = BLOCKS / f"{SHARED.get(module, module)}.md"
    text = page.read_text().split("## Ports")[1].split("## Registers")[0]
    sections = re.split(r"^`(fl_\w+)`.*:$", text, flags=re.MULTILINE)
    return {page.stem: sections[0], **dict(zip(sections[1::2], sections[2::2], strict=True))}[module]


def wrong_parameters(module: str, section: str, text: str | None = None) -> list[str]:
    """Rows of parameters that are not what the module has. text: of its source."""
    wrong = []
    parameters = parameters_of(module, text)
    for name, cell, meaning in ROW.findall(section):
        if name not in parameters:
            continue
        parameter = parameters[name]
        match = re.match(r"(.*?) \((default|derived)\)", cell)
        if not match or (match.group(2) == "derived") != parameter.derived:
            wrong.append(f"{name}: {cell}: not the {'derived' if parameter.derived else 'default'} value")
            continue
        given = match.group(1).replace("`", "")
        plain = re.sub(r"[\s_]", "", given)
        if plain != re.sub(r"[\s_]", "", parameter.text):
            texts = re.split(r" or ", given)
            counts = [None, 5][: len(texts)]
            right = [parameter_value(module, name, phases, text) for phases in counts]
            if [value_of(piece) for piece in texts] != right:
                wrong.append(f"{name}: {given}, code: {parameter.text} = {right}")
        # A formula with the number of phases gives its values for three and for five.
        if pair := re.search(r": (\d+) and (\d+)$", meaning.strip()):
            right = [parameter_value(module, name, phases, text) for phases in (3, 5)]
            if [float(piece) for piece in pair.groups()] != right:
                wrong.append(f"{name}: {pair.group()}, code: {right}")
    return wrong


def value_of(text: str) -> float | str:
    """The number that a cell holds in C's, SystemVerilog's or plain notation, else the cell."""
    if match := re.fullmatch(r"\d+'([bdh])(\w+)", text):
        return int(match.group(2), {"b": 2, "d": 10, "h": 16}[match.group(1)])
    try:
        return float(text.replace("_", ""))
    except ValueError:
        return text


@pytest.mark.parametrize("module", MODULES)
def test_parameter_tables(module: str) -> None:
    """Defaults and derived values of a module's page are those of its header.

    Verifies: DOC-07
    """
    assert not wrong_parameters(module, section_of(module))


@pytest.mark.parametrize("module", MODULES)
def test_ports(module: str) -> None:
    """Direction and width of a page's ports are those of the module.

    Verifies: DOC-02
    """
    ports = ports_of(module)
    wrong = []
    for name, cell, rest in ROW.findall(section_of(module)):
        if name in ports:
            given = plain_type(rest.split("|")[0].strip().strip("`"))
            if (cell, given) != (ports[name].direction, ports[name].type):
                wrong.append(f"{name}: {cell} {given}, code: {ports[name].direction} {ports[name].type}")
    assert not wrong


def tables_of(text: str) -> list[tuple[list[str], list[str]]]:
    """Rows of a page's tables: heads of the columns, cells."""
    found = []
    lines = text.splitlines()
    for k, line in enumerate(lines):
        if re.fullmatch(r"\|[-|: ]+\|", line) and k:
            heads = [cell.strip() for cell in lines[k - 1].strip("|").split("|")]
            for row in lines[k + 1 :]:
                if not row.startswith("|"):
                    break
                found.append((heads, [cell.strip() for cell in row.strip("|").split("|")]))
    return found


def wrong_numbers(text: str, read: Callable[[Path], str] = Path.read_text) -> list[str]:
    """Numbers of a page that are not those of the code that it names beside them, or that name none where they must."""
    wrong = []
    numbers = {match.end(): match.group(1) for match in MARKED.finditer(text)}
    for mark in MARK.finditer(text):
        if mark.end() not in numbers:
            wrong.append(f"{mark.group()}: no number in front of it")
            continue
        number = numbers[mark.end()]
        try:
            value = constant(mark.group(1), mark.group(2), read)
        except Unknown as error:
            wrong.append(f"{mark.group()}: {error}")
            continue
        if not agrees(number, value):
            wrong.append(f"{number}{mark.group()}: {value}")
    for heads, cells in tables_of(text):
        named = NAMED.findall(" ".join(cells))
        timed = [cell for head, cell in zip(heads, cells, strict=False) if head.startswith(TIMED)]
        if named:
            shown = {printed(digits)[0] for cell in timed for digits in re.findall(r"\d+", cell)}
            for module, name in named:
                try:
                    value = constant(module, name, read)
                except Unknown as error:
                    wrong.append(f"`{module}::{name}`: {error}")
                    continue
                if value not in shown:
                    wrong.append(f"`{module}::{name}`: {value}, not in: {timed}")
        else:
            bare = [re.sub(r"[\d.]+ *<!--.*?-->|`[^`]*`|\[[^]]*\]\([^)]*\)", "", cell) for cell in timed]
            wrong += [f"no code named for: {cell}" for cell in bare if re.search(r"\d", cell)]
    return wrong


@pytest.mark.parametrize("page", WRITTEN, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_numbers(page: Path) -> None:
    """Numbers with the name of their constant have its value; in tables of times every number has one.

    Verifies: DOC-07
    """
    assert not wrong_numbers(page.read_text())


@pytest.mark.parametrize("module", MODULES)
def test_another_parameter_is_found(module: str) -> None:
    """A page whose module has another default, or derives another value, is found: each numeric parameter in turn.

    Verifies: DOC-07
    """
    text = source_of(module).read_text()
    section = section_of(module)
    for name, parameter in parameters_of(module).items():
        if re.fullmatch(r"[\w\s+*/()$-]*\d[\w\s+*/()$-]*", parameter.text) and not re.search(
            r"[a-z]\(", parameter.text
        ):
            head = re.search(rf"\b{name}\s*=\s*{re.escape(parameter.text)}", text)
            assert head, f"{name} = {parameter.text}"
            changed = text[: head.end()] + " + 1" + text[head.end() :]
            assert any(row.startswith(f"{name}:") for row in wrong_parameters(module, section, changed)), name


def marks_of(page: Path) -> list[tuple[str, str]]:
    """What a page names behind its numbers, each once."""
    return sorted({(mark.group(1), mark.group(2)) for mark in MARK.finditer(page.read_text())})


@pytest.mark.parametrize("page", [p for p in WRITTEN if marks_of(p)], ids=lambda p: p.relative_to(ROOT).as_posix())
def test_another_constant_is_found(page: Path) -> None:
    """A page is found when one of the constants that it names has another value, and when it has another name.

    Verifies: DOC-07
    """
    lines = page.read_text().splitlines()
    for where, expression in marks_of(page):
        mark = f"<!--{where}:{expression}-->"
        quoted = "\n".join(line for line in lines if mark in line and not line.startswith("|"))
        quoted += "".join(
            f"\n{cell}" for line in lines if line.startswith("|") for cell in line.split("|") if mark in cell
        )
        assert mark in quoted and not wrong_numbers(quoted)
        name, key = re.findall(r"([A-Za-z_]\w*)(?:\[(\d+)\])?", expression)[0]
        value = rf"(\b{name} = \{{[^}}]*\b{key}: )" if key else rf"(\b{name}\b\s*=\s*|#define {name} +)"
        path = ROOT / where if "/" in where else source_of(where)
        for pattern, into in ((value, r"\g<1>1000 + "), (rf"\b{name}\b", f"{name}_NOT")):

            def read(asked: Path, pattern: str = pattern, into: str = into, path: Path = path) -> str:
                text = asked.read_text()
                return re.sub(pattern, into, text) if asked == path else text

            assert any(mark in row for row in wrong_numbers(quoted, read)), (mark, pattern)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("8<!--sim/fluxlock/firmware/compiler.py:WATCHDOG_TICKS-->", ""),
        ("9<!--sim/fluxlock/firmware/compiler.py:WATCHDOG_TICKS-->", "9<!--"),
        ("8.0<!--sim/fluxlock/firmware/compiler.py:WATCHDOG_TICKS-->", ""),
        ("8 ticks<!--sim/fluxlock/firmware/compiler.py:WATCHDOG_TICKS-->", "no number in front"),
        ("8<!--sim/fluxlock/firmware/compiler.py:NO_SUCH-->", "no constant NO_SUCH"),
        ("8<!--sim/fluxlock/no_such.py:WATCHDOG_TICKS-->", "no such file"),
        ("8<!--fl_no_such:Latency-->", "no module"),
        ("17<!--fl_sense:CurrentLatency + 10-->", ""),
        ("3.5<!--fl_sense:CurrentLatency / 2-->", ""),
        ("3<!--fl_sense:CurrentLatency / 2-->", "3<!--"),
        ("50<!--registers:safety.dead_time.cycles-->", ""),
        ("51<!--registers:safety.dead_time.cycles-->", "51<!--"),
        ("50<!--registers:safety.dead_time.no_such-->", "no field"),
        ("| a | clocks |\n|---|---|\n| `fl_sense::Latency` | 13 |", ""),
        ("| a | clocks |\n|---|---|\n| `fl_sense::Latency` | 14 |", "fl_sense::Latency"),
        ("| a | clocks |\n|---|---|\n| `fl_sense::NoSuch` | 14 |", "no constant NoSuch"),
        ("| a | gates off |\n|---|---|\n| b | 14 clocks |", "no code named for: 14 clocks"),
        ("| a | gates off |\n|---|---|\n| b | [14 clocks](measured.md) |", ""),
    ],
)
def test_what_counts(text: str, problem: str) -> None:
    """Right and wrong numbers, names and tables.

    Verifies: DOC-07
    """
    wrong = wrong_numbers(text)
    assert (len(wrong) == 1 and problem in wrong[0]) if problem else not wrong, wrong
