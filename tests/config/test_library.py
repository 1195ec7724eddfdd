# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The motor library: its files are what `motor new` makes, with a source and without a mistake."""

from __future__ import annotations

import pytest

from fluxlock.config import load_motor
from fluxlock.config.info import warnings
from fluxlock.datasheet.convert import SPEED_OVER_NO_LOAD
from fluxlock.datasheet.library import FOLDER, Machine, machines
from fluxverify.docs.library import PAGE, page

LEAST_MACHINES = 20


@pytest.mark.parametrize("machine", machines(), ids=lambda machine: machine.stem)
def test_a_machine(machine: Machine) -> None:
    """Written as the table says, loads, no warning, source in the file; the stated supply carries its highest speed.

    Verifies: FRONT-72
    """
    assert machine.path.read_text(encoding="utf-8") == machine.text
    motor = load_motor(machine.path)
    assert motor.datasheet is not None
    assert motor.datasheet.source == machine.source
    assert warnings(motor) == []
    emf_v = motor.line_flux_vs * motor.omega_e(motor.max_speed_rpm)
    assert 0.3 * machine.supply_v < emf_v < SPEED_OVER_NO_LOAD * machine.supply_v


@pytest.mark.parametrize("machine", machines(), ids=lambda machine: machine.stem)
def test_a_guess_has_a_note(machine: Machine) -> None:
    """An inertia that no source states is guessed, and the head of the file says so.

    Verifies: FRONT-72
    """
    stated = "inertia" in dict(machine.options)
    assert stated != any(note.startswith("Inertia: not stated; guessed") for note in machine.notes)
    assert stated != ("GUESSED" in machine.text)


def test_the_library_is_whole() -> None:
    """No file without its entry, at least so many machines, and the page is of this table.

    Verifies: FRONT-72
    """
    assert sorted(FOLDER.glob("*.toml")) == sorted(machine.path for machine in machines())
    assert len(machines()) >= LEAST_MACHINES
    assert PAGE.read_text(encoding="utf-8") == page()
