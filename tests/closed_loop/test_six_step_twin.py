# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The averaged six-step drive against the chip: the same shipped scenarios through both, window by window."""

from __future__ import annotations

import os

import numpy as np
import pytest

from fluxlock.config import Scenario
from fluxlock.cosim.outcome import Run
from fluxlock.native.player import player
from fluxlock.results.metrics import run_metrics, trips
from fluxlock.results.rundata import RunData
from fluxverify.regression.case import LOCK_MAY_GO, Row
from fluxverify.regression.runner import Runner

EVERY_VARIABLE = "FLUXLOCK_SIX_STEP_TWIN"
SCENARIOS = ("own-outrunner.toml", "own-spindle.toml", "own-pump.toml", "slow-down.toml")
RUNNING = 3  # drive_state_t
# How far the averaged drive may be off the chip. Torque: share of the rated one; start: share of the time it takes.
SPEED_SHARE, COMMUTATION_DEG, TORQUE_SHARE, START_SHARE = 0.005, 0.5, 0.05, 0.1


def _values(data: RunData, scenario: Scenario) -> dict[str, float | None]:
    _, metrics = run_metrics(data, scenario)
    states = data.states()
    running = np.flatnonzero(states["state"] == RUNNING)
    found = {"state": float(states["state"][-1]), "trips": float(len(trips(data)))}
    found["running_s"] = float(states["t_s"][running[0]]) if running.size else float("nan")
    for name, window in metrics.items():
        found[f"{name}.rpm"] = window["speed_rpm"]["mean"]
        found[f"{name}.deg"] = window["commutation_error_deg"]["rms"]
        found[f"{name}.nm"] = window["torque_nm"]["mean"]
    return dict(found)


def compared(name: str, chip: Run, drive: RunData) -> Row:
    """A row of the differences, averaged drive less chip."""
    real, ours = _values(chip.data, chip.scenario), _values(drive, chip.scenario)
    most_nm = TORQUE_SHARE * chip.scenario.motor.rated_torque_nm
    limits: dict[str, tuple[float | None, float | None]] = {"state.off": (0, 0), "trips.off": (0, 0)}
    most_s = START_SHARE * (real["running_s"] or 0.0)
    limits["running_s.off"] = (-most_s, most_s)
    for key in real:
        most = {
            "rpm": SPEED_SHARE * abs(real[key] or 0.0),
            "deg": COMMUTATION_DEG,
            "nm": most_nm,
        }.get(key.rpartition(".")[2])
        if most is not None:
            limits[f"{key}.off"] = (-most, most)
    off = {f"{key}.off": None if value is None else (ours[key] or 0.0) - value for key, value in real.items()}
    return Row(f"six-step/twin/{name}", {"motor": chip.scenario.motor.name}, {**real, **off}, limits)


@pytest.mark.skipif(EVERY_VARIABLE not in os.environ, reason=f"long: {EVERY_VARIABLE}=1; the demo is in test_runs.py")
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_averaged_drive_goes_where_the_chip_goes(scenario: str) -> None:
    """Speed, commutation error, torque, time of the start, state and trips.

    Verifies: POP-07
    """
    accepted = dict.fromkeys((*LOCK_MAY_GO, "current", "voltage"), "compared")
    runner = Runner("six-step-twin", plots=False)
    chip = runner.drive(scenario, scenario.removesuffix(".toml"), "expect=[]", accept=accepted)
    row = compared(scenario, chip, player(chip.scenario, runner.seed).run())
    print(row.as_json())
    assert not row.misses()
