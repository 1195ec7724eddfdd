# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Gate safety against gate logs written by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fluxlock.results.gates import GateSafety, gate_safety
from fluxlock.results.rundata import LogKind
from tests.results.synthetic import CLOCK_HZ, Drive, make_run

A_HIGH, A_LOW, B_LOW = 1, 2, 8
E_HIGH, E_LOW = 256, 512
OFF_CLOCKS = 8000


def safety(gates: list[tuple[int, int]], trips: tuple[int, ...] = ()) -> GateSafety:
    """Judge a run of 20 000 clocks with these changes (cycle, gates) and trips (cycle)."""
    log = [(cycle, LogKind.GATES, value, 0) for cycle, value in gates]
    log += [(cycle, LogKind.TRIP, 1, 0) for cycle in trips]
    return gate_safety(replace(make_run(Drive()), log=np.array(sorted(log), dtype=np.int64), cycles=20_000))


def test_clean_gates() -> None:
    """A change-over after 10 clocks, a trip that acts after one clock, a restart 8000 clocks later.

    Verifies: FRONT-25
    """
    gates = [(100, A_HIGH | B_LOW), (200, B_LOW), (210, A_LOW | B_LOW), (300, B_LOW), (500, A_LOW), (1001, 0)]
    found = safety([*gates, (1001 + OFF_CLOCKS, A_LOW), (15_000, 0)], trips=(1000,))
    assert found.shoot_throughs == 0 and not found.on_at_end
    assert found.least_dead_time_s == pytest.approx(10 / CLOCK_HZ)
    assert found.latest_off_cycles == 1
    assert found.shortest_off_s == pytest.approx(OFF_CLOCKS / CLOCK_HZ)


def test_violations_are_found() -> None:
    """Both switches of a leg, a short dead time in either direction, gates that stay or come back on after a trip.

    Verifies: FRONT-25
    """
    assert safety([(100, A_HIGH | B_LOW), (110, A_HIGH | A_LOW)]).shoot_throughs == 1
    assert safety([(100, E_HIGH), (110, E_HIGH | E_LOW)]).shoot_throughs == 1
    for first, second in ((A_HIGH, A_LOW), (A_LOW, A_HIGH), (E_HIGH, E_LOW)):
        assert safety([(1, first), (50, 0), (52, second)]).least_dead_time_s == pytest.approx(2 / CLOCK_HZ)
    # One switch pulsing again is no change-over; nor is the other one after it without its own gap.
    assert safety([(1, A_HIGH), (50, 0), (52, A_HIGH)]).least_dead_time_s is None
    stays = safety([(1, A_HIGH)], trips=(1000,))
    assert stays.latest_off_cycles == 19_000 and stays.on_at_end
    late = safety([(1, A_HIGH), (1010, 0), (1020, A_HIGH)], trips=(1000,))
    assert late.latest_off_cycles == 10 and late.shortest_off_s == pytest.approx(10 / CLOCK_HZ)


def test_trip_with_gates_off() -> None:
    """A trip while the gates are off acts at once; without trips there is nothing to judge.

    Verifies: FRONT-25
    """
    found = safety([(1, A_HIGH), (50, 0)], trips=(1000,))
    assert found.latest_off_cycles == 0 and found.shortest_off_s == pytest.approx(19_000 / CLOCK_HZ)
    assert safety([(1, A_HIGH), (50, 0)]).latest_off_cycles is None
    assert safety([], trips=(1000,)).latest_off_cycles == 0
