# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection on the chip with five phases, its machine held at an angle: what the registers show of the HF current."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Inverter, load_inverter, load_motor
from fluxlock.cosim.program import Row, read, reads, run_script, wait
from fluxlock.results.rundata import LogKind
from fluxverify.regression.five_phase.register_bench import bypassed, locked_plant, voltage_q17

IQ, SEPARATOR = 2, 3
PERIOD, OFFSET = 6250, 20  # clocks
VOLTAGE_V = 150.0
FULL_SCALE_A = 4.0  # of the current channels: the HF current fills most of it
ERRORS_DEG = (10.0, -25.0, 40.0)  # angle of the injection less that of the rotor
REST, SETTLE, READINGS = 12, 24, 6  # samples, samples, times
SEED = 1
NAMES = [("snap_re", 0), ("snap_re", 1), ("snap_im", 0), ("snap_im", 1)]


def script(method: int, period: int, inverter: Inverter) -> list[Row]:
    """At each error of Park and inverse Park a wave on the d axis; results and the regulators' current are read."""
    control = method << 1 | 1 << 3  # remove
    rows = [
        *bypassed(PERIOD, OFFSET, inverter, 0.0),
        Row("injection.control", 0, control),
        Row("injection.wave", 0, period | period // 4 << 16),
        Row("injection.rate", 0, round(2**36 / (period * PERIOD))),
        Row("injection.lag", 0, 2**30),
        Row("injection.amplitude", 0, voltage_q17(VOLTAGE_V, inverter)),
    ]
    for degrees in ERRORS_DEG:
        turn = round(degrees / 360 * 2**32)
        # A wave that begins and ends with whole periods leaves no current behind.
        rows += [Row("foc.park", 0, turn), Row("foc.lead", 0, turn), wait(REST)]
        rows += [Row("injection.control", 0, control | 1 | 1 << 8), wait(SETTLE)]
        for _ in range(READINGS):
            rows += [*(read(f"injection.{name}", i) for name, i in NAMES), read("foc.snap_i", 0), read("foc.snap_i", 1)]
        rows += [Row("injection.control", 0, control), wait(REST)]
    return rows


@pytest.mark.parametrize(("method", "period"), [(IQ, 8), (SEPARATOR, 4)])
def test_registers_show_the_angle_error(method: int, period: int) -> None:
    """Currents of d and q in the proportion that the inductances give; the separator takes them from the regulators.

    Verifies: SOC-25
    """
    # Without cross-saturation: the position of the salient axis is that of the rotor.
    motor = load_motor(ROOT / "motors" / "five-phase-yu.toml").model_copy(update={"saturation": None})
    inverter = load_inverter(ROOT / "inverters" / "five-leg-350v.toml")
    plant = locked_plant(motor, inverter)
    plant = replace(plant, sensing=replace(plant.sensing, i_full_scale_a=FULL_SCALE_A))
    folder = BUILD / "closed_loop" / f"five-phase-injection-{method}"
    shutil.rmtree(folder, ignore_errors=True)
    # A value takes 90 us of the console, less than a sample.
    samples = 20 + len(ERRORS_DEG) * (2 * REST + SETTLE + READINGS * (len(NAMES) + 2))
    data = run_script(script(method, period, inverter), plant, samples * PERIOD / CLOCK_HZ, folder, SEED)
    assert not data.rows(LogKind.TRIP).size
    shown = np.array(reads(data)).reshape(len(ERRORS_DEG), READINGS, len(NAMES) + 2)
    ld, lq = motor.inductance_h[0], motor.inductance_q_h or 0.0
    for degrees, values in zip(ERRORS_DEG, shown, strict=True):
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        flux_vs = VOLTAGE_V * PERIOD / CLOCK_HZ * period / 4  # half the swing
        d_a, q_a = flux_vs * (c * c / ld + s * s / lq), flux_vs * c * s * (1 / lq - 1 / ld)
        re_d, re_q, im_d, im_q, i_d, i_q = values.mean(axis=0)
        ratio = complex(re_q, im_q) / complex(re_d, im_d)
        print(f"seed {SEED}, {degrees} deg: ratio {ratio:.5f}, expected {q_a / d_a:.5f}, d {re_d:.0f}, {i_d:.0f}")
        # 0.001 are 0.4 degrees.
        assert abs(ratio - q_a / d_a) < 0.001
        if method == SEPARATOR:
            assert abs(re_d / 2**18 * FULL_SCALE_A - d_a) < 0.02 * d_a
            assert abs(complex(i_d, i_q)) / 2**17 * FULL_SCALE_A < 0.03 * d_a
