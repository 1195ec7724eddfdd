# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection at low speed on the whole chip with its motor, led by `fluxlock.drive` alone."""

from __future__ import annotations

from fluxlock.base.paths import ROOT
from fluxlock.drive import Drive, drive_test, run_tests

SCENARIO = ROOT / "scenarios" / "vector" / "ipm-injection.toml"
RPM = 100
LOCKED_S = 0.008  # the loop turns to the angle by 18 degrees a millisecond, from 103 degrees away


async def found(drive: Drive) -> None:
    """The common start: the angle is found at rest, the motor begins to turn."""
    await drive.start(RPM)


@drive_test(after=found)
async def holds_the_angle_at_low_speed(drive: Drive) -> None:
    """Ends of one start, light and loaded: the load slows the rotor down, the angle holds within the scenario's limit.

    Verifies: DRV-01, DRV-04
    """
    ends = drive.branch([0.0, 0.02])
    for end in ends:
        drive.load(constant_nm=end.value)
        await drive.run(LOCKED_S)
        end.keep((drive.speed_rpm, drive.angle_error_deg, drive.state))
    print(ends.kept)
    (light_rpm, light_deg, _), (loaded_rpm, loaded_deg, _) = ends.kept
    assert all(state == "running" for _, _, state in ends.kept)
    assert loaded_rpm < light_rpm
    assert abs(light_deg) < 5.0 and abs(loaded_deg) < 5.0


@drive_test(after=found)
async def follows_its_target(drive: Drive) -> None:
    """The core takes its turns in time: the rotor comes up to the speed by the ramp, and goes the other way when asked.

    Verifies: DRV-01, INJC-19
    """
    await drive.until(lambda: drive.speed_rpm > 0.9 * RPM, 0.1)
    await drive.console(f"set speed_rpm {-RPM}")
    await drive.until(lambda: drive.speed_rpm < -0.9 * RPM, 0.15)
    assert drive.state == "running" and abs(drive.angle_error_deg) < 5.0


@drive_test(after=found)
async def coasts_with_open_gates(drive: Drive) -> None:
    """After `stop now` no gate moves, and no current is left.

    Verifies: DRV-01
    """
    await drive.stop(now=True)
    await drive.until(lambda: drive.gates_off, 0.01)
    await drive.run(2e-3)
    assert max(abs(drive.currents_a)) < 0.01
    assert drive.state == "ready" and drive.fault_name == "none"


def test_injection() -> None:
    """The chip with vector and injection path."""
    run_tests(SCENARIO, __name__)
