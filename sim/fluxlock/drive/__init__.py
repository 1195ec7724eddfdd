# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The whole chip in closed loop with its motor, for cocotb tests of your own.

    from fluxlock.drive import Drive, drive_test, run_tests

    @drive_test()
    async def holds_its_speed(drive: Drive) -> None:
        await drive.start(20_000)
        drive.load(factor=1.25)
        await drive.run(0.05)
        assert abs(drive.speed_rpm - 20_000) < 200

    def test_spindle() -> None:
        run_tests("spindle.toml", __file__)

`run_tests` stands in the process of pytest: it builds chip and firmware and starts the simulator. `drive_test` and
`Drive` stand in the simulator's process. `verilator_runner` is for tests of RTL of your own in the same file.
docs/howto/cocotb-test.md is the tutorial.
"""

from fluxlock.drive.bench import Bench, run_tests, verilator_runner
from fluxlock.drive.copies import BranchError, End
from fluxlock.drive.drive import Drive, DriveError
from fluxlock.drive.isolated import drive_test

__all__ = ["Bench", "BranchError", "Drive", "DriveError", "End", "drive_test", "run_tests", "verilator_runner"]
