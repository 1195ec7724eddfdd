# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""NFV-SVPWM of the chip with five phases, from its gates: registers turn a vector open loop on the five-phase plant."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Inverter, load_inverter, load_motor
from fluxlock.cosim.program import Row as RegisterRow
from fluxlock.cosim.program import wait
from fluxlock.results.rundata import FloatArray, LogKind, RunData
from fluxverify.regression.case import Row, case
from fluxverify.regression.five_phase.register_bench import PHASES, bypassed, locked_plant, voltage_q17
from fluxverify.regression.runner import Runner

PERIOD, OFFSET = 2500, 100  # clocks
FIELD_HZ = 500.0
LARGEST = 0.5257  # amplitude over V_dc up to which the modulation is linear
RATIOS = (0.05, 0.3, 0.5, LARGEST)
CARRIERS = 45  # each, a turn is 40
LEAST_CARRIERS = 35  # of each that must be seen
SECTOR = math.pi / 5
NEAR = 0.01  # of a ratio: carriers farther off are those before the first voltage
THIRD_PERCENT = 0.1  # of V_dc T_s
FIRST_CLOCKS, ON_TIME_CLOCKS = 1.5, 2.0


def script(inverter: Inverter) -> list[RegisterRow]:
    """A vector of each ratio, turning at FIELD_HZ, on the first subspace; the regulators are bypassed."""
    rows = bypassed(PERIOD, OFFSET, inverter, FIELD_HZ)
    for ratio in RATIOS:
        rows += [RegisterRow("foc.forward", 0, voltage_q17(ratio * inverter.supply_v, inverter)), wait(CARRIERS)]
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


@dataclass
class Seen:
    """Of the carriers of one ratio: their number; largest errors in clocks."""

    carriers: int = 0
    first: float = 0.0
    third: float = 0.0
    on_time: float = 0.0


def modulated(runner: Runner) -> tuple[RunData, dict[float, Seen]]:
    """The run, and what its gates show by ratio."""
    motor = load_motor(ROOT / "motors" / "five-phase-yu.toml")
    inverter = load_inverter(ROOT / "inverters" / "five-leg-350v.toml")
    duration_s = (len(RATIOS) * CARRIERS + 10) * PERIOD / CLOCK_HZ
    data = runner.script(script(inverter), locked_plant(motor, inverter), duration_s, "turning")
    # The voltage of a sample acts from the next carrier's start on, the pins follow the update by a clock.
    chosen = data.rows(LogKind.ANGLE)[10:-3]
    widths = pulses(data, [int(row[0]) - OFFSET + PERIOD for row in chosen])
    found = {ratio: Seen() for ratio in RATIOS}
    for width, row in zip(widths, chosen, strict=True):
        theta = row[2] % 2**32 / 2**32 * 2 * math.pi
        first = subspace(width, 1) / PERIOD
        ratio = min(RATIOS, key=lambda r: abs(r - abs(first)))
        if abs(abs(first) - ratio) > NEAR:
            continue
        seen = found[ratio]
        ordered = sorted(width, reverse=True)
        times = [PERIOD * t for t in on_times(ratio, theta)]
        seen.carriers += 1
        seen.first = max(seen.first, abs(first - ratio * complex(math.cos(theta), math.sin(theta))) * PERIOD)
        seen.third = max(seen.third, abs(subspace(width, 3)))
        seen.on_time = max(
            seen.on_time, *(abs(a - b - t) for a, b, t in zip(ordered, ordered[1:], times, strict=False))
        )
    return data, found


@case("five-phase/modulation")
def modulation(runner: Runner) -> Iterator[Row]:
    """NFV-SVPWM from the gates over a turn at four lengths: third subspace, vector, on-times of the active vectors."""
    data, found = modulated(runner)
    for ratio, seen in found.items():
        yield Row(
            f"five-phase/modulation/{ratio:g}",
            {"amplitude_over_vdc": ratio, "carrier_clocks": PERIOD, "field_hz": FIELD_HZ},
            {
                "carriers": seen.carriers,
                "third_subspace_percent": 100 * seen.third / PERIOD,
                "vector_clocks": seen.first,
                "on_time_clocks": seen.on_time,
                "trips": len(data.rows(LogKind.TRIP)),
            },
            {
                "carriers": (LEAST_CARRIERS, None),
                "third_subspace_percent": (None, THIRD_PERCENT),
                "vector_clocks": (None, FIRST_CLOCKS),
                "on_time_clocks": (None, ON_TIME_CLOCKS),
                "trips": (0, 0),
            },
            "third_subspace_percent: volt-seconds of the third subspace in a carrier over V_dc T_s, largest",
        )
