# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection from voltage to angle in floating point against the closed forms of the papers."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fluxlock.theory.injection.chain import (
    SEQUENCES,
    AnalyticHfCurrent,
    Biquad,
    ExactHfCurrent,
    HfCurrent,
    HfMachine,
    Injection,
    IqDemodulator,
    LockIn,
    Pll,
    Separator,
    Sequence,
    settled_error,
    settled_lock_in_error,
    track,
)

TIAN = HfMachine(r_ohm=1.3, ld_h=6.54e-3, lq_h=8.32e-3)
TIAN_WAVE = Injection(u_v=20.0, period=40, ts_s=1 / 10_300)
TIAN_PLL = Pll(kp=80.0, ki=1200.0)
YU = HfMachine(r_ohm=0.5, ld_h=11.8e-3, lq_h=13.7e-3)
YU_WAVE = Injection(u_v=60.0, period=4, ts_s=125e-6)
YU_PLL = Pll(kp=115.0, ki=3306.0)


def electrical(rpm: float, pole_pairs: int) -> float:
    return rpm / 60 * 2 * math.pi * pole_pairs


@pytest.mark.parametrize("rpm", [50.0, 150.0, 300.0, 600.0, -300.0])
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_separator_reproduces_the_closed_forms(rpm: float, sequence: Sequence) -> None:
    """Yu's machine at rated current, analytic HF currents and the exact machine: closed forms within 3 %.

    Verifies: INJ-12
    """
    omega = electrical(rpm, 9)
    expected = settled_error(YU, omega * YU_WAVE.ts_s, sequence)
    currents: list[HfCurrent] = [
        AnalyticHfCurrent(YU, omega, YU_WAVE.ts_s),
        ExactHfCurrent(YU, omega, YU_WAVE.ts_s),
    ]
    for current in currents:
        run = track(
            current,
            Separator(YU, YU_WAVE),
            YU_WAVE,
            YU_PLL,
            omega=omega,
            sequence=sequence,
            seconds=0.6,
            fundamental=0.2 + 5j,
        )
        limit = 0.03 * abs(expected) if sequence != "exact" else 0.002
        name = type(current).__name__
        assert abs(run.mean - expected) <= limit, f"{name}: {run.mean:.5f}, not {expected:.5f} rad"


def test_held_sequence_has_a_largest_speed() -> None:
    """Above 1266 r/min the held sequence does not settle.

    Verifies: INJ-12
    """
    assert settled_error(YU, electrical(1265, 9) * YU_WAVE.ts_s, "held") > 0
    with pytest.raises(ValueError, match="does not settle"):
        settled_error(YU, electrical(1267, 9) * YU_WAVE.ts_s, "held")


@pytest.mark.parametrize("rpm", [20.0, 100.0, -60.0])
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_iq_reproduces_the_closed_forms(rpm: float, sequence: Sequence) -> None:
    """Tian's machine with all of its resistance: the I/Q error has no speed term, what remains is the sequence's.

    Verifies: INJ-12
    """
    omega = electrical(rpm, 4)
    run = track(
        ExactHfCurrent(TIAN, omega, TIAN_WAVE.ts_s),
        IqDemodulator(TIAN, TIAN_WAVE),
        TIAN_WAVE,
        TIAN_PLL,
        omega=omega,
        sequence=sequence,
        seconds=1.0,
    )
    expected = settled_error(TIAN, omega * TIAN_WAVE.ts_s, sequence)
    limit = 0.03 * abs(expected) if sequence != "exact" else 1e-4
    assert abs(run.mean - expected) <= limit, f"{run.mean:.6f}, not {expected:.6f} rad"


@pytest.mark.parametrize("rpm", [20.0, 100.0])
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_lock_in_reproduces_the_phasors(rpm: float, sequence: Sequence) -> None:
    """Sign-based lock-in: the settled error is that of the phasors with sign() on the sample grid, within 3 %.

    Verifies: INJ-12
    """
    omega = electrical(rpm, 4)
    run = track(
        ExactHfCurrent(TIAN, omega, TIAN_WAVE.ts_s),
        LockIn(TIAN, fs_hz=10_300, f0_hz=257.5),
        TIAN_WAVE,
        TIAN_PLL,
        omega=omega,
        sequence=sequence,
        seconds=1.0,
    )
    expected = settled_lock_in_error(TIAN, TIAN_WAVE, omega, sequence)
    assert run.mean == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("phi_deg", [-20.0, 10.0, 30.0])
def test_reference_phase_error(phi_deg: float) -> None:
    """Conventional demodulation: a reference that leads by phi shifts the angle by -(w L_d / (w_h L_dif)) tan phi.

    Verifies: INJ-12
    """
    machine = replace(TIAN, r_ohm=0.0)
    omega, phi = electrical(100, 4), math.radians(phi_deg)
    errors = [
        track(
            ExactHfCurrent(machine, omega, TIAN_WAVE.ts_s),
            LockIn(machine, fs_hz=10_300, f0_hz=257.5, lag_rad=math.pi / 2 - lead),
            TIAN_WAVE,
            TIAN_PLL,
            omega=omega,
            sequence="exact",
            seconds=1.0,
        ).mean
        for lead in (0.0, phi)
    ]
    expected = -omega * machine.ld_h / (TIAN_WAVE.omega_h * machine.difference_h) * math.tan(phi)
    assert errors[1] - errors[0] == pytest.approx(expected, rel=0.03)


def test_filters_by_frequency_response() -> None:
    """Band-pass 1 without phase at f0, low-pass 1/k at f0 and 1 at 0."""
    f0, fs, k = 257.5, 10_300.0, 0.45
    for kind, expected in (("band", 1.0), ("low", -1j / k)):
        filter_ = Biquad("band" if kind == "band" else "low", f0, fs, k)
        total = 0j
        for m in range(4000):
            wave = complex(math.cos(2 * math.pi * m / 40), math.sin(2 * math.pi * m / 40))
            y = filter_.step(wave)
            if m >= 3960:
                total += y / wave / 40
        assert abs(total - expected) < 1e-9
    low = Biquad("low", f0, fs, k)
    for _ in range(4000):
        y = low.step(3 - 2j)
    assert abs(y - (3 - 2j)) < 1e-9


def test_bad_values_are_refused() -> None:
    """Messages name the value and its range."""
    with pytest.raises(ValueError, match="lq_h above ld_h"):
        HfMachine(1.0, 2e-3, 1e-3)
    with pytest.raises(ValueError, match="r_ohm = -1"):
        HfMachine(-1.0, 1e-3, 2e-3)
    with pytest.raises(ValueError, match="multiple of 4"):
        Injection(20.0, 6, 1e-4)
    with pytest.raises(ValueError, match="below fs_hz / 2"):
        Biquad("low", 6000.0, 10_000.0, 1.0)
