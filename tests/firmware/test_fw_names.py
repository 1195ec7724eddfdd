# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The tables of faults and names against the firmware."""

from __future__ import annotations

from pathlib import Path

import pytest

from fluxlock.firmware.binding import names, types
from fluxlock.firmware.toolchain import SW
from fluxlock.interface.names import (
    Fault,
    NamesError,
    check_uses,
    fault_names,
    load_faults,
    load_names,
    trip_fault,
    words,
)
from tests.firmware.firmware_bench import Bench

PLANTED = Fault("planted", 0x5000, 7, "Planted.")


def test_each_number_of_a_fault_has_its_name() -> None:
    """The console prints the table's name for each number, and each trip cause means a fault of the table.

    Verifies: FW-23
    """
    drive = Bench().fw
    printed = [drive.lib.fault_name(number) for number in range(len(fault_names()) + 2)]
    texts = [types().string(pointer).decode() for pointer in printed]
    assert texts == ["none", *fault_names(), "unknown"]
    for bit, cause in enumerate(words("trip")):
        assert drive.lib.fault_of_trip(1 << bit) == 1 + fault_names().index(trip_fault(cause))


def test_c_counts_as_the_lists() -> None:
    """The enumerations of C have the words of the lists.

    Verifies: FW-23
    """
    for name in ("state", "phase", "limit", "hall_mode"):
        assert names(load_names()[name].type) == words(name)


def test_a_fault_that_nothing_reports_is_named() -> None:
    """An entry of the table that no C source reports, and no hardware trip means.

    Verifies: FW-23
    """
    sources = sorted(SW.rglob("*.c"))
    check_uses(sources, load_faults())
    with pytest.raises(NamesError, match=r"no C source reports the fault planted$"):
        check_uses(sources, (*load_faults(), PLANTED))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ('name = "a"\nemcy = 1\nbit = 1', "fault a: no text"),
        ('name = "a"\nemcy = 1\nbit = 1\ntext = "A."\ncolour = 1', "fault a: unknown key colour"),
        ('name = "a"\nemcy = 1\nbit = 1\ntext = "A."\ntrip = "b"', "fault a: unknown trip b"),
    ],
)
def test_contradictions_are_named(tmp_path: Path, entry: str, message: str) -> None:
    """A wrong entry is refused by its name.

    Verifies: FW-23
    """
    table = tmp_path / "faults.toml"
    table.write_text(f"[[fault]]\n{entry}\n")
    with pytest.raises(NamesError, match=f"^{message}$"):
        load_faults(table)
    twice = '[[fault]]\nname = "a"\nemcy = 1\nbit = 1\ntext = "A."\n' * 2
    (tmp_path / "twice.toml").write_text(twice)
    with pytest.raises(NamesError, match=r"^fault a stands twice$"):
        load_faults(tmp_path / "twice.toml")
