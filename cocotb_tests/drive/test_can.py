# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The drive as a CANopen node, led by `fluxlock.drive` alone."""

from __future__ import annotations

from fluxlock.base.paths import ROOT
from fluxlock.drive import Drive, drive_test, run_tests


@drive_test()
async def master_enables_the_operation(drive: Drive) -> None:
    """A master walks the node through CiA 402: the motor follows its target, and stops when it shuts down.

    Verifies: DRV-06
    """
    master = drive.can
    await master.receive(0x700 + master.node_id, within_s=0.05)
    master.operate()
    await master.write(0x60FF, 0, 60_000, 4)
    for word in (0x06, 0x07, 0x0F):
        await master.write(0x6040, 0, word, 2)
    await drive.at_speed(60_000)
    status, speed = await master.read(0x6041), await master.read(0x606C, signed=True)
    assert status & 0x6F == 0x27  # operation enabled
    assert abs(speed - drive.speed_rpm) < 600
    await master.write(0x6040, 0, 0x00, 2)
    await drive.until(lambda: drive.gates_off, 0.01)
    assert drive.torque_nm == 0


def test_can() -> None:
    """The chip with the CAN controller."""
    run_tests(ROOT / "scenarios" / "campaign" / "can.toml", __name__)
