# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Ideal gate sequences of six-step operation, from the definitions of alignments and chopping patterns in time.

Sectors are indexed 0..5 = I..VI; chapter 6 counts its fundamental phase y from the entry into sector II (A+C-), where
the space vector stands at 30 degrees, (6.1). Gates: bit 2X = upper, bit 2X + 1 = lower switch of leg X.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from fluxlock.interface import kinds
from fluxlock.interface.settings import choices
from fluxlock.results.rundata import BoolArray, FloatArray, IntArray

Commutation: TypeAlias = kinds.Commutation
Chopping: TypeAlias = kinds.Pattern
COMMUTATIONS, CHOPPINGS = choices("commutation"), choices("pattern")

SECTORS = 6
UPPER_LEG = np.array([0, 0, 1, 1, 2, 2])
LOWER_LEG = np.array([1, 2, 2, 0, 0, 1])
FIRST_SECTOR = 1  # sector at y = 0
# Instants closer than this, in carriers, are one: a carrier start on a commutation counts as not before it.
SAME_CARRIERS = 1e-9


@dataclass(frozen=True)
class GateSequence:
    """Gates over time. Times in electrical turns from 0; `gates[k]` holds from `at[k]` to `at[k + 1]`.

    at: [k] first entry 0, every commutation among them; gates: [k]; length: end of the last entry; commutations: [c]
    instants at which the sector changed; sectors: [c] sector entered.
    """

    at: FloatArray
    gates: IntArray
    length: float
    commutations: FloatArray
    sectors: IntArray


def upper_chops(chopping: Chopping, sector: IntArray) -> BoolArray:
    """Whether the upper switch of a sector chops (else the lower one), positive speed.

    ON-PWM: each phase is on for its first 60 degrees and chops in its last 60; PWM-ON the reverse. The upper phase is
    in its last 60 degrees in II, IV, VI.
    """
    upper_is_later: BoolArray = sector % 2 == 1
    if chopping == "ON-PWM":
        return upper_is_later
    if chopping == "PWM-ON":
        return ~upper_is_later
    return np.full(sector.shape, chopping == "H_PWM-L_ON")


def freewheel_mode(chopping: Chopping, sector: IntArray) -> IntArray:
    """Commutation mode 1 or 2 of the freewheeling after entering a sector, section 4.3.

    Mode 1: the switch on the side of the freewheeling diode chops (lower diode in I, III, V, upper in II, IV, VI).
    """
    diode_is_upper = sector % 2 == 1
    return np.where(upper_chops(chopping, sector) == diode_is_upper, 1, 2)


def gates_of(chopping: Chopping, sector: IntArray, pulse: BoolArray) -> IntArray:
    """Gates of a sector while the pulse is on or off; without synchronous rectification."""
    chops_upper = upper_chops(chopping, sector)
    high = np.where(pulse | ~chops_upper, 1 << 2 * UPPER_LEG[sector], 0)
    low = np.where(pulse | chops_upper, 2 << 2 * LOWER_LEG[sector], 0)
    return (high | low).astype(np.int64)


def gate_sequence(
    commutation: Commutation,
    n: float,
    duty: float,
    *,
    turns: int = 1,
    start_deg: float = 0.0,
    chopping: Chopping = "ON-PWM",
) -> GateSequence:
    """Gates of ideal six-step operation at constant speed and duty.

    n: carriers a sector (5.2); duty: 0..1; turns: electrical turns to make; start_deg: fundamental phase y at time 0
    (phi_0 of (6.4)). RSC and NSC have a carrier start at time 0; CSC starts a carrier at every commutation.

    RSC: gates take the sector at the carrier start; NSC: at once, the carrier runs on; CSC: at once, the carrier
    restarts with a pulse (section 6.2). The instants at which anything can change are collected, and what holds
    between two of them is read off in the middle.
    """
    check_operating_point(n, duty)
    carriers = SECTORS * n
    offset = start_deg / 60.0  # sectors
    first, last = int(np.floor(offset)), int(np.ceil(SECTORS * turns + offset))
    commutation_at = (np.arange(first, last + 1) - offset) / SECTORS
    if commutation == "CSC":
        pulses = np.arange(int(np.floor(n)) + 1)
        within = np.sort(np.concatenate([pulses, pulses + duty]))
        within = within[within < n]
        marks = (commutation_at[:, None] + within / carriers).ravel()
    else:
        starts = np.arange(int(np.ceil(carriers * turns)) + 1)
        marks = np.concatenate([starts, starts + duty]) / carriers
        if commutation == "NSC":
            marks = np.concatenate([marks, commutation_at])
    same = SAME_CARRIERS / carriers
    inside = marks[(marks > same) & (marks < turns - same)]
    at = np.sort(np.concatenate([[0.0], inside]))
    # Marks that rounding keeps apart are one instant.
    at = at[np.append(True, np.diff(at) > same)]
    middle = (at + np.append(at[1:], turns)) / 2

    count = carriers * middle
    reference = middle
    if commutation == "RSC":
        reference = np.floor(count) / carriers + same
    number = np.floor(SECTORS * reference + offset)
    if commutation == "CSC":
        count = (SECTORS * middle + offset - number) * n
    pulse = count - np.floor(count) < duty
    sector = ((number + FIRST_SECTOR) % SECTORS).astype(np.int64)
    gates = gates_of(chopping, sector, pulse)

    commutates = np.append(False, number[1:] != number[:-1])
    # A commutation in the off time need not change a gate (H_PWM-L_ON); it is an entry all the same.
    keep = np.append(True, gates[1:] != gates[:-1]) | commutates
    return GateSequence(at[keep], gates[keep], float(turns), at[commutates], sector[commutates])


def check_operating_point(n: float, duty: float) -> None:
    """Raise unless carriers a sector and duty are possible."""
    if not (np.isfinite(n) and n > 0.0):
        raise ValueError(f"n = {n!r}: carriers a sector must be above 0")
    if not 0.0 <= duty <= 1.0:
        raise ValueError(f"duty = {duty!r}: must be 0 to 1")
