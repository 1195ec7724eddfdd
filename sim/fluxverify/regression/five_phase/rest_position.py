# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Yu's rotor at rest at a random angle, its polarity unknown: the search on the host and on the chip."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import load_scenario
from fluxlock.cosim.outcome import Run
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware import ParameterBlock
from fluxlock.firmware.binding import new
from fluxlock.headers import CData
from fluxlock.theory.injection.cases import YU_BEST, yu
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.five_phase.rest_trial import Trial, saturated, trials
from fluxverify.regression.five_phase.yu import SCENARIO
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, event, timeline

TRIALS, QUICK_TRIALS = 1000, 100
CHIP_TRIALS = 4  # of each saturation
LONGEST_S, MOVED_DEG = 0.05, 1.0
DEAD_TIMES_US = (2.0, 0.0)
START_S, MEAN_S, AFTER_S = 0.004, 0.005, 0.001
CREEP_RPM = 1.0
HOST_NOTE = "C firmware on the host against the float model, settings of the chip's parameter block"
CHIP_NOTE = "whole chip, asked for its state after 50 ms; motion of the rotor within them"


@dataclass(frozen=True)
class Saturation:
    """Change of L_d at +5 A and -5 A of i_d."""

    name: str
    plus: float
    minus: float

    @property
    def weak(self) -> bool:
        """The polarity need not be found, but may not be wrong."""
        return self.name == "weak"


SATURATIONS = (Saturation("strong", -0.10, 0.05), Saturation("weak", -0.03, 0.015))


def search_settings(block: ParameterBlock) -> CData:
    """rest_position_settings_t as the chip's firmware makes them of its parameters."""
    results = block["injection_search_results"]
    assert isinstance(results, tuple)
    counts = dict(zip(("settle", "frame_count", "lock", "current_settle", "current_count"), results, strict=True))
    return new(
        "rest_position_settings_t",
        **counts,
        current_i_q25=block.number("injection_search_i_q25"),
        rise_i_q25=block.number("injection_search_rise_i_q25"),
        sure_q16=block.number("injection_search_sure_q16"),
        minimum_i_q21=block.number("injection_search_least_i_q21"),
    )


def chip_trial(runner: Runner, saturation: Saturation, theta_rad: float, k: int) -> Trial:
    """Search on the chip; seconds: LONGEST_S if it has ended by then, without end otherwise."""
    asked_s = START_S + LONGEST_S
    events = [
        event(0.002, "speed_rpm", CREEP_RPM),
        event(START_S, "command", "start"),
        event(asked_s, "command", "status"),
    ]
    run = runner.drive(
        SCENARIO,
        f"{saturation.name}-{k}",
        *timeline(asked_s + AFTER_S, events, [("steady", asked_s - MEAN_S, asked_s)]),
        "expect=[]",
        f"initial.theta_deg={math.degrees(theta_rad):.3f}",
        f"motor.saturation.plus={saturation.plus}",
        f"motor.saturation.minus={saturation.minus}",
        f"inverter.dead_time_s={DEAD_TIMES_US[k // 2 % 2] * 1e-6:g}",
        seed=runner.seed + k,
        accept={"fault": "polarity_unsure is a right answer to a weak saturation"} if saturation.weak else None,
    )
    return judged(run)


def judged(run: Run) -> Trial:
    """The answer to `status`, the last angle error before it, the rotor's motion."""
    theta = run.data.records["theta_e"]
    moved = math.degrees(float(np.abs(theta - theta[0]).max())) / run.data.pole_pairs
    console = run.console()
    error_deg = run.metrics["steady"]["angle_error_deg"]["mean"]
    if re.search(r"^fault polarity_unsure", console, re.MULTILINE):
        return Trial("not_sure", LONGEST_S, math.inf, moved)
    state = re.search(r"^state (\S+)", console, re.MULTILINE)
    if state is None or state[1] != "running" or error_deg is None or run.result["trips"]:
        return Trial("no_signal", math.inf, math.inf, moved)
    return Trial("found", LONGEST_S, math.radians(error_deg), moved)


def row_of(name: str, saturation: Saturation, found: Sequence[Trial], note: str) -> Row:
    """Row of trials: all right, of the weak saturation right or not sure."""
    errors = [abs(t.error_rad) for t in found if t.name == "found"]
    values: dict[str, Number] = {
        "trials": len(found),
        "right": sum(t.right for t in found),
        "not_sure": sum(t.name == "not_sure" for t in found),
        "in_50ms": sum(t.seconds <= LONGEST_S for t in found),
        "moved_deg.max": max(t.moved_deg for t in found),
        "angle_error_rad.max": max(errors) if errors else None,
    }
    values["wrong"] = len(found) - sum(t.right or t.name == "not_sure" for t in found)
    if note != CHIP_NOTE:
        values["seconds.max"] = max(t.seconds for t in found)
    limits: Limits = {"wrong": (0, 0), "in_50ms": (len(found), len(found)), "moved_deg.max": (None, MOVED_DEG)}
    if not saturation.weak:
        limits["right"] = (len(found), len(found))
    conditions: dict[str, Condition] = {"motor": "Yu", "plus": saturation.plus, "minus": saturation.minus}
    return Row(f"five-phase/rest-position/{name}", conditions, values, limits, note)


@case("five-phase/rest-position")
def rest_position(runner: Runner) -> Iterator[Row]:
    """Random rest angles, polarity unknown, two saturations: result, duration, motion; host and chip."""
    settings = search_settings(parameter_block(load_scenario(ROOT / "scenarios" / SCENARIO)))
    count = QUICK_TRIALS if runner.quick else TRIALS
    for saturation in SATURATIONS:
        for dead_time_us in DEAD_TIMES_US[:1] if runner.quick else DEAD_TIMES_US:
            loop = saturated(yu(YU_BEST, dead_time_us * 1e-6), saturation.plus, saturation.minus)
            found = trials(loop, settings, count, runner.seed)
            note = f"{HOST_NOTE}; noise seeds 0 to {count - 1}"
            yield row_of(f"host/{saturation.name}-{dead_time_us:g}us", saturation, found, note)
    rng = np.random.default_rng(runner.seed)
    angles = rng.uniform(0.0, 2 * math.pi, (CHIP_TRIALS, len(SATURATIONS)))
    for column, saturation in enumerate(SATURATIONS):
        rows = angles[: 1 if runner.quick else CHIP_TRIALS, column]
        found = [chip_trial(runner, saturation, float(theta), k) for k, theta in enumerate(rows)]
        yield row_of(f"chip/{saturation.name}", saturation, found, CHIP_NOTE)
