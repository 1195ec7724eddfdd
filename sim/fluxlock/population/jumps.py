# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The rotor's angle jumps while an injected drive holds it: followed, named in time, or wrong.

The first ten machines of the injection's population that the checks permit and whose rotor stands at the start and is
free. Each jumps by three angles at three speeds. The drive may not start again, so that a fault ends the run.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fluxlock.native.injection_run import InjectionRun
from fluxlock.population.injection_draw import InjectionDraw
from fluxlock.population.injection_life import SEARCH_S, InjectionLife, injection_life, injection_refusals

MACHINES = 10
ANGLES_DEG = (60.0, 120.0, 180.0)
SHARES = (0.0, 0.05, 0.2)  # of base speed
START_SHARE = 0.05  # of a drive that is to stand afterwards
NAMED_S, AFTER_S = 0.05, 0.15
FOLLOWED_DEG, WRONG_WAY_DEG = 30.0, 90.0
FOLLOWED, NAMED, WRONG = "followed", "named", "wrong"
OUTCOMES = (FOLLOWED, NAMED, WRONG)


@dataclass(frozen=True)
class Jump:
    """One jump and how it ended. after_s: from the jump to the fault, nan without one."""

    machine: int
    share: float
    angle_deg: float
    outcome: str
    fault: str
    after_s: float
    backward_deg: float
    off_deg: float  # angle error, largest from 50 ms after the jump on

    def __str__(self) -> str:
        """What happened, in words."""
        place = f"machine {self.machine}, {100 * self.share:g} % of base speed, {self.angle_deg:g} degrees"
        end = "no fault" if math.isnan(self.after_s) else f"{self.fault} after {1e3 * self.after_s:.0f} ms"
        return f"{place}: {end}, {self.backward_deg:.0f} degrees backward, angle off by {self.off_deg:.0f}"


def _starts(life: InjectionLife) -> bool:
    """A rotor that stands and is free, on a machine that is permitted, is found."""
    if life.draw.blocked or life.draw.turning or injection_refusals(life):
        return False
    return _begin(life, START_SHARE) is not None


def jump_machines(seed: int, count: int = MACHINES) -> list[InjectionLife]:
    """The first lives of the population that start."""
    lives = (injection_life(InjectionDraw.of(seed, index)) for index in itertools.count())
    return list(itertools.islice(filter(_starts, lives), count))


def _begin(life: InjectionLife, share: float) -> InjectionRun | None:
    """The run of a drive that has found its rotor."""
    rpm = math.copysign(share, life.draw.target) * life.scenario.motor.max_speed_rpm
    at, index = life.draw.theta_deg, life.draw.index
    run = InjectionRun(life.scenario, theta_deg=at, target_rpm=rpm, machine=life.machine, seed=index)
    return run if run.start(SEARCH_S) else None


def _ended(run: InjectionRun, life: InjectionLife, share: float, angle_deg: float, jumped_s: float) -> Jump:
    after_s, backward_deg = run.fault_s - jumped_s, run.wrong_deg(jumped_s)
    off_deg = float(np.abs(run.window(jumped_s + NAMED_S)["error_deg"]).max(initial=0.0))
    if run.fault != "none":
        outcome = NAMED if after_s <= NAMED_S else WRONG
    else:
        outcome = FOLLOWED if off_deg <= FOLLOWED_DEG else WRONG
    # A rotor that is to stand has no way that is the wrong one.
    if share > 0.0 and backward_deg > WRONG_WAY_DEG:
        outcome = WRONG
    return Jump(life.draw.index, share, angle_deg, outcome, run.fault, after_s, backward_deg, off_deg)


def jump(life: InjectionLife, share: float, angle_deg: float) -> Jump:
    """Start, settle at a share of base speed, jump."""
    run = _begin(life, share or START_SHARE)
    assert run is not None, life.draw.index
    run.run(life.run_s)
    if share == 0.0:
        run.aim(0.0)
        run.run(life.run_s)
    jumped_s = run.chip.now
    run.chip.turn(math.radians(angle_deg))
    run.run(AFTER_S)
    return _ended(run, life, share, angle_deg, jumped_s)


def run_jumps(
    lives: Iterable[InjectionLife],
    done: Callable[[Jump], None],
    *,
    shares: Sequence[float] = SHARES,
    angles_deg: Sequence[float] = ANGLES_DEG,
) -> list[Jump]:
    """Each jump of each machine; done: called for each as it ends. shares: of base speed, 0: stopped before."""
    found = []
    for life, share, angle_deg in itertools.product(lives, shares, angles_deg):
        found.append(jump(life, share, angle_deg))
        done(found[-1])
    return found
