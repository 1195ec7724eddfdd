# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Mean of the output under CSC against generated gates and explicit pulse lists."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.theory.six_step.fourier import space_vector
from fluxlock.theory.six_step.linearity import (
    compensated_duty,
    mean_output,
    mean_with_min_pulse,
    whole_and_rest,
)
from fluxlock.theory.six_step.patterns import gate_sequence


def mean_of_gates(n: float, duty: float) -> float:
    """Share of a turn in which a pair of phases is excited."""
    sequence = gate_sequence("CSC", n, duty, turns=1)
    width = np.diff(sequence.at, append=sequence.length)
    return float(np.sum(np.abs(space_vector(sequence.gates)) * width))


def test_mean_against_gates() -> None:
    """(5.16) and (5.17) are the mean of the generated gates, integer N and N < 1 included.

    Verifies: THEORY-10
    """
    rng = np.random.default_rng(5)
    for n in (*rng.uniform(0.3, 8.0, 60), 1.0, 2.0, 3.0, 3.125, 0.5):
        for duty in (*rng.uniform(0.0, 1.0, 5), 0.0, 1.0):
            assert float(mean_output(duty, n)) == pytest.approx(mean_of_gates(float(n), float(duty)), abs=1e-9)


def test_compensation_is_exact() -> None:
    """(5.18) gives the wanted mean at every N and mean, and exactly one of M1 and M2 is valid.

    Verifies: THEORY-10
    """
    n = np.concatenate([np.linspace(0.2, 9.0, 881), [1 - 1e-12, 3 - 1e-12, 3 + 1e-12]])[:, None]
    wanted = np.linspace(0.0, 1.0, 201)
    assert np.abs(mean_output(compensated_duty(wanted, n), n) - wanted).max() < 1e-9
    whole, rest = whole_and_rest(n)
    first, second = n / (whole + 1) * wanted, 1 - n / np.maximum(whole, 1) * (1 - wanted)
    inside = (whole >= 1) & (np.abs(first - rest) > 1e-6)
    assert np.array_equal((first <= rest)[inside], ~(second > rest)[inside])


def test_without_compensation() -> None:
    """A cut pulse only adds: up to 0.101 at N from 2 to 7, nothing at integers.

    Verifies: THEORY-10
    """
    duty = np.linspace(0.0, 1.0, 401)
    n = np.linspace(2.0, 7.0, 2001)[:, None]
    error = mean_output(duty, n) - duty
    print(f"largest error {error.max():.4f}")
    assert error.min() > -1e-12 and error.max() == pytest.approx(0.101, abs=1e-3)
    assert np.abs(mean_output(duty, np.array([[2.0], [3.0], [5.0]])) - duty).max() < 1e-12


def test_wrong_n() -> None:
    """5 % of error in N cost 0.043 to 0.048 of the mean at N from 2 to 7 (specification: up to 0.04).

    Verifies: THEORY-10
    """
    wanted, n = np.linspace(0.0, 1.0, 401), np.linspace(2.0, 7.0, 1001)[:, None]
    for factor, largest in ((1.05, 0.0429), (0.95, 0.0474)):
        error = np.abs(mean_output(compensated_duty(wanted, n * factor), n) - wanted)
        print(f"N x {factor}: {error.max():.4f}")
        assert error.max() == pytest.approx(largest, abs=1e-3)


def pulses_by_the_rule(n: float, duty: float, least: float) -> list[tuple[float, float]]:
    """Pulses of one sector, built carrier by carrier as the rule says: (begin, end) in carriers."""
    found: list[tuple[float, float]] = []
    for start in np.arange(0.0, n - 1e-12):
        end_of_carrier = min(start + 1.0, n)
        width = min(duty, end_of_carrier - start)
        goes_on = bool(found) and abs(found[-1][1] - start) < 1e-12
        cut = end_of_carrier == n
        if width < least and not (cut and goes_on):
            continue
        end = start + width
        # A gap too short until the next pulse, which starts at the carrier's end or with the commutation.
        if end_of_carrier - end < least:
            end = end_of_carrier
        found.append((start, end))
    return found


def test_min_pulse() -> None:
    """No pulse and no gap is shorter than the minimum, and the mean is that of such pulses.

    Verifies: THEORY-10
    """
    rng = np.random.default_rng(6)
    for _ in range(2000):
        n, duty, least = float(rng.uniform(0.5, 6.0)), float(rng.uniform(0.0, 1.0)), float(rng.uniform(0.0, 0.2))
        pulses = pulses_by_the_rule(n, duty, least)
        merged: list[list[float]] = []
        for begin, end in pulses:
            if merged and begin - merged[-1][1] < 1e-12:
                merged[-1][1] = end
            else:
                merged.append([begin, end])
        edges = np.array([x for pulse in merged for x in pulse] + [n])
        widths = np.diff(edges)
        assert np.all((widths > least - 1e-12) | (widths < 1e-12)), (n, duty, least, merged)
        mean = sum(end - begin for begin, end in pulses) / n
        assert float(mean_with_min_pulse(duty, n, least)) == pytest.approx(mean, abs=1e-9), (n, duty, least)


def test_min_pulse_costs_little() -> None:
    """Without a minimum nothing changes; with one the mean is off by less than one pulse a sector and carrier.

    Verifies: THEORY-10
    """
    wanted, n = np.linspace(0.0, 1.0, 201), np.linspace(1.0, 7.0, 301)[:, None]
    duty = compensated_duty(wanted, n)
    assert np.array_equal(mean_with_min_pulse(duty, n, 0.0), mean_output(duty, n))
    whole, _ = whole_and_rest(n)
    error = np.abs(mean_with_min_pulse(duty, n, 0.008) - wanted)
    assert np.all(error <= 0.008 * (whole + 1) / n + 1e-12)
