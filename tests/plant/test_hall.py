# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Hall sensors of the plant against its true angle."""

from __future__ import annotations

import math

import pytest

from fluxlock.plant import HallParams, Plant
from fluxlock.plant import layout as L
from tests.plant.drives import drive, motor_1, six_step_gates

# Code (sensors A, B, C in bits 0, 1, 2) of each sector for positive speed: the default map of fl_hall.
CODES = (0b001, 0b011, 0b010, 0b110, 0b100, 0b101)


@pytest.mark.parametrize("offset_deg", [(0.0, 0.0, 0.0), (8.0, -5.0, 2.0)])
@pytest.mark.parametrize("mode", ["jit", "py"])
def test_hall_edges(mode: str, offset_deg: tuple[float, float, float]) -> None:
    """Each edge comes at its commutation angle plus the sensor's offset, within the sample period.

    Verifies: PLANT-16
    """
    plant = Plant(motor_1(machine__hall=HallParams(offset_deg)), seed=1, mode=mode)
    last = None
    seen = []
    for k in range(1, 3000):
        t = 50 * k
        plant.step(t, six_step_gates(plant, t, 0.6), 1)
        code = int(plant.io[L.IO_PINS]) >> 1
        prime = math.degrees(plant.theta_e_rad) + 180.0
        if last is not None and code != last:
            sensor = (code ^ last).bit_length() - 1
            assert code ^ last in (1, 2, 4)
            assert CODES.index(code) == (CODES.index(last) + 1) % 6
            rises = code >> sensor & 1
            wanted = 120.0 * sensor + offset_deg[sensor] - 30.0 + (0.0 if rises else 180.0)
            late = (prime - wanted + 180.0) % 360.0 - 180.0
            assert 0.0 <= late < 0.4, f"sensor {sensor} {late:.3f} degrees late"
            seen.append(code)
        last = code
    assert len(seen) >= 15


def test_no_hall_sensors() -> None:
    """Without them their pins stay low, and the fault pin works beside them.

    Verifies: PLANT-16
    """
    plant = Plant(motor_1(), seed=1, mode="jit")
    drive(plant, 300)
    assert int(plant.io[L.IO_PINS]) == 0
    plant = Plant(motor_1(machine__hall=HallParams()), seed=1, mode="jit")
    drive(plant, 300)
    hall = int(plant.io[L.IO_PINS])
    assert hall in {2 * c for c in CODES}
    plant.inject_fault("fault_pin", level=1)
    assert int(plant.io[L.IO_PINS]) == hall + 1
    plant.inject_fault("clear")
    assert int(plant.io[L.IO_PINS]) == hall


@pytest.mark.parametrize("order", ["ABC", "ACB", "BAC", "BCA", "CAB", "CBA"])
@pytest.mark.parametrize("inverted", ["", "A", "BC", "ABC"])
def test_wires(order: str, inverted: str) -> None:
    """Each input shows the sensor that its wire leads to, or its opposite.

    Verifies: PLANT-16
    """
    offset_deg = (8.0, -5.0, 2.0)
    right = Plant(motor_1(machine__hall=HallParams(offset_deg)), seed=1, mode="jit")
    wired = Plant(motor_1(machine__hall=HallParams(offset_deg, order, inverted)), seed=1, mode="jit")
    seen = set()
    for k in range(1, 1500):
        for plant in (right, wired):
            plant.step(100 * k, six_step_gates(plant, 100 * k, 0.6), 1)
        sensors = int(right.io[L.IO_PINS]) >> 1
        wanted = sum((sensors >> "ABC".index(s) & 1 ^ ("ABC"[x] in inverted)) << x for x, s in enumerate(order))
        assert int(wired.io[L.IO_PINS]) >> 1 == wanted
        seen.add(sensors)
    assert seen == set(CODES)
