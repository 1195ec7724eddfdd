"""The chip with five phases on the five-phase plant: registers drive the modulator open loop, gates are recorded."""

from __future__ import annotations

import math
import shutil

import numpy as np

from fluxlock.analysis.rundata import FloatArray, LogKind, RunData
from fluxlock.config import Inverter, load_inverter, load_motor
from fluxlock.config.specs import CLOCK_HZ
from fluxlock.cosim.program import Row, run_script, wait
from fluxlock.paths import BUILD, ROOT
from tests.closed_loop.five_phase_bench import PHASES, bypassed, locked_plant, voltage_q17

PERIOD, OFFSET = 2500, 100  # clocks
FIELD_HZ = 500.0
LARGEST = 0.5257  # amplitude over V_dc up to which the modulation is linear
RATIOS = (0.05, 0.3, 0.5, LARGEST)
CARRIERS = 45  # each, a turn is 40
SECTOR = math.pi / 5
SEED = 1


def script(inverter: Inverter) -> list[Row]:
    """A vector of each ratio, turning at FIELD_HZ, on the first subspace; the regulators are bypassed."""
    rows = bypassed(PERIOD, OFFSET, inverter, FIELD_HZ)
    for ratio in RATIOS:
        rows += [Row("foc.forward", 0, voltage_q17(ratio * inverter.supply_v, inverter)), wait(CARRIERS)]
    return rows


def pulses(data: RunData, starts: list[int]) -> FloatArray:
    """Width of every leg's pulse in the carriers that begin at these clocks; clocks."""
    rows = data.rows(LogKind.GATES)
    found = np.zeros((len(starts), PHASES))
    for x in range(PHASES):
        upper, lower = (rows[:, 2] >> 2 * x & 1).astype(float), (rows[:, 2] >> 2 * x + 1 & 1).astype(float)
        for k, start in enumerate(starts):
            edges = np.concatenate(([start], rows[(rows[:, 0] > start) & (rows[:, 0] < start + PERIOD), 0]))
            state = np.searchsorted(rows[:, 0], edges, side="right") - 1
            spans = np.diff(np.append(edges, start + PERIOD))
            on, off = float(upper[state] @ spans), float(lower[state] @ spans)
            # Each side gives up the dead time; a leg without edges is on one side all the time.
            found[k, x] = PERIOD * on / (on + off) if 0.0 in (on, off) else on + (PERIOD - on - off) / 2
    return found


def on_times(ratio: float, theta: float) -> list[float]:
    """Of the four active vectors of NFV-SVPWM in the order of the legs that are on, 1 to 4; over the period."""
    sector = math.floor(theta / SECTOR)
    x = theta - sector * SECTOR
    ahead, behind = math.sin(SECTOR - x), math.sin(x)
    large, medium = 1.90211 * ratio, 1.17557 * ratio
    if sector % 2:
        ahead, behind = behind, ahead
    return [medium * ahead, large * behind, large * ahead, medium * behind]


def subspace(widths: FloatArray, h: int) -> complex:
    """Vector of the legs' volt-seconds over V_dc; clocks."""
    turn = np.exp(2j * np.pi * h * np.arange(PHASES) / PHASES)
    return complex(2 / PHASES * widths @ turn)


def test_modulator_drives_the_five_phase_plant() -> None:
    """On-times of the active vectors, nothing in the third subspace, linear up to 0.5257 V_dc, the machine's current.

    Verifies: SOC-24
    """
    motor = load_motor(ROOT / "motors" / "five-phase-yu.toml")
    inverter = load_inverter(ROOT / "inverters" / "five-leg-350v.toml")
    folder = BUILD / "closed_loop" / "five-phase-chip"
    shutil.rmtree(folder, ignore_errors=True)
    duration_s = (len(RATIOS) * CARRIERS + 10) * PERIOD / CLOCK_HZ
    data = run_script(script(inverter), locked_plant(motor, inverter), duration_s, folder, SEED)
    assert not data.rows(LogKind.TRIP).size
    instants = data.rows(LogKind.ANGLE)
    assert len(instants) > len(RATIOS) * CARRIERS and set(np.diff(instants[5:, 0])) == {PERIOD}
    # The voltage of a sample acts from the next carrier's start on, the pins follow the update by a clock.
    chosen = [row for row in instants[10:-3]]
    widths = pulses(data, [int(row[0]) - OFFSET + PERIOD for row in chosen])
    angles = [row[2] % 2**32 / 2**32 * 2 * math.pi for row in chosen]
    seen = dict.fromkeys(RATIOS, 0)
    worst_third = worst_first = worst_time = 0.0
    for width, theta in zip(widths, angles, strict=True):
        first = subspace(width, 1) / PERIOD
        ratio = min(RATIOS, key=lambda r: abs(r - abs(first)))
        if abs(abs(first) - ratio) > 0.01:
            continue  # the carrier before the first voltage
        seen[ratio] += 1
        worst_first = max(worst_first, abs(first - ratio * complex(math.cos(theta), math.sin(theta))) * PERIOD)
        worst_third = max(worst_third, abs(subspace(width, 3)))
        ordered = sorted(width, reverse=True)
        times = [PERIOD * t for t in on_times(ratio, theta)]
        worst_time = max(worst_time, *(abs(a - b - t) for a, b, t in zip(ordered, ordered[1:], times, strict=False)))
    print(f"seed {SEED}: {seen}; clocks: first {worst_first:.2f}, third {worst_third:.2f}, on-time {worst_time:.2f}")
    assert min(seen.values()) >= 35, f"carriers of each ratio: {seen}"
    assert worst_third <= 0.001 * PERIOD, f"third subspace {worst_third} clocks"
    assert worst_first <= 1.5 and worst_time <= 2.0
    # What the machine makes of it: the amplitude lies between those of both axes.
    last = data.records[-40:]
    amplitude = 0.5 * (float(np.max(last["ia"])) - float(np.min(last["ia"])))
    reactance = [2 * math.pi * FIELD_HZ * value for value in (motor.inductance_q_h or 0.0, motor.inductance_h[0])]
    low, high = (LARGEST * inverter.supply_v / x for x in reactance)
    assert 0.8 * low < amplitude < 1.2 * high, f"{amplitude} A, {low} to {high} A"
