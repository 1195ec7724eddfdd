# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Step of i_d at standstill on Yu's machine: what the separator of the chip takes for HF current (Yu 2022, Fig. 9).

The firmware has no such step, so registers set up regulators and injection; the HF current is read from the snapshots.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Inverter, Motor, load_inverter, load_motor
from fluxlock.cosim.program import Row as RegisterRow
from fluxlock.cosim.program import read, reads, wait
from fluxlock.results.rundata import FloatArray, LogKind
from fluxlock.theory.vector.controllers import gains
from fluxlock.theory.vector.model import Sampling, SmoothMachine
from fluxverify.regression.case import Row, case
from fluxverify.regression.five_phase.register_bench import DOUBLE, REGULATE, bypassed, locked_plant, voltage_q17
from fluxverify.regression.runner import Runner

CARRIER, OFFSET = 12_500, 20  # clocks
TS_S = CARRIER / 2 / CLOCK_HZ
SEPARATOR, REMOVE, ENABLE, CLEAR = 3 << 1, 1 << 3, 1, 1 << 8  # of injection.control
PERIOD = 4  # updates
AMPLITUDE_V = 60.0
GAMMA = 0.3
STEP_A = 5.0
BEGIN, BEFORE, AFTER, QUICK_AFTER = 60, 12, 80, 40  # samples; pairs of readings
LEAK_MA = 10.0
SHARE = 0.9  # of the voltage circle
FULL_Q17, STATE_Q25 = 2**17, 2**25
PLACES = 2**17 - 1  # of a gain's mantissa


@dataclass(frozen=True)
class Stepped:
    """Readings, one to two samples apart: HF currents of d and q (A), number of the first one after the step.

    time_s, i_d_a: current of the machine at the samples; step_sample: the last one before it moves.
    """

    d_a: FloatArray
    q_a: FloatArray
    step: int
    time_s: FloatArray
    i_d_a: FloatArray
    trips: int

    @property
    def step_sample(self) -> int:
        """Number of the last sample before the current leaves the HF current's range."""
        hf_a = float(np.abs(self.i_d_a[: BEGIN // 2]).max()) + float(self.d_a[: self.step].mean())
        return int(np.flatnonzero(np.abs(self.i_d_a) > hf_a + STEP_A / 10)[0]) - 1

    def leak_a(self) -> float:
        """Largest deviation of the HF amplitudes from those before the step."""
        return max(
            float(np.abs(values[self.step :] - values[: self.step].mean()).max()) for values in (self.d_a, self.q_a)
        )


def regulators(motor: Motor, inverter: Inverter) -> list[RegisterRow]:
    """Both subspaces at standstill: gains for every second sample, with the delay that the separator makes."""
    assert motor.third is not None and motor.inductance_q_h is not None
    full_a, full_v = inverter.sensing.current_full_scale_a, inverter.sensing.voltage_full_scale_v
    inductances = (
        (motor.inductance_h[0] + motor.inductance_q_h) / 2,
        (motor.third.inductance_d_h + motor.third.inductance_q_h) / 2,
    )
    rest_v = SHARE * inverter.supply_v / 2 - AMPLITUDE_V
    rows = [RegisterRow("foc.limit", s, voltage_q17(rest_v, inverter)) for s in range(2)]
    for s, (inductance_h, ts_s) in enumerate(zip(inductances, (2 * TS_S, TS_S), strict=True)):
        machine = SmoothMachine(motor.resistance_ohm[0], inductance_h, 0.0)
        made = gains("C", machine, 0.0, Sampling(ts_s, ts_s, "exact"), gamma=GAMMA)
        unit = STATE_Q25 / full_v * full_a / FULL_Q17
        g, h = made.g.real * unit, made.h.real * unit
        shift = math.floor(math.log2(PLACES / g))
        rows += [
            RegisterRow("foc.gain", 2 * s, round(g * 2**shift)),
            RegisterRow("foc.hold", 2 * s, round(h * 2**shift)),
            RegisterRow("foc.ratio", 2 * s, min(PLACES, round(h / g * FULL_Q17))),
            RegisterRow("foc.shift", s, shift),
        ]
    return rows


def script(motor: Motor, inverter: Inverter, after: int, amplitude_v: float) -> list[RegisterRow]:
    """The wave, then the step; readings of every result from before it on."""
    injection = SEPARATOR | REMOVE
    rows = [
        *bypassed(CARRIER, OFFSET, inverter, 0.0, DOUBLE | REGULATE),
        *regulators(motor, inverter),
        RegisterRow("injection.control", 0, injection),
        RegisterRow("injection.wave", 0, PERIOD | PERIOD // 4 << 16),
        RegisterRow("injection.rate", 0, round(2**36 / (PERIOD * CARRIER // 2))),
        RegisterRow("injection.lag", 0, 2**30),
        RegisterRow("injection.amplitude", 0, voltage_q17(amplitude_v, inverter)),
        wait(4),
        RegisterRow("injection.control", 0, injection | ENABLE | CLEAR),
        wait(BEGIN),
    ]
    wanted = round(STEP_A / inverter.sensing.current_full_scale_a * FULL_Q17)
    # Two values take 180 us of the console, a result comes every two samples, 250 us: none is missed.
    pair = [read("injection.snap_re", 0), read("injection.snap_re", 1), wait(1)]
    rows += pair * BEFORE + [RegisterRow("foc.reference", 0, wanted), wait(1)] + pair * after
    return rows


def stepped(runner: Runner, amplitude_v: float = AMPLITUDE_V) -> Stepped:
    """Play the step on the chip with exact converter, without saturation and dead time."""
    motor = load_motor(ROOT / "motors" / "five-phase-yu.toml").model_copy(update={"saturation": None})
    inverter = load_inverter(ROOT / "inverters" / "five-leg-350v.toml")
    sensing = inverter.sensing.model_copy(update={"noise_lsb": 0.0})
    inverter = inverter.model_copy(update={"sensing": sensing, "dead_time_s": 0.0})
    after = QUICK_AFTER if runner.quick else AFTER
    samples = BEGIN + 2 * (BEFORE + after) + 40
    rows = script(motor, inverter, after, amplitude_v)
    data = runner.script(rows, locked_plant(motor, inverter), samples * TS_S, f"step-{amplitude_v:g}v")
    values = np.array(reads(data), dtype=np.float64).reshape(-1, 2) * (inverter.sensing.current_full_scale_a / 2**18)
    time_s = data.records["t_cycle"] / data.clock_hz
    # With the rotor at 0 the d axis is that of phase A, and subspace 3 has no current.
    return Stepped(values[:, 0], values[:, 1], BEFORE, time_s, data.records["ia"], len(data.rows(LogKind.TRIP)))


@case("five-phase/yu-leakage")
def leakage(runner: Runner) -> Iterator[Row]:
    """Step of i_d by 5 A at standstill, no noise: what of the fundamental the separator takes for HF current."""
    run = stepped(runner)
    yield Row(
        "five-phase/yu-leakage",
        {"motor": "Yu", "step_a": STEP_A, "amplitude_v": AMPLITUDE_V, "dead_time_us": 0.0},
        {
            "leak_ma": 1e3 * run.leak_a(),
            "hf_d_a": float(run.d_a[: run.step].mean()),
            "readings": run.d_a.size,
            "trips": run.trips,
        },
        {"leak_ma": (None, LEAK_MA), "readings": (run.step + 30, None), "trips": (0, 0)},
    )
