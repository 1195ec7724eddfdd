# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Line spectra: series of chapter 6, generated gates, recorded gates, currents of the switched circuit."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from fluxlock.results.rundata import LogKind
from fluxlock.theory.six_step.fourier import (
    cut_edges,
    line_amplitudes,
    recorded_lines,
    sequence_lines,
    space_vector,
)
from fluxlock.theory.six_step.linearity import compensated_duty
from fluxlock.theory.six_step.patterns import (
    CHOPPINGS,
    COMMUTATIONS,
    Chopping,
    Commutation,
    gate_sequence,
)
from fluxlock.theory.six_step.recording import recorded_spectrum, whole_turns
from fluxlock.theory.six_step.spectrum import (
    Lines,
    analytic_lines,
    double_series,
    line_numbers,
    weighted_distortion,
)
from fluxlock.theory.six_step.switched import CLOCK_S, NO_SENSING, ideal_inverter, plant_at_speed
from tests.results.synthetic import Drive, make_run
from tests.theory.six_step_machines import MOTOR_1, SINUSOIDAL, SUPPLY_V

EXACT = 1e-9
# Integers, N < 1, the thesis's 25/8, lines at order 0 (25/6, 5/6, 7/12, 13/12), whole n w_e / w_c (1/2), ...
RATIOS = [Fraction(*r) for r in ((25, 8), (10, 3), (3, 1), (1, 1), (25, 6), (29, 10), (20, 3), (7, 5), (13, 12))]
RATIOS += [Fraction(*r) for r in ((1, 2), (5, 6), (7, 12))]
DUTIES = (0.0, 0.1, 0.375, 0.6, 0.875, 1.0)


@pytest.mark.parametrize("commutation", COMMUTATIONS)
@pytest.mark.parametrize("ratio", RATIOS, ids=str)
def test_series_against_gates(commutation: Commutation, ratio: Fraction) -> None:
    """Every line up to order 60 of the series is that of the generated gates, at any duty and initial phase.

    Verifies: THEORY-07, THEORY-08
    """
    rng = np.random.default_rng(ratio.numerator)
    k = line_numbers(ratio, 60.0)
    for duty in DUTIES:
        start = float(rng.uniform(0.0, 360.0))
        lines = analytic_lines(commutation, ratio, duty, k, start)
        for chopping in ("ON-PWM", "H_PWM-L_ON"):
            sequence = gate_sequence(
                commutation, float(ratio), duty, turns=ratio.denominator, start_deg=start, chopping=chopping
            )
            difference = np.abs(lines.amplitude - sequence_lines(sequence, lines.order))
            assert difference.max() < EXACT, (duty, start, chopping)


@pytest.mark.parametrize("ratio", [Fraction(25, 8), Fraction(10, 3), Fraction(13, 12)], ids=str)
def test_closed_csc_formulas(ratio: Fraction) -> None:
    """(6.39) and (6.41) as printed.

    Verifies: THEORY-07
    """
    n_z, n_d = divmod(float(ratio), 1.0)
    k = line_numbers(ratio, 60.0)
    k = k[k % ratio.denominator == 0]
    for duty in (0.5 * n_d, n_d, 0.5 + 0.5 * n_d):
        lines = analytic_lines("CSC", ratio, duty, k)
        n = lines.order

        def e(power: float, order: np.ndarray = n) -> np.ndarray:
            return np.asarray(np.exp(-2j * np.pi * order / (6 * float(ratio)) * power))

        root = 3 * (np.sqrt(3) + 1j)
        if duty <= n_d:
            printed = root / (-2j * np.pi * n) * (e(n_z + 1) - 1) * (e(duty) - 1) / (e(1) - 1)
        else:
            printed = (6j + root * (e(n_z) - 1) * (e(1) - e(duty)) / (e(1) - 1)) / (2j * np.pi * n)
        some = np.abs(e(1) - 1) > 1e-6
        assert np.abs(lines.amplitude - printed)[some].max() < EXACT


@pytest.mark.parametrize("commutation", ["NSC", "RSC"])
def test_double_series(commutation: Commutation) -> None:
    """(6.12) and (6.21) term by term: their partial sums on a line approach the closed form.

    The terms of RSC fall with 1/l and cancel in pairs only slowly, those of NSC with 1/l^2.

    Verifies: THEORY-07
    """
    ratio, duty, start = Fraction(25, 8), 0.6, 5.0
    p, q = ratio.numerator, ratio.denominator
    for k in range(-12, 13):
        (m0, h0) = next((m, (k - m * p) // q) for m in range(q) if (k - m * p) % q == 0)
        step = np.arange(-200_000, 200_001)
        m, h = m0 + step * q, h0 - step * p
        terms = double_series(commutation, float(ratio), duty, m, h) * np.exp(1j * (1 + 6 * h) * np.radians(start))
        closed = analytic_lines(commutation, ratio, duty, np.array([k]), start).amplitude[0]
        assert abs(terms.sum() - closed) < 2e-6, k


def test_literal_coefficients() -> None:
    """Single terms as printed, and the limits 2 pi M where m + n w_e / w_c is 0.

    Verifies: THEORY-07
    """
    duty, n = 0.6, 3.1
    m, h = np.array([[1], [-2], [3]]), np.array([[-1, 0, 2]])
    orders = 1 + 6 * h
    nsc = 3j / (2 * np.pi**2) * (np.exp(-2j * np.pi * m * duty) - 1) / (m * orders)
    assert double_series("NSC", n, duty, m, h) == pytest.approx(nsc, abs=1e-15)
    w = m + orders / (6 * n)
    rsc = 3j / (2 * np.pi**2 * orders) * (np.exp(-2j * np.pi * w * duty) - 1) / w
    assert double_series("RSC", n, duty, m, h) == pytest.approx(rsc, abs=1e-15)
    assert double_series("NSC", n, duty, np.array(0), np.array(2)) == pytest.approx(3 / np.pi * duty / 13)
    # m = -1, n = 25 = 6 N.
    assert double_series("RSC", 25 / 6, duty, np.array(-1), np.array(4)) == pytest.approx(6 / 25 / (2 * np.pi) * duty)


def test_orders() -> None:
    """N = 25/8: lines every 0.75 f_e under RSC and NSC; CSC has none beside 1 + 6 k.

    Verifies: THEORY-07
    """
    ratio = Fraction(25, 8)
    k = line_numbers(ratio, 17.0)
    lines = {c: analytic_lines(c, ratio, 0.6, k, 5.0) for c in COMMUTATIONS}
    assert np.diff(lines["RSC"].order) == pytest.approx(0.75)
    own = k % ratio.denominator == 0
    assert np.all(np.abs(lines["CSC"].amplitude[~own]) == 0.0)
    for commutation in ("RSC", "NSC"):
        assert np.abs(lines[commutation].amplitude[~own]).max() > 0.05, commutation


def test_mid_value_where_a_carrier_meets_a_commutation() -> None:
    """RSC jumps there in the initial phase: the series gives the mean of both sides.

    Verifies: THEORY-07
    """
    ratio, k = Fraction(25, 8), line_numbers(Fraction(25, 8), 20.0)
    at = analytic_lines("RSC", ratio, 0.6, k, 0.0).amplitude
    sides = [
        sequence_lines(gate_sequence("RSC", 25 / 8, 0.6, turns=8, start_deg=start), 1 + 6 * k / 8)
        for start in (-1e-4, 1e-4)
    ]
    assert np.abs(sides[0] - sides[1]).max() > 0.01
    assert np.abs(at - (sides[0] + sides[1]) / 2).max() < 1e-4


def test_weighted_distortion() -> None:
    """N = 25/8, mean 0.6: 0.238 (RSC), 0.123 (NSC), 0.061 (CSC), with 1/order as weight.

    RSC and CSC do not depend on the initial phase. NSC does, 0.1225 to 0.1274; 0.123 is one of its values. CSC has the
    mean 0.6 at the duty of (5.18).

    Verifies: THEORY-09
    """
    ratio, k = Fraction(25, 8), line_numbers(Fraction(25, 8), 400.0)
    starts = np.linspace(0.05, 7.45, 38)
    values = {
        c: [weighted_distortion(analytic_lines(c, ratio, duty, k, start)) for start in starts]
        for c, duty in (("RSC", 0.6), ("NSC", 0.6), ("CSC", float(compensated_duty(0.6, 25 / 8))))
    }
    print({c: (round(min(v), 4), round(max(v), 4)) for c, v in values.items()})
    assert values["RSC"] == pytest.approx([0.238] * starts.size, abs=5e-4)
    assert values["CSC"] == pytest.approx([0.061] * starts.size, abs=5e-4)
    assert min(values["NSC"]) < 0.1235 < max(values["NSC"]) < 0.1280
    assert weighted_distortion(analytic_lines("CSC", ratio, 0.6, k)) == pytest.approx(0.0602, abs=5e-5)


@pytest.mark.parametrize("commutation", COMMUTATIONS)
def test_weighted_distortion_is_that_of_the_flux(commutation: Commutation) -> None:
    """Integral of the excitation, exactly: its mean square without the fundamental gives the same figure.

    Verifies: THEORY-09
    """
    ratio, duty = Fraction(25, 8), 0.6
    lines = analytic_lines(commutation, ratio, duty, line_numbers(ratio, 2000.0), 5.0)
    sequence = gate_sequence(commutation, float(ratio), duty, turns=8, start_deg=5.0)
    width = np.diff(sequence.at, append=sequence.length)
    f = space_vector(sequence.gates)
    end = np.cumsum(f * width)
    start = end - f * width
    flux_mean = np.sum((start + end) / 2 * width) / 8
    # Mean square of a straight line from a to b: (|a|^2 + |b|^2 + Re(a b*)) / 3.
    a, b = start - flux_mean, end - flux_mean
    square = np.sum((np.abs(a) ** 2 + np.abs(b) ** 2 + (a * b.conj()).real) / 3 * width) / 8
    fundamental = abs(lines.fundamental)
    expected = np.sqrt(square * (2 * np.pi) ** 2 - fundamental**2) / fundamental
    assert weighted_distortion(lines) == pytest.approx(expected, rel=1e-5)


def test_energy() -> None:
    """All lines together hold the mean square of the excitation, its mean duty, for all three alignments.

    Verifies: THEORY-09
    """
    ratio = Fraction(25, 8)
    k = line_numbers(ratio, 20_000.0)
    others = []
    for commutation, duty in (("RSC", 0.6), ("NSC", 0.6), ("CSC", float(compensated_duty(0.6, 25 / 8)))):
        lines = analytic_lines(commutation, ratio, duty, k, 5.0)
        energy = float(np.sum(np.abs(lines.amplitude) ** 2))
        assert energy == pytest.approx(0.6, abs=1e-3)  # what lies above order 20 000
        others.append(energy - abs(lines.fundamental) ** 2)
    assert max(others) - min(others) < 0.002


def test_line_at_order_zero_has_no_weight() -> None:
    """N = 25/6: RSC has a line at order 0, which an inductance does not limit.

    Verifies: THEORY-09
    """
    ratio = Fraction(25, 6)
    lines = analytic_lines("RSC", ratio, 0.6, line_numbers(ratio, 50.0), 5.0)
    assert np.abs(lines.amplitude[lines.order == 0.0]).item() > 1e-3
    assert weighted_distortion(lines) == float("inf")


@pytest.mark.parametrize("chopping", CHOPPINGS)
def test_gates_of_the_patterns(chopping: Chopping) -> None:
    """Each switch conducts 120 degrees and chops in the half that its pattern names; never both of a leg.

    Verifies: THEORY-08
    """
    sequence = gate_sequence("CSC", 10.0, 0.5, turns=1, chopping=chopping)
    angle = 360.0 * (sequence.at + np.append(sequence.at[1:], 1.0)) / 2  # middle of each interval, y
    share = np.diff(sequence.at, append=1.0)
    chops_first = {"ON-PWM": "", "PWM-ON": "HL", "H_PWM-L_ON": "H", "H_ON-L_PWM": "L"}[chopping]
    chops_last = {"ON-PWM": "HL", "PWM-ON": "", "H_PWM-L_ON": "H", "H_ON-L_PWM": "L"}[chopping]
    for leg in range(3):
        assert not np.any((sequence.gates >> 2 * leg & 3) == 3)
        for bit, side, entry in ((0, "H", 30.0), (1, "L", 210.0)):
            on = (sequence.gates >> 2 * leg + bit & 1).astype(bool)
            # theta' = y + 90: phase A is high from theta' = 30 on, B and C 120 degrees later each.
            own = (angle + 90.0 - entry - 120.0 * leg) % 360.0
            for half, chops in ((own < 60.0, chops_first), ((own >= 60.0) & (own < 120.0), chops_last)):
                expected = (0.5 if side in chops else 1.0) / 6
                assert share[on & half].sum() == pytest.approx(expected, abs=1e-12), (leg, side)
            assert not np.any(on & (own >= 120.0))


def test_commutation_instants() -> None:
    """NSC and CSC commutate every 60 degrees, RSC at the next carrier start.

    Verifies: THEORY-08
    """
    n, start = 3.1, 7.0
    ideal = (60.0 * np.arange(1, 13) - start) / 360.0
    for commutation in COMMUTATIONS:
        sequence = gate_sequence(commutation, n, 0.6, turns=2, start_deg=start)
        expected = np.ceil(ideal * 6 * n) / (6 * n) if commutation == "RSC" else ideal
        assert sequence.commutations == pytest.approx(expected[expected < 2.0], abs=1e-12)
        assert sequence.sectors.tolist() == [(2 + k) % 6 for k in range(sequence.sectors.size)]


def test_excitation() -> None:
    """Pairs of phases have unit length at multiples of 60 degrees from 30; one-sided states and dead times are zero.

    Verifies: THEORY-08
    """
    pairs = [(0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)]
    gates = np.array([1 << 2 * high | 2 << 2 * low for high, low in pairs])
    assert space_vector(gates) == pytest.approx(np.exp(1j * np.radians(-30.0 + 60.0 * np.arange(6))), abs=1e-15)
    assert np.all(space_vector(np.array([0, 0b01, 0b10, 0b0101, 0b1010_10])) == 0.0)


def test_recorded_edges() -> None:
    """Edges in whole clocks, embedded in a longer recording, give the lines of the sequence within their rounding.

    Verifies: THEORY-08
    """
    ratio, turn_cycles = Fraction(25, 8), 46_875.0  # 64 000 r/min at 50 MHz
    for commutation in COMMUTATIONS:
        sequence = gate_sequence(commutation, float(ratio), 0.6, turns=24, start_deg=5.0)
        cycles = np.round(sequence.at * turn_cycles).astype(np.int64) + 1_000_000
        orders = 1 + 6 * line_numbers(ratio, 40.0) / 8
        first = 1_000_000 + 3 * turn_cycles
        found = recorded_lines(cycles, sequence.gates, first, first + 16 * turn_cycles, 16, orders)
        lines = analytic_lines(commutation, ratio, 0.6, line_numbers(ratio, 40.0), 5.0)
        # The window starts three turns on, in which lines between whole orders have turned.
        difference = np.abs(found - lines.amplitude * np.exp(2j * np.pi * 3 * orders))
        # Half a clock at each of some 7 edges a sector.
        assert difference.max() < 0.5 * 42 / turn_cycles


def test_cut_edges() -> None:
    """A window keeps the state it starts in, and refuses to run backwards.

    Verifies: THEORY-08
    """
    at, gates = cut_edges(np.array([10, 20, 30, 40]), np.array([1, 2, 3, 4]), 25.0, 35.0, 1.0)
    assert at.tolist() == [0.0, 0.5] and gates.tolist() == [2, 3]
    at, gates = cut_edges(np.array([10]), np.array([1]), 0.0, 20.0, 2.0)
    assert at.tolist() == [0.0, 1.0] and gates.tolist() == [0, 1]
    with pytest.raises(ValueError, match="must be before"):
        cut_edges(np.array([10]), np.array([1]), 20.0, 20.0, 1.0)
    with pytest.raises(ValueError, match="must start at 0"):
        line_amplitudes(np.array([0.1]), np.array([1.0 + 0j]), 1.0, np.array([1.0]))


def test_recorded_run() -> None:
    """A synthetic CSC run: whole turns are found, and all its lines are 1 + 6 k.

    Verifies: THEORY-08
    """
    run = make_run(Drive(speed_rpm=60_000, duration_s=0.02, carrier_hz=20e3, duty=0.5))
    window = whole_turns(run, 0.0031, 0.0172)
    assert window.turns == 14
    assert (window.last_cycle - window.first_cycle) / run.clock_hz == pytest.approx(0.014, abs=1e-8)
    lines = recorded_spectrum(run, window, 20.0)
    own = np.abs((lines.order - 1 + 3) % 6 - 3) < 1e-9
    size = np.abs(lines.amplitude)
    expected = analytic_lines("CSC", Fraction(10, 3), 0.5, line_numbers(Fraction(10, 3), 20.0))
    assert abs(lines.fundamental) == pytest.approx(abs(expected.fundamental), abs=1e-3)
    assert size[~own].max() < 1e-3
    assert run.rows(LogKind.GATES).shape[0] > 14 * 6
    for low, high in ((0.0031, 0.0035), (1.0, 2.0)):
        with pytest.raises(ValueError, match=r"turn|outside"):
            whole_turns(run, low, high)


def current_lines(chopping: Chopping, points: int = 3072) -> dict[int, float]:
    """Lines of the current's space vector under CSC at N = 25/8, from the switched circuit, A."""
    speed, duty, settle = 64_000, 0.75, 12
    sequence = gate_sequence("CSC", 25 / 8, duty, turns=settle + 1, chopping=chopping)
    turn = 2 * np.pi / (float(SINUSOIDAL.omega_e(speed)) * CLOCK_S)
    plant = plant_at_speed(MOTOR_1, ideal_inverter(SUPPLY_V), speed, 90.0, NO_SENSING, 0)
    edges = [(round(at * turn), int(g)) for at, g in zip(sequence.at, sequence.gates, strict=True)]
    currents = []
    for sample in np.round((settle + np.arange(points) / points) * turn).astype(int):
        while edges and edges[0][0] <= sample:
            plant.step(*edges.pop(0))
            plant.drain()
        plant.advance(int(sample))
        currents.append(plant.currents_a)
    vector = 2 / 3 * np.array(currents) @ np.exp(2j * np.pi / 3 * np.arange(3))
    amplitudes = np.abs(np.fft.fft(vector)) / points
    return {k: float(amplitudes[k]) for k in range(-30, 31)}


@pytest.mark.parametrize("chopping", CHOPPINGS)
def test_current_under_csc(chopping: Chopping) -> None:
    """The current has only 1 + 6 k lines where upper and lower commutations are alike; else 1 + 3 k lines remain.

    Verifies: THEORY-07
    """
    lines = current_lines(chopping)
    fundamental = lines[1]
    three = max(lines[1 + 3 * k] for k in (-3, -1, 1, 3)) / fundamental
    rest = max(size for k, size in lines.items() if (k - 1) % 3) / fundamental
    print(f"{chopping}: fundamental {fundamental:.1f} A, 1 + 3 k {three:.4f}, others {rest:.1e} of it")
    # Sampling at 3072 points a turn and edges in whole nanoseconds leave 1e-4.
    assert rest < 2e-4
    if chopping in ("ON-PWM", "PWM-ON"):
        assert three < 2e-4
    else:
        assert three > 0.02


def test_operating_points_are_checked() -> None:
    """Impossible points raise.

    Verifies: THEORY-08
    """
    for n, duty in ((0.0, 0.5), (float("nan"), 0.5), (3.0, 1.1), (3.0, -0.1)):
        with pytest.raises(ValueError, match="must be"):
            gate_sequence("CSC", n, duty)
    with pytest.raises(ValueError, match="no double series"):
        double_series("CSC", 3.0, 0.5, np.array(1), np.array(1))
    assert Lines(np.array([0.0, 1.0]), np.array([0j, 2j])).fundamental == 2j
