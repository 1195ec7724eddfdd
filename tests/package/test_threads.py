# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Twins in several threads of one process, which have one host library."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest

import fluxlock
from fluxlock.base.paths import ROOT
from fluxlock.firmware.host import HostFirmware
from tests.package.dask_workers import dask_workers

OWN = ROOT / "scenarios" / "own-spindle.toml"
VECTOR = ROOT / "scenarios" / "vector" / "start.toml"
EVENTS = [{"at_s": 0.004, "speed_rpm": 1000}, {"at_s": 0.005, "command": "start"}]
SHORT = {"duration_s": 0.1, "window": [], "expect": []}
WINDOW = {"name": "held", "from_s": 0.06, "to_s": 0.1}


def test_threads() -> None:
    """Runs in two threads at once are bit for bit those of one after the other, of both methods.

    Verifies: PACKAGE-7
    """
    scenarios = [
        fluxlock.scenario_of(file, {**SHORT, "event": EVENTS, "motor.resistance_ohm": ohm})
        for file in (OWN, VECTOR)
        for ohm in (0.15, 0.16)
    ]
    simulate = partial(fluxlock.simulate, twin=True)
    one = [run.data.records for run in map(simulate, scenarios)]
    begin = Barrier(2)
    with ThreadPoolExecutor(2, initializer=begin.wait) as pool:
        two = [run.data.records for run in pool.map(simulate, scenarios)]
    assert not np.array_equal(one[0], one[1]) and len(one[0]) > 100
    for here, there in zip(one, two, strict=True):
        np.testing.assert_array_equal(here, there)


def test_worker_of_two_threads(tmp_path: Path) -> None:
    """A Dask worker of two threads gives the rows of the pool.

    Verifies: PACKAGE-9
    """
    scenario = fluxlock.scenario_of(OWN, {**SHORT, "window": [WINDOW]})
    grid = {"motor.resistance_ohm": "0.8x:1.2x:4", "drive.commutation": ["RSC", "CSC"]}
    with dask_workers(tmp_path, 1, threads=2) as dask:
        there = fluxlock.sweep(scenario, grid, twin=True, scheduler=dask.address()).rows
    assert there == fluxlock.sweep(scenario, grid, twin=True, jobs=2).rows
    assert len({row["held.speed_rpm.mean"] for row in there}) == 4


def test_twin_within_a_twin() -> None:
    """A load that asks for a twin itself ends the run by name: there is no second library.

    Verifies: PACKAGE-11
    """

    def nested(speed: float, angle: float, time: float) -> float:
        return fluxlock.simulate(OWN, twin=True, **SHORT).data.duration_s

    with pytest.raises(fluxlock.SimulationFault, match="load_nm raised RuntimeError: a twin runs already in this thre"):
        fluxlock.simulate(OWN, twin=True, load_nm=nested, **SHORT)


def test_one_table_of_types() -> None:
    """Threads that ask for the firmware's types at once get one table: another one would not know the types of it.

    Verifies: PACKAGE-7
    """
    program = """
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from fluxlock.firmware.binding import types

with ThreadPoolExecutor(4, initializer=Barrier(4).wait) as pool:
    print(len({id(found.result()) for found in [pool.submit(types) for _ in range(4)]}))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout == "1\n", done.stderr


def test_library_without_a_turn() -> None:
    """Another thread than the first does not get the library unless it waits for its turn.

    Verifies: PACKAGE-9
    """
    with ThreadPoolExecutor(1) as pool, pytest.raises(RuntimeError, match="one_at_a_time"):
        pool.submit(HostFirmware).result()
