# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Boards: every pin of a top stands once in its constraint file and in the pin table of its page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT, RTL

BOARDS = {"fl_board_ulx3s": "ulx3s.lpf", "fl_board_arty": "arty-a7-35.xdc"}
# Ball of the package: row, column.
BALL = re.compile(r"[A-Y][1-9][0-9]?")
LOCATION = {
    ".lpf": re.compile(r'^LOCATE COMP "([^"]+)" SITE "([^"]+)";$', re.MULTILINE),
    ".xdc": re.compile(
        r"^set_property -dict \{ PACKAGE_PIN (?P<pin>\w+) .*\} \[get_ports \{(?P<port>\S+)\}\]$", re.MULTILINE
    ),
}
# pad_input_ns of the configuration limits them.
PAD_LIMITED = ("adc_sdata_i", "flash_miso_i")
STANDARD = {
    ".lpf": re.compile(r'^IOBUF PORT "([^"]+)" .*IO_TYPE=LVCMOS33\b', re.MULTILINE),
    ".xdc": re.compile(r"IOSTANDARD LVCMOS33\b.*\[get_ports \{(\S+)\}\]$", re.MULTILINE),
}


PULLS = {"fault_pin_i": "UP", "adc_sdata_i": "UP", "can_rx_i": "UP", "hall_i": "DOWN", "encoder_i": "DOWN"}
# Widths of a top that can have five phases.
WIDEST = {"Phases-1": 4, "Channels-1": 12}


def ports(module: str) -> dict[str, str]:
    """Every pin of a top at its widest, a bus bit by bit, and its direction."""
    text = re.sub(r"//.*", "", (RTL / "board" / f"{module}.sv").read_text())
    head = text.split(") (")[1].split(");")[0]
    found = {}
    for direction, width, name in re.findall(r"(input|output)\s+logic\s*(?:\[\s*([\w-]+):0\])?\s*(\w+)", head):
        top = WIDEST.get(width) or int(width or 0)
        found.update({f"{name}[{i}]": direction for i in range(top + 1)} if width else {name: direction})
    return found


def constraints(module: str) -> tuple[str, str]:
    """Text and suffix of a board's constraint file."""
    path = ROOT / "constraints" / BOARDS[module]
    return path.read_text(), path.suffix


def located(module: str) -> list[tuple[str, str]]:
    """Pin of the top and pin of the package, in the order of the constraint file."""
    text, suffix = constraints(module)
    pairs = [
        (m.group("port"), m.group("pin")) if m.groupdict() else m.groups() for m in LOCATION[suffix].finditer(text)
    ]
    return [(str(port), str(pin)) for port, pin in pairs]


@pytest.mark.parametrize("module", BOARDS)
def test_every_port_has_one_pin(module: str) -> None:
    """Every pin of the top is placed once, no package pin twice, and all at 3.3 V.

    Verifies: BRD-06
    """
    pairs, top = located(module), ports(module)
    assert len(top) > 30
    assert sorted(port for port, _ in pairs) == sorted(top)
    pins = [pin for _, pin in pairs]
    assert len(set(pins)) == len(pins)
    assert all(BALL.fullmatch(pin) for pin in pins)
    text, suffix = constraints(module)
    assert sorted(STANDARD[suffix].findall(text)) == sorted(top)


@pytest.mark.parametrize("module", BOARDS)
def test_pulls(module: str) -> None:
    """Without a board at the header a fault is read, neither Hall sensor nor encoder, and an idle bus.

    Verifies: BRD-06
    """
    text, suffix = constraints(module)
    lines = [line for line in text.splitlines() if line.startswith(("IOBUF", "set_property -dict"))]
    for port in ports(module):
        (line,) = (line for line in lines if f'"{port}"' in line or f"{{{port}}}" in line)
        pull = re.search(r"PULLMODE=(\w+)|PULLTYPE PULL(\w+)", line)
        level = (pull.group(1) or pull.group(2)) if pull else "NONE"
        name = port.split("[")[0]
        wanted = PULLS.get(name)
        assert level == wanted if wanted else (level == "NONE" or port.endswith("i")), line
    assert suffix in LOCATION


@pytest.mark.parametrize("module", BOARDS)
def test_every_port_is_timed(module: str) -> None:
    """Every input is a clock, asynchronous by name, or one whose way is limited; so is every output of the XDC.

    Verifies: BRD-07
    """
    text, suffix = constraints(module)
    for port, direction in ports(module).items():
        if direction == "output" and suffix == ".lpf":
            continue  # pad_output_ns and together_ns of the configuration limit all of them
        name = port.split("[")[0]
        if suffix == ".lpf":
            timed = f'PATH FROM PORT "{port}"' in text or f'FREQUENCY PORT "{port}"' in text or name in PAD_LIMITED
        else:
            commands = [line for line in text.splitlines() if re.match(r"create_clock|set_(false|input|output)_", line)]
            timed = any(re.search(rf"\b{name}\b", line) for line in commands)
        assert timed, port


@pytest.mark.parametrize("module", BOARDS)
def test_pin_table(module: str) -> None:
    """The table of the page is the constraint file's.

    Verifies: BRD-06
    """
    page: Path = ROOT / "docs" / "blocks" / f"{module}.md"
    section = page.read_text().split("## Pins")[1].split("## Limits")[0]
    rows = re.findall(r"^\| `([^`]+)` \| (\w+) \| [^|]+ \| [^|]+ \|$", section, re.MULTILINE)
    assert rows == located(module)
