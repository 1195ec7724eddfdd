# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machines of the motor library on the twin: the life with the file's own values, vector control, fitting inverter."""

from __future__ import annotations

from dataclasses import replace

from fluxlock.config import load_motor
from fluxlock.datasheet.library import Machine as Entry
from fluxlock.prove.cases import Row, find_high, least_rpm
from fluxlock.prove.fitting import fitting_inverter
from fluxlock.prove.life import Machine, fitting_carrier_hz


def library_life(entry: Entry) -> tuple[Machine, Row]:
    """The machine with the speeds that it held, and how its life was."""
    motor = load_motor(entry.path)
    carrier_hz = fitting_carrier_hz(motor, entry.supply_v, "vector")
    machine = Machine(motor, fitting_inverter(motor, entry.supply_v, carrier_hz), "vector", carrier_hz)
    machine, tried = find_high(replace(machine, least_rpm=least_rpm(machine)))
    return machine, tried[-1]
