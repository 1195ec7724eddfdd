# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The vector algorithms of the firmware, called on the host: structures, prototypes and conversions."""

from __future__ import annotations

import ctypes
import math

from fluxlock.firmware import build_host_library, gain
from fluxlock.firmware.control_library import Gain, PiResult

I32, U32, I64, U64 = ctypes.c_int32, ctypes.c_uint32, ctypes.c_int64, ctypes.c_uint64
POINTER = ctypes.c_void_p


class Complex(ctypes.Structure):
    """complex_t."""

    _fields_ = [("re", I32), ("im", I32)]


class ComplexGain(ctypes.Structure):
    """complex_gain_t."""

    _fields_ = [("re", I32), ("im", I32), ("shift", I32)]


class Decay(ctypes.Structure):
    """decay_t."""

    _fields_ = [("factor_q30", I32), ("slope_q30", I32)]


class Machine(ctypes.Structure):
    """vector_machine_t."""

    _fields_ = [
        ("resistance_q30", U32),
        ("delay_q30", U32),
        ("admittance", Gain),
        ("impedance", Gain),
        ("period_cycles", U32),
        ("harmonic", U32),
        ("park", ctypes.c_int),
    ]


class Plant(ctypes.Structure):
    """vector_plant_t."""

    _fields_ = (("machine", Machine), ("factor_q30", I32), ("share_q30", I32), ("held_q30", I32))


class Model(ctypes.Structure):
    """vector_model_t."""

    _fields_ = [
        ("phi_q30", Complex),
        ("gamma1_q30", Complex),
        ("gamma1_share_q30", Complex),
        ("gamma2_q30", Complex),
        ("gamma_e_q30", Complex),
        ("turn_rad_q29", I32),
    ]


class RegulatorGains(ctypes.Structure):
    """regulator_gains_t."""

    _fields_ = [("g", Complex), ("h", Complex), ("ratio", Complex), ("shift", I32)]


class RegulatorDesign(ctypes.Structure):
    """regulator_design_t."""

    _fields_ = [("order", ctypes.c_int), ("bandwidth_q30", I32), ("gamma_q30", I32)]


class ComplexRegulator(ctypes.Structure):
    """complex_regulator_t."""

    _fields_ = [("voltage_v_q25", Complex), ("error_i_q17", Complex), ("carry_v_q25", Complex)]


class Observer(ctypes.Structure):
    """emf_observer_t."""

    _fields_ = [("current_i_q25", Complex), ("emf_v_q25", Complex), ("voltage_v_q25", Complex)]


class ObserverGains(ctypes.Structure):
    """emf_observer_gains_t."""

    _fields_ = [
        ("phi_q30", Complex),
        ("gamma1", Complex),
        ("gamma2", Complex),
        ("gamma_e", Complex),
        ("innovation_q30", I32),
        ("shift", I32),
        ("emf_gain", Complex),
        ("emf_shift", I32),
        ("emf_bits", I32),
    ]


class Pll(ctypes.Structure):
    """pll_t."""

    _fields_ = [("angle_turn_q36", U64), ("speed_turn_q60", I64), ("acceleration_turn_q60", I64)]


class PllGains(ctypes.Structure):
    """pll_gains_t."""

    _fields_ = [("angle", Gain), ("speed", Gain), ("acceleration", Gain), ("speed_max_turn_q36", I32)]


class FieldWeakening(ctypes.Structure):
    """field_weakening_t."""

    _fields_ = (("current_i_q30", I32),)


class FieldWeakeningSettings(ctypes.Structure):
    """field_weakening_settings_t."""

    _fields_ = (("ki", Gain), ("wanted_v_q25", I32), ("lowest_i_q25", I32))


class IfSettings(ctypes.Structure):
    """if_settings_t."""

    _fields_ = (
        ("current_i_q25", I32),
        ("rise_i_q25", I32),
        ("align_ticks", U32),
        ("acceleration_turn_q44", I32),
        ("minimum_v_q25", U32),
        ("tolerance_turn_q32", I32),
        ("steady_ticks", U32),
    )


class IfStart(ctypes.Structure):
    """if_start_t."""

    _fields_ = (
        ("speed_turn_q44", I64),
        ("current_i_q25", I32),
        ("aligned_ticks", U32),
        ("turn_q32", I32),
        ("steady_ticks", U32),
    )


def to_complex(z: Complex, unit: float = 1.0) -> complex:
    """Value of a pair of integers in multiples of `unit`."""
    return complex(z.re, z.im) / unit


def from_complex(z: complex, unit: float = 1.0) -> Complex:
    """Nearest pair of integers, `unit` to 1."""
    return Complex(round(z.real * unit), round(z.imag * unit))


def real_gain(value: float) -> Gain:
    """gain_t of a real factor > 0."""
    return Gain(*gain(value))


def model_at(lib: ctypes.CDLL, machine: Machine, speed_turn_q36: int) -> Model:
    """The firmware's model of a machine at a speed."""
    plant, model = Plant(), Model()
    lib.vector_plant(ctypes.byref(plant), ctypes.byref(machine))
    lib.vector_model(ctypes.byref(model), ctypes.byref(plant), speed_turn_q36)
    return model


def observer_gains(
    lib: ctypes.CDLL, machine: Machine, speed_turn_q36: int, pole1: float = 0.7, pole2: float = 0.7
) -> ObserverGains:
    """The firmware's gains of the observer for two real poles."""
    gains, model = ObserverGains(), model_at(lib, machine, speed_turn_q36)
    poles = round(pole1 * 2**30), round(pole2 * 2**30)
    lib.emf_observer_design(ctypes.byref(gains), ctypes.byref(machine), ctypes.byref(model), *poles)
    return gains


def pll_gains(pole: float, period_cycles: int, order: int = 2) -> PllGains:
    """Phase-locked loop with all its poles at `pole`, order 2 or 3; its speed is limited to 0.45 turns a period."""
    q = 1 - pole
    k_p, k_i, k_a = (2 * q, q**2, 0.0) if order == 2 else (3 * q, 3 * q**2, q**3)
    per_turn = 2**30 / (2 * math.pi) / period_cycles
    return PllGains(
        real_gain(k_p * 2**32 / (2 * math.pi * 2**30)),
        real_gain(k_i * per_turn),
        real_gain(k_a * per_turn),
        round(0.45 / period_cycles * 2**36),
    )


def vector_library() -> ctypes.CDLL:
    """The host library with the prototypes of the vector functions."""
    library = ctypes.CDLL(str(build_host_library()))
    for name, result, arguments in (
        ("cis_q30", Complex, [U32]),
        ("complex_angle_turn_q32", U32, [Complex]),
        ("complex_abs", U32, [Complex]),
        ("complex_mul_q30", Complex, [Complex, Complex]),
        ("complex_scale_q30", Complex, [Complex, I32]),
        ("complex_inverse", ComplexGain, [Complex]),
        ("sqrt_u64", U32, [U64]),
        ("decay_q30", Decay, [U32]),
        ("complex_gain_apply", Complex, [Complex, ComplexGain]),
        ("vector_turn_q32", I32, [POINTER, I32]),
        ("vector_lead_turn_q32", I32, [POINTER, I32]),
        ("vector_plant", None, [POINTER, POINTER]),
        ("vector_model", None, [POINTER, POINTER, I32]),
        ("vector_model_join", None, [POINTER, U32]),
        ("regulator_design", ctypes.c_bool, [POINTER, POINTER, POINTER, POINTER]),
        ("emf_observer_design", None, [POINTER, POINTER, POINTER, I32, I32]),
        ("emf_observer_preset", None, [POINTER, Complex, Complex, Complex]),
        ("emf_observer_step", None, [POINTER, POINTER, Complex]),
        ("emf_observer_voltage", None, [POINTER, POINTER, Complex]),
        ("pll_error_q30", I32, [Complex, I32, U32]),
        ("pll_error_from_q30", I32, [Complex, I32, U32, POINTER]),
        ("pll_preset", None, [POINTER, U32, I32]),
        ("pll_angle_turn_q32", U32, [POINTER]),
        ("pll_speed_turn_q36", I32, [POINTER]),
        ("pll_step", I32, [POINTER, POINTER, U32, I32]),
        ("complex_regulator_turn", None, [POINTER, Complex]),
        ("emf_observer_turn", None, [POINTER, Complex]),
        ("mtpa_current_i_q25", Complex, [I32, I32]),
        ("field_weakening_step", I32, [POINTER, POINTER, Complex, I32]),
        ("current_rest_i_q25", I32, [I32, I32]),
        ("vector_speed_preset", None, [POINTER, POINTER, I32, I32, I32]),
        ("vector_speed_step", PiResult, [POINTER, POINTER, I32, I32, I32, I32]),
        ("fade", I32, [I32, I32, I32]),
        ("if_begin", None, [POINTER]),
        ("if_resume", None, [POINTER, POINTER, I32, U32]),
        ("if_step", ctypes.c_bool, [POINTER, POINTER, I32]),
        ("if_speed_turn_q36", I32, [POINTER]),
        ("if_ready", ctypes.c_bool, [POINTER, POINTER, Complex]),
        ("if_turn_back_q32", I32, [Complex]),
        ("circle_limit_v_q25", Complex, [Complex, I32, POINTER]),
        ("complex_regulator_preset", None, [POINTER, Complex, Complex]),
        ("complex_regulator_step", ctypes.c_bool, [POINTER, POINTER, Complex, Complex, I32]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
