"""The vector algorithms of the firmware, called on the host: structures, prototypes and conversions."""

from __future__ import annotations

import ctypes

from fluxlock.firmware import build_host_library, gain
from tests.firmware.control_library import Gain

I32, U32, U64 = ctypes.c_int32, ctypes.c_uint32, ctypes.c_uint64
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


def to_complex(z: Complex, unit: float = 1.0) -> complex:
    """Value of a pair of integers in multiples of `unit`."""
    return complex(z.re, z.im) / unit


def from_complex(z: complex, unit: float = 1.0) -> Complex:
    """Nearest pair of integers, `unit` to 1."""
    return Complex(round(z.real * unit), round(z.imag * unit))


def real_gain(value: float) -> Gain:
    """gain_t of a real factor > 0."""
    return Gain(*gain(value))


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
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
