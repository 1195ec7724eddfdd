# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip with five phases on the five-phase plant: registers drive the modulator open loop, gates are recorded."""

from __future__ import annotations

import math

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import load_inverter, load_motor
from fluxlock.results.rundata import LogKind
from fluxverify.regression.five_phase.modulation import (
    CARRIERS,
    FIELD_HZ,
    FIRST_CLOCKS,
    LARGEST,
    LEAST_CARRIERS,
    ON_TIME_CLOCKS,
    PERIOD,
    RATIOS,
    THIRD_PERCENT,
    modulated,
)
from fluxverify.regression.runner import Runner


def test_modulator_drives_the_five_phase_plant() -> None:
    """On-times of the active vectors, nothing in the third subspace, linear up to 0.5257 V_dc, the machine's current.

    Verifies: SOC-24
    """
    motor = load_motor(ROOT / "motors" / "five-phase-yu.toml")
    inverter = load_inverter(ROOT / "inverters" / "five-leg-350v.toml")
    runner = Runner("five-phase/modulation", quick=True)
    data, found = modulated(runner)
    print(f"seed {runner.seed}: {found}")
    assert not data.rows(LogKind.TRIP).size
    instants = data.rows(LogKind.ANGLE)
    assert len(instants) > len(RATIOS) * CARRIERS and set(np.diff(instants[5:, 0])) == {PERIOD}
    assert min(seen.carriers for seen in found.values()) >= LEAST_CARRIERS
    assert max(seen.third for seen in found.values()) <= THIRD_PERCENT / 100 * PERIOD
    assert max(seen.first for seen in found.values()) <= FIRST_CLOCKS
    assert max(seen.on_time for seen in found.values()) <= ON_TIME_CLOCKS
    # What the machine makes of it: the amplitude lies between those of both axes.
    last = data.records[-40:]
    amplitude = 0.5 * (float(np.max(last["ia"])) - float(np.min(last["ia"])))
    reactance = [2 * math.pi * FIELD_HZ * value for value in (motor.inductance_q_h or 0.0, motor.inductance_h[0])]
    low, high = (LARGEST * inverter.supply_v / x for x in reactance)
    assert 0.8 * low < amplitude < 1.2 * high, f"{amplitude} A, {low} to {high} A"
