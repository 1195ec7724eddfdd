# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with the wiring, by name, from the two tables of the firmware's test.

Row k of a table belongs to the pulses of leg k, column j to input j of the converter. Currents are peaks. An isolated
star point gives the true currents c a sum of zero in each row; input j shows s_j c[k, p_j], of phase p_j with the sign
s_j. Of all orders p and signs s the right one has the largest sum of s_j table[p_j, j]: for any saliency that sum is
the trace of an admittance, which no other choice reaches. Of equal phases the next choice has two thirds of that sum:
numbers that are not well above their noise tell nothing. Voltages count by how far a divider stands out of the other
two: that is its own leg's pulse, and a constant where its gain is off.
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
# Largest current number over its noise, rms: below the first the order is not known, below the second no gain. Four
# numbers make the difference between two orders, so the first leaves four times its noise.
LEAST_CLEAR, GAIN_CLEAR = 8.0, 25.0
EMPTY_CLEAR = 3.0  # largest number of a row or column, over the noise, below which there is no signal
# Largest over least admittance of the directions, over the motor file's: a winding of which half is shorted has 2 and
# more, unequal phases and values of a datasheet stay below.
WINDING_RATIO = 1.7
# Of the rated current: what the test stays below while the rotor stands.
CURRENT_SHARE = 0.1
# Duty while no leg's pulse is different: half of the carrier each terminal is at the link.
HIGH_SHARE = 0.5

Table = NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    kind: `leg`, `no_current`, `noise`, `turning`, `current_sensor`, `current_wiring`, `current_gain`, `divider`,
    `voltage_wiring`, `voltage_gain`, `winding` or `leg_wiring`. what: it in words; remedy: what to do. inputs: letters
    of what it is about.
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


@dataclass(frozen=True)
class Evidence:
    """What the test has measured.

    current_a, voltage_v: tables (3, 3) of leg and input; voltage zero: not measured. least_a: of currents. noise_a: of
    a current number, rms. peak_a: amplitude of the current at most, most_a: what it may be. anisotropy: see the
    function of that name, by the motor file.
    """

    current_a: Table
    voltage_v: Table
    least_a: float
    vdc_v: float
    noise_a: float = 0.0
    peak_a: float = 0.0
    most_a: float = np.inf
    anisotropy: float = 1.0


# Why a start does not go on: the terminals show no rest.
WAITS = "the rotor turns, which must stop first, or an upper switch conducts for ever: measure each leg without supply"
# Faults that end a start before the test has its tables: what it may be, and what to do.
_STOPS = {
    "rotor_spinning": WAITS,
    "fault_pin": "a gate driver reports a fault: a switch conducts for ever, or a leg is shorted to a rail; measure "
    "each leg against both rails without supply",
    "phase_over_current": "legs are shorted to each other, or one of them to a rail: measure the leads and the motor's "
    "terminals without supply",
    "shorted_winding": "two phases are shorted: measure the motor's terminals without supply",
    "current_sum": "the currents do not add up to zero: a sensor is dead, or a lead has a path to earth or a rail",
    "voltage_channel": "a voltage divider keeps one value: check the wires of the dividers",
}
_STOPS["dc_over_current"] = _STOPS["phase_over_current"]


def stopped(fault: str) -> str:
    """Why the test has no tables, by the fault that the drive stopped with."""
    why = _STOPS.get(fault)
    return f"the drive stopped with the fault {fault}" + (f": {why}" if why else ", before the test had ended")


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


def anisotropy(table: Table) -> float:
    """Largest over least admittance of all directions, of a table in order, or of a matrix of the phases."""
    axes = np.exp(2j * np.pi * np.arange(3) / 3)
    mean, swing = abs(axes.conj() @ table @ axes), abs(axes @ (table + table.T) @ axes) / 2
    return float((mean + swing) / max(mean - swing, 1e-9 * mean))


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


def _current_findings(seen: Evidence) -> tuple[list[Finding], str | None, str]:
    table = seen.current_a
    most = float(np.abs(table).max())
    if most < max(seen.least_a, LEAST_CLEAR / 2 * min(seen.noise_a, seen.least_a)):
        what = "no current sensor sees the pulses"
        remedy = "check supply and enable of the gate drivers, the motor's leads, the supply of the sensors"
        return [Finding("no_current", what, remedy, LETTERS)], None, ""
    if most < LEAST_CLEAR * seen.noise_a:
        what = f"the pulses' current of {most:.2g} A drowns in the sensors' noise of {seen.noise_a:.2g} A"
        remedy = "lower current_full_scale_a or noise_lsb of the inverter's sensing: sensors that fit the machine"
        return [Finding("noise", what, remedy, LETTERS)], None, ""
    empty = max(EMPTY_CURRENT * most, EMPTY_CLEAR * seen.noise_a)
    rows, columns = (np.abs(table).max(axis=axis) < empty for axis in (1, 0))
    if rows.any():
        legs = "".join(letter for letter, empty in zip(LETTERS, rows, strict=True) if empty)
        return [_dead_leg(legs, seen)], None, ""
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
    if most < GAIN_CLEAR * seen.noise_a:
        return found, order, inverted
    gains = relative_gains(table * np.array(signs))
    for letter, gain in zip(LETTERS, gains, strict=True):
        others = (gains.sum() - gain) / 2.0
        if not 1.0 / CURRENT_GAIN < gain / others < CURRENT_GAIN and gain == max(gains, key=lambda g: abs(np.log(g))):
            what = f"current sensor at input {letter} shows {gain / others:.2g} times what the others show"
            found.append(Finding("current_gain", what, f"check range, shunt and amplifier of sensor {letter}", letter))
    return found, order, inverted


def _dead_leg(legs: str, seen: Evidence) -> Finding:
    """A divider that sees the pulses of its leg shows that the leg switches."""
    own = [seen.voltage_v[k, k] - seen.voltage_v[:, k].min() for k in range(3)]
    switches = max(own) > 0.0 and own[LETTERS.index(legs[0])] > EMPTY_VOLTAGE * max(own)
    remedy = f"check the gate driver of leg {legs[0]}, its bootstrap supply, and the motor's lead {legs[0]}"
    if switches:
        remedy = f"the leg switches: check the motor's lead {legs[0]} and the sensor's conductor"
    return Finding("leg", f"leg {' and '.join(legs)} makes no current", remedy, legs)


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


def _winding_findings(seen: Evidence) -> list[Finding]:
    """Currents that a whole winding of the motor file would not have; the sensors are in order."""
    ratio = anisotropy(seen.current_a)
    if np.abs(seen.current_a).max() < GAIN_CLEAR * seen.noise_a or ratio < WINDING_RATIO * seen.anisotropy:
        return []
    letter = LETTERS[int(np.argmax(np.diag(seen.current_a)))]
    what = f"the directions' currents differ by {ratio:.2g}, by the motor file {seen.anisotropy:.2g}, most in {letter}"
    remedy = "a winding is shorted in part, which its resistances show, or inductance_q_h of the motor file is wrong"
    return [Finding("winding", what, remedy, letter)]


def _leg_finding(order: str) -> Finding:
    """Sensors and dividers have the same wrong order."""
    moved = _order_finding("leg_wiring", "gate", order)
    legs = " and ".join(moved.inputs)
    what = f"current sensors and voltage dividers are in the same wrong order: {_moves(order)}"
    if len(moved.inputs) == 2:
        what = f"current sensors and voltage dividers of {legs} are both swapped"
    remedy = f"swap the gate signals of {legs}" if len(moved.inputs) == 2 else "put the gate signals into this order"
    return Finding("leg_wiring", what, f"{remedy}, or the plugs of both", moved.inputs)


def name_wiring(seen: Evidence, stopped_by_test: bool = False) -> tuple[list[Finding], Wiring]:
    """Findings, none of a right wiring, and the wiring seen. stopped_by_test: the drive calls the wiring wrong."""
    found, order, inverted = _current_findings(seen)
    voltage_order = None
    # A leg that does not switch moves nothing that a divider could see.
    if seen.voltage_v.any() and not any(finding.kind in ("leg", "no_current") for finding in found):
        more, voltage_order = _voltage_findings(seen.voltage_v, seen.vdc_v)
        if order is not None and order == voltage_order != LETTERS:
            kept = [finding for finding in found if finding.kind != "current_wiring" or finding.what.endswith("sign")]
            gains = [finding for finding in more if finding.kind == "voltage_gain"]
            found, more = [_leg_finding(order), *kept], gains
        found += more
    if stopped_by_test and not found and not seen.voltage_v.any():
        found = [no_dividers()]
    found = found or _winding_findings(seen)
    # A current can be believed where its sensors are in order.
    if not found and seen.peak_a > seen.most_a:
        what = f"{seen.peak_a:.2g} A flowed, more than a tenth of the rated current"
        found = [Finding("turning", what, "the rotor turns: let it stop first, and test again", "")]
    return found, Wiring(order, inverted, voltage_order)
