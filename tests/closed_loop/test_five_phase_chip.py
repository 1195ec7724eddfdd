"""The chip with five phases on the five-phase plant: registers drive the modulator open loop, gates are recorded."""

from __future__ import annotations

import math
import shutil

import numpy as np

from fluxlock.analysis.rundata import FloatArray, LogKind, RunData
from fluxlock.config import load_inverter, load_motor
from fluxlock.config.motor import machine_params
from fluxlock.config.specs import CLOCK_HZ
from fluxlock.cosim.convert import inverter_params, sensing_params
from fluxlock.cosim.program import run_script, wait
from fluxlock.paths import BUILD, ROOT
from fluxlock.plant import MechanicsParams, PlantParams, RecordingParams

PHASES = 5
PERIOD, OFFSET, DEAD = 2500, 100, 2  # clocks
FIELD_HZ = 500.0
LARGEST = 0.5257  # amplitude over V_dc up to which the modulation is linear
RATIOS = (0.05, 0.3, 0.5, LARGEST)
CARRIERS = 45  # each, a turn is 40
SECTOR = math.pi / 5
SEED = 1


def script(full_scale_v: float, vdc_v: float) -> list[tuple[str, int, int]]:
    """A vector of each ratio, turning at FIELD_HZ, on the first subspace; the regulators are bypassed."""
    shift = 22
    scale = round(PERIOD * full_scale_v / vdc_v / 2**17 * 2**shift)
    assert scale < 2**17
    rows = [("sense.offset", PHASES + x, 2048 << 4) for x in range(PHASES)]
    rows += [
        ("sense.scheduler", 0, 3 | OFFSET << 16),
        ("foc.period", 0, PERIOD),
        ("foc.window", 0, OFFSET),
        ("foc.scale", 0, scale | shift << 24),
        ("foc.omega", 0, round(FIELD_HZ / CLOCK_HZ * 2**36)),
        ("foc.control", 0, 1 | 1 << 1 | 1 << 3),  # source, enable, bypass
        ("safety.trip_enable", 0, 0),
        ("safety.dead_time", 0, DEAD),
        ("timer.tick_period", 0, 1000),
        wait(2),
        ("timer.tick_samples", 0, 1),
        ("safety.guard", 0, 1),
    ]
    for ratio in RATIOS:
        rows += [("foc.forward", 0, round(ratio * vdc_v / full_scale_v * 2**17)), wait(CARRIERS)]
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
    plant = PlantParams(
        machine=machine_params(motor),
        inverter=inverter_params(inverter),
        sensing=sensing_params(inverter, motor.phases),
        mechanics=MechanicsParams(motor.inertia_kgm2, mode="locked"),
        recording=RecordingParams(every_strobes=1),
        clock_period_s=1.0 / CLOCK_HZ,
    )
    folder = BUILD / "closed_loop" / "five-phase-chip"
    shutil.rmtree(folder, ignore_errors=True)
    rows = script(inverter.sensing.voltage_full_scale_v, inverter.supply_v)
    duration_s = (len(RATIOS) * CARRIERS + 10) * PERIOD / CLOCK_HZ
    data = run_script(rows, plant, duration_s, folder, SEED)
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
