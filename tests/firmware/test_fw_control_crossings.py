# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Linearity under CSC, adaptive thresholds and advance of the firmware against models in floating point."""

from __future__ import annotations

import math
from random import Random

import pytest

from fluxlock.firmware import gain
from fluxlock.firmware.binding import address, new
from fluxlock.headers import CData


def linear_duty(lib: CData, sector: int, period: int, mean: float, tolerance: int = 655) -> float:
    """Duty that the firmware makes of a wanted mean."""
    factors = lib.csc_linearity(sector, period, tolerance)
    return float(lib.csc_linear_duty_q30(address(factors), round(mean * 2**30))) / 2**30


def cut_mean(sector: int, period: int, duty: float) -> float:
    """Mean of a train of pulses that starts with the sector and is cut at its end."""
    return sum(min(duty * period, sector - start) for start in range(0, sector, period)) / sector


def test_csc_linearity_gives_the_wanted_mean(lib: CData) -> None:
    """N 0.8 to 8, M 0.02 to 1: the mean of the cut train is the wanted one within 1e-3, also at and about integers.

    Verifies: FW-27
    """
    period = 1250
    sectors = [round(period * (0.8 + 0.01 * k)) for k in range(721)]
    sectors += [n * period + d for n in range(1, 9) for d in (-2, -1, 0, 1, 2)]
    for sector in sectors:
        last = -1.0
        for mean in [0.02 * k for k in range(1, 51)]:
            duty = linear_duty(lib, sector, period, mean, 0)
            assert 0.0 <= duty <= 1.0
            assert duty >= last
            last = duty
            error = cut_mean(sector, period, duty) - mean
            assert abs(error) < 1e-3, (sector / period, mean)
    # Without the correction it is far off.
    assert max(abs(cut_mean(s, period, m) - m) for s in sectors[:100] for m in (0.2, 0.5, 0.8)) > 0.15


def test_csc_linearity_tolerates_jitter_about_integers(lib: CData) -> None:
    """Within the tolerance below an integer the duty is the mean; it is continuous there within 1 %.

    Verifies: FW-27
    """
    for n in range(1, 9):
        for mean in (0.02, 0.3, 0.7, 0.99):
            at = linear_duty(lib, n * 1250, 1250, mean)
            assert at == pytest.approx(mean, abs=1e-4)
            assert linear_duty(lib, n * 1250 - 12, 1250, mean) == pytest.approx(mean, abs=1e-4)
            assert linear_duty(lib, n * 1250 + 12, 1250, mean) == pytest.approx(mean, abs=0.011)
            assert linear_duty(lib, n * 1250 - 14, 1250, mean) == pytest.approx(mean, abs=0.013)
    # Very many carriers, and an interval that is not measured yet: nothing to correct.
    assert linear_duty(lib, 0xFFFFFF, 1250, 0.37) == pytest.approx(0.37, abs=1e-6)


def carried_mean(sector: int, period: int, duty: float, min_pulse: int, sectors: int = 400) -> float:
    """Mean with whole clocks, the minimum-pulse rule and the carrier's account of volt-seconds, as fl_carrier states.

    A carrier of n clocks owes min(duty, n); what a pulse gave more or less goes into the next one.
    """
    carry, on = 0.0, 0
    for _ in range(sectors):
        for start in range(0, sector, period):
            n = min(period, sector - start)
            want = duty * period + carry
            width = 0 if want < min_pulse else min(int(want), n)
            if n - width < min_pulse:
                width = n
            # The commutation would cut the pulse too short: it is not started.
            width = 0 if n < min_pulse else width
            carry += min(duty * period, n) - width
            carry = max(-period, min(period, carry))
            on += width
    return on / (sectors * sector)


def test_csc_linearity_with_minimum_pulses(lib: CData) -> None:
    """Vanishing pulses and gaps return through the carrier's account: the mean holds within 0.4 %.

    Verifies: FW-27
    """
    rng = Random(7)
    for _ in range(1500):
        sector, mean = rng.randint(1000, 10_000), rng.uniform(0.02, 0.98)
        duty = linear_duty(lib, sector, 1250, mean)
        got = carried_mean(sector, 1250, duty, 20)
        tolerance = 0.004 if (sector + 12) % 1250 > 12 else 0.015
        assert got == pytest.approx(mean, abs=tolerance), (sector / 1250, mean, duty)


def crossing_lag_rad(threshold: float, divider: float, asymmetry: float, emf: float, rises: bool) -> float:
    """How late a crossing comes: v = K (1/2 + 3/2 psi w sin + dv) in fractions of vdc meets the threshold."""
    level = (threshold / divider - 0.5 - asymmetry) / (1.5 * emf)
    return math.asin(level) if rises else -math.asin(level)


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("mode", [1, 2])
def test_balance_evens_out_the_crossings(lib: CData, mode: int, backward: bool) -> None:
    """Divider gains 1.10, 1.00, 0.90 end at thresholds of 0.550, 0.500, 0.450; inductances are seen in `both` only.

    Verifies: FW-28
    """
    turn, emf, bandwidth = 150_000, 0.1775, 280.0  # psi w over vdc: Motor-II at 20 000 r/min, 15 V
    dividers, inductances = (1.10, 1.00, 0.90), (27.5, 27.2, 28.6)
    high, low, opened = (0, 0, 1, 1, 2, 2), (1, 2, 2, 0, 0, 1), (2, 1, 0, 2, 1, 0)
    dv = [-0.5 * (1 - math.sqrt(3) * emf) * (inductances[h] - inductances[k]) / (inductances[h] + inductances[k])
          for h, k in zip(high, low, strict=True)]  # fmt: skip
    if mode == 1:
        dv = [0.0] * 6
    step = gain(bandwidth * 2 * math.pi / 50e6 * 1.5 * emf * 2**25 / 6)
    balance = new("balance_t")
    intervals, errors = new("uint32_t[6]"), new("int32_t[6]")
    history = []
    for _ in range(100):
        thresholds = [lib.balance_threshold_q17(balance, s, 65536) / 2**17 for s in range(6)]
        lag = [
            crossing_lag_rad(thresholds[s], dividers[opened[s]], dv[s], emf, (s % 2 == 1) != backward) for s in range(6)
        ]
        for s in range(6):
            before = lag[(s + 1) % 6] if backward else lag[s - 1]
            intervals[s] = round(turn / 6 + (lag[s] - before) / (2 * math.pi) * turn)
        history.append(max(abs(6 * t / turn - 1) * 60 for t in intervals))
        lib.balance_errors(intervals, backward, errors)
        lib.balance_step(balance, mode, errors, step, round(0.15 * 2**25))
    assert history[0] > 10.0
    assert history[-1] < 0.05
    # First order: w T_turn of the rest in a turn.
    assert history[5] < history[0] * (1 - bandwidth * turn / 50e6) ** 5 * 2.0 + 0.1
    for s in range(6):
        assert thresholds[s] == pytest.approx(dividers[opened[s]] * (0.5 + dv[s]), abs=1.5e-3), s
    # What is excluded returns to zero.
    lib.balance_step(balance, 0, errors, step, round(0.15 * 2**25))
    assert [lib.balance_threshold_q17(balance, s, 60000 + s) for s in range(6)] == [60000 + s for s in range(6)]


def test_balance_is_limited_and_blind_to_a_common_lag(lib: CData) -> None:
    """A lag in all sectors changes nothing; an absurd one is limited.

    Verifies: FW-28
    """
    balance, errors = new("balance_t"), new("int32_t[6]")
    lib.balance_errors([20_000] * 6, False, errors)
    assert list(errors) == [0] * 6
    lib.balance_errors([30_000, 10_000] * 3, False, errors)
    for _ in range(1000):
        lib.balance_step(balance, 2, errors, gain(5.0), 1_000_000)
    assert all(abs(abs(v) - 1_000_000) < 2 for v in balance.vertical_q25)


def test_advance_is_linear_and_limited(lib: CData) -> None:
    """Two products, rounded; the sum within 30 degrees.

    Verifies: FW-29
    """
    rng = Random(8)
    for _ in range(300):
        speed, current = rng.randint(-32768, 32767), rng.randint(-32768, 32767)
        a, b = rng.randint(0, 65536), rng.randint(0, 131072)
        added = lib.advance_added_q16(speed, a, current, b)
        assert added == pytest.approx(speed * a / 65536 + current * b / 65536, abs=1.01)
        base = rng.randint(-32768, 32767)
        assert lib.advance_total_q16(base, added) == max(-32767, min(32767, base + added))
