# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Angle error of the injection, angles of the sequences and the cross-coupling curve, against float models."""

from __future__ import annotations

import cmath
import math
from random import Random

import pytest

from fluxlock.config.injection import SEQUENCES
from fluxlock.firmware import injection_formats as formats
from fluxlock.firmware.binding import constant, names, new
from fluxlock.firmware.vector_formats import Complex, from_complex, pll_gains, vector_machine
from fluxlock.headers import CData
from fluxlock.theory.injection.chain import ExactHfCurrent, HfMachine, Injection, IqDemodulator, LockIn, Separator
from fluxlock.theory.injection.theory import LEAD_AND_REPORT, LoopSequence, sequence_error

SEED = 77
Q29, Q30, Q32, Q36 = 2**29, 2**30, 2**32, 2**36
FULL_SCALE_A = 10.0
YU = HfMachine(0.5, 11.8e-3, 13.7e-3)
TIAN = HfMachine(1.3, 6.54e-3, 8.32e-3)
IPM = HfMachine(0.12, 0.2e-3, 0.4e-3)


def found(lib: CData, settings: CData, amplitude: CData) -> float:
    """Error of the firmware (rad)."""
    return float(lib.injection_error_q30(settings, amplitude)) / Q30


def amplitude(d: complex, q: complex, unit: float, count: int = 0) -> CData:
    """injection_amplitude_t in a register's format."""
    return new("injection_amplitude_t", d=from_complex(d, unit), q=from_complex(q, unit), count=count)


def clamp(x: float) -> float:
    """Within +-1."""
    return max(-1.0, min(1.0, x))


def test_formulas_in_exact_arithmetic(lib: CData) -> None:
    """Random amplitudes of all sizes and random machines, every method.

    Verifies: INJC-01
    """
    rng = Random(SEED)
    worst, methods = 0.0, names("injection_method_t")
    for _ in range(8000):
        l_d = 10 ** rng.uniform(-5, -1)
        l_q = l_d * rng.uniform(1.05, 5.0)
        hz = 10 ** rng.uniform(2, 4)
        r = rng.uniform(0.0, 0.5) * 2 * math.pi * hz * (l_q - l_d)
        ratio = l_q / (l_q - l_d)
        sign = rng.choice((-1, 1))
        method = rng.choice(methods)
        if method == "iq":
            settings = formats.error_settings(method, l_d, l_q, r_ohm=r, injection_hz=hz)
            d = cmath.rect(2 ** rng.uniform(12, 30.4), rng.uniform(-math.pi, math.pi))
            q = d * cmath.rect(10 ** rng.uniform(-6, 0.3), rng.uniform(-math.pi, math.pi))
            if max(abs(q.real), abs(q.imag)) >= 2**31:
                continue
            a = amplitude(d, q, 1.0, rng.randint(1, min(4095, int(abs(d) / 4))))
            z = complex(a.q.re, a.q.im) / complex(a.d.re, a.d.im)
            expected = clamp(z.real * ratio + z.imag * r / (2 * math.pi * hz * (l_q - l_d)))
            resolution = 2 * ratio / abs(d) + 2.0**-26 * abs(z) * ratio
        else:
            shift = rng.randint(0, 7) if method != "separator" else 0
            settings = formats.error_settings(method, l_d, l_q, shift=shift)
            d = sign * round(2 ** rng.uniform(4, 23))
            q = round(rng.choice((-1, 1)) * min(2 ** rng.uniform(0, 23), 2**23))
            d_register, q_register = (Complex(int(x.real), rng.getrandbits(30)) for x in (d, q))
            a = new("injection_amplitude_t", d=d_register, q=q_register)
            expected = clamp(q / (d.real * 2**shift) * ratio)
            if abs(q / (d.real * 2**shift)) >= 2:
                expected = clamp(math.copysign(2 * ratio, expected))
            resolution = 2.0**-28 * ratio
        got = found(lib, settings, a)
        worst = max(worst, abs(got - expected) - resolution)
        assert abs(got - expected) < 1e-7 + resolution, (SEED, method, a.d.re, a.q.re)
    print(f"seed {SEED}: worst beyond the resolution {worst:.2e} rad")


def test_separator_by_the_expected_size(lib: CData) -> None:
    """K I_q whatever I_d; its size is that of the registers' format.

    Verifies: INJC-01
    """
    t_h, u_h = 5e-4, 60.0
    settings = formats.error_settings(
        "separator", YU.ld_h, YU.lq_h, expected_volt_seconds=t_h * u_h, full_scale_a=FULL_SCALE_A
    )
    unit = formats.SEPARATOR_FULL_SCALE / FULL_SCALE_A
    k = 4 * YU.ld_h * YU.lq_h / (t_h * u_h * (YU.lq_h - YU.ld_h))
    for i_q in (-2.0, -0.05, 0.0, 0.001, 0.03):
        a = amplitude(0.3, i_q, unit)
        assert found(lib, settings, a) == pytest.approx(clamp(k * a.q.re / unit), abs=1e-8)


def test_without_signal_there_is_no_angle(lib: CData) -> None:
    """Below the least size of I_d, at zero and without samples the error is 0; sizes are those of the formats.

    Verifies: INJC-01
    """
    sizes = {
        "lock_in": (2**21, 0),
        "conventional": (2**21, 0),
        "separator": (2**18, 0),
        "iq": (2**19 / 2 * 100, 100),
    }
    for method, (full_scale, count) in sizes.items():
        settings = formats.error_settings(method, 1e-3, 2e-3, minimum_a=0.1, full_scale_a=1.0)
        for size in (0.0, 0.0999, 0.101, 0.9):
            a = amplitude(-size, 0.01, full_scale, count)
            magnitude = lib.injection_magnitude_i_q17(settings, a) / formats.Q17
            assert magnitude == pytest.approx(size, abs=2 / formats.Q17), method
            assert (found(lib, settings, a) == 0.0) == (size < 0.1), (method, size)
        if count:
            assert found(lib, settings, amplitude(-0.5, 0.1, full_scale, 0)) == 0.0


def chain(machine: HfMachine, error: float, omega: float, injection: Injection) -> list[tuple[complex, int, float]]:
    """Current in the estimated frame, quantised to 18 bits, with phase and angle: 3 s of time constants long."""
    current = ExactHfCurrent(machine, omega, injection.ts_s)
    samples = []
    lsb = FULL_SCALE_A / formats.Q17
    for m in range(60 * injection.period + 1):
        theta = omega * injection.ts_s * m
        # The voltage is on the estimated axis at the middle of its effect, as with the exact sequence.
        rotor = current.step(injection.voltage(m), theta - error - omega * injection.ts_s / 2, theta)
        seen = rotor * cmath.exp(1j * error)
        seen = complex(round(seen.real / lsb), round(seen.imag / lsb)) * lsb
        samples.append((seen, injection.phase(m), injection.angle(m)))
    return samples


@pytest.mark.parametrize("error", [-0.1, -0.02, 0.0, 0.05])
@pytest.mark.parametrize(
    ("machine", "injection", "omega"),
    [
        (TIAN, Injection(90.0, 16, 1 / 10_300), 42.0),
        (YU, Injection(60.0, 4, 125e-6), 47.0),
        (IPM, Injection(6.0, 8, 50e-6), -160.0),
    ],
)
def test_chip_formats_give_the_angle_of_the_float_models(
    lib: CData, machine: HfMachine, injection: Injection, omega: float, error: float
) -> None:
    """I/Q, lock-in and separator on the exact HF current of a turning machine at a fixed angle error.

    I/Q and separator find the machine's error itself, to the third power of it and what a peak of few samples has of
    resistance; the lock-in its float model's.

    Verifies: INJC-02
    """
    samples = chain(machine, error, omega, injection)
    hz = injection.omega_h / (2 * math.pi)
    frequency = {"r_ohm": machine.r_ohm, "injection_hz": hz, "full_scale_a": FULL_SCALE_A}

    model = IqDemodulator(machine, injection)
    expected = [result for s in samples if (result := model.step(*s)) is not None][-1]
    sums = [0j, 0j]
    for current, _, angle in samples[-1 - injection.period : -1]:
        kernel = cmath.exp(-1j * angle) * 2**19 / FULL_SCALE_A
        sums = [sums[0] + current.real * kernel, sums[1] + current.imag * kernel]
    iq = found(
        lib,
        formats.error_settings("iq", machine.ld_h, machine.lq_h, **frequency),
        amplitude(sums[0], sums[1], 1.0, injection.period),
    )
    assert iq == pytest.approx(expected, abs=1e-5)
    assert iq == pytest.approx(error, abs=0.03 * abs(error) + 4e-4)

    lock_in = LockIn(machine, 1 / injection.ts_s, hz, low_hz=0.08 * hz)
    for s in samples:
        expected = lock_in.step(*s) or 0.0
    shift = 3
    settings = formats.error_settings("lock_in", machine.ld_h, machine.lq_h, shift=shift, **frequency)
    unit = 2**21 / FULL_SCALE_A
    got = found(lib, settings, amplitude(lock_in.magnitude, lock_in.error * 2**shift, unit))
    assert got == pytest.approx(expected, abs=1e-5)

    if injection.period == 4:
        separator = Separator(machine, injection)
        expected = [result for s in samples if (result := separator.step(*s)) is not None][-1]
        a = amplitude(separator.amplitude.real, separator.amplitude.imag, formats.SEPARATOR_FULL_SCALE / FULL_SCALE_A)
        volt_seconds = injection.u_v * injection.period * injection.ts_s
        sized = formats.error_settings(
            "separator", machine.ld_h, machine.lq_h, expected_volt_seconds=volt_seconds, full_scale_a=FULL_SCALE_A
        )
        assert found(lib, sized, a) == pytest.approx(expected, abs=1e-4)
        normalised = formats.error_settings("separator", machine.ld_h, machine.lq_h)
        assert found(lib, normalised, a) == pytest.approx(error, abs=0.03 * abs(error) + 2e-3)


def machine_for(delay: float, period_cycles: int) -> CData:
    """What the sequences look at: delay and period."""
    return vector_machine(0.0, delay, 1.0, period_cycles)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0])
def test_leads_of_the_sequences(lib: CData, delay: float) -> None:
    """Inverse Park and report at any delay; with a whole period those of the theory.

    Verifies: INJC-03
    """
    rng = Random(SEED)
    machine = machine_for(delay, 6250)
    for _ in range(200):
        speed = rng.randint(-1_700_000, 1_700_000)  # 2^-36 turn a clock, +-1 rad a period
        delta = speed * 6250 / Q36 * 2 * math.pi
        action = (delay + 0.5) * delta
        for sequence in SEQUENCES:
            leads = lib.angle_sequence_leads(constant("SEQUENCE", sequence), machine, speed)
            lead = {"held-tian": 0.0, "held": action - delta / 2}.get(sequence, action)
            report = {"exact": 0.0}.get(sequence, lead)
            got = [x / Q32 * 2 * math.pi for x in (leads.lead_q32, leads.report_q32)]
            assert got == pytest.approx([lead, report], abs=1e-7), (SEED, sequence)
            if delay == 1.0:
                expected = [x * delta for x in LEAD_AND_REPORT[sequence]]  # type: ignore[index]
                assert got == pytest.approx(expected, abs=1e-7), (SEED, sequence)


@pytest.mark.parametrize("rpm", [-300.0, 150.0, 600.0])
@pytest.mark.parametrize("sequence", ["held", "half-step", "exact"])
def test_closed_loop_rests_where_the_closed_form_says(lib: CData, sequence: LoopSequence, rpm: float) -> None:
    """Separator, error, loop of third order and sequence of the firmware on Yu's machine with a driven shaft.

    Within 3 % of the closed form, the exact sequence within 0.005 rad of the rotor.

    Verifies: INJC-03
    """
    ts, cycles = 125e-6, 6250
    omega = 9 * rpm * math.pi / 30
    delta = omega * ts
    injection = Injection(60.0, 4, ts)
    current = ExactHfCurrent(YU, omega, ts)
    separator = Separator(YU, injection)
    settings = formats.error_settings("separator", YU.ld_h, YU.lq_h, full_scale_a=FULL_SCALE_A)
    machine = machine_for(1.0, cycles)
    gains = pll_gains(math.exp(-2 * math.pi * 23.0 * ts), cycles, 3)
    pll, error_q30 = new("pll_t"), 0
    lib.pll_preset(pll, 0, round(delta / (2 * math.pi) / cycles * Q36))
    acting = waiting = 0.0  # angles of the voltage that acts and of the next one
    errors = []
    count = 4000
    for m in range(count):
        theta = delta * m
        park = lib.pll_angle_turn_q32(pll) / Q32 * 2 * math.pi
        seen = current.step(injection.voltage(m), acting, theta) * cmath.exp(1j * (theta - park))
        if separator.step(seen, injection.phase(m), injection.angle(m)) is not None:
            unit = formats.SEPARATOR_FULL_SCALE / FULL_SCALE_A
            a = amplitude(separator.amplitude.real, separator.amplitude.imag, unit)
            error_q30 = lib.injection_error_q30(settings, a)
        speed = lib.pll_speed_turn_q36(pll)
        leads = lib.angle_sequence_leads(constant("SEQUENCE", sequence), machine, speed)
        acting, waiting = waiting, park + leads.lead_q32 / Q32 * 2 * math.pi
        reported = park + leads.report_q32 / Q32 * 2 * math.pi
        if m > count // 2:
            errors.append(math.remainder(reported - theta, 2 * math.pi))
        lib.pll_step(pll, gains, cycles, error_q30)
    mean = sum(errors) / len(errors)
    expected = sequence_error(YU, delta, sequence)
    print(f"{sequence}, {rpm:g} r/min: {mean:+.5f} rad, closed form {expected:+.5f}")
    assert mean == pytest.approx(expected, abs=0.005 if sequence == "exact" else 0.03 * abs(expected))


CURVES = ((0.018, -0.025, 0.0, -0.0015), (0.0, -0.015), (-0.1, 0.02, 0.004, 0.0))


@pytest.mark.parametrize("curve", CURVES)
def test_cross_coupling_curve(lib: CData, curve: tuple[float, ...]) -> None:
    """Polynomial of the motor file, held beyond its ends; first-order filter of the current.

    Verifies: INJC-04
    """
    rng = Random(SEED)
    most, share = 6.25, 0.125
    settings = formats.cross_coupling_settings(curve, most, FULL_SCALE_A, share)
    state = new("cross_coupling_t")
    ampere = formats.Q25 / FULL_SCALE_A
    lib.cross_coupling_begin(state, settings, 0)
    filtered = 0.0

    def angle(i_a: float) -> float:
        held = max(-most, min(most, i_a))
        return sum(c * held**k for k, c in enumerate(curve))

    for _ in range(500):
        i_a = rng.uniform(-FULL_SCALE_A, FULL_SCALE_A)
        got = lib.cross_coupling_curve_q32(settings, round(i_a * ampere)) / Q32 * 2 * math.pi
        assert got == pytest.approx(angle(i_a), abs=1e-7), SEED
        filtered += share * (i_a - filtered)
        assert lib.cross_coupling_step(state, settings, round(i_a * ampere)) == 0
        assert state.c_q32 / Q32 * 2 * math.pi == pytest.approx(angle(filtered), abs=1e-5), SEED


def test_following_leaves_the_published_angle(lib: CData) -> None:
    """What the frame turns and what the curve changes cancel, to the bit.

    Verifies: INJC-04
    """
    rng = Random(SEED)
    settings = formats.cross_coupling_settings(CURVES[0], 6.25, FULL_SCALE_A, 0.3, following=True)
    state = new("cross_coupling_t")
    lib.cross_coupling_begin(state, settings, formats.Q25 // 4)
    frame, published = 0, state.c_q32
    for _ in range(200):
        frame += lib.cross_coupling_step(state, settings, rng.randrange(-formats.Q25, formats.Q25))
        assert frame + state.c_q32 == published, SEED
    assert frame != 0
