# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The injection's algorithms of the firmware on the host: their C structures from SI units."""

from __future__ import annotations

import math

from fluxlock.firmware.binding import constant, new
from fluxlock.firmware.block import gain
from fluxlock.headers import CData

Q16, Q17, Q25, Q29, Q32 = 2**16, 2**17, 2**25, 2**29, 2**32
SEPARATOR_FULL_SCALE = 2**18


def error_settings(
    method: str,
    l_d_h: float,
    l_q_h: float,
    *,
    r_ohm: float = 0.0,
    injection_hz: float = 1.0,
    expected_volt_seconds: float = 0.0,
    full_scale_a: float = 1.0,
    shift: int = 0,
    minimum_a: float = 0.0,
) -> CData:
    """injection_error_settings_t. method: `lock_in`, `conventional`, `iq` or `separator`.

    expected_volt_seconds: T_h U_h for the separator by its expected size, else 0.
    """
    difference = l_q_h - l_d_h
    expected = 0.0
    if expected_volt_seconds:
        k_per_a = 4 * l_d_h * l_q_h / (expected_volt_seconds * difference)
        expected = k_per_a * full_scale_a / SEPARATOR_FULL_SCALE * Q29
    return new(
        "injection_error_settings_t",
        method=constant("INJECTION", method),
        ratio=gain(l_q_h / difference),
        loss=gain(r_ohm / (2 * math.pi * injection_hz * difference)),
        expected=gain(expected),
        shift=shift,
        minimum_i_q17=round(minimum_a / full_scale_a * Q17),
    )


def cross_coupling_settings(
    angle_rad: tuple[float, ...], most_a: float, full_scale_a: float, filter_share: float = 1.0, following: bool = False
) -> CData:
    """cross_coupling_settings_t of a motor file's curve, coefficients in powers of A, held beyond +-most_a."""
    turns = [angle_rad[k] * most_a**k / (2 * math.pi) if k < len(angle_rad) else 0.0 for k in range(4)]
    return new(
        "cross_coupling_settings_t",
        c_q32=[round(turn * Q32) for turn in turns],
        current=gain(Q29 / (most_a / full_scale_a * Q25)),
        filter_q16=round(filter_share * Q16),
        following=following,
    )


def handover_settings(up_turn_q36: float, down_turn_q36: float, share_step: float, results: int) -> CData:
    """injection_handover_settings_t. Speeds in 2^-36 turn per clock; share_step: change of the share per step."""
    return new(
        "injection_handover_settings_t",
        up_turn_q36=round(up_turn_q36),
        down_turn_q36=round(down_turn_q36),
        step_q16=round(share_step * Q16),
        results=results,
    )
