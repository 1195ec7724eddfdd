# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive on the host over machine and pulses: the speed from no load to the limit, braking at its limit."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.config import Inverter, Load, Motor
from tests.firmware import machines
from tests.firmware.firmware_bench import OTHERS, Bench, small_motor, stage

# Machines of the files, a racing motor, a compressor, a mid-drive: speed to hold (r/min), load there that their
# commutation carries (N*m), carrier (Hz).
STRANGERS = [
    (*OTHERS[0][:2], 15_000, 0.16, 30e3),
    (*OTHERS[1][:2], 6_000, 0.22, 30e3),
    (*OTHERS[2][:2], 8_000, 0.08, 30e3),
    (*OTHERS[3][:2], 3_000, 0.55, 30e3),
    (small_motor(7, 0.045, 9e-6, 3.66e-4, 4e-6, 30.0, 29_000), stage(14.8, 20.0, 60.0, 48.0), 18_000, 0.05, 48e3),
    (small_motor(3, 0.045, 60e-6, 5e-3, 2.5e-5, 12.0, 14_000), stage(48.0, 60.0, 50.0, 40.0), 9_000, 0.29, 20e3),
    (small_motor(8, 0.061, 76e-6, 6.2e-3, 2.4e-4, 15.0, 4_500), stage(36.0, 48.0, 60.0, 48.0), 2_400, 1.2, 20e3),
]


def held(bench: Bench, seconds: float = 0.2) -> float:
    """Mean of the true speed."""
    speeds = []
    for _ in range(round(seconds / bench.tick_s)):
        bench.step()
        speeds.append(bench.model.rpm)
    return float(np.mean(speeds))


@pytest.mark.parametrize("share", [0.01, 0.1, 1.0])
@pytest.mark.parametrize(("motor", "inverter", "rpm", "full_nm", "carrier_hz"), STRANGERS)
@pytest.mark.parametrize("current_loop", [False, True])
def test_speed_is_held_from_no_load_to_the_limit(
    motor: Motor, inverter: Inverter, rpm: int, full_nm: float, carrier_hz: float, share: float, current_loop: bool
) -> None:
    """A fan of 1/100, 1/10 and all of the full load: within 0.2 %, with diodes as far as their pulses allow.

    Verifies: FW-70
    """
    drive = machines.drive(carrier_hz=carrier_hz, current_loop=current_loop)
    bench = Bench(motor, inverter, drive, Load(fan_torque_nm=share * full_nm, fan_speed_rpm=rpm))
    bench.start(rpm, 2.0)
    bench.run(2.5, lambda: bench.model.rpm > 0.99 * rpm)
    bench.run(0.5)
    assert held(bench) == pytest.approx(rpm, rel=0.002)
    assert bench.trips == 0
