# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What each image of the firmware costs: its bytes, and the longest control step of the drives that it holds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fluxlock.cosim.run import image_of
from fluxlock.firmware import compile_parameters
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, event, timeline

# Phases, method of the image with the CANopen node, None: without it, all methods. docs/canopen.md has those with it.
BUDGET_BYTES = {(3, None): 117_760, (5, None): 86_016, (3, "six-step"): 100_352, (3, "vector"): 108_544}


@dataclass(frozen=True)
class Work:
    """A scenario that asks much of a control step. ticks: that its longest one may take.

    A tick is lost, and counted as an overrun, when a second one comes while the step before still lasts. The search of
    the injection and its end have single steps of more than a tick, with shorter ones behind them.
    """

    name: str
    file: str
    overrides: tuple[str, ...]
    ticks: int = 1


# Unequal phases learnt, braking by the switches; caught, so that no time goes into a start.
SIX_STEP = Work("six-step", "spinning.toml", ("drive.sync_rect=true", 'drive.zcd.balance="both"', "duration_s=0.06"))
STARTED = (event(0.002, "speed_rpm", 24_000), event(0.003, "command", "start"))
VECTOR = Work("vector", "vector/start.toml", ("initial.speed_rpm=20_000", *timeline(0.12, STARTED, ())))
INJECTION = Work("injection", "vector/ipm-injection.toml", ("window=[]",), 2)
FIVE_PHASE = Work("five-phase", "five-phase/yu.toml", ("window=[]",))


def _row(runner: Runner, family: str, work: Work, can: bool) -> Row:
    """One image under one load."""
    name = f"{work.name}{'-can' if can else ''}"
    run = runner.drive(work.file, name, *work.overrides, "expect=[]", *(("can.node_id=5",) if can else ()))
    phases, method = run.scenario.motor.phases, run.scenario.drive.method if can else None
    control = run.result["run"]["isr"]["control"]
    tick_cycles = compile_parameters(run.scenario)["tick_cycles"]
    assert isinstance(tick_cycles, int)
    values: dict[str, Number] = {
        "bytes": image_of(run.scenario).stat().st_size,
        "control_cycles.mean": control["mean"],
        "control_cycles.max": control["max"],
        "overruns": run.result["run"]["overruns"],
    }
    limits: Limits = {
        "bytes": (None, BUDGET_BYTES[phases, method]),
        "control_cycles.max": (None, work.ticks * tick_cycles),
        "overruns": (0, 0),
    }
    image = "all methods" if method is None else f"{method} with the CANopen node"
    conditions: dict[str, Condition] = {"image": image, "scenario": work.file, "tick_cycles": tick_cycles}
    return Row(f"{family}/images/{name}", conditions, values, limits)


@case("six-step/images")
def six_step(runner: Runner) -> Iterator[Row]:
    """Bytes and longest control step of the images that drive in six steps."""
    for can in (False, True):
        yield _row(runner, "six-step", SIX_STEP, can)


@case("vector/images")
def vector(runner: Runner) -> Iterator[Row]:
    """Bytes and longest control step of the images with vector control and injection."""
    for work, can in ((VECTOR, False), (VECTOR, True), (INJECTION, False)):
        yield _row(runner, "vector", work, can)


@case("five-phase/images")
def five_phase(runner: Runner) -> Iterator[Row]:
    """Bytes and longest control step of the image for five phases."""
    yield _row(runner, "five-phase", FIVE_PHASE, False)
