"""The CANopen node in the chip's firmware, on the simulator's bus.

Needs a chip of its own, which takes minutes to build: runs with FLUXLOCK_CAN_CHIP set, as `make canopen` does.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from fluxlock.analysis.rundata import LogKind
from tests.canopen.chip_bench import CAN, SPINNING, Listener, run_chip

# The longest instruction: an interrupt waits for the one that the main loop is in.
DIVISION_CYCLES = 35

pytestmark = pytest.mark.skipif("FLUXLOCK_CAN_CHIP" not in os.environ, reason="builds a chip: make canopen")


def test_control_is_undisturbed(tmp_path: Path) -> None:
    """With the node in the main loop no control tick is missed or entered later, and the motor commutates as well.

    A rotor is caught and driven up; the bus carries the boot-up frame. Boots differ in length, so do the phases of the
    ticks against the rotor.

    Verifies: CO-21
    """
    without, _ = run_chip(tmp_path / "without", SPINNING, 0.1)
    with_node, frames = run_chip(tmp_path / "with", (*SPINNING, CAN), 0.1, Listener())
    assert frames == [[0x705, "00"]]
    assert len(without.rows(LogKind.COMMUTATION)) > 200
    for run in (without, with_node):
        print(run.isr)
    entry, step = ([run.isr[name] for run in (without, with_node)] for name in ("control_entry", "control"))
    assert entry[1]["max"] <= entry[0]["max"] + DIVISION_CYCLES
    assert entry[1]["mean"] <= entry[0]["mean"]
    assert step[1]["mean"] < 1.02 * step[0]["mean"]
    assert with_node.overruns == without.overruns == 0
    late = [run.rows(LogKind.COMMUTATION)[100:, 0] for run in (without, with_node)]
    assert abs(np.diff(late[0]).mean() / np.diff(late[1]).mean() - 1) < 0.001
