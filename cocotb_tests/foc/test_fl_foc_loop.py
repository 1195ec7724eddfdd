# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Current control in closed loop with the exact discrete machine: what the theory promises at a low sampling ratio.

The machine is solved in the stationary frame in floating point, the voltage held from T_d after the sample to T_d after
the next; it knows nothing of the regulators' frame. Motor-I, 15 kHz, step of the d current.
"""

from __future__ import annotations

import cmath
import itertools
import math
import tomllib
from dataclasses import dataclass
from typing import Any

import cocotb
import pytest

from cocotb_tests.foc.foc_bench import FULL_SCALE, SOURCES, TB, TURN, Pair, Regulator, park, phases_of
from fluxlock.base.paths import ROOT
from fluxlock.cosim.block import run_block_test

MOTOR = tomllib.loads((ROOT / "motors" / "motor-1.toml").read_text())
R, L = float(MOTOR["resistance_ohm"]), float(MOTOR["inductance_h"])
T_S = 1 / 15_000
CURRENT_FULL_SCALE_A, VOLTAGE_FULL_SCALE_V = 50.0, 30.0
STEP_A = 20.0
SAMPLES = 40
# Peak of |i_q| at the samples, per cent of the step: (frequency of the subspace, T_d / T_s) -> A, B, C.
PEAKS = {
    (750, 0.25): (10.4, 3.9, 2.0),
    (750, 0.5): (15.3, 9.0, 2.8),
    (750, 0.75): (22.7, 15.9, 2.1),
    (750, 1.0): (32.4, 0.0, 0.0),
    (1500, 0.25): (28.0, 7.5, 4.1),
    (1500, 0.5): (40.4, 17.6, 5.7),
    (1500, 0.75): (57.0, 31.2, 4.2),
    (1500, 1.0): (80.3, 0.0, 0.0),
}


def gains(controller: str, omega: float, delay: float) -> tuple[complex, complex]:
    """Gains g and h in V/A at the subspace's signed speed (rad/s), voltage held at the sample's angle."""
    t_d = delay * T_S
    before, whole = math.exp(-R / L * (T_S - t_d)), math.exp(-R / L * T_S)
    turn = cmath.exp(-1j * omega * T_S)
    gamma1 = turn * (1 - before) / R
    gamma2 = turn**2 * (before - whole) / R
    if controller == "A":
        omega_n = 2 * math.pi * 800
        return omega_n * L + omega_n * (R + 1j * omega * L) * T_S, omega_n * L
    if controller == "C":
        g = 0.35 / (gamma1 + gamma2)
    elif delay < 1:
        g = 0.35 * (1 - delay) / gamma1
    else:
        g = 0.35 / gamma2
    return g, g * whole * turn


def mantissas(g: complex, h: complex) -> tuple[Pair, Pair, int]:
    """Gains g and h (V/A) as the registers hold them: mantissas of 18 bits and the shift."""
    scale = CURRENT_FULL_SCALE_A / VOLTAGE_FULL_SCALE_V * 2**25 / 2**17
    parts = [scale * x for x in (g.real, g.imag, h.real, h.imag)]
    shift = next(s for s in range(31, -1, -1) if max(map(abs, parts)) * 2**s < FULL_SCALE - 1)
    g_d, g_q, h_d, h_q = (round(x * 2**shift) for x in parts)
    return (g_d, g_q), (h_d, h_q), shift


def set_gains(regulator: Regulator, g: complex, h: complex) -> None:
    """Gains g and h (V/A) and their ratio."""
    regulator.gain, regulator.hold, regulator.shift = mantissas(g, h)
    ratio = h / g * FULL_SCALE
    regulator.ratio = (round(ratio.real), round(ratio.imag))


@dataclass
class Machine:
    """Currents of one subspace in the stationary frame; its voltage acts T_d late."""

    delay: float
    current_a: complex = 0j
    voltage_v: complex = 0j

    def advance(self, voltage_v: complex) -> None:
        before, whole = math.exp(-R / L * T_S * (1 - self.delay)), math.exp(-R / L * T_S)
        self.current_a = whole * self.current_a + (before - whole) / R * self.voltage_v + (1 - before) / R * voltage_v
        self.voltage_v = voltage_v


async def response(tb: TB, subspace: int, controller: str, hertz: float, delay: float, exact: bool) -> list[complex]:
    """Current of the subspace (d + jq, of the step) at the samples after the step of its d current.

    The other subspace, at three times or a third of its speed, is held at 0 by C and must not notice.
    """
    harmonic = 1 + 2 * subspace
    omega = 2 * math.pi * hertz / harmonic
    lead = omega * (delay + 0.5) * T_S if exact else 0.0
    machines = [Machine(delay) for _ in tb.regulators]
    for s, regulator in enumerate(tb.regulators):
        n = 1 + 2 * s
        g, h = gains(controller if s == subspace else "C", n * omega, delay)
        back = cmath.exp(-1j * n * lead)
        set_gains(regulator, g * back, h * back)
        regulator.enable, regulator.reference = 0, (0, 0)
    await tb.run([0] * tb.phases, 0)
    for s, regulator in enumerate(tb.regulators):
        regulator.enable = 1
        regulator.reference = (round(STEP_A / CURRENT_FULL_SCALE_A * FULL_SCALE), 0) if s == subspace else (0, 0)
    found = []
    for k in range(SAMPLES):
        theta = round(omega * k * T_S / (2 * math.pi) * TURN)
        currents = phases_of([m.current_a for m in machines], 0, tb.phases)
        codes = [round(x / CURRENT_FULL_SCALE_A * FULL_SCALE) for x in currents]
        out = await tb.run(codes, theta, round(lead / (2 * math.pi) * TURN))
        turned = [m.current_a * cmath.exp(-1j * (1 + 2 * s) * omega * k * T_S) for s, m in enumerate(machines)]
        found.append(turned[subspace] / STEP_A)
        for s, m in enumerate(machines):
            assert s == subspace or abs(m.current_a) < 2e-4 * STEP_A, f"subspace {s} disturbed: {m.current_a} A"
            m.advance(park(out.voltage, 0, 1 + 2 * s) / FULL_SCALE * VOLTAGE_FULL_SCALE_V)
    return found


@cocotb.test()
@cocotb.parametrize(sign=[1, -1])
async def steps_reach_the_specified_peaks(dut: Any, sign: int) -> None:
    """Peak of i_q of A, B and C within 0.5 % of the step at every speed and delay, both directions and both subspaces.

    Held and exact inverse Park give the same currents; C settles to 5 % within seven samples.

    Verifies: FOC-08
    """
    tb = TB(dut)
    await tb.start()
    for subspace, ((hertz, delay), peaks) in itertools.product(range(tb.subspaces), PEAKS.items()):
        shown = []
        for controller, peak in zip("ABC", peaks, strict=True):
            held, exact = [
                await response(tb, subspace, controller, sign * hertz, delay, choice) for choice in (False, True)
            ]
            context = f"{controller} at {sign * hertz} Hz, T_d {delay}"
            difference = max(abs(a - b) for a, b in zip(held, exact, strict=True))
            assert difference < 1e-3, f"{context}: held and exact differ by {100 * difference:.3f} %"
            for run in (held, exact):
                found = 100 * max(abs(i.imag) for i in run)
                assert abs(found - peak) <= 0.5, f"{context}: {found:.2f} % instead of {peak} %"
                if controller == "C":
                    late = [k for k, i in enumerate(run) if abs(i - 1) > 0.05]
                    assert max(late) < 7, f"{context}: settles at sample {max(late) + 1}"
            shown.append(f"{100 * max(abs(i.imag) for i in held):.2f}")
        dut._log.info("subspace %d, %5d Hz, T_d %.2f: peaks %s %%", subspace, sign * hertz, delay, " / ".join(shown))


@cocotb.test()
@cocotb.parametrize(delay=[0.5, 1.0])
async def returns_from_the_limit_like_a_step(dut: Any, delay: float) -> None:
    """60 samples of a current that the voltage limit does not allow, then one that it does: C settles in seven samples.

    To 5 % of the way, as after a step. Without what the limit took away being carried over it takes more than 40.

    Verifies: FOC-10
    """
    tb = TB(dut)
    await tb.start()
    omega = 2 * math.pi * 1500 / 3 ** (tb.subspaces - 1)
    out_of_reach_a, reached_a = 49.0 / tb.subspaces, 10.0 / tb.subspaces
    for carried in (True, False):
        machines = [Machine(delay) for _ in tb.regulators]
        errors = []
        for s, regulator in enumerate(tb.regulators):
            set_gains(regulator, *gains("C", omega * (1 + 2 * s), delay))
            regulator.ratio = regulator.ratio if carried else (0, 0)
            limit_v = 0.6 * out_of_reach_a * abs(R + 1j * omega * (1 + 2 * s) * L)
            regulator.limit = round(limit_v / VOLTAGE_FULL_SCALE_V * FULL_SCALE)
            regulator.enable, regulator.reference = 0, (0, 0)
        await tb.run([0] * tb.phases, 0)
        for regulator in tb.regulators:
            regulator.enable = 1
        for k in range(120):
            angle = omega * k * T_S
            wanted = out_of_reach_a if k < 60 else reached_a
            for regulator in tb.regulators:
                regulator.reference = (0, round(wanted / CURRENT_FULL_SCALE_A * FULL_SCALE))
            currents = phases_of([m.current_a for m in machines], 0, tb.phases)
            codes = [round(x / CURRENT_FULL_SCALE_A * FULL_SCALE) for x in currents]
            out = await tb.run(codes, round(angle / (2 * math.pi) * TURN))
            assert all(out.limited) or not 20 <= k < 60, k
            turned = [m.current_a * cmath.exp(-1j * (1 + 2 * s) * angle) for s, m in enumerate(machines)]
            errors.append([abs(i - 1j * reached_a) for i in turned])
            for s, m in enumerate(machines):
                m.advance(park(out.voltage, 0, 1 + 2 * s) / FULL_SCALE * VOLTAGE_FULL_SCALE_V)
        settled = [
            max(k for k, e in enumerate(errors) if e[s] > 0.05 * errors[60][s]) - 59 for s in range(tb.subspaces)
        ]
        dut._log.info("T_d %.2f, carried %s: settled after %s samples", delay, carried, settled)
        assert max(settled) <= 7 if carried else max(settled) > 40


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_foc_loop(phases: int) -> None:
    """Closed loop for both phase counts."""
    run_block_test("fl_foc", SOURCES, __name__, parameters={"Phases": phases})
