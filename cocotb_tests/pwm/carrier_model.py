# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a carrier does by the rules in the header of fl_carrier: volt-seconds, minimum pulse, announced commutations.

Written from the rules, without the registers of the RTL.
"""

from __future__ import annotations

import numpy as np

from cocotb_tests.pwm.chain import Trace, carriers


def owed(trace: Trace, duty: float) -> np.ndarray:
    """Volt-seconds delivered less volt-seconds owed after every whole carrier, in clocks."""
    rows = carriers(trace)
    return np.cumsum([on - min(duty, n) for _, n, on in rows])


def planned(length: int, duty_q8: int, minimum: int, owed_q8: int) -> int:
    """Clocks of the pulse of a carrier that begins with this owed to the load."""
    want = (owed_q8 + duty_q8) >> 8
    if duty_q8 == 0 or want <= 0 or want < minimum:
        return 0
    return length if duty_q8 >> 8 >= length or want + minimum > length else want


def levels(period: int, duty: int, minimum: int, p: int) -> list[int]:
    """Pulse of a carrier with an announced commutation at its clock p (NSC).

    duty: clocks, neither between 1 and `minimum` nor, unless a whole period, within it of the period.
    """
    if duty in (0, period) or p == 0:
        return plain(period, duty)
    if p < minimum:  # the pulse waits for the commutation, and is left out if too little is left of it then
        return [int(duty - p >= minimum and p <= c < duty) for c in range(period)]
    if p < duty:  # a rest too short ends with the commutation
        return plain(period, p if duty - p < minimum else duty)
    if p + minimum > period:  # the rest of the carrier is filled; so is a gap that would end too soon
        return [int(c < duty or c >= p or p - duty < minimum) for c in range(period)]
    return [int(c < duty or c < p < duty + minimum) for c in range(period)]


def cut(period: int, duty: int, minimum: int, p: int) -> list[int]:
    """Pulse of a carrier that an announced commutation ends after p clocks (CSC); duty as for `levels`."""
    if duty in (0, period):
        return plain(p, duty)
    if p < minimum:  # not started
        return [0] * p
    return plain(p, p if p - duty < minimum else duty)


def plain(clocks: int, duty: int) -> list[int]:
    """Pulse without the rule."""
    return [int(c < duty) for c in range(clocks)]
