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


def levels(period: int, duty: int, minimum: int, p: int) -> tuple[list[int], int]:
    """Pulse of a carrier with an announced commutation at its clock p (NSC), and changes counted for it.

    duty: clocks, neither between 1 and `minimum` nor, unless a whole period, within it of the period.
    """
    plain = [int(c < duty) for c in range(period)]
    if duty in (0, period) or p == 0:
        return plain, 0
    if p < minimum:  # the pulse waits for the commutation, and is left out if too little is left of it then
        fits = duty - p >= minimum
        return [int(fits and p <= c < duty) for c in range(period)], 1 if fits else 2
    if p < duty:  # a rest too short ends with the commutation
        short = duty - p < minimum
        return [int(c < (p if short else duty)) for c in range(period)], int(short)
    if p + minimum > period:  # the rest of the carrier is filled; so is a gap that would end too soon
        return [int(c < duty or c >= p or p - duty < minimum) for c in range(period)], 1
    return [int(c < duty or c < p < duty + minimum) for c in range(period)], 0
