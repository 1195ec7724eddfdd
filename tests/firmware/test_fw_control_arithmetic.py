# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fixed point, checksum and angles of the firmware against exact arithmetic."""

from __future__ import annotations

import math
import zlib
from random import Random

import pytest

from fluxlock.firmware import gain
from fluxlock.headers import CData

PRODUCT_MAX = 2**29 - 1


def some_ints(rng: Random, bits: int, count: int) -> list[int]:
    """Integers of all magnitudes below 2^bits, with the corners."""
    corners = [0, 1, 2, 3, 2**bits - 1, 2 ** (bits - 1), 2 ** (bits // 2), 2 ** (bits // 2) - 1]
    return corners + [rng.getrandbits(rng.randint(1, bits)) for _ in range(count)]


def test_division_and_root_are_exact(lib: CData) -> None:
    """Division saturates and is exact, also where a trial digit has to be corrected; the root is the floor.

    Verifies: FW-02
    """
    rng = Random(1)
    for n in some_ints(rng, 64, 150):
        assert lib.sqrt_u32(n >> 32) == math.isqrt(n >> 32), n
        for d in some_ints(rng, 32, 20):
            wanted = 2**32 - 1 if d == 0 else min(n // d, 2**32 - 1)
            assert lib.div_sat_u32(n, d) == wanted, (n, d)
            if d:
                assert lib.div_u64(n, d) == n // d, (n, d)


def test_gain_rounds_and_saturates(lib: CData) -> None:
    """X * mant / 2^shift rounded half up and limited, over all shifts.

    Verifies: FW-02
    """
    rng = Random(2)
    for shift in range(4, 63):
        for _ in range(60):
            x = rng.choice([-1, 1]) * rng.choice(some_ints(rng, 31, 4))
            mant = rng.choice([-1, 1]) * rng.choice(some_ints(rng, 31, 4))
            exact = (x * mant + (1 << (shift - 1))) >> shift
            wanted = max(-PRODUCT_MAX, min(PRODUCT_MAX, exact))
            assert lib.gain_apply(x, (mant, shift)) == wanted, (x, mant, shift)
    for value in (1e-6, 0.37, 1.0, 4000.0):
        mant, shift = gain(value)
        assert mant * 2.0**-shift == pytest.approx(value, rel=2**-29)
        assert lib.gain_apply(1000, (mant, shift)) == pytest.approx(1000 * value, abs=0.51)


def test_crc_is_the_ieee_one(lib: CData) -> None:
    """Same checksums as zlib.

    Verifies: FW-03
    """
    rng = Random(3)
    assert lib.crc32(b"123456789", 9) == 0xCBF43926
    for length in (0, 1, 3, 64, 500):
        data = rng.randbytes(length)
        assert lib.crc32(data, length) == zlib.crc32(data)


def turn_difference_deg(a: int, b_deg: float) -> float:
    """Angle a (2^32 = one turn) less b in degrees, -180..180."""
    return (a / 2**32 * 360.0 - b_deg + 180.0) % 360.0 - 180.0


def test_vector_angle(lib: CData) -> None:
    """All directions and lengths: within 0.1 degrees plus the resolution of the components.

    Verifies: FW-30
    """
    rng = Random(9)
    for _ in range(5000):
        length, angle = 2 ** rng.uniform(8, 18), rng.uniform(0, 360)
        x = round(length * math.cos(math.radians(angle)))
        y = round(length * math.sin(math.radians(angle)))
        exact = math.degrees(math.atan2(y, x))
        assert abs(turn_difference_deg(lib.vector_angle(x, y), exact)) < 0.1 + 5e-3
    for x, y, wanted in ((0, 0, 0), (5, 0, 0), (0, 5, 90), (-5, 0, 180), (0, -5, 270), (7, 7, 45)):
        assert abs(turn_difference_deg(lib.vector_angle(x, y), wanted)) < 0.01
