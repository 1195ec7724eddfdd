# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The shipped scenarios: each carries its limits, and the run fails if one is missed."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_scenario
from fluxlock.cosim.outcome import Run
from fluxlock.native.player import player
from fluxlock.results.scope import caption
from tests.closed_loop.native_run import play
from tests.closed_loop.support import SEED, drive
from tests.closed_loop.test_six_step_twin import compared


def test_demo() -> None:
    """Standstill to 60 000 r/min, load step, gates off; beside it the native program and the averaged drive.

    Verifies: SYS-01, SYS-02, SYS-03, CO-19, FRONT-65, POP-07
    """
    run = drive("demo.toml", "demo")
    assert not run.verdict.failures
    assert not run.result["trips"]
    assert run.gates()[-1, 1] == 0, "gates are off at the end"
    assert run.data.overruns == 0
    for window in ("steady", "loaded"):
        m = run.metrics[window]
        assert m["speed_rpm"]["min"] >= 59_700 and m["speed_rpm"]["max"] <= 60_300
        assert abs(m["commutation_error_deg"]["mean"]) <= 0.3
        assert m["commutation_error_deg"]["rms"] <= 0.3
        assert m["late_crossings"] == 0
    assert run.metrics["loaded"]["torque_nm"]["mean"] == pytest.approx(0.025, rel=0.02)
    assert caption(run.data, run.result) in (ROOT / "README.md").read_text(encoding="utf-8"), (
        "the README shows another run: fluxlock scope build/demo --out docs/images/scope.svg"
    )
    native_runs_alike(run)
    row = compared("demo.toml", run, player(run.scenario, SEED).run())
    print(row.as_json())
    assert not row.misses()


def native_runs_alike(run: Run) -> None:
    """The same C on averaged models starts, locks, ramps and takes the load step at the chip's times and speeds."""
    records = run.data.records
    chip_s = records["t_cycle"] / run.data.clock_hz
    chip_rpm = records["omega_e"] / run.data.pole_pairs * 30.0 / np.pi
    t_s, rpm = play(load_scenario(ROOT / "scenarios" / "demo.toml"))
    beside = np.interp(t_s, chip_s, chip_rpm)
    for level in (5_000, 20_000, 59_700):
        times = t_s[np.argmax(rpm > level)], t_s[np.argmax(beside > level)]
        print(f"{level} r/min: native {times[0]:.3f} s, chip {times[1]:.3f} s")
        assert times[0] == pytest.approx(times[1], abs=0.02)
    driven = t_s < 0.87
    assert np.abs(rpm - beside)[driven].max() < 0.02 * 60_000
    for begin, end in ((0.66, 0.72), (0.80, 0.86)):
        window = (t_s >= begin) & (t_s <= end)
        assert rpm[window].mean() == pytest.approx(beside[window].mean(), rel=1e-3)
    step = (t_s > 0.72) & (t_s < 0.80)
    dips = 60_000 - rpm[step].min(), 60_000 - beside[step].min()
    print(f"dip of the load step: native {dips[0]:.0f} r/min, chip {dips[1]:.0f} r/min")
    assert 0.5 < dips[0] / dips[1] < 2.0


def test_slow_down() -> None:
    """From 60 000 r/min to 20 000, slowed by the fan alone, with the least voltage at the end; gates off.

    Verifies: SYS-01
    """
    run = drive("slow-down.toml", "slow-down")
    assert not run.verdict.failures
    assert not run.result["trips"]
    assert run.gates()[-1, 1] == 0, "gates are off at the end"
    slow = run.metrics["slow"]["speed_rpm"]
    assert slow["min"] >= 19_600 and slow["max"] <= 20_400


@pytest.mark.parametrize("alignment", ["RSC", "NSC"])
def test_commutation_alignments(alignment: str) -> None:
    """RSC: uniform over a carrier (8.85 deg mean, 5.1 deg std at N = 3.39); NSC: no delay. CSC is the demo's.

    Verifies: SYS-03
    """
    # RSC: 0.125 s after the catch are 730 commutations: the mean of an even spread of 17.7 degrees is known to 0.2.
    end_s = 0.2 if alignment == "RSC" else 0.12
    short = (f"duration_s={end_s}", "window.steady.from_s=0.07", f"window.steady.to_s={end_s - 0.005}")
    run = drive("patterns.toml", f"alignments-{alignment}", f"drive.commutation={alignment}", *short)
    assert not run.result["trips"]
    error = run.metrics["steady"]["commutation_error_deg"]
    if alignment == "RSC":
        carrier_deg = 360.0 * 59_000 / 60 / 20_000
        assert error["mean"] == pytest.approx(carrier_deg / 2, abs=0.5)
        assert error["std"] == pytest.approx(carrier_deg / 12**0.5, abs=0.4)
    else:
        assert abs(error["mean"]) <= 0.3
        assert error["rms"] <= 0.3


def test_motor_from_its_file_alone() -> None:
    """A machine nobody tuned for starts and holds its speed: 4 pole pairs, trapezoidal EMF, to just after the ramp.

    The firmware on the host starts this, the outrunner of 7 and the spindle of 2 pole pairs: test_fw_drive_start.py.

    Verifies: SYS-04
    """
    window = ("window.steady.from_s=0.72", "window.steady.to_s=0.78")
    run = drive("own-pump.toml", "own-pump", "duration_s=0.78", *window)
    assert not run.verdict.failures
    assert not run.result["trips"]
