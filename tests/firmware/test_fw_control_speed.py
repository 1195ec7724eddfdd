# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Regulators, ramp, limits and currents of the firmware against models in floating point."""

from __future__ import annotations

from random import Random

import pytest

from fluxlock.firmware import gain
from fluxlock.firmware.binding import new
from fluxlock.headers import CData


def test_pi_follows_its_float_model(lib: CData) -> None:
    """Random errors and moving limits: output within 4 units of a float PI with the same back-calculation.

    Verifies: FW-04
    """
    rng = Random(4)
    kp, ki = 37.2, 5.3 * 32
    gains = new("pi_gains_t", gain(kp), gain(ki))
    state, integral, error = new("pi_state_t", 0), 0.0, 0
    for k in range(4000):
        error = rng.randint(-20000, 20000) if k % 50 == 0 else error + rng.randint(-200, 200)
        feed_forward = 2_000_000 + 1000 * (k % 300)
        high = 2_500_000 if (k // 500) % 2 else 30_000_000
        result = lib.pi_step(state, gains, error, feed_forward, 100_000, high)
        u = feed_forward + kp * error + integral
        out = min(max(u, 100_000), high)
        integral += ki / 32 * error + (out - u) / 8
        assert abs(result.output - out) < 4 + 1e-5 * abs(out), k
        assert (result.output < result.unlimited) == (out < u) or abs(out - u) < 4


def test_pi_leaves_a_limit_without_windup(lib: CData) -> None:
    """After a second at the limit the output leaves it within 40 steps of the sign change of the error.

    Verifies: FW-04
    """
    gains = new("pi_gains_t", gain(10.0), gain(2.0 * 32))
    state = new("pi_state_t", 0)
    for _ in range(10_000):
        result = lib.pi_step(state, gains, 50_000, 0, 0, 1_000_000)
    assert result.output == 1_000_000
    steps = 0
    while result.output == 1_000_000:
        result = lib.pi_step(state, gains, -2_000, 0, 0, 1_000_000)
        steps += 1
        assert steps < 40
    lib.pi_preset(state, gains.kp, 1234, 5678, 400_000)
    assert lib.pi_step(state, gains, 1234, 5678, 0, 10**8).output == pytest.approx(400_000, abs=1)


def test_ramp_slope_window_and_fractions(lib: CData) -> None:
    """Slopes far below 1/256 r/min a step are kept exactly; the window holds the reference; both directions alike.

    Verifies: FW-05
    """
    for sign in (1, -1):
        ramp = new("ramp_t")
        lib.ramp_preset(ramp, sign * 256_000)
        target, step = sign * 2_560_000, 1_301
        for k in range(1, 50_000):
            assert lib.ramp_step(ramp, target, step, target, 10**6) == sign
            assert abs(sign * ramp.value_rpm_q8 - (256_000 + k * step / 4096)) <= 1
        lib.ramp_preset(ramp, 0)
        for _ in range(1000):
            lib.ramp_step(ramp, sign * 100_000, 2**31 - 1, 0, 5_000)
        assert ramp.value_rpm_q8 == sign * 5_000
        assert lib.ramp_step(ramp, sign * 100_000, 4096, sign * -9_000, 5_000) == sign
        assert ramp.value_rpm_q8 == sign * 5_000
        for _ in range(1000):
            lib.ramp_step(ramp, sign * 5_100, 4096, sign * 5_000, 5_000)
        assert ramp.value_rpm_q8 == sign * 5_100
        assert lib.ramp_step(ramp, sign * 5_100, 4096, 0, 5_000) == 0


def test_speed_from_period(lib: CData) -> None:
    """r/min of a period to 1/256 r/min, for pole pairs and clocks.

    Verifies: FW-06
    """
    for clock, pole_pairs in ((50_000_000, 1), (50_000_000, 7), (100_000_000, 4)):
        numerator = lib.speed_numerator_q8(clock, pole_pairs)
        for period in (1, 600, 50_000, 51_237, 7_000_001, 2**27 - 1):
            wanted = 60 * clock / (pole_pairs * period) * 256
            got = lib.speed_from_period_rpm_q8(numerator, period)
            assert got == (2**31 - 1 if wanted > 2**31 - 1 else pytest.approx(wanted, abs=1.01)), (
                clock,
                period,
            )
    assert lib.speed_from_period_rpm_q8(numerator, 0) == 2**31 - 1


def test_duty_and_voltage_are_inverse(lib: CData) -> None:
    """Duty of a voltage with and without a diode drop; voltage_from_duty inverts it; limits at 0 and 1.

    Verifies: FW-07
    """
    rng = Random(5)
    for _ in range(2000):
        vdc = rng.randint(2**20, 2**25)
        diode = rng.choice([0, rng.randint(0, 2**20)])
        u = rng.randint(-(2**21), vdc + 2**20)
        duty = lib.duty_from_voltage_q30(u, vdc, diode) / 2**30
        wanted = min(1.0, max(0.0, (u + diode) / (vdc + diode)))
        assert duty == pytest.approx(wanted, abs=2**-21 + 256 / vdc), (u, vdc, diode)
        if 0.0 < wanted < 1.0:
            back = lib.voltage_from_duty_v_q25(round(wanted * 2**30), vdc, diode)
            assert back == pytest.approx(u, abs=2)
    assert lib.duty_from_voltage_q30(1000, 0, 0) == 0


def test_carrier_period_and_pulse(lib: CData) -> None:
    """The carrier is stretched just so far that the pulse keeps its floor; a dead time is added or taken off.

    Verifies: FW-08
    """
    for duty in (0.0, 0.01, 0.03, 0.05, 0.1, 0.2239, 0.2241, 0.5, 1.0):
        period = lib.carrier_period_cycles(round(duty * 2**30), 1250, 6250, 280)
        wanted = 6250 if duty == 0 else min(6250, max(1250, 280 / duty))
        assert period == pytest.approx(wanted, abs=1.01), duty
        for added in (10, -10):
            pulse = lib.pulse_cycles_q8(round(duty * 2**30), period, added * 256) / 256
            assert pulse == pytest.approx(0 if duty == 0 else max(0, duty * period + added), abs=0.005)


def test_pulse_for_a_current_below_the_boundary(lib: CData) -> None:
    """The pulse of the law gives its current: pulse and gap of a carrier are integrated exactly, the diode ends it.

    Verifies: FW-70
    """
    rng = Random(7)
    clock_hz, full_v, full_a = 50e6, 60.0, 40.0
    for _ in range(500):
        vdc, drop = rng.uniform(10, 50), rng.uniform(0.0, 1.2)
        emf = vdc * rng.uniform(0.05, 0.9)
        line_h, period = 10 ** rng.uniform(-5, -3), rng.randint(600, 6000)
        period_s = period / clock_hz
        per_volt = gain(4096 / (2 * line_h * clock_hz) * full_v / full_a)
        v = [round(x / full_v * 2**25) for x in (emf, vdc, drop)]
        made = lib.boundary(*v, period, per_volt)
        edge = new("boundary_t", made.duty_q30, made.current_i_q25)
        # At the boundary the current is back at zero as the carrier ends.
        rise_s = edge.duty_q30 / 2**30 * period_s
        assert (vdc - emf) * rise_s == pytest.approx((emf + drop) * (period_s - rise_s), rel=2e-3)
        wanted_a = edge.current_i_q25 / 2**25 * full_a
        if not 0.02 < wanted_a < 30.0:
            continue
        for share in (0.01, 0.1, 0.5, 0.9, 1.0):
            share_q16 = lib.boundary_share_q16(edge, round(share * edge.current_i_q25))
            pulse_s = lib.discontinuous_duty_q30(edge, share_q16) / 2**30 * period_s
            peak_a = (vdc - emf) / line_h * pulse_s
            fall_s = peak_a * line_h / (emf + drop)
            assert pulse_s + fall_s < 1.003 * period_s
            mean_a = peak_a * (pulse_s + fall_s) / 2 / period_s
            assert mean_a == pytest.approx(share * wanted_a, rel=0.01), (share, emf, vdc)
        for share in (-3.0, -0.5, 0.0, 0.5, 3.0):
            got = lib.boundary_share_q16(edge, round(share * edge.current_i_q25)) / 65536
            assert got == pytest.approx(min(1.0, max(-1.0, share)), abs=1e-3)


def test_limiter_bounds_by_model_and_trim(lib: CData) -> None:
    """Bound = EMF + R*I + kp*margin; the trim moves only while it binds, within half of R*I, and decays after.

    Verifies: FW-10
    """
    gains = new("limiter_gains_t", kp=gain(20.0), ki=gain(2.0))
    limiter = new("limiter_t", 0)
    bound = lib.limiter_bound(limiter, gains, 10_000_000, 400_000, -500)
    assert bound == pytest.approx(10_000_000 + 400_000 - 20 * 500, abs=2)
    for _ in range(1000):
        lib.limiter_update(limiter, gains, 400_000, -500, True)
    assert limiter.trim_v_q25 == -200_000
    for _ in range(1000):
        lib.limiter_update(limiter, gains, 400_000, -500, False)
    assert abs(limiter.trim_v_q25) < 64


def test_line_current_balances_the_power(lib: CData) -> None:
    """The current whose power behind the link is what the link gives, with R and diode; bounded near standstill.

    Verifies: FW-25
    """
    rng = Random(6)
    volt, ampere = 2**25 / 30.0, 2**25 / 50.0
    for _ in range(2000):
        vdc, emf, r = rng.uniform(10, 28), rng.uniform(1.0, 12.0), rng.uniform(0.01, 0.2)
        current, duty = rng.uniform(-20, 20), rng.uniform(0.1, 0.95)
        if emf + r * current < 1.0:
            continue
        diode = rng.choice([0.0, 0.7])
        idc = current * (emf + r * current + (1 - duty) * diode) / vdc
        ratio = lib.line_current_ratio_q16(
            round(vdc * volt), round(emf * volt), round(r * current * volt), round(diode * volt), round(duty * 2**30)
        )
        assert lib.line_current(round(idc * ampere), ratio) / ampere == pytest.approx(current, rel=1e-3, abs=1e-3)
        wanted = min(50.0, 7.0 * ratio / 65536)
        assert lib.line_current_limit_q25(round(7.0 / 50 * 2**17), ratio) / ampere == pytest.approx(wanted, rel=1e-3)
    assert lib.line_current_ratio_q16(round(25 * volt), 0, 0, 0, 2**20) == 32 << 16
    assert lib.line_current_ratio_q16(round(25 * volt), -1000, 0, 0, 2**20) == 32 << 16
    assert lib.line_current_ratio_q16(0, 1000, 0, 0, 2**20) == 0


def test_torque_reference_between_its_limits(lib: CData) -> None:
    """Target inside; a falling line toward the upper speed, a rising one toward the lower; current limits last.

    Verifies: FW-26
    """
    kp = 3.0
    for target in (-50_000, 0, 4_000, 90_000):
        for speed in (0, 900, 1_000, 5_000, 9_000, 10_000, 12_000, 40_000):
            wanted = min(max(target, kp * (1_000 - speed)), kp * (10_000 - speed))
            wanted = min(max(wanted, -20_000), 25_000)
            got = lib.torque_reference(target, gain(kp), speed, 1_000, 10_000, -20_000, 25_000)
            assert got == pytest.approx(wanted, abs=1), (target, speed)


def test_braking_current_falls_at_once_and_rises_slowly(lib: CData) -> None:
    """Full far below the limit voltage, none at it, linear between; upward at most a 64th of the limit a step.

    Verifies: FW-31
    """
    share = gain(65536 / 1_000_000)
    for vdc, wanted in ((10_000_000, 640_000), (19_500_000, 320_000), (20_000_000, 0), (25_000_000, 0)):
        assert lib.brake_current(640_000, 640_000, vdc, 20_000_000, share) == pytest.approx(wanted, abs=20)
    current, steps = 0, 0
    while current < 640_000:
        current = lib.brake_current(current, 640_000, 10_000_000, 20_000_000, share)
        steps += 1
    assert 62 <= steps <= 65


@pytest.mark.parametrize("ticks", [(10, 40), (6, 7)])
def test_emf_of_each_pair(lib: CData, ticks: tuple[int, int]) -> None:
    """Pairs of unequal flux at a held speed: what each has more than the mean of the three, within 2 % after 120 turns.

    The current follows the true EMF through resistance and inductance, and random sectors. The model in floating point
    is the circuit itself, the filter of the measured current takes longer than a short sector, and the inductance that
    is told is 10 % wrong. A sector of too few ticks, a pause and an EMF that is gone or reversed teach nothing.

    Verifies: FW-74
    """
    rng = Random(11)
    resistance, inductance, mean_v, shift = 0.4, 3.0, 4.0e6, 2  # V/A as units of 2^25, L over a tick
    apart_v = (150_000.0, -20_000.0, -130_000.0)
    gains = new("pair_emf_gains_t", gain(resistance), gain(1.1 * inductance), gain(1e-6))
    state, commutations = new("pair_emf_t"), 0
    wanted_a = 500_000.0
    current_a = filtered_a = wanted_a

    def sector(ticks: int) -> None:
        nonlocal commutations, current_a, filtered_a
        emf_v = mean_v + apart_v[commutations % 3]
        for _ in range(ticks):
            told_v = mean_v + resistance * wanted_a
            u_v = told_v + mean_v * state.more_q20[commutations % 3] / 2**20
            filtered_a += (current_a - filtered_a) / 2**shift
            lib.pair_emf_step(state, gains, round(told_v), round(mean_v), round(filtered_a), shift, commutations)
            current_a += (u_v - emf_v - resistance * current_a) / (inductance + resistance)
        commutations += 1

    for _ in range(6 * 120):
        sector(rng.randint(*ticks))
    found = list(state.more_q20)
    assert [mean_v * share / 2**20 for share in found] == pytest.approx(apart_v, abs=0.02 * max(apart_v))
    lib.pair_emf_pause(state)
    for _ in range(12):
        sector(4)
    assert list(state.more_q20) == found
    # A division by zero would end the process here.
    for emf in (0, -1, -22, -2048):
        for tick in range(40):
            lib.pair_emf_step(state, gains, round(mean_v), emf, 0, shift, commutations + tick // 8)
        commutations += 5
    assert list(state.more_q20) == found
