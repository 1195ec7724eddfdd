# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Hand-over between injection and EMF, and the validity of the injection."""

from __future__ import annotations

import math
from random import Random

import pytest

from fluxlock.firmware import injection_formats as formats
from fluxlock.firmware.binding import names, new, types
from fluxlock.firmware.vector_formats import Complex
from fluxlock.headers import CData
from fluxlock.theory.injection.cases import YU_BEST, yu
from fluxlock.theory.injection.chain import HfMachine
from fluxlock.theory.injection.theory import amplitude as hf_amplitude
from fluxverify.regression.five_phase.injection_bench import CLOCK_HZ, Q30, Q32, Q36, TURN, InjectionBench, firmware_pll

SEED = 41
Q16, Q21 = 2**16, 2**21


def test_share_follows_the_speed_with_a_hysteresis(lib: CData) -> None:
    """A random walk of the speed: steps, injection on where it counts, changes of direction at the two speeds only.

    Verifies: INJC-06
    """
    rng = Random(SEED)
    settings = formats.handover_settings(2000, 1500, 3000 / Q16, 5)
    state = new("injection_handover_t")
    lib.injection_handover_begin(state, False)
    speed, share, emf, results, seen = 0, 0, False, 0, set()
    for _ in range(20_000):
        speed = max(-4000, min(4000, speed + rng.randint(-80, 80)))
        fresh, there = rng.random() < 0.5, rng.random() < 0.9
        before = state.inject
        lib.injection_handover_step(state, settings, speed, fresh, there)
        results = 0 if not before else results + fresh
        assert abs(state.share_q16 - share) <= 3000 and 0 <= state.share_q16 <= Q16, SEED
        assert state.inject or (state.share_q16 == Q16 and abs(speed) > 1500), SEED
        if state.share_q16 < share:
            assert results >= 5 and not state.emf, SEED
        if state.emf and not emf:
            assert there and abs(speed) > 2000, SEED
        if emf and not state.emf:
            assert abs(speed) < 1500 and results >= 5, SEED
        share, emf = state.share_q16, state.emf
        seen.add((state.inject, state.emf))
    assert seen == {(True, False), (True, True), (False, True)}


def test_error_and_curve_are_shared(lib: CData) -> None:
    """Error (1 - s) e_injection + s e_EMF and curve (1 - s) c, rounded.

    Verifies: INJC-06
    """
    rng = Random(SEED)
    for _ in range(500):
        share = rng.choice((0, Q16, rng.randint(0, Q16)))
        state = new("injection_handover_t", share_q16=share, emf=True, inject=True)
        a, b, c = (rng.randint(-(2**30), 2**30) for _ in range(3))
        error = lib.injection_handover_error_q30(state, a, b)
        assert error == pytest.approx(((Q16 - share) * a + share * b) / Q16, abs=0.51), SEED
        assert lib.injection_handover_curve_q32(state, c) == pytest.approx((Q16 - share) * c / Q16, abs=0.51)


@pytest.mark.parametrize("direction", [1, -1])
def test_loaded_machine_is_handed_over_both_ways(lib: CData, direction: int) -> None:
    """Yu's machine, driven shaft, 50 to 400 r/min and back at i_q = 4 A, whose curve is 0.18 rad.

    The EMF's angle error is the true one with 1 degree of offset, as an observer with wrong parameters has it.

    Verifies: INJC-06
    """
    loop = yu(YU_BEST, 2e-6)
    full_scale_a, ts = loop.inverter.current_full_scale_a, loop.settings.ts_s
    motor = loop.motor
    rpm = [50.0, 400.0, 400.0, 50.0, 50.0]
    times = [0.1, 0.35, 0.4, 0.65, 0.75]
    i_q = 4.0
    bench = InjectionBench(loop, 0.3, SEED, direction * motor.omega_e(50.0))
    errors = formats.error_settings("separator", bench.m.l_d, bench.m.l_q, full_scale_a=full_scale_a, minimum_a=0.02)
    assert motor.saturation is not None
    curve = formats.cross_coupling_settings(motor.saturation.angle_rad, 6.25, full_scale_a)
    hertz = Q36 / CLOCK_HZ / TURN
    settings = formats.handover_settings(motor.omega_e(250.0) * hertz, motor.omega_e(200.0) * hertz, ts / 0.02, 20)
    state, pll, gains = new("injection_handover_t"), new("pll_t"), firmware_pll(loop.settings.pll, ts)
    lib.injection_handover_begin(state, False)
    c = float(lib.cross_coupling_curve_q32(curve, round(i_q / full_scale_a * 2**25)))
    bench.nco_q36 = round((bench.theta - c / Q32 * TURN) / TURN * Q36) % int(Q36)
    lib.pll_preset(pll, 0, round(bench.speed_rad_s * hertz))
    error_q30, published_before = 0, 0.0
    published, torques, injecting = [], [], []
    for k in range(round(times[-1] / ts)):
        t = k * ts
        at = next((n for n, end in enumerate(times) if t < end), len(times) - 1)
        begin = times[at - 1] if at else 0.0
        share = (t - begin) / (times[at] - begin)
        wanted = rpm[max(at - 1, 0)] + (rpm[at] - rpm[max(at - 1, 0)]) * share
        bench.imposed_rad_s = direction * motor.omega_e(wanted)
        bench.sample()
        if bench.amplitude is not None:
            error_q30 = lib.injection_error_q30(errors, bench.amplitude)
        emf_q30 = round(math.sin(-bench.error_rad() + math.radians(1.0)) * Q30)
        speed = lib.pll_speed_turn_q36(pll)
        lib.injection_handover_step(state, settings, speed, bench.amplitude is not None, True)
        c_now = lib.injection_handover_curve_q32(state, round(c))
        # Following: what the published angle has beyond the frame changes with the share.
        follow = round(published_before - c_now) if k else 0
        published_before = float(c_now)
        both = lib.injection_handover_error_q30(state, error_q30, emf_q30)
        command = bench.command
        command.turn_q32 = follow + lib.pll_correct(pll, gains, both)
        command.speed_turn_q36 = lib.pll_speed_turn_q36(pll)
        command.lead_q32 = round(1.5 * command.speed_turn_q36 * bench.cycles / 16)
        ahead = c_now / Q32 * TURN
        command.reference_a = i_q * 1j * complex(math.cos(ahead), math.sin(ahead))
        command.inject = bool(state.inject)
        published.append(math.degrees(bench.error_rad(ahead)))
        torques.append(float(bench.state[6]))
        injecting.append(bool(state.inject))
    first, last = injecting.index(False), len(injecting) - injecting[::-1].index(False)
    assert all(injecting[:first]) and all(injecting[last:]), "one hand-over each way"
    settled = round(0.05 / ts)
    largest = max(abs(e) for e in published[settled:])
    n = round(2e-3 / ts)
    sliding = [sum(torques[k : k + n]) / n for k in range(settled, len(torques) - n, n // 2)]
    mean = sum(sliding) / len(sliding)
    dip = max(abs(x / mean - 1) for x in sliding)
    print(f"seed {SEED}, direction {direction}: published error at most {largest:.2f} deg, torque {100 * dip:.2f} %")
    assert largest < 3.0
    assert dip < 0.05


YU = HfMachine(0.5, 11.8e-3, 13.7e-3)
U_V, T_H = 60.0, 5e-4
FULL_SCALE_A = 10.0
UNIT = Q21 / FULL_SCALE_A


def validity_settings(machine: HfMachine = YU) -> CData:
    """Derated from 0.02 rad of noise and a ratio of 1.12, faults at 0.06 rad and 1.04."""
    difference = machine.lq_h - machine.ld_h
    return new(
        "injection_validity_settings_t",
        minimum_i_q21=round(0.05 * UNIT),
        expected_i_q21=round(hf_amplitude(machine, U_V, T_H).d * UNIT),
        saliency_q16=round(machine.lq_h / machine.ld_h * Q16),
        derate_ratio_q16=round(1.12 * Q16),
        fault_ratio_q16=round(1.04 * Q16),
        noise_factor_q16=round(machine.lq_h / difference / (4 / math.sqrt(math.pi)) * Q16),
        derate_noise_q16=round(0.02 * Q16),
        fault_noise_q16=round(0.06 * Q16),
        filter_shift=6,
        fault_results=50,
    )


def judged(lib: CData, d_a: float, q_a: float, sigma_a: float, results: int = 1500) -> CData:
    """After so many results with white noise."""
    rng, state, settings = Random(SEED), new("injection_validity_t"), validity_settings()
    lib.injection_validity_begin(state)
    for _ in range(results):
        d, q = (round((x + rng.gauss(0, sigma_a)) * UNIT) for x in (d_a, q_a))
        lib.injection_validity_step(state, settings, Complex(d, q))
    return state


def test_noise_of_the_angle(lib: CData) -> None:
    """Its rms within 15 %, derating even between the limits, fault by name beyond.

    Verifies: INJC-07
    """
    d = hf_amplitude(YU, U_V, T_H).d
    per_rad = YU.lq_h / (YU.lq_h - YU.ld_h) / d  # rad/A
    for noise in (0.005, 0.03, 0.05, 0.1):
        state = judged(lib, d, 0.0, noise / per_rad)
        found = state.noise_q16 / Q16
        name = names("injection_verdict_t")[state.verdict]
        print(f"seed {SEED}: {noise:g} rad, found {found:.4f}, {name}, share {state.share_q16 / Q16:.2f}")
        assert found == pytest.approx(noise, rel=0.15)
        assert state.share_q16 / Q16 == pytest.approx(max(0.0, min(1.0, (0.06 - found) / 0.04)), abs=0.001)
        assert name == ("good" if noise < 0.02 else "derated" if noise < 0.06 else "noise")
        assert types().string(lib.injection_verdict_name(state.verdict)).decode() == name


def test_ratio_of_the_inductances(lib: CData) -> None:
    """On the d axis that of the motor file; on the q axis, and where L_d has come near L_q, a fault by name.

    Verifies: INJC-07
    """
    cases = (
        (hf_amplitude(YU, U_V, T_H).d, "good", YU.lq_h / YU.ld_h),
        (hf_amplitude(HfMachine(0.5, 12.6e-3, 13.7e-3), U_V, T_H).d, "derated", 13.7 / 12.6),
        (hf_amplitude(HfMachine(0.5, 13.4e-3, 13.7e-3), U_V, T_H).d, "no_saliency", 13.7 / 13.4),
        (hf_amplitude(YU, U_V, T_H, math.pi / 2).d, "no_saliency", 1.0),
    )
    for d, name, ratio in cases:
        state = judged(lib, d, 0.0, 0.0)
        assert state.ratio_q16 / Q16 == pytest.approx(ratio, abs=2e-3)
        assert names("injection_verdict_t")[state.verdict] == name


def test_lost_signal_and_time_to_a_fault(lib: CData) -> None:
    """No amplitude is a fault after the stated results, not before; it stays.

    Verifies: INJC-07
    """
    state, settings = new("injection_validity_t"), validity_settings()
    lib.injection_validity_begin(state)
    assert state.share_q16 == Q16
    good = Complex(round(hf_amplitude(YU, U_V, T_H).d * UNIT), 0)

    def steps(vector: Complex, count: int) -> str:
        for _ in range(count):
            lib.injection_validity_step(state, settings, vector)
        return names("injection_verdict_t")[state.verdict]

    assert steps(good, 400) == "good"
    # The mean of 64 results falls to the ratio's limit, then to the least amplitude.
    verdicts = [steps(Complex(0, 0), 1) for _ in range(400)]
    assert "derated" in verdicts and verdicts[-1] == "no_saliency"
    assert verdicts.index("no_saliency") >= 49
    assert steps(good, 1000) == "no_saliency" and state.share_q16 == 0
    lib.injection_validity_begin(state)
    assert steps(Complex(0, 0), 400) == "no_signal"
