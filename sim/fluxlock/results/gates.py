# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Checks the recorded gates of a run for what must never happen, such as both switches of a leg on: `GateSafety`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fluxlock.results.rundata import BoolArray, IntArray, LogKind, RunData

LEGS = 5  # at most; those that are not there have no edges


@dataclass(frozen=True)
class GateSafety:
    """Counts and least times over a whole run.

    shoot_throughs: gate states with both switches of a leg on. least_dead_time_s: shortest time from one switch of a
    leg turning off to the other turning on; None: no leg ever changed over. latest_off_cycles: longest time from a
    trip to all gates off. shortest_off_s: shortest time that the gates then stayed off; both None without a trip.
    on_at_end: a gate is on at the end of the run.
    """

    shoot_throughs: int
    least_dead_time_s: float | None
    latest_off_cycles: int | None
    shortest_off_s: float | None
    on_at_end: bool


def _edges(on: BoolArray, rising: bool) -> IntArray:
    """Rows in which a gate turns on, or off; it is off before the first row."""
    before = np.concatenate(([False], on[:-1]))
    rows: IntArray = np.flatnonzero(on & ~before if rising else ~on & before)
    return rows


def _dead_times(cycle: IntArray, upper: BoolArray, lower: BoolArray) -> IntArray:
    """Clocks from each turn-off of a switch to the next turn-on of the other one, while the first stays off."""
    found = []
    for leaving, entering in ((upper, lower), (lower, upper)):
        off, on, again = cycle[_edges(leaving, False)], cycle[_edges(entering, True)], cycle[_edges(leaving, True)]
        last = np.searchsorted(off, on, side="right") - 1
        known = last >= 0
        on, off_at = on[known], off[last[known]]
        # Only a turn-on without a pulse of the first switch in between is a change-over.
        pulses = np.searchsorted(again, on, side="left") - np.searchsorted(again, off_at, side="left")
        found.append((on - off_at)[pulses == 0])
    return np.concatenate(found)


def _reaction(cycle: IntArray, on: BoolArray, trip: int, end: int) -> tuple[int, int]:
    """Clocks from a trip to all gates off, and how long they then stay off; `end` where that does not happen."""
    k = int(np.searchsorted(cycle, trip, side="right")) - 1
    off_at = trip
    if k >= 0 and on[k]:
        off = cycle[k + 1 :][~on[k + 1 :]]
        off_at = int(off[0]) if off.size else end
    later = cycle[on & (cycle > off_at)]
    return off_at - trip, (int(later[0]) if later.size else end) - off_at


def gate_safety(data: RunData) -> GateSafety:
    """Judge the gate log and the trips of a run."""
    rows = data.rows(LogKind.GATES)
    cycle, gates = rows[:, 0], rows[:, 2]
    legs = [((gates >> 2 * x & 1).astype(np.bool_), (gates >> 2 * x + 1 & 1).astype(np.bool_)) for x in range(LEGS)]
    dead = np.concatenate([_dead_times(cycle, upper, lower) for upper, lower in legs])
    on = gates != 0
    reactions = [_reaction(cycle, on, int(trip), data.cycles) for trip in data.rows(LogKind.TRIP)[:, 0]]
    return GateSafety(
        shoot_throughs=int(np.count_nonzero(np.any([upper & lower for upper, lower in legs], axis=0))),
        least_dead_time_s=float(dead.min()) / data.clock_hz if dead.size else None,
        latest_off_cycles=max((off for off, _ in reactions), default=None),
        shortest_off_s=min(stay for _, stay in reactions) / data.clock_hz if reactions else None,
        on_at_end=bool(on.size and on[-1]),
    )
