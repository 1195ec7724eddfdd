# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The injection's algorithms of the firmware, called on the host: structures, prototypes, settings from SI units."""

from __future__ import annotations

import ctypes
import math

from fluxlock.firmware.block import gain
from fluxlock.firmware.control_library import Gain, PiGains, PiState
from fluxlock.firmware.toolchain import build_host_library
from fluxlock.firmware.vector_library import I32, POINTER, U32, Complex, Machine, Pll, PllGains, real_gain

LOCK_IN, CONVENTIONAL, IQ, SEPARATOR = range(4)
SEQUENCES = ("held-tian", "held", "half-step", "exact")
Q16, Q17, Q25, Q29, Q32 = 2**16, 2**17, 2**25, 2**29, 2**32
SEPARATOR_FULL_SCALE = 2**18


class Amplitude(ctypes.Structure):
    """injection_amplitude_t."""

    _fields_ = (("d", Complex), ("q", Complex), ("count", U32))


class ErrorSettings(ctypes.Structure):
    """injection_error_settings_t."""

    _fields_ = (
        ("method", ctypes.c_int),
        ("ratio", Gain),
        ("loss", Gain),
        ("expected", Gain),
        ("shift", I32),
        ("minimum_i_q17", U32),
    )


class Leads(ctypes.Structure):
    """angle_sequence_leads_t."""

    _fields_ = (("lead_q32", I32), ("report_q32", I32))


class CrossCouplingSettings(ctypes.Structure):
    """cross_coupling_settings_t."""

    _fields_ = (("c_q32", I32 * 4), ("current", Gain), ("filter_q16", I32), ("following", ctypes.c_bool))


class CrossCoupling(ctypes.Structure):
    """cross_coupling_t."""

    _fields_ = (("i_q25", I32), ("c_q32", I32))


REST_PHASES = ("first", "second", "lock", "plus", "minus", "release", "found", "not sure", "no signal")


class RestSettings(ctypes.Structure):
    """rest_position_settings_t."""

    _fields_ = (
        ("settle", U32),
        ("frame_count", U32),
        ("lock", U32),
        ("current_settle", U32),
        ("current_count", U32),
        ("current_i_q25", I32),
        ("rise_i_q25", I32),
        ("sure_q16", I32),
        ("minimum_i_q21", I32),
    )


class RestPosition(ctypes.Structure):
    """rest_position_t."""

    _fields_ = (
        ("phase", ctypes.c_int),
        ("results", U32),
        ("sum_i_q21", ctypes.c_int64),
        ("first_i_q21", I32),
        ("plus_i_q21", I32),
        ("minus_i_q21", I32),
        ("current_i_q25", I32),
    )


class RestCommand(ctypes.Structure):
    """rest_position_command_t."""

    _fields_ = (("turn_q32", I32), ("current_i_q25", I32), ("track", ctypes.c_bool))


class HandoverSettings(ctypes.Structure):
    """injection_handover_settings_t."""

    _fields_ = (("up_turn_q36", I32), ("down_turn_q36", I32), ("step_q16", I32), ("results", U32))


class InjectionHandover(ctypes.Structure):
    """injection_handover_t."""

    _fields_ = (("share_q16", I32), ("emf", ctypes.c_bool), ("inject", ctypes.c_bool), ("results", U32))


VERDICTS = ("good", "derated", "no_signal", "noise", "no_saliency")


class ValiditySettings(ctypes.Structure):
    """injection_validity_settings_t."""

    _fields_ = (
        ("minimum_i_q21", I32),
        ("expected_i_q21", I32),
        ("saliency_q16", U32),
        ("derate_ratio_q16", U32),
        ("fault_ratio_q16", U32),
        ("noise_factor_q16", U32),
        ("derate_noise_q16", U32),
        ("fault_noise_q16", U32),
        ("filter_shift", I32),
        ("fault_results", U32),
    )


class Validity(ctypes.Structure):
    """injection_validity_t."""

    _fields_ = (
        ("mean_i_q37", ctypes.c_int64),
        ("scatter_i_q37", ctypes.c_int64),
        ("last_i_q21", Complex),
        ("seen", U32),
        ("bad", U32),
        ("noise_q16", U32),
        ("ratio_q16", U32),
        ("share_q16", U32),
        ("verdict", ctypes.c_int),
    )


class FrameSettings(ctypes.Structure):
    """injection_frame_settings_t."""

    _fields_ = (
        ("error", ErrorSettings),
        ("rest", RestSettings),
        ("handover", HandoverSettings),
        ("validity", ValiditySettings),
        ("pll", PllGains),
        ("sequence", ctypes.c_int),
        ("machine", Machine),
        ("coupling", CrossCouplingSettings),
        ("speed", PiGains),
        ("speed_filter_q16", I32),
        ("third_q16", I32),
        ("limit_i_q25", I32),
    )


class FrameInput(ctypes.Structure):
    """injection_frame_input_t."""

    _fields_ = (
        ("fresh", ctypes.c_bool),
        ("amplitude", Amplitude),
        ("current_i_q25", Complex),
        ("emf_error_q30", I32),
        ("emf_there", ctypes.c_bool),
        ("by_speed", ctypes.c_bool),
        ("speed_turn_q36", I32),
        ("current_wanted_i_q25", Complex),
    )


class FrameCommand(ctypes.Structure):
    """injection_frame_command_t."""

    _fields_ = (
        ("turn_q32", I32),
        ("speed_turn_q36", I32),
        ("lead_q32", I32),
        ("report_q32", I32),
        ("curve_q32", I32),
        ("reference_i_q25", Complex * 2),
        ("inject", ctypes.c_bool),
    )


class Frame(ctypes.Structure):
    """injection_frame_t."""

    _fields_ = (
        ("resting", ctypes.c_bool),
        ("rest", RestPosition),
        ("handover", InjectionHandover),
        ("validity", Validity),
        ("amplitude", Amplitude),
        ("judge", ctypes.c_bool),
        ("pll", Pll),
        ("coupling", CrossCoupling),
        ("speed", PiState),
        ("filtered_q52", ctypes.c_int64),
        ("error_q30", I32),
        ("curve_q32", I32),
        ("turn_q30", Complex),
        ("third_turn_q30", Complex),
        ("wanted_i_q25", I32),
        ("limited", ctypes.c_bool),
    )


class OpenPhaseSettings(ctypes.Structure):
    """open_phase_settings_t."""

    _fields_ = (("share_q16", U32), ("minimum_i_q17", U32), ("turn_q32", U32))


class OpenPhase(ctypes.Structure):
    """open_phase_t."""

    _fields_ = (("open", U32), ("angle_q32", U32), ("quiet_q32", I32 * 5), ("samples", U32 * 5))


def error_settings(
    method: int,
    l_d_h: float,
    l_q_h: float,
    *,
    r_ohm: float = 0.0,
    injection_hz: float = 1.0,
    expected_volt_seconds: float = 0.0,
    full_scale_a: float = 1.0,
    shift: int = 0,
    minimum_a: float = 0.0,
) -> ErrorSettings:
    """Settings of the angle error; expected_volt_seconds: T_h U_h for the separator by its expected size, else 0."""
    difference = l_q_h - l_d_h
    expected = gain(0.0)
    if expected_volt_seconds:
        k_per_a = 4 * l_d_h * l_q_h / (expected_volt_seconds * difference)
        expected = gain(k_per_a * full_scale_a / SEPARATOR_FULL_SCALE * Q29)
    return ErrorSettings(
        method,
        real_gain(l_q_h / difference),
        Gain(*gain(r_ohm / (2 * math.pi * injection_hz * difference))),
        Gain(*expected),
        shift,
        round(minimum_a / full_scale_a * Q17),
    )


def cross_coupling_settings(
    angle_rad: tuple[float, ...], most_a: float, full_scale_a: float, filter_share: float = 1.0, following: bool = False
) -> CrossCouplingSettings:
    """Curve of a motor file, coefficients in powers of A, held beyond +-most_a."""
    turns = [angle_rad[k] * most_a**k / (2 * math.pi) if k < len(angle_rad) else 0.0 for k in range(4)]
    return CrossCouplingSettings(
        (I32 * 4)(*(round(turn * Q32) for turn in turns)),
        real_gain(Q29 / (most_a / full_scale_a * Q25)),
        round(filter_share * Q16),
        following,
    )


def injection_library() -> ctypes.CDLL:
    """The host library with the prototypes of the injection's functions."""
    library = ctypes.CDLL(str(build_host_library()))
    for name, result, arguments in (
        ("injection_magnitude_i_q17", U32, [POINTER, POINTER]),
        ("injection_error_q30", I32, [POINTER, POINTER]),
        ("injection_vector_i_q21", Complex, [POINTER, POINTER]),
        ("open_phase_begin", None, [POINTER]),
        ("open_phase_step", U32, [POINTER, POINTER, POINTER, U32, U32, U32]),
        ("angle_sequence_leads", Leads, [ctypes.c_int, POINTER, I32]),
        ("rest_position_begin", None, [POINTER]),
        ("rest_position_step", RestCommand, [POINTER, POINTER, ctypes.c_bool, Complex]),
        ("injection_handover_begin", None, [POINTER, ctypes.c_bool]),
        ("injection_handover_step", None, [POINTER, POINTER, I32, ctypes.c_bool, ctypes.c_bool]),
        ("injection_handover_error_q30", I32, [POINTER, I32, I32]),
        ("injection_handover_curve_q32", I32, [POINTER, I32]),
        ("injection_validity_begin", None, [POINTER]),
        ("injection_validity_step", None, [POINTER, POINTER, Complex]),
        ("injection_verdict_name", ctypes.c_char_p, [ctypes.c_int]),
        ("injection_frame_begin", None, [POINTER, POINTER, ctypes.c_bool, I32]),
        ("injection_frame_step", FrameCommand, [POINTER, POINTER, POINTER]),
        ("cross_coupling_curve_q32", I32, [POINTER, I32]),
        ("cross_coupling_begin", None, [POINTER, POINTER, I32]),
        ("cross_coupling_step", I32, [POINTER, POINTER, I32]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
