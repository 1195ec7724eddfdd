# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Current controllers A, B, C on the exact model, and their frequency responses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluxlock.theory.vector.controllers import (
    GAMMA,
    KINDS,
    Gains,
    Kind,
    Regulator,
    cross_peak,
    follow,
    gains,
    settling_samples,
    step_response,
)
from fluxlock.theory.vector.frequency import (
    Loop,
    current_loop,
    gain_margin,
    on_circle,
    phase_bandwidth,
    phase_margin_deg,
    plant_zero,
    tracking_bandwidth,
    tracking_decoupling,
)
from fluxlock.theory.vector.model import Coefficients, Sampling, coefficients
from tests.theory.vector_machines import DELAYS, FS_HZ, MOTOR_1

SAMPLES = 80
# Specification: peak |i_q| at the samples, per cent of an i_d step, Motor-I, f_s 15 kHz, held; by f_e / f_s, T_d / T_s.
PEAKS = {
    (0.05, 0.25): (10.4, 3.9, 2.0),
    (0.05, 0.50): (15.3, 9.0, 2.8),
    (0.05, 0.75): (22.7, 15.9, 2.1),
    (0.05, 1.00): (32.4, 0.0, 0.0),
    (0.10, 0.25): (28.0, 7.5, 4.1),
    (0.10, 0.50): (40.4, 17.6, 5.7),
    (0.10, 0.75): (57.0, 31.2, 4.2),
    (0.10, 1.00): (80.3, 0.0, 0.0),
}


def loop_at(
    kind: Kind, speed: float, delay: float, park: str = "held", gamma: float = GAMMA
) -> tuple[Coefficients, Gains]:
    """Model and gains at a speed over f_s and a delay over T_s."""
    omega = 2 * math.pi * speed * FS_HZ
    sampling = Sampling.at(FS_HZ, delay, park)  # type: ignore[arg-type]
    return coefficients(MOTOR_1, omega, sampling), gains(kind, MOTOR_1, omega, sampling, gamma=gamma)


@pytest.mark.parametrize(("speed", "delay"), PEAKS)
@pytest.mark.parametrize("direction", [1, -1])
def test_peaks_of_the_specification(speed: float, delay: float, direction: int) -> None:
    """Peak |i_q| of an i_d step, every cell within 0.1 %, in both directions; C settles in at most seven samples.

    Verifies: VTHEORY-04
    """
    for kind, printed in zip(KINDS, PEAKS[speed, delay], strict=True):
        model, chosen = loop_at(kind, direction * speed, delay)
        response = step_response(model, chosen, SAMPLES)
        found = 100 * cross_peak(response)
        assert abs(found - printed) < 0.1, (kind, found)
        if kind == "C":
            assert settling_samples(response) <= 7


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("speed", [0.05, -0.1])
def test_held_and_exact_agree(speed: float, delay: float) -> None:
    """B and C designed for the exact Park give the same currents; A does if its gains are turned back by the lead.

    Verifies: VTHEORY-05
    """
    for kind in KINDS:
        held, exact = loop_at(kind, speed, delay), loop_at(kind, speed, delay, "exact")
        lead = 2 * math.pi * speed * (delay + 0.5)
        own = exact[1].turned(-lead) if kind == "A" else exact[1]
        difference = step_response(exact[0], own, SAMPLES) - step_response(*held, SAMPLES)
        assert np.abs(difference).max() < 1e-12
        assert abs(held[1].g) > 0.05


@pytest.mark.parametrize("speed", [0.05, 0.1])
def test_mixed_park(speed: float) -> None:
    """Gains for held with the exact Park: the loop is turned by the lead, and the axes couple.

    Verifies: VTHEORY-05
    """
    chosen = loop_at("C", speed, 0.75)[1]
    model = loop_at("C", speed, 0.75, "exact")[0]
    assert cross_peak(step_response(model, chosen, SAMPLES)) > 0.2


def test_recurrence_is_the_transfer_function() -> None:
    """Simulated steps equal the inverse transform of the closed loop; without T_d (7.27) at T_d = T_s.

    Verifies: VTHEORY-06
    """
    for kind in KINDS:
        for delay in DELAYS:
            model, chosen = loop_at(kind, 0.1, delay)
            loop = current_loop(model, chosen)
            response = step_response(model, chosen, 4000)
            # The sequence's transform: (z - 1) / z times that of the step response.
            pulse = np.diff(response)
            for f in (0.003, -0.08, 0.31):
                z = on_circle(f)
                sum_ = np.sum(pulse * z ** -np.arange(1, 4000))
                assert complex(loop.closed(z)) == pytest.approx(sum_, abs=1e-9), (kind, delay, f)
    loop = current_loop(*loop_at("C", 0.1, 1.0))
    z = on_circle(np.linspace(-0.5, 0.5, 101))
    assert np.abs(loop.closed(z) - GAMMA / (z * z - z + GAMMA)).max() < 1e-12


def test_tracking_and_decoupling() -> None:
    """P and Q as real and imaginary polynomials give, (7.33) with the minus of a division; no Q at T_d = T_s.

    Verifies: VTHEORY-06
    """
    f = np.linspace(0.001, 0.5, 400)
    for delay in DELAYS:
        loop = current_loop(*loop_at("C", 0.05, delay))
        p, q = tracking_decoupling(loop, f)
        z = on_circle(f)
        total = np.polyadd(loop.numerator, loop.denominator)
        pn, qn = (np.polyval(part, z) for part in (loop.numerator.real, loop.numerator.imag))
        pd, qd = (np.polyval(part, z) for part in (total.real, total.imag))
        size = pd**2 + qd**2
        assert np.abs(p - (pn * pd + qn * qd) / size).max() < 1e-9
        assert np.abs(q - (qn * pd - pn * qd) / size).max() < 1e-9
        # A cosine on d, from rest, ends as P on d and Q on q.
        assert (np.abs(q).max() < 1e-12) == (delay in (0.0, 1.0))


def test_decoupling_in_time() -> None:
    """A sinusoid of the d reference: amplitudes of i_d and i_q after settling are |P| and |Q|.

    Verifies: VTHEORY-06
    """
    model, chosen = loop_at("C", 0.1, 0.5)
    cycles, period = 60, 20
    reference = np.cos(2 * np.pi * np.arange(cycles * period) / period)
    response = np.concatenate([[0], np.diff(step_response(model, chosen, reference.size))])
    current = np.convolve(response, reference)[: reference.size][-period:]
    basis = np.exp(-2j * np.pi * np.arange(period) / period) * 2 / period
    p, q = tracking_decoupling(current_loop(model, chosen), 1 / period)
    assert complex(current.real @ basis) == pytest.approx(complex(p), abs=1e-9)
    assert complex(current.imag @ basis) == pytest.approx(complex(q), abs=1e-9)


def test_bandwidth_of_figure_7_7() -> None:
    """T_d = T_s / 2: of B from 0.11 f_s to 0.092 f_s as f_e grows to 0.1 f_s, of C constant; Q of C is the smaller.

    (From 0.35 f_s on Q of B is the smaller, by less than 0.006.)

    Verifies: VTHEORY-06
    """
    speeds, f = (0.01, 0.05, 0.1), np.linspace(0.001, 0.5, 500)
    found = {}
    for kind in ("B", "C"):
        loops = [current_loop(*loop_at(kind, speed, 0.5, gamma=0.4)) for speed in speeds]  # type: ignore[arg-type]
        found[kind] = (
            [tracking_bandwidth(loop) for loop in loops],
            [np.abs(tracking_decoupling(loop, f)[1]) for loop in loops],
        )
    b, c = found["B"][0], found["C"][0]
    print("bandwidth of B, C over f_s:", b, c)
    assert b[0] == pytest.approx(0.11, abs=5e-3) and b[2] == pytest.approx(0.092, abs=5e-3)
    assert max(c) / min(c) < 1.02
    for of_b, of_c in zip(found["B"][1], found["C"][1], strict=True):
        assert of_c.max() < 0.45 * of_b.max()
        assert np.all(of_c[f < 0.34] < of_b[f < 0.34])


def test_phase_bandwidth_and_margins() -> None:
    """T_d = T_s, where H = gamma / (z^2 - z + gamma): closed forms of the 90 degree frequency, margin and gain.

    Verifies: VTHEORY-07
    """
    for gamma in (0.2, 0.35):
        loop = current_loop(*loop_at("C", 0.1, 1.0, gamma=gamma))
        # Re(z^2 - z + gamma) = 0.
        cosine = (1 + math.sqrt(1 + 8 * (1 - gamma))) / 4
        assert phase_bandwidth(loop) == pytest.approx(math.acos(cosine) / (2 * math.pi), rel=1e-6)
        # |z (z - 1)| = gamma at 2 asin(gamma / 2); the phase there is -90 - 1.5 w.
        w = 2 * math.asin(gamma / 2)
        assert phase_margin_deg(loop) == pytest.approx(90 - math.degrees(1.5 * w), abs=1e-3)
        # z^2 - z + 1 has its roots on the circle.
        assert gain_margin(loop) == pytest.approx(1 / gamma, rel=1e-6)
    unstable = current_loop(*loop_at("C", 0.1, 1.0, gamma=1.2))
    assert phase_margin_deg(unstable) < 0 and gain_margin(unstable) == 0.0 and not unstable.stable


def test_margin_is_where_the_loop_becomes_unstable() -> None:
    """Turned by less than the phase margin every loop is stable, by more it is not (complex loops: either way).

    Verifies: VTHEORY-07
    """
    for kind in KINDS:
        for delay in (0.25, 0.5, 1.0):
            loop = current_loop(*loop_at(kind, 0.05, delay))
            margin = math.radians(phase_margin_deg(loop))

            def turned(angle: float, loop: Loop = loop) -> bool:
                return Loop(loop.numerator * np.exp(1j * angle), loop.denominator).stable

            assert turned(0.995 * margin) and turned(-0.995 * margin)
            assert not (turned(1.005 * margin) and turned(-1.005 * margin)), (kind, delay)


def test_five_kilohertz() -> None:
    """20 kHz carrier with double update: C has 5 kHz by the phase rule when the voltage follows the sample in 2 us.

    Verifies: VTHEORY-07
    """
    omega = 2 * math.pi * 1500
    for delay, gamma, margin in ((0.08, GAMMA, 78.0), (0.25, 0.5, 68.0)):
        sampling = Sampling.at(40e3, delay)
        loop = current_loop(coefficients(MOTOR_1, omega, sampling), gains("C", MOTOR_1, omega, sampling, gamma=gamma))
        found = 40e3 * phase_bandwidth(loop), phase_margin_deg(loop)
        print(f"T_d = {delay:g} T_s, gamma {gamma:g}: {found[0]:.0f} Hz, {found[1]:.1f} deg")
        assert found[0] > 5000 and found[1] > margin


def test_plant_zero() -> None:
    """The zero moves from the origin out of the unit circle as T_d grows (figure 7.4).

    Verifies: VTHEORY-06
    """
    sizes = [abs(complex(plant_zero(loop_at("C", 0.1, delay)[0]))) for delay in DELAYS]
    assert sizes[0] == 0.0 and sizes[1] < 1.0 < sizes[3] and sizes[4] == math.inf
    assert sizes == sorted(sizes)


U_MAX = 10.5


def test_limit_binds_the_size() -> None:
    """The circle binds the voltage's size, not its angle, and the bound voltage is the state.

    Verifies: VTHEORY-08
    """
    chosen = loop_at("C", 0.1, 0.5)[1]
    bound, free = Regulator(chosen, 0.6), Regulator(chosen)
    assert bound.step(100 + 50j) == pytest.approx(0.6 * free.step(100 + 50j) / abs(free.u))
    assert bound.step(0j) == pytest.approx(bound.u) and abs(bound.u) == pytest.approx(0.6)


@pytest.mark.parametrize("delay", [0.5, 1.0])
def test_return_from_the_limit(delay: float) -> None:
    """100 samples at the limit (reference out of reach), then 10 A: the plain form fades with Phi, conditioned is fast.

    Verifies: VTHEORY-08
    """
    model, chosen = loop_at("C", 0.1, delay)
    back = 1j * 2 * math.pi * 0.1 * FS_HZ * MOTOR_1.psi_vs
    reference = np.concatenate([np.full(100, 60j), np.full(200, 10j)])
    found = {}
    for conditioned in (False, True):
        regulator = Regulator(chosen, U_MAX, conditioned)
        error = follow(model, regulator, reference, back)[100:] / 10j - 1.0
        found[conditioned] = int(np.flatnonzero(np.abs(error) > 0.05)[-1]) + 1
        if not conditioned:
            # Long after the limit only the pole that is no longer cancelled is left.
            assert error[51] / error[50] == pytest.approx(complex(model.phi), rel=0.02)
    print(f"T_d = {delay:g} T_s: back within 5 % of 10 A after {found[False]} samples, conditioned {found[True]}")
    assert found[True] <= 12 and found[False] > 3 * found[True]


def test_conditioning_without_limit() -> None:
    """Below the limit both forms are the same.

    Verifies: VTHEORY-08
    """
    model, chosen = loop_at("C", 0.1, 0.5)
    reference = np.full(40, 5 + 3j)
    one, two = (follow(model, Regulator(chosen, 100.0, c), reference) for c in (False, True))
    assert np.array_equal(one, two)


def test_not_settled() -> None:
    """A response that ends outside the band has no settling time.

    Verifies: VTHEORY-04
    """
    with pytest.raises(ValueError, match="not settled"):
        settling_samples(step_response(*loop_at("C", 0.1, 0.5), 4))
    assert settling_samples(np.ones(5)) == 0
