# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A stop that does not slow the rotor opens the gates within 50 ms, by name, with any method; a slow one goes on."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fluxlock.firmware.block import Value
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import Bench, fault_of
from tests.firmware.vector_bench import VectorBench, VectorSettings

PATIENCE_S, AT_ONCE_S = 0.05, 0.01
HALL = machines.motor(hall={})


def logged(bench: Bench | VectorBench) -> str:
    """What `faults` says."""
    return " ".join(bench.fw.command("faults"))


@pytest.mark.parametrize("sync_rect", [False, True])
@pytest.mark.parametrize("mode", ["off", "sensored"])
def test_six_step_driven_by_its_load(mode: str, sync_rect: bool) -> None:
    """A load that drives harder than the drive brakes: gates off within 50 ms, the log says why.

    With diodes nothing brakes, and the shortest pulse drives: the drive lets go at once, which no fault is.

    Verifies: FW-61
    """
    drive = machines.drive(sync_rect=sync_rect, hall={"mode": mode})
    bench = Bench(HALL, drive=drive)
    bench.start(20_000)
    bench.run(0.2)
    bench.model.m[am.M_FAN] = 0.0
    bench.model.m[am.M_CONSTANT] = -0.1 if sync_rect else -1e-4
    assert bench.fw.command("stop") == ["ok"]
    assert bench.run(PATIENCE_S if sync_rect else AT_ONCE_S, lambda: bench.fw.state != "stopping")
    assert bench.get("safety.guard") & 1 == 0
    assert ("stop_failed" in logged(bench)) == sync_rect
    assert (bench.fw.state, fault_of(bench)) == (("fault", "stop_failed") if sync_rect else ("ready", "none"))


@pytest.mark.parametrize("accel_rpm_per_s", [1000.0, 100_000.0])
@pytest.mark.parametrize("sync_rect", [None, True])
def test_slow_stop_goes_on(accel_rpm_per_s: float, sync_rect: bool | None) -> None:
    """A stop along a slow ramp, and a heavy rotor that only its fan slows: no fault, none in the log.

    Verifies: FW-61
    """
    motor = machines.motor(inertia_kgm2=2e-5)
    bench = Bench(motor, drive=machines.drive(sync_rect=sync_rect, accel_rpm_per_s=accel_rpm_per_s), speed_rpm=20_000)
    bench.start(20_000)
    bench.run(0.1)
    before_rpm = bench.model.rpm
    assert bench.fw.command("stop") == ["ok"]
    bench.run(0.5)
    assert bench.fw.state == "stopping" and "stop_failed" not in logged(bench)
    assert bench.model.rpm < 0.99 * before_rpm


@pytest.mark.parametrize("sensored", [False, True])
@pytest.mark.parametrize("direction", [1, -1])
def test_vector_driven_by_its_load(direction: int, sensored: bool) -> None:
    """The same of the vector drive, by its EMF and by an encoder, in both directions.

    Verifies: FW-61
    """
    settings = VectorSettings()
    if sensored:
        settings = replace(settings, sensored=True, encoder_lines=256)
    values: dict[str, Value] = {"accel_rpm_s": 250_000, "brake_limit_ma": 2000}
    bench = VectorBench(settings, values=values)
    bench.start(direction * 20_000)
    bench.run(0.2)
    bench.fan_nm = -0.5  # at 90 000 r/min
    assert bench.fw.command("stop") == ["ok"]
    assert bench.run(PATIENCE_S, lambda: bench.fw.state != "stopping"), bench.fw.command("status")
    assert bench.get("safety.guard") & 1 == 0
    assert "stop_failed" in logged(bench)
