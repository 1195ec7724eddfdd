# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the images with the CANopen node leave out changes nothing of what they drive."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.config.drive import TICK_HZ
from fluxlock.firmware.toolchain import build_host_library
from tests.firmware import machines
from tests.firmware.firmware_bench import Bench
from tests.firmware.vector_bench import VectorBench

SECONDS = 0.5


def test_six_step_is_the_same() -> None:
    """Start, ramp and braking of the six-step drive: every register after every tick is that of the whole firmware.

    Verifies: CO-22
    """
    drive = machines.drive(accel_rpm_per_s=400_000.0, current_limit_a=22.5, sync_rect=True)
    benches = [Bench(drive=drive, library=library) for library in (None, build_host_library(can_method="six-step"))]
    for bench in benches:
        assert bench.fw.command("set speed_rpm 40000") == ["ok"]
    for tick in range(round(SECONDS * TICK_HZ)):
        for bench in benches:
            if tick == 100:
                assert bench.fw.command("start") == ["ok"]
            if tick == 4500:
                assert bench.fw.command("set speed_rpm 20000") == ["ok"]
            bench.step()
        assert np.array_equal(benches[0].fw.registers, benches[1].fw.registers), tick
    assert benches[0].fw.state == "running"


def test_vector_is_the_same() -> None:
    """The same of the vector drive, without injection.

    Verifies: CO-22
    """
    benches = [VectorBench(library=library) for library in (None, build_host_library(can_method="vector"))]
    for tick in range(round(SECONDS * 20_000)):
        for bench in benches:
            if tick == 100:
                assert bench.fw.command("set speed_rpm 30000") == ["ok"]
                assert bench.fw.command("start") == ["ok"]
            bench.sample()
        assert np.array_equal(benches[0].fw.registers, benches[1].fw.registers), tick
    assert benches[0].fw.state == "running"


@pytest.mark.parametrize(("held", "other"), [("six-step", VectorBench), ("vector", Bench)])
def test_other_method_is_refused(held: str, other: type[VectorBench | Bench]) -> None:
    """A parameter block for what the image does not hold leaves the drive in init with a fault.

    Verifies: CO-22
    """
    bench = other(library=build_host_library(can_method=held))
    assert bench.fw.state == "init"
    assert "fault chip" in bench.fw.command("status")
