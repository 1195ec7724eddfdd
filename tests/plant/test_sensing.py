# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sense chain: scaling, noise, pole, clipping."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtri

from fluxlock.plant import CHANNEL_NAMES, Plant
from fluxlock.plant import layout as L
from fluxlock.plant.sensing import normal_quantile
from tests.plant.drives import CLOCK_S, motor_1

VA, VB, VC, IA, IB, IC, VDC, IDC, VSM = range(9)


def test_scaling_gains_and_offsets() -> None:
    """Codes of a locked rotor's DC currents and voltages follow from Ohm's law.

    Verifies: PLANT-07
    """
    offsets = (1.0, -2.0, 3.0, 4.0, -5.0, 6.0, 7.0, -8.0, 9.0)
    gains = (1.10, 1.00, 0.90)
    params = motor_1(
        mechanics__mode="locked", sensing__noise_lsb_rms=0.0, sensing__divider_gain=gains,
        sensing__offset_lsb=offsets, machine__r_ohm=(0.4, 0.5, 0.6),
    )  # fmt: skip
    plant = Plant(params, seed=1, mode="py")
    plant.set_gates(0b100001)  # A+ C-
    codes = plant.sample(500_000)  # many time constants
    amps = 25.0 / (0.02 + 2 * 0.005 + 0.4 + 0.6)
    vdc = 25.0 - 0.02 * amps
    va, vc = vdc - 0.005 * amps, 0.005 * amps
    vb = va - 0.4 * amps
    volts = np.array([va * 1.1, vb, vc * 0.9]) / (30.0 / 4096)
    expected = [
        *volts,
        2048 + amps * 40.96,
        2048,
        2048 - amps * 40.96,
        vdc / (30.0 / 4096),
        2048 + amps * 40.96,
    ]
    expected.append((va + vb + vc) / 3 / (30.0 / 4096))
    wanted = np.floor(np.array(expected) + offsets + 0.5)
    assert codes.tolist() == wanted.tolist()


def test_clipping() -> None:
    """Codes stop at 0 and at full scale.

    Verifies: PLANT-07
    """
    params = motor_1(
        mechanics__mode="locked",
        sensing__noise_lsb_rms=0.0,
        sensing__i_full_scale_a=5.0,
        sensing__v_full_scale_v=20.0,
    )
    plant = Plant(params, seed=1, mode="py")
    plant.set_gates(0b001001)  # A+ B-
    codes = plant.sample(5000)
    assert plant.currents_a[0] > 5.0
    assert codes[IA] == 4095 and codes[IB] == 0 and codes[IC] == 2048
    assert codes[VA] == 4095 and codes[VDC] == 4095
    plant.set_gates(0b000000)  # A freewheels through its lower diode: below the rail
    codes = plant.sample(5100)
    assert plant.terminals_v[0] < -0.69
    assert codes[VA] == 0


def test_pole_step_response() -> None:
    """The divider output follows a step of the terminal voltage exponentially; the star point likewise.

    Verifies: PLANT-07
    """
    params = motor_1(
        mechanics__mode="locked", sensing__noise_lsb_rms=0.0, sensing__bits=24, sensing__divider_pole_s=1e-6,
        inverter__supply_r_ohm=0.0,
    )  # fmt: skip
    plant = Plant(params, seed=1, mode="py")
    plant.set_gates(0b101010)
    plant.advance(1000)
    plant.set_gates(0b101001)
    for t in (1001, 1010, 1025, 1050, 1100, 1400):
        codes = plant.sample(t)
        rise = 1 - math.exp(-(t - 1000) * CLOCK_S / 1e-6)
        # The drop over the switches is the rest: up to 5 mOhm times the current.
        drop = 0.005 * plant.currents_a[0]
        assert codes[VA] * 30 / 2**24 == pytest.approx(25 * rise, abs=drop + 1e-5)
        assert codes[VSM] * 30 / 2**24 == pytest.approx(25 * rise / 3, abs=drop + 1e-5)


def test_noise_is_normal_white_and_independent() -> None:
    """Mean, rms, tails, autocorrelation and correlation between channels over 20 000 samples.

    Verifies: PLANT-08
    """
    seed, n, lsb = 7, 20_000, 40.0
    print(f"seed {seed}")
    params = motor_1(
        mechanics__mode="locked", sensing__noise_lsb_rms=lsb, recording__every_strobes=0,
        sensing__offset_lsb=(1000.0,) * 3 + (0.0,) * 6,
    )  # fmt: skip
    plant = Plant(params, seed=seed, mode="jit")
    codes = np.array([plant.sample(k) for k in range(1, n + 1)], float)[:, :VSM]
    true = np.array([1000, 1000, 1000, 2048, 2048, 2048, 25 / 30 * 4096, 2048])
    # Dividers at rest at the star of the sense resistors: no voltage.
    noise = (codes - true) / lsb
    sigma = 1 / math.sqrt(n)
    assert np.all(np.abs(noise.mean(0)) < 5 * sigma)
    assert np.all(np.abs(noise.std(0) - 1) < 5 * sigma / math.sqrt(2))
    beyond_2 = 2 * tail_probability(2.0)
    assert np.all(np.abs((np.abs(noise) > 2).mean(0) - beyond_2) < 5 * math.sqrt(beyond_2 / n))
    correlation = np.corrcoef(noise.T) - np.eye(8)
    assert np.abs(correlation).max() < 5 * sigma
    for lag in (1, 2, 3, 16):
        lagged = (noise[lag:] * noise[:-lag]).mean(0)
        assert np.all(np.abs(lagged) < 5 * sigma), lag


def tail_probability(z: float) -> float:
    """Probability above z."""
    return 0.5 * math.erfc(z / math.sqrt(2))


def test_noise_depends_on_seed_channel_and_number_only() -> None:
    """Same seed, same codes whatever the timing; another seed, other codes.

    Verifies: PLANT-08
    """

    def codes(seed: int, spacing: int, extra_events: bool) -> np.ndarray:
        plant = Plant(motor_1(mechanics__mode="locked", sensing__noise_lsb_rms=20.0), seed=seed, mode="py")
        rows = []
        for k in range(1, 60):
            if extra_events:
                plant.advance(k * spacing - 1)
            rows.append(plant.sample(k * spacing))
        return np.array(rows)[:, [IA, IB, IC, VDC, IDC]]

    assert np.array_equal(codes(1, 50, False), codes(1, 70, True))
    assert not np.array_equal(codes(1, 50, False), codes(2, 50, False))


def test_normal_quantile() -> None:
    """The quantile agrees with scipy's over all tails that 32 bits can reach.

    Verifies: PLANT-08
    """
    p = np.concatenate([np.linspace(1e-4, 1 - 1e-4, 2001), 10.0 ** -np.arange(4, 10.5, 0.25)])
    mine = np.array([normal_quantile(float(x)) for x in p])
    assert np.abs(mine / np.where(ndtri(p) == 0, 1, ndtri(p)) - 1)[ndtri(p) != 0].max() < 1e-6


def test_stuck_channel() -> None:
    """A stuck channel keeps its code while the others go on.

    Verifies: PLANT-12
    """
    plant = Plant(motor_1(), seed=1, mode="py")
    plant.set_gates(0b001001)
    plant.sample(100)
    for name in CHANNEL_NAMES:
        plant.inject_fault("stuck_channel", channel=name, code=1234)
        assert plant.sample(plant.t_cycle + 50)[CHANNEL_NAMES.index(name)] == 1234
    plant.inject_fault("clear")
    held = plant.sample(plant.t_cycle + 50)
    assert held[IA] != 1234
    plant.inject_fault("stuck_channel", channel="ia")
    assert plant.sample(plant.t_cycle + 500)[IA] == held[IA]
    assert plant.state[L.SAMPLE] == 12
