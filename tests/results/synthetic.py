# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Run data of an ideal six-step drive with known errors, made from the EMF alone.

Which pair of phases conducts at an angle is found from the EMFs of the machine (largest line EMF), not from
the angle tables of the analysis, so that the two can disagree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.plant.trajectory import wave_dtype
from fluxlock.results.rundata import PLANT_EVENT_DTYPE, RECORD_DTYPE, LogKind, PlantEventKind, RunData

PAIRS = ((0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1))  # upper and lower phase of sectors I..VI


def emf(theta: float, phase: int, direction: float) -> float:
    """Phase EMF over psi |omega|, from lambda_A = psi cos(theta)."""
    return -direction * float(np.sin(theta - phase * 2 * np.pi / 3))


def best_sector(theta: float, direction: float) -> int:
    """Sector whose line EMF is largest: the one that should conduct."""
    return max(range(6), key=lambda s: emf(theta, PAIRS[s][0], direction) - emf(theta, PAIRS[s][1], direction))


def floating(sector: int) -> int:
    return 3 - sum(PAIRS[sector])


@dataclass
class Drive:
    """What to make. Errors are functions of the commutation's or crossing's number, in degrees, + = late."""

    speed_rpm: float = 60_000.0
    accel_rpm_per_s: float = 0.0
    pole_pairs: int = 1
    duration_s: float = 0.02
    carrier_hz: float = 40e3
    duty: float = 0.5
    current_a: float = 10.0
    torque_nm: float = 0.02
    torque_ripple_nm: float = 0.004
    freewheel_deg: float | None = 9.0
    commutation_error: Callable[[int], float] = field(default=lambda k: 0.0)
    crossing_error: Callable[[int], float] = field(default=lambda k: 0.0)
    late: frozenset[int] = frozenset()
    trip_at_s: float | None = None
    trip_mask: int = 0
    zoom_s: tuple[float, float] | None = None
    # The drive's own account: (time in s, state, limit) from there on, as the firmware numbers them.
    account: tuple[tuple[float, int, int], ...] = ((0.0, 3, 0),)
    target_rpm: float | None = None  # that it says it has, the speed at time 0 if left out
    measures: float = 1.0  # speed that it says it measures, over the true one
    lost_locks: int = 0

    def theta(self, t_s: np.ndarray | float) -> np.ndarray | float:
        """Electrical angle, rad."""
        rate, accel = (x * self.pole_pairs * np.pi / 30 for x in (self.speed_rpm, self.accel_rpm_per_s))
        return 0.3 + rate * t_s + 0.5 * accel * t_s * t_s

    def omega(self, t_s: np.ndarray | float) -> np.ndarray | float:
        """Electrical speed, rad/s."""
        rate, accel = (x * self.pole_pairs * np.pi / 30 for x in (self.speed_rpm, self.accel_rpm_per_s))
        return rate + accel * t_s

    @property
    def direction(self) -> float:
        return 1.0 if self.speed_rpm > 0 else -1.0

    def time_of(self, theta: float) -> float:
        """Time at which the rotor passes an angle (Newton)."""
        t = (theta - 0.3) / float(self.omega(0.0))
        for _ in range(20):
            t -= (float(self.theta(t)) - theta) / float(self.omega(t))
        return t


def _sector_starts(drive: Drive) -> list[tuple[float, int]]:
    """Ideal angles at which sectors begin, with the sector, in the order of rotation.

    The boundaries are where the best sector changes; they are found by bisection.
    """
    d = drive.direction
    turned = abs(float(drive.theta(drive.duration_s)) - 0.3)
    grid = 0.3 + d * np.arange(0.0, turned + 0.1, np.radians(1.0))
    found = []
    for a, b in pairwise(grid):
        before, after = best_sector(a, d), best_sector(b, d)
        if before == after:
            continue
        low, high = a, b
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if best_sector(middle, d) == before else (low, middle)
        found.append((high, after))
    return found


def _gates(sector: int, pulse: bool, incoming_upper: bool) -> int:
    """ON-PWM: the switch in its first sector is on, the other one chops."""
    upper, lower = PAIRS[sector]
    high, low = 1 << 2 * upper, 1 << 2 * lower + 1
    if pulse:
        return high | low
    return high if incoming_upper else low


def make_run(drive: Drive) -> RunData:
    """Log, records and events of the drive."""
    d, clock = drive.direction, CLOCK_HZ
    cycles = round(drive.duration_s * clock)
    log: list[tuple[int, int, int, int]] = []
    events: list[tuple[float, int, int, float]] = []
    starts = _sector_starts(drive)
    commutations: list[tuple[int, int]] = []
    for k, (theta, sector) in enumerate(starts):
        t = drive.time_of(theta + d * np.radians(drive.commutation_error(k)))
        commutations.append((round(t * clock), sector))
        crossing = drive.time_of(theta + d * np.radians(30.0 + drive.crossing_error(k)))
        # The chip knows the crossing later than it happened: only the stamp counts.
        if crossing < drive.duration_s - 20e-6:
            log.append(
                (
                    round((crossing + 8e-6) * clock),
                    LogKind.CROSSING,
                    sector | (16 if k in drive.late else 0),
                    round(crossing * clock),
                )
            )
        if drive.freewheel_deg is not None:
            end = drive.time_of(float(drive.theta(t)) + d * np.radians(drive.freewheel_deg))
            events.append((end * clock, PlantEventKind.EXTINCTION, floating(sector), float(drive.theta(end))))
            # Circulating current of the floating phase later in the sector, and other phases, must not count.
            events.append((end * clock + 40, PlantEventKind.DIODE_ON, floating(sector), 0.0))
            events.append((end * clock + 80, PlantEventKind.EXTINCTION, floating(sector), 0.0))
            events.append((t * clock + 10, PlantEventKind.EXTINCTION, PAIRS[sector][0], 0.0))
    period = round(clock / drive.carrier_hz)
    previous = 0
    for k, (start, sector) in enumerate(commutations):
        log.append((start - 1, LogKind.COMMUTATION, sector, start))
        end = commutations[k + 1][0] if k + 1 < len(commutations) else cycles
        incoming_upper = sector % 2 == 0 if d > 0 else sector % 2 == 1
        # Carrier-synchronized: pulse at the start of the sector.
        for carrier in range(start, end, period):
            for at, pulse in ((carrier, True), (carrier + round(period * drive.duty), False)):
                gates = _gates(sector, pulse, incoming_upper)
                if at < end and gates != previous:
                    log.append((at, LogKind.GATES, gates, 0))
                    previous = gates
    if drive.trip_at_s is not None:
        log.append((round(drive.trip_at_s * clock), LogKind.TRIP, drive.trip_mask, 0))
    log += _updates(drive, cycles)
    log.sort()
    records = _records(drive, np.arange(0, cycles + 1, 500, dtype=np.float64), commutations)
    zoom = np.zeros(0, RECORD_DTYPE)
    if drive.zoom_s is not None:
        low, high = (t * clock for t in drive.zoom_s)
        edges = np.array([row[0] for row in log if row[1] == LogKind.GATES and low <= row[0] < high], dtype=np.float64)
        at = np.unique(np.concatenate([np.arange(low, high, 50.0), edges - 1, edges]))
        zoom = _records(drive, at, commutations, log)
    event_array = np.array(sorted(events), dtype=PLANT_EVENT_DTYPE)
    return RunData(
        log=np.array(log, dtype=np.int64).reshape(-1, 4),
        records=records,
        plant_events=event_array,
        zoom=zoom,
        clock_hz=clock,
        pole_pairs=drive.pole_pairs,
        cycles=cycles,
        wall_s=2.0,
        seed=7,
        uart=["ok"],
        isr={"control": {"min": 300, "mean": 350.5, "max": 400, "count": 1000}},
    )


def _updates(drive: Drive, cycles: int) -> list[tuple[int, int, int, int]]:
    """The drive's account at every control tick of 0.1 ms."""
    target = round(drive.speed_rpm if drive.target_rpm is None else drive.target_rpm)
    rows = []
    for cycle in range(0, cycles, 5000):
        t = cycle / CLOCK_HZ
        _, state, limit = [entry for entry in drive.account if entry[0] <= t][-1]
        pole_pairs_rpm = drive.pole_pairs * np.pi / 30
        speed = round(abs(float(drive.omega(t))) / pole_pairs_rpm * drive.measures * 256)
        words = state | limit << 16 | drive.lost_locks << 20
        rows.append((cycle, int(LogKind.UPDATE), speed << 32 | words, target << 32 | target * 256 & 0xFFFFFFFF))
    return rows


def _records(
    drive: Drive,
    cycle: np.ndarray,
    commutations: list[tuple[int, int]],
    log: list[tuple[int, int, int, int]] | None = None,
) -> np.ndarray:
    """Rectangular phase currents; terminal voltages follow gates and EMF where the log is given."""
    t = cycle / CLOCK_HZ
    records = np.zeros(cycle.size, RECORD_DTYPE)
    records["t_cycle"], records["theta_e"], records["omega_e"] = cycle, drive.theta(t), drive.omega(t)
    records["vdc"] = 25.0
    records["torque_nm"] = drive.torque_nm + drive.torque_ripple_nm / 2 * np.sin(2 * np.pi * 3001.0 * t)
    if not commutations:
        return records
    starts = np.array([c for c, _ in commutations])
    index = np.searchsorted(starts, cycle, side="right") - 1
    gate_rows = np.array([row for row in log or [] if row[1] == LogKind.GATES], dtype=np.int64).reshape(-1, 4)
    for n in range(cycle.size):
        if index[n] < 0:
            continue
        upper, lower = PAIRS[commutations[index[n]][1]]
        current = dict.fromkeys(range(3), 0.0) | {upper: drive.current_a, lower: -drive.current_a}
        for phase, name in enumerate("abc"):
            records[f"i{name}"][n] = current[phase]
        if gate_rows.size:
            row = np.searchsorted(gate_rows[:, 0], cycle[n], side="right") - 1
            gates = int(gate_rows[row, 2]) if row >= 0 else 0
            records["gates"][n] = gates
            e = [
                1e-3 * abs(float(drive.omega(t[n]))) * emf(float(drive.theta(t[n])), x, drive.direction)
                for x in range(3)
            ]
            rail = {x: 25.0 if gates >> 2 * x & 1 else 0.0 for x in (upper, lower)}
            for x, other, drop in ((upper, lower, 0.0), (lower, upper, 25.0)):
                if not gates >> 2 * x & 3:
                    rail[x] = 25.0 - drop if gates >> 2 * other & 1 else 0.0
            star = (rail[upper] + rail[lower] - e[upper] - e[lower]) / 2
            open_leg = 3 - upper - lower
            for x, name in enumerate("abc"):
                records[f"v{name}"][n] = min(max(star + e[x], -0.7), 25.7) if x == open_leg else rail[x]
    return records


def _five_phases(rows: np.ndarray) -> np.ndarray:
    """The same rows with the columns of a five-phase machine."""
    wide = np.zeros(rows.size, wave_dtype(5))
    for name in rows.dtype.names or ():
        wide[name] = rows[name]
    return wide


def make_vector_run(
    drive: Drive,
    errors_deg: np.ndarray,
    d_a: float = 0.0,
    q_a: float = 10.0,
    sample_hz: float = 40e3,
    phases: int = 3,
    third_a: float = 0.0,
) -> RunData:
    """Vector control: sinusoidal currents and a sample every 1 / sample_hz, the errors of the angle by turns.

    third_a: with five phases the current of subspace 3 on its q axis.
    """
    data = make_run(replace(drive, freewheel_deg=None))
    if phases == 5:
        data = replace(data, records=_five_phases(data.records), zoom=_five_phases(data.zoom))
    for rows in (data.records, data.zoom):
        for phase, name in enumerate("abcde"[:phases]):
            angle = rows["theta_e"] - phase * 2 * np.pi / phases
            rows[f"i{name}"] = d_a * np.cos(angle) - q_a * np.sin(angle) - third_a * np.sin(3 * angle)
    cycles = np.arange(500, data.cycles, round(CLOCK_HZ / sample_hz))
    error = np.radians(np.resize(errors_deg, cycles.size))
    turns = (np.asarray(drive.theta(cycles / CLOCK_HZ)) + error) / (2 * np.pi)
    log = np.zeros((cycles.size, 4), dtype=np.int64)
    log[:, 0], log[:, 1], log[:, 2] = cycles, LogKind.ANGLE, np.round(turns % 1.0 * 2**32) % 2**32
    kept = [data.rows(kind) for kind in (LogKind.GATES, LogKind.TRIP, LogKind.UPDATE)]
    merged = np.concatenate((*kept, log))
    return replace(data, log=merged[np.argsort(merged[:, 0], kind="stable")])
