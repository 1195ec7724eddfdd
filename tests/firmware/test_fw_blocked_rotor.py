# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A rotor that stands while crossings and the commutations that they cause chase each other.

After a commutation the floating phase of a standing rotor shows no EMF: what lies first beyond the blanking is taken
for the crossing, the commutation follows after half of the interval, and the intervals shrink to what the blanking
leaves.
"""

from __future__ import annotations

import pytest

from fluxlock.config import Load
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import Bench

GHOST_S = (60e-6, 100e-6, 150e-6)


def fault_of(bench: Bench) -> str:
    """Name of the present fault."""
    return bench.fw.command("get fault")[0].split()[1]


@pytest.mark.parametrize("ghost_s", GHOST_S)
def test_blocked_rotor_is_a_failed_start(ghost_s: float) -> None:
    """Crossings that chase the commutations are no lock: the retries are made, then start_failed.

    Verifies: FW-20
    """
    bench = Bench(drive=machines.drive(start={"retries": 2, "current_a": 6.0}))
    bench.model.m[am.M_LOCKED] = 1.0
    bench.model.m[am.M_GHOST] = ghost_s
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    assert bench.until_state("starting", 0.01)
    ramps, before = 0, False
    while bench.fw.state == "starting":
        forced = bench.get("comm.control") & 3 == am.TIMER_FORCED
        ramps += forced and not before
        before = forced
        bench.step()
        if bench.fw.state == "running":
            assert bench.run(0.05, lambda: bench.fw.state != "running")
    assert (bench.fw.state, fault_of(bench), ramps) == ("fault", "start_failed", 3)


def test_rotor_that_jams_is_a_lost_lock() -> None:
    """A rotor that stops dead at low speed, without over-current: a lost lock, then starts that fail by name.

    Verifies: FW-20
    """
    bench = Bench(drive=machines.drive(start={"retries": 1}))
    bench.start(8_000, 0.35)
    bench.run(1.1)
    bench.model.m[am.M_LOCKED] = 1.0
    bench.model.m[am.M_GHOST] = 400e-6
    assert bench.until_state("starting", 0.05)
    assert bench.fw.command("get lost_locks")[0] == "lost_locks 1"
    assert bench.until_state("fault", 3.0)
    assert fault_of(bench) == "start_failed"


@pytest.mark.parametrize(("speed_rpm", "ghost_s"), [(8_000, 100e-6), (20_000, 150e-6), (60_000, 100e-6)])
def test_rotor_that_jams_at_speed_is_an_over_current(speed_rpm: int, ghost_s: float) -> None:
    """The voltage of the speed drives the current of standstill: the trip is quicker than any doubt of the speed.

    Verifies: FW-18
    """
    bench = Bench()
    bench.start(speed_rpm, 0.35)
    bench.run(0.6)
    bench.model.m[am.M_LOCKED] = 1.0
    bench.model.m[am.M_GHOST] = ghost_s
    assert bench.until_state("fault", 0.05)
    assert fault_of(bench) == "phase_over_current"


@pytest.mark.parametrize("speed_rpm", [8_000, 20_000, 60_000])
def test_turning_rotor_is_not_doubted(speed_rpm: int) -> None:
    """Sampled once a carrier the DC-link current is that of the pulse, over twice its mean: no reason for a doubt.

    Verifies: FW-20
    """
    bench = Bench(drive=machines.drive(zcd={"sampling": "carrier"}))
    bench.start(speed_rpm, 0.5)
    bench.model.set_load(Load(coulomb_nm=10e-3))
    for _ in range(10_000):
        bench.step()
        assert bench.fw.state == "running"
    assert bench.fw.command("get lost_locks")[0] == "lost_locks 0"
