# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The pure algorithms of the firmware, called on the host: structures and prototypes."""

from __future__ import annotations

import ctypes

from fluxlock.firmware.toolchain import build_host_library


class Gain(ctypes.Structure):
    """gain_t."""

    _fields_ = [("mant", ctypes.c_int32), ("shift", ctypes.c_int32)]


class PiGains(ctypes.Structure):
    """pi_gains_t."""

    _fields_ = [("kp", Gain), ("ki", Gain)]


class PiState(ctypes.Structure):
    """pi_state_t."""

    _fields_ = [("integral_q5", ctypes.c_int32)]


class PiResult(ctypes.Structure):
    """pi_result_t."""

    _fields_ = [("output", ctypes.c_int32), ("unlimited", ctypes.c_int32)]


class Ramp(ctypes.Structure):
    """ramp_t."""

    _fields_ = [("value_rpm_q8", ctypes.c_int32), ("carry_q12", ctypes.c_uint32)]


class Limiter(ctypes.Structure):
    """limiter_t."""

    _fields_ = [("trim_v_q25", ctypes.c_int32)]


class Linearity(ctypes.Structure):
    """csc_linearity_t."""

    _fields_ = [("first_q16", ctypes.c_uint32), ("second_q16", ctypes.c_uint32), ("rest_q16", ctypes.c_uint32)]


class Balance(ctypes.Structure):
    """balance_t."""

    _fields_ = [("vertical_q25", ctypes.c_int32 * 3), ("horizontal_q25", ctypes.c_int32 * 3)]


class Catch(ctypes.Structure):
    """catch_t."""

    _fields_ = [
        ("angle", ctypes.c_uint32),
        ("step", ctypes.c_int32),
        ("travel", ctypes.c_int32),
        ("agreeing", ctypes.c_uint32),
        ("seen", ctypes.c_uint32),
    ]


class Handover(ctypes.Structure):
    """handover_t."""

    _fields_ = [
        ("crossings", ctypes.c_uint16),
        ("late", ctypes.c_uint8),
        ("clean", ctypes.c_uint16),
        ("plausible", ctypes.c_uint16),
    ]


class Stuck(ctypes.Structure):
    """stuck_t."""

    _fields_ = (("last_q17", ctypes.c_int32 * 3), ("same_ticks", ctypes.c_uint32 * 3), ("quiet_ticks", ctypes.c_uint32))


def control_library() -> ctypes.CDLL:
    """The host library with the prototypes of the pure functions."""
    library = ctypes.CDLL(str(build_host_library()))
    i32, u32, u64 = ctypes.c_int32, ctypes.c_uint32, ctypes.c_uint64
    for name, result, arguments in (
        ("gain_apply", i32, [i32, Gain]),
        ("mul_q16", i32, [i32, i32]),
        ("div_sat_u32", u32, [u64, u32]),
        ("div_u64", u64, [u64, u32]),
        ("sqrt_u32", u32, [u32]),
        ("crc32", u32, [ctypes.c_char_p, ctypes.c_size_t]),
        ("pi_step", PiResult, [ctypes.c_void_p, ctypes.c_void_p, i32, i32, i32, i32]),
        ("pi_preset", None, [ctypes.c_void_p, Gain, i32, i32, i32]),
        ("ramp_step", i32, [ctypes.c_void_p, i32, i32, i32, i32]),
        ("ramp_preset", None, [ctypes.c_void_p, i32]),
        ("speed_numerator_q8", u64, [u32, u32]),
        ("speed_from_period_rpm_q8", i32, [u64, u32]),
        ("limiter_bound", i32, [ctypes.c_void_p, ctypes.c_void_p, i32, i32, i32]),
        ("limiter_update", None, [ctypes.c_void_p, ctypes.c_void_p, i32, i32, ctypes.c_bool]),
        ("duty_from_voltage_q30", i32, [i32, i32, i32]),
        ("voltage_from_duty_v_q25", i32, [i32, i32, i32]),
        ("carrier_period_cycles", u32, [i32, u32, u32, u32]),
        ("pulse_cycles_q8", u32, [i32, u32, u32]),
        ("line_current_ratio_q16", i32, [i32, i32, i32, i32, i32]),
        ("line_current", i32, [i32, i32]),
        ("line_current_limit_q25", i32, [i32, i32]),
        ("torque_reference", i32, [i32, Gain, i32, i32, i32, i32, i32]),
        ("csc_linearity", Linearity, [u32, u32, u32]),
        ("csc_linear_duty_q30", i32, [ctypes.c_void_p, i32]),
        ("balance_errors", None, [ctypes.c_void_p, ctypes.c_bool, ctypes.c_void_p]),
        ("balance_step", None, [ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, Gain, i32]),
        ("balance_threshold_q17", i32, [ctypes.c_void_p, u32, i32]),
        ("advance_added_q16", i32, [i32, i32, i32, i32]),
        ("advance_total_q16", i32, [i32, i32]),
        ("vector_angle", u32, [i32, i32]),
        ("catch_step", ctypes.c_bool, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]),
        ("catch_restore", i32, [ctypes.c_void_p, i32, ctypes.c_void_p]),
        ("catch_sector", u32, [u32, ctypes.c_bool]),
        ("stuck_reset", None, [ctypes.c_void_p]),
        ("stuck_step", ctypes.c_bool, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_bool, u32]),
        ("catch_sector_cycles", u32, [i32, u32]),
        ("brake_current", i32, [i32, i32, i32, i32, Gain]),
        ("start_sector", u32, [u32, ctypes.c_bool]),
        ("forced_interval_cycles", u32, [u32, u32]),
        ("handover_reset", None, [ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint8]),
        ("handover_step", None, [ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint8, u32, u32, u32]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
