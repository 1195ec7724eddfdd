# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Wanted against real mean of the output under CSC (section 5.4.3), from the gates of the chip."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.results.metrics import GUARD_CYCLES
from fluxlock.results.rundata import FloatArray, LogKind, RunData
from fluxlock.theory.six_step.fourier import space_vector
from fluxlock.theory.six_step.linearity import compensated_duty, mean_output, whole_and_rest
from fluxlock.theory.six_step.recording import mean_excitation, whole_turns
from fluxverify.regression.case import Condition, Row, case
from fluxverify.regression.runner import Runner

PERIOD_CYCLES, TICK_CYCLES = 1250, 5000  # carrier of 40 kHz
MIN_PULSE_CYCLES = 20
LIMIT_PERCENT = 0.2
NARROW_NOTE = (
    "Pulses or gaps shorter than the minimum cannot exist: the carrier holds them back and returns their volt-seconds "
    "in a later carrier, which may lie in the next sector. What it owes at a commutation is less than a minimum pulse, "
    "so a sector departs by at most that many clocks, 2 % of the shortest and 0.2 % of the longest, and six sectors by "
    "no more together. Mergeable: the sector's pulses, or gaps, together are no shorter than the minimum."
)
SETTLED_SECTORS, SECTORS = 2, 6
BOOT_CYCLES, ROW_CYCLES = 20_000, 100  # before the first row, of the loop from row to row
CARRIERS = (0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 1.95, 2.0, 2.2, 2.5, 2.95, 3.125, 3.5, 4.0, 4.6, 5.4, 6.5, 7.3, 8.0)
MEANS = (*np.arange(0.02, 0.1, 0.01).tolist(), *np.arange(0.1, 0.96, 0.05).tolist(), 0.97, 0.98, 0.99, 1.0)
QUICK_CARRIERS, QUICK_MEANS = (0.8, 1.25, 2.5, 3.125, 8.0), (0.02, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 0.98, 1.0)


@dataclass(frozen=True)
class Point:
    """One row of the program's table."""

    interval_cycles: int
    mean: float
    compensate: bool

    @property
    def carriers(self) -> float:
        """N, with the interval in whole clocks."""
        return self.interval_cycles / PERIOD_CYCLES

    @property
    def duty(self) -> float:
        """Duty in theory."""
        return float(compensated_duty(self.mean, self.carriers)) if self.compensate else self.mean

    @property
    def edge_cycles(self) -> float:
        """Distance of the pulse from the instant in its carrier at which the commutation cuts (N_D)."""
        return abs(self.duty - float(whole_and_rest(self.carriers)[1])) * PERIOD_CYCLES

    @property
    def narrow(self) -> bool:
        """Pulse or gap of the theory shorter than the minimum pulse."""
        pulse = self.duty * PERIOD_CYCLES
        return 0.0 < pulse < MIN_PULSE_CYCLES or 0.0 < PERIOD_CYCLES - pulse < MIN_PULSE_CYCLES

    @property
    def mergeable(self) -> bool:
        """All pulses of the sector together, and all gaps, last a minimum pulse: one of each could hold the mean."""
        on = (self.mean if self.compensate else float(mean_output(self.mean, self.carriers))) * self.interval_cycles
        return MIN_PULSE_CYCLES <= on <= self.interval_cycles - MIN_PULSE_CYCLES


def table_of(points: list[Point]) -> tuple[bytes, int]:
    """The program's table and the clock cycles that it takes."""
    words, total, before = [len(points)], BOOT_CYCLES, 0
    for p in points:
        hold = 2 * TICK_CYCLES + before + (SETTLED_SECTORS + SECTORS + 1) * p.interval_cycles
        words += [p.interval_cycles, PERIOD_CYCLES, round(p.mean * 2**30), int(p.compensate), hold]
        total, before = total + hold + ROW_CYCLES, p.interval_cycles
    return struct.pack(f"<{len(words)}I", *words), total


def sector_means(run: RunData, count: int) -> FloatArray:
    """Share of each sector in which a pair of phases is excited [count, SECTORS], from the recorded gates.

    Every row of the table takes effect at an update event of its own; the first sectors after it are left out.
    """
    updates = run.rows(LogKind.UPDATE)[:, 0]
    if len(updates) != count:
        raise ValueError(f"{len(updates)} updates for {count} rows")
    gates = run.rows(LogKind.GATES)
    at, driven = gates[:, 0], np.abs(space_vector(gates[:, 2])) > 0.5
    on = np.concatenate(([0.0], np.cumsum(np.diff(at) * driven[:-1])))
    comms = run.rows(LogKind.COMMUTATION)[:, 0] + GUARD_CYCLES

    def on_until(cycle: FloatArray) -> FloatArray:
        row = np.searchsorted(at, cycle, side="right") - 1
        return np.asarray(on[row] + (cycle - at[row]) * driven[row])

    means = np.empty((count, SECTORS))
    for k, (begin, end) in enumerate(zip(updates, [*updates[1:], run.cycles], strict=True)):
        own = comms[(comms > begin) & (comms <= end)][SETTLED_SECTORS:]
        edges = own[: SECTORS + 1].astype(np.float64)
        means[k] = np.diff(on_until(edges)) / np.diff(edges)
    return means


@case("six-step/linearity")
def linearity(runner: Runner) -> Iterator[Row]:
    """CSC, N 0.8 to 8, mean 0.02 to 1: the real mean is the wanted one with (5.18), that of (5.16) without."""
    carriers, wanted = (QUICK_CARRIERS, QUICK_MEANS) if runner.quick else (CARRIERS, MEANS)
    for compensate in (True, False):
        points = [Point(round(n * PERIOD_CYCLES), m, compensate) for n in carriers for m in wanted]
        table, cycles = table_of(points)
        name = "compensated" if compensate else "plain"
        run = runner.program(
            "linearity",
            table,
            "six-step/linearity.toml",
            name,
            f"duration_s={cycles / CLOCK_HZ}",
            "motor.resistance_ohm=10",
        )
        means = sector_means(run, len(points))
        theory = np.array([p.mean if compensate else float(mean_output(p.mean, p.carriers)) for p in points])
        mean_error = 100.0 * np.abs(means.mean(axis=1) - theory)
        single_error = 100.0 * np.abs(means - theory[:, None]).max(axis=1)
        single_clocks = single_error / 100.0 * np.array([p.interval_cycles for p in points])
        near = np.array([p.edge_cycles <= MIN_PULSE_CYCLES for p in points])
        narrow = np.array([p.narrow for p in points]) & ~near
        mergeable = np.array([p.mergeable for p in points])
        above = single_error > LIMIT_PERCENT
        conditions: dict[str, Condition] = {
            "carriers_per_sector": f"{min(carriers):g} … {max(carriers):g}",
            "mean": f"{min(wanted):g} … {max(wanted):g}",
            "min_pulse_carriers": MIN_PULSE_CYCLES / PERIOD_CYCLES,
            "against": "wanted mean" if compensate else "(5.16), (5.17)",
        }
        yield Row(
            f"six-step/linearity/{name}",
            conditions | {"points": len(points)},
            {
                "mean_error_percent_vdc": float(mean_error.max()),
                "single_sector_error_percent_vdc": float(single_error[~near & ~narrow].max()),
                "single_sector_near_cut_percent_vdc": float(single_error[near].max(initial=0.0)),
                "single_sector_near_cut_clocks": float(single_clocks[near].max(initial=0.0)),
                "largest_departure_from_wanted_percent_vdc": float(
                    100.0 * np.max(np.abs(means.mean(axis=1) - [p.mean for p in points]))
                ),
            },
            {
                "mean_error_percent_vdc": (None, LIMIT_PERCENT),
                "single_sector_error_percent_vdc": (None, LIMIT_PERCENT),
                "single_sector_near_cut_clocks": (None, MIN_PULSE_CYCLES),
            },
        )
        yield Row(
            f"six-step/linearity/{name}-narrow",
            conditions | {"points": int(narrow.sum()), "min_pulse_clocks": MIN_PULSE_CYCLES},
            {
                "mean_error_percent_vdc": float(mean_error[narrow].max(initial=0.0)),
                "single_sector_error_percent_vdc": float(single_error[narrow].max(initial=0.0)),
                "single_sector_error_clocks": float(single_clocks[narrow].max(initial=0.0)),
                "points_above_limit": int((narrow & above).sum()),
                "points_above_limit_mergeable": int((narrow & above & mergeable).sum()),
            },
            {"mean_error_percent_vdc": (None, LIMIT_PERCENT), "single_sector_error_clocks": (None, MIN_PULSE_CYCLES)},
            NARROW_NOTE,
        )
    for linear in (True,) if runner.quick else (True, False):
        yield _drive_row(runner, linear)


# The regulated drive at 64 000 r/min, N = 25/8; frozen, so that one duty holds for the span that is measured.
DRIVE_EVENTS = (
    'event=[{at_s=0.003, speed_rpm=70000}, {at_s=0.004, command="start"}, {at_s=0.080, command="set freeze 1"}, '
    '{at_s=0.082, command="get duty"}]'
)
DRIVE_SPAN_S = (0.083, 0.094)


def _drive_row(runner: Runner, linear: bool) -> Row:
    """The drive's own duty, before the correction, against the mean of its gates."""
    name = "drive" if linear else "drive-plain"
    overrides = (DRIVE_EVENTS, "window=[]", "duration_s=0.095", f"drive.linearity={str(linear).lower()}")
    run = runner.drive("six-step/spectrum.toml", name, *overrides)
    wanted = float(re.findall(r"^duty ([\d.]+)", run.console(), re.MULTILINE)[0])
    window = whole_turns(run.data, *DRIVE_SPAN_S)
    real = mean_excitation(run.data, window)
    carriers = 20_000 / (6 * window.fundamental_hz(run.data.clock_hz))
    theory = wanted if linear else float(mean_output(wanted, carriers))
    return Row(
        f"six-step/linearity/{name}",
        {"motor": "Motor-I", "speed_rpm": 64_000, "carrier_hz": 20_000, "linearity": linear, "turns": window.turns},
        {
            "carriers_per_sector": carriers,
            "wanted_mean": wanted,
            "real_mean": real,
            "mean_error_percent_vdc": 100 * abs(real - theory),
            "trips": len(run.result["trips"]),
        },
        {"mean_error_percent_vdc": (None, 0.2), "trips": (0, 0)},
    )
