# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiled and plain kernel: the same bits, the same faults, the fixed interface."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import numpy as np
import pytest

from fluxlock.plant import Plant, PlantError
from fluxlock.plant import layout as L
from fluxlock.plant.build import CALLBACK
from tests.plant.circuits import random_gates, random_params
from tests.plant.drives import drive, motor_1

SAMPLED_CYCLES = 500


@pytest.mark.parametrize("seed", range(8))
def test_identical_bits(seed: int) -> None:
    """State, codes and records agree bit for bit between plain Python and compiled code.

    Verifies: PLANT-06
    """
    rng = np.random.default_rng(seed)
    params = random_params(rng, "free" if seed % 2 else "imposed", 1e-7 * (seed % 3))
    gates = dict(random_gates(rng, 60_000))
    moments = sorted({*gates, *range(SAMPLED_CYCLES, 60_000, SAMPLED_CYCLES)})
    plants = [Plant(params, seed=seed, mode=mode) for mode in ("py", "jit")]
    for plant in plants:
        plant.configure_recording(3, ((10_000, 20_000),))
        now = 0
        for t in moments:
            now = gates.get(t, now)
            plant.step(t, now, int(t % SAMPLED_CYCLES == 0))
    py, jit = plants
    assert py.state.tobytes() == jit.state.tobytes()
    assert py.io.tobytes() == jit.io.tobytes()
    assert int(py.io[L.IO_HEARTBEAT]) == len(moments)
    assert len(py.records()) > 0 and len(py.zoom_records()) > 0


def test_identical_bits_in_a_drive() -> None:
    """The same for a six-step drive with trapezoidal EMF, noise and a divider pole.

    Verifies: PLANT-06
    """
    py, jit = (Plant(motor_1(machine__emf="trapezoidal"), seed=5, mode=mode) for mode in ("py", "jit"))
    drive(py, 2000)
    drive(jit, 2000)
    assert py.state.tobytes() == jit.state.tobytes()
    assert py.io.tobytes() == jit.io.tobytes()


@pytest.mark.parametrize("mode", ["py", "jit"])
def test_native_interface(mode: str) -> None:
    """A call through the address with the arrays' addresses, as the simulator main makes it.

    Verifies: PLANT-06
    """
    plant = Plant(motor_1(), seed=1, mode=mode)
    step = CALLBACK(plant.address)
    s = plant.state.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
    io = plant.io.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))
    assert step(0, 0b001001, 2, s, io) == 0
    assert step(100, 0b001000, 3, s, io) == 0
    assert plant.currents_a[0] > 0.0
    assert plant.io[L.IO_HEARTBEAT] == 2
    assert step(200, 0b000011, 2, s, io) == L.FAULT_SHOOT_THROUGH
    assert plant.io[L.IO_HEARTBEAT] == 2
    assert step(150, 0, 0, s, io) == L.FAULT_TIME


@pytest.mark.parametrize("mode", ["py", "jit"])
def test_fault_codes(mode: str) -> None:
    """Shoot-through, time running backwards, values that are not finite.

    Verifies: PLANT-13
    """
    with pytest.raises(PlantError, match="shoot-through"):
        Plant(motor_1(), seed=1, mode=mode).step(10, 0b110000)
    plant = Plant(motor_1(), seed=1, mode=mode)
    plant.advance(10)
    with pytest.raises(PlantError, match="backwards"):
        plant.advance(9)
    plant = Plant(motor_1(inverter__dc_link_c_f=1e-4), seed=1, mode=mode)
    plant.state[L.VDC] = np.nan
    with pytest.raises(PlantError, match="not finite"):
        plant.advance(10)


def test_exception_in_plain_mode_becomes_a_fault() -> None:
    """An exception in the plain kernel is kept and reported, not swallowed by ctypes.

    Verifies: PLANT-13
    """
    plant = Plant(motor_1(), seed=1, mode="py")
    plant.state[L.GATES] = np.nan
    with pytest.raises(PlantError, match="ValueError") as caught:
        plant.step(10, 0)
    assert isinstance(caught.value.__cause__, ValueError)


def test_plain_mode_needs_no_numba() -> None:
    """Mode "py", also by environment variable, imports no numba.

    Verifies: PLANT-06
    """
    code = (
        "import sys; from tests.plant.drives import drive, motor_1; from fluxlock.plant import Plant;"
        "p = Plant(motor_1(), seed=1); drive(p, 20); assert p.mode == 'py'; assert 'numba' not in sys.modules"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        env={"FLUXLOCK_PLANT": "py", "PYTHONPATH": "."},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr


def test_unknown_mode() -> None:
    """A wrong mode is named.

    Verifies: PLANT-13
    """
    with pytest.raises(ValueError, match="'fast'"):
        Plant(motor_1(), seed=1, mode="fast")
