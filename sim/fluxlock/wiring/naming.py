# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with the wiring, by name, from the two tables of the firmware's test.

Row k of a table belongs to the pulses of leg k, column j to input j of the converter. Currents are peaks. An isolated
star point gives the true currents c a sum of zero in each row; input j shows s_j c[k, p_j], of phase p_j with the sign
s_j. Of all orders p and signs s the right one has the largest sum of s_j table[p_j, j]: for any saliency that sum is
the trace of an admittance, which no other choice reaches. Voltages count by how far a divider stands out of the
other two: that is its own leg's pulse, and a constant where its gain is off.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

LETTERS = "ABC"
# Shares below which a row or column is empty, of the largest value.
EMPTY_CURRENT, EMPTY_VOLTAGE = 0.12, 0.2
# Gain over the others' mean, and its inverse, from which on a sensor is named.
CURRENT_GAIN, VOLTAGE_GAIN = 1.5, 1.15
# A divider that stands out of the others by so much of their voltage sees none.
DEAD_SHARE = 0.75
# Duty while no leg's pulse is different: half of the carrier each terminal is at the link.
HIGH_SHARE = 0.5

Table = NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    kind: `leg`, `no_current`, `current_sensor`, `current_wiring`, `current_gain`, `divider`, `voltage_wiring` or
    `voltage_gain`. what: it in words; remedy: what to do. inputs: letters of what it is about.
    """

    kind: str
    what: str
    remedy: str
    inputs: str


@dataclass(frozen=True)
class Wiring:
    """Phases at the inputs A, B, C, and the inputs with the wrong sign; None where a table does not tell."""

    current_order: str | None = "ABC"
    current_inverted: str = ""
    voltage_order: str | None = "ABC"


def best_order(table: Table, signed: bool) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Phases of the inputs and their signs with the largest sum."""
    choices = product(permutations(range(3)), product((1.0, -1.0), repeat=3) if signed else ((1.0, 1.0, 1.0),))
    return max(choices, key=lambda choice: sum(s * table[p, j] for j, (p, s) in enumerate(zip(*choice, strict=True))))


def relative_gains(table: Table) -> Table:
    """Gains of three current inputs that are in order, their mean is 1: the true currents sum to zero in every row."""
    inverse = np.linalg.svd(table)[2][-1]
    inverse = inverse * np.sign(inverse.sum() or 1.0)
    gains = 1.0 / np.maximum(inverse, 1e-3)
    return np.asarray(gains / gains.mean())


def _moves(order: str) -> str:
    """What an order of the phases at the inputs A, B, C is, and what to do."""
    wrong = [k for k in range(3) if order[k] != LETTERS[k]]
    if len(wrong) == 2:
        return f"{LETTERS[wrong[0]]} and {LETTERS[wrong[1]]}"
    return ", ".join(f"input {LETTERS[k]} sees phase {order[k]}" for k in wrong)


def _order_finding(kind: str, name: str, order: str) -> Finding:
    wrong = "".join(letter for letter, phase in zip(LETTERS, order, strict=True) if letter != phase)
    if len(wrong) == 2:
        what, remedy = f"{name}s of {_moves(order)} are swapped", f"swap the plugs of {_moves(order)}"
    else:
        steps = ", ".join(f"the plug at input {LETTERS[k]} to input {order[k]}" for k in range(3))
        what, remedy = f"{name}s are turned round: {_moves(order)}", f"move {steps}"
    return Finding(kind, what, remedy, wrong)


def _current_findings(table: Table, least: float) -> tuple[list[Finding], str | None, str]:
    most = float(np.abs(table).max())
    if most < least:
        what = "no current sensor sees the pulses"
        remedy = "check supply and enable of the gate drivers, the motor's leads, the supply of the sensors"
        return [Finding("no_current", what, remedy, LETTERS)], None, ""
    rows, columns = (np.abs(table).max(axis=axis) < EMPTY_CURRENT * most for axis in (1, 0))
    if rows.any():
        legs = "".join(letter for letter, empty in zip(LETTERS, rows, strict=True) if empty)
        remedy = f"check the gate driver of leg {legs[0]}, its bootstrap supply, and the motor's lead {legs[0]}"
        return [Finding("leg", f"leg {' and '.join(legs)} makes no current", remedy, legs)], None, ""
    if columns.any():
        return (
            [
                Finding(
                    "current_sensor",
                    f"current sensor at input {letter} gives no signal",
                    _sensor_remedy(letter),
                    letter,
                )
                for letter, empty in zip(LETTERS, columns, strict=True)
                if empty
            ],
            None,
            "",
        )
    phases, signs = best_order(table, signed=True)
    order = "".join(LETTERS[p] for p in phases)
    inverted = "".join(letter for letter, sign in zip(LETTERS, signs, strict=True) if sign < 0.0)
    found = [] if order == LETTERS else [_order_finding("current_wiring", "current sensor", order)]
    if inverted:
        what = f"current sensor at input {' and '.join(inverted)} has the wrong sign"
        remedy = f"turn the two wires of input {' and '.join(inverted)} round, or the sensor on its conductor"
        found.append(Finding("current_wiring", what, remedy, inverted))
    gains = relative_gains(table * np.array(signs))
    for letter, gain in zip(LETTERS, gains, strict=True):
        others = (gains.sum() - gain) / 2.0
        if not 1.0 / CURRENT_GAIN < gain / others < CURRENT_GAIN and gain == max(gains, key=lambda g: abs(np.log(g))):
            what = f"current sensor at input {letter} shows {gain / others:.2g} times what the others show"
            found.append(Finding("current_gain", what, f"check range, shunt and amplifier of sensor {letter}", letter))
    return found, order, inverted


def _sensor_remedy(letter: str) -> str:
    return f"check plug, supply and output of the sensor at input {letter}"


def _voltage_findings(table: Table, vdc: float) -> tuple[list[Finding], str | None]:
    swing = table - table.min(axis=0)
    constant = table.min(axis=0) / (HIGH_SHARE * vdc)
    empty = (swing.max(axis=0) < EMPTY_VOLTAGE * swing.max()) | (constant > DEAD_SHARE)
    if empty.any():
        return [
            Finding("divider", f"voltage divider at input {letter} gives no signal", _divider_remedy(letter), letter)
            for letter, missing in zip(LETTERS, empty, strict=True)
            if missing
        ], None
    phases, _ = best_order(swing, signed=False)
    order = "".join(LETTERS[p] for p in phases)
    found = [] if order == LETTERS else [_order_finding("voltage_wiring", "voltage divider", order)]
    for letter, off in zip(LETTERS, constant, strict=True):
        if off > VOLTAGE_GAIN - 1.0:
            what = f"voltage divider at input {letter} is off by {100.0 * off:.0f} %"
            found.append(Finding("voltage_gain", what, f"check the two resistors of the divider {letter}", letter))
    return found, order


def no_dividers() -> Finding:
    """The drive has stopped, and no table shows a voltage."""
    return Finding("divider", "no voltage divider gives a signal", "check plug and supply of the dividers", LETTERS)


def _divider_remedy(letter: str) -> str:
    return f"check the divider of leg {letter}: its wire, both resistors, the input"


def name_wiring(current: Table, voltage: Table, least: float, vdc: float) -> tuple[list[Finding], Wiring]:
    """Findings, none of a right wiring, and the wiring seen.

    current, voltage: tables (3, 3) of leg and input, A and V; voltage zero: not measured. least: of currents, A. vdc:
    link, V.
    """
    found, order, inverted = _current_findings(current, least)
    voltage_order: str | None = "ABC"
    # A leg that does not switch moves nothing that a divider could see.
    if voltage.any() and not any(finding.kind in ("leg", "no_current") for finding in found):
        more, voltage_order = _voltage_findings(voltage, vdc)
        found += more
    return found, Wiring(order, inverted, voltage_order)
