# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Angles, vectors and decay of the vector firmware against exact arithmetic."""

from __future__ import annotations

import cmath
import math
from random import Random

from fluxlock.firmware.vector_formats import Complex, to_complex
from fluxlock.headers import CData

SEED = 20
Q30 = 2**30
Q32 = 2**32


def some_angles(rng: Random) -> list[int]:
    """Angles q32: every eighth of a turn with its neighbours, and random ones."""
    eighths = [(k * 2**29 + d) % Q32 for k in range(8) for d in (-2, -1, 0, 1, 2)]
    return eighths + [rng.getrandbits(32) for _ in range(20_000)]


def some_vectors(rng: Random) -> list[Complex]:
    """Vectors of all lengths and directions, along and next to the axes and diagonals."""
    corners = (-(2**31) + 1, -(2**30), -7, -1, 0, 1, 5, 2**17, 2**31 - 1)
    found = [Complex(re, im) for re in corners for im in corners if re or im]
    for _ in range(20_000):
        z = cmath.rect(2 ** rng.uniform(0, 30.9), rng.uniform(-math.pi, math.pi))
        if abs(z) >= 1:
            found.append(Complex(round(z.real), round(z.imag)))
    return found


def test_sine_and_cosine(lib: CData) -> None:
    """Both within 2e-9 at random angles, exact on the axes, the mirror image exact.

    Verifies: VC-01
    """
    worst = 0.0
    for angle in some_angles(Random(SEED)):
        z = to_complex(lib.cis_q30(angle), Q30)
        error = z - cmath.exp(2j * math.pi * angle / Q32)
        worst = max(worst, abs(error.real), abs(error.imag))
        assert to_complex(lib.cis_q30(-angle % Q32), Q30) == z.conjugate(), (SEED, angle)
    print(f"seed {SEED}: worst part {worst:.2e}")
    assert worst < 2e-9
    assert [to_complex(lib.cis_q30(k * Q32 // 4), Q30) for k in range(4)] == [1, 1j, -1, -1j]


def test_angle_and_length_of_a_vector(lib: CData) -> None:
    """Angle within 5 units of 2^-32 of a turn, length the floor, for all lengths and directions.

    Verifies: VC-01
    """
    worst = 0.0
    for z in some_vectors(Random(SEED)):
        exact = math.atan2(z.im, z.re) / (2 * math.pi) * Q32
        error = (lib.complex_angle_turn_q32(z) - exact + Q32 / 2) % Q32 - Q32 / 2
        worst = max(worst, abs(error))
        assert lib.complex_abs(z) == math.isqrt(z.re**2 + z.im**2), (z.re, z.im)
    print(f"seed {SEED}: worst angle {worst:.2f} * 2^-32 turn")
    assert worst < 5
    assert lib.complex_angle_turn_q32(Complex(0, 0)) == 0
    quarters = [lib.complex_angle_turn_q32(Complex(*z)) / 2**30 for z in ((9, 0), (0, 9), (-9, 0), (0, -9))]
    assert quarters == [0, 1, 2, 3]


def test_root_of_64_bits_is_the_floor(lib: CData) -> None:
    """Random numbers of all lengths, squares and their neighbours.

    Verifies: VC-01
    """
    rng = Random(SEED)
    numbers = [0, 1, 2**64 - 1, 2**63, 2**32 - 1, 2**32] + [rng.getrandbits(rng.randint(1, 64)) for _ in range(20_000)]
    for _ in range(5_000):
        square = rng.getrandbits(rng.randint(1, 32)) ** 2
        numbers += [square, square + 1, max(square - 1, 0)]
    for high in (2**15, 2**16 - 1):  # largest rests of the upper half
        numbers += [(high**2 + 2 * high) * 2**32 + low for low in (0, 2**32 - 1)]
    for n in numbers:
        assert lib.sqrt_u64(n) == math.isqrt(n), n


def test_decay(lib: CData) -> None:
    """exp(-x) and (1 - exp(-x))/x within 3e-9 for 0 <= x < 2.

    Verifies: VC-01
    """
    rng = Random(SEED)
    worst = 0.0
    for x in [0, 1, 2, 2**31 - 1, 2**30, *(rng.getrandbits(rng.randint(1, 31)) for _ in range(20_000))]:
        decay, y = lib.decay_q30(x), x / Q30
        worst = max(worst, abs(decay.factor_q30 / Q30 - math.exp(-y)))
        worst = max(worst, abs(decay.slope_q30 / Q30 - (-math.expm1(-y) / y if x else 1.0)))
    print(f"seed {SEED}: worst {worst:.2e}")
    assert worst < 3e-9


def test_complex_products_and_inverse(lib: CData) -> None:
    """Products round half up and saturate; the inverse is right to 2^-27 of its length.

    Verifies: VC-02
    """
    rng = Random(SEED)
    most = 2**31 - 1
    vectors = some_vectors(rng)
    for a in vectors[:4000]:
        b = rng.choice(vectors)
        re, im = a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re
        wanted = [max(-most - 1, min(most, (x + 2**29) >> 30)) for x in (re, im)]
        got = lib.complex_mul_q30(a, b)
        assert [got.re, got.im] == wanted, (SEED, a.re, a.im, b.re, b.im)
        inverse = lib.complex_inverse(a)
        product = complex(inverse.re, inverse.im) * 2.0**-inverse.shift * to_complex(a)
        assert abs(product - 1) < 2**-27, (SEED, a.re, a.im)
    zero = lib.complex_inverse(Complex(0, 0))
    assert complex(zero.re, zero.im) * 2.0**-zero.shift == 1
