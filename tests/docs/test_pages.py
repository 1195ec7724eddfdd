# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Pages of the documentation against the checkout: links, port tables, parameter table."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT, RTL
from fluxlock.interface import __main__ as console
from fluxverify.docs import parameters

PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
BLOCKS = ROOT / "docs" / "blocks"
# Modules that share the page of their parent; the register wrappers are on the page of the chip.
SHARED = {
    "fl_interval": "fl_timer",
    "fl_uart_rx": "fl_uart",
    "fl_uart_tx": "fl_uart",
    "fl_fifo": "fl_uart",
    "fl_mac": "fl_foc",
    "fl_sqrt": "fl_foc",
    "fl_ratio": "fl_foc",
    "fl_injection_mac": "fl_lock_in",
    "fl_can_confinement": "fl_can_bsp",
    "fl_six_step": "fl_soc",
}


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as web views of Markdown form them."""
    found = set()
    for heading in re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE):
        plain = re.sub(r"[^\w\- ]", "", re.sub(r"[`*]", "", heading).lower())
        found.add(plain.strip().replace(" ", "-"))
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_links(page: Path) -> None:
    """Relative links lead somewhere.

    Verifies: DOC-01
    """
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"https?:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{target}: no such file"
        assert not anchor or anchor in anchors(file), f"{target}: no such heading"


@pytest.mark.parametrize(
    "page", sorted((ROOT / "docs" / "howto").rglob("*.md")), ids=lambda p: p.relative_to(ROOT).as_posix()
)
def test_pytest_is_there(page: Path) -> None:
    """A how-to page that calls pytest of the environment installs it before, for it may begin with a fresh clone.

    Verifies: DOC-04
    """
    before, called, _ = page.read_text().partition("\n.venv/bin/pytest")
    assert not called or re.search(r"^tools/setup\.sh .*\btest\b", before, re.MULTILINE)


def names_in_rtl(module: str) -> set[str]:
    """Ports and header parameters of a module."""
    (source,) = RTL.rglob(f"{module}.sv")
    head = re.search(rf"^module {module}\b(.*?)^\);", source.read_text(), re.DOTALL | re.MULTILINE)
    assert head, f"{source}: no module header"
    lines = [re.sub(r"//.*", "", line) for line in head.group(1).splitlines()]
    ports = [m.group(1) for line in lines if (m := re.match(r"\s*(?:in|out)put\b.*?(\w+)\s*(?:= [\w']+)?,?\s*$", line))]
    values = [m.group(1) for line in lines if (m := re.match(r"\s*(?:local)?param(?:eter)?\b.*?(\w+)\s*=", line))]
    assert ports, f"{source}: no ports found"
    return {*ports, *values}


MODULES = sorted(
    p.stem
    for p in RTL.rglob("fl_*.sv")
    if not p.stem.endswith("_wb") and re.search(rf"^module {p.stem}\b", p.read_text(), re.MULTILINE)
)


@pytest.mark.parametrize("module", MODULES)
def test_port_tables(module: str) -> None:
    """A page's tables name what the module has.

    Verifies: DOC-02
    """
    page = BLOCKS / f"{SHARED.get(module, module)}.md"
    text = page.read_text()
    sections = re.split(r"^`(fl_\w+)`.*:$", text.split("## Ports")[1].split("## Registers")[0], flags=re.MULTILINE)
    tables = {page.stem: sections[0], **dict(zip(sections[1::2], sections[2::2], strict=True))}
    named = set(re.findall(r"^\| `(\w+)` \|", tables[module], re.MULTILINE))
    assert named == names_in_rtl(module)


def test_parameter_table() -> None:
    """The table of the parameter reference is the schema's.

    Verifies: DOC-03
    """
    assert parameters.main(["--check"]) == 0


def test_console_tables() -> None:
    """The tables of the console's page are the drive's own.

    Verifies: DOC-03
    """
    assert console.main(["--check"]) == 0
