# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The kernel's own CAN bus, vcan0: a master that is not ours, candump, cansend and cangen, in their own session."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_scenario
from fluxlock.cosim.run import chip_of

WITH_VCAN = str(ROOT / "tools" / "socketcan.sh")
NOT_TO_BE_HAD = (3, 125)  # exit codes of the script: nothing is installed; User-Mode Linux does not start
OURS = ("PYTEST_", "FLUXLOCK_TEST_TIMES")
TESTS = ("tests/canopen/test_master.py", "tests/canopen/can_utils.py")


def test_on_the_kernels_bus() -> None:
    """The master's tests on the native program, and the tools on the chip, over vcan0: all pass, none is skipped.

    `make test-socketcan` takes the master to the chip over vcan0 too, where it is slower than on a bus of its own.

    Verifies: CO-26
    """
    boots = {**os.environ, "CAN_UML_TIMEOUT": "300"}
    tried = subprocess.run([WITH_VCAN, "true"], env=boots, capture_output=True, text=True, check=False)
    if tried.returncode in NOT_TO_BE_HAD:
        pytest.skip(f"no vcan0: {' '.join(tried.stderr.split())}")
    assert tried.returncode == 0, tried.stderr
    chip_of(load_scenario(ROOT / "scenarios" / "can.toml"))  # outside, where a compiler has all cores
    env = {name: value for name, value in os.environ.items() if not name.startswith(OURS)}
    command = [WITH_VCAN, sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "native or can_utils"]
    env["FLUXLOCK_SOCKETCAN"] = "vcan0"
    done = subprocess.run([*command, *TESTS], cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    print(done.stdout, done.stderr)
    assert done.returncode == 0
    assert " passed" in done.stdout and "skipped" not in done.stdout
