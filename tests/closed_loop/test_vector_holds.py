# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The vector drive holds a machine that nobody tuned it for: a light servo on the native twin."""

from __future__ import annotations

from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_scenario
from fluxlock.cosim.outcome import write_outcome
from fluxlock.firmware import vector_compiler
from fluxlock.native.vector_run import Play
from fluxlock.results.metrics import run_metrics

LOAD_STEP = ROOT / "scenarios/vector/load-step.toml"
DECELERATION = ROOT / "scenarios/vector/deceleration.toml"
ENCODER = ROOT / "scenarios/vector/encoder.toml"
WRONG_ENCODER = ROOT / "scenarios/vector/encoder-lines.toml"
RIGHT = "drive.motor_error.encoder_lines=1"
# What a leg loses beyond its compensation. A dead time of 75 clocks of 5000 takes 4.65 V of 310 V.
LEFT_V = (0.0, 0.8, 2.0)
# A loop whose omega_n is the rotor's frequency at 3000 r/min.
FAST_LOOP = ("drive.vector.pll_hz=978",)
SWING_V, CALM_DEG, CALM_RPM = 1.4, 0.5, 15.0
SEED = 1


def _played(left_v: float, *overrides: str, seed: int = SEED) -> Play:
    print(f"seed {seed}, {left_v} V left, {' '.join(overrides)}")
    play = Play(load_scenario(LOAD_STEP, list(overrides)), seed)
    play.chip.set_left_voltage(left_v)
    return play


@pytest.mark.parametrize("left_v", LEFT_V)
def test_light_servo_holds_a_rated_load_step(left_v: float, tmp_path: Path) -> None:
    """Speed and angle of the scenario's limits, whatever of the dead time is left.

    Verifies: VC-41
    """
    play = _played(left_v)
    outcome = write_outcome(play.run(), play.scenario, tmp_path)
    assert outcome.verdict.failures == []


def test_hard_deceleration_brakes_at_once(tmp_path: Path) -> None:
    """2 ms after the target fell the torque is that of the braking current's limit; the speed arrives without a dip.

    Verifies: VC-43
    """
    scenario = load_scenario(DECELERATION)
    outcome = write_outcome(Play(scenario, SEED).run(), scenario, tmp_path)
    assert outcome.verdict.failures == []


@pytest.mark.parametrize("left_v", [0.2, 0.3])
def test_a_right_encoder_is_not_doubted_at_rest(left_v: float, tmp_path: Path) -> None:
    """The observer takes what is left of the dead time for an EMF; the encoder of a rotor that is held shows none.

    Verifies: ENC-05
    """
    play = Play(load_scenario(ENCODER), SEED)
    play.chip.set_left_voltage(left_v)
    assert write_outcome(play.run(), play.scenario, tmp_path).verdict.failures == []


@pytest.mark.parametrize(
    "override",
    [
        "drive.motor_error.encoder_lines=0.9765625",
        "drive.motor_error.encoder_lines=2",
        "motor.encoder.inverted=true",
        "motor.encoder.missing_lines=40",
        "drive.motor_error.encoder_offset_deg=30",
    ],
)
def test_a_wrong_encoder_is_named(override: str, tmp_path: Path) -> None:
    """Lines, tracks, lost lines or an index that are not those of the file end the scenario in `encoder`.

    Verifies: ENC-07, ENC-08
    """
    scenario = load_scenario(WRONG_ENCODER, [RIGHT, override])
    outcome = write_outcome(Play(scenario, SEED).run(), scenario, tmp_path)
    assert outcome.verdict.failures == []
    right = load_scenario(WRONG_ENCODER, [RIGHT])
    assert Play(right, SEED).run().fault is None


@pytest.mark.parametrize("damped", [True, False])
def test_residual_dead_time_leaves_no_swing(monkeypatch: pytest.MonkeyPatch, damped: bool) -> None:
    """Light load and a loop as fast as the rotor, the worst place for the stator's mode; undamped it swings.

    Verifies: VC-42
    """
    if not damped:
        monkeypatch.setattr(vector_compiler, "regulator_damping", lambda *_: 1.0)
    play = _played(SWING_V, *FAST_LOOP)
    _, metrics = run_metrics(play.run(), play.scenario)
    rms_deg, speed = metrics["light"]["angle_error_deg"]["rms"], metrics["light"]["speed_rpm"]
    print(rms_deg, speed)
    assert (rms_deg < CALM_DEG) == damped
    assert (speed["max"] - speed["min"] < CALM_RPM) == damped
