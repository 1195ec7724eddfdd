# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What happens to a salient machine of the population: a start by injection, a run to a target, friction on the shaft.

The drive knows the file. The machine that it drives is another one, as `injection_draw` says; it stands, turns already
or is blocked. A fault ends the life.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from fluxlock.config import Load, Motor, Scenario
from fluxlock.config.drive import Drive
from fluxlock.config.injection_rules import injection_loops
from fluxlock.config.inverter import Inverter
from fluxlock.config.scenario import Event
from fluxlock.cosim.parameters import refusals
from fluxlock.firmware.host import one_at_a_time
from fluxlock.native.injection_run import InjectionRun
from fluxlock.population.injection_draw import InjectionDraw, injection_ranges, parts
from fluxlock.theory.injection.choice import best, choices
from fluxlock.theory.injection.frequency import Rule, feasible

SEARCH_S = 0.5  # within which the search ends or says why not
RUN_S, RUN_CONSTANTS = 0.5, 25.0  # before the friction and after it, at least each; time constants of the speed loop


@dataclass(frozen=True)
class InjectionLife:
    """A drawn machine with what happens to it. scenario: the user's; machine: the true one."""

    draw: InjectionDraw
    scenario: Scenario
    machine: Motor
    load_nm: float
    unsettled: str  # why no amplitude and period suit; empty if some do

    @property
    def target_rpm(self) -> float:
        """Speed that the drive is to hold."""
        return float(round(self.draw.target * self.scenario.motor.max_speed_rpm))

    @property
    def run_s(self) -> float:
        """Time before the friction, and after it."""
        return max(RUN_S, RUN_CONSTANTS / (2 * math.pi * injection_loops(self.scenario).speed_hz))


def _settings(d: InjectionDraw, motor: Motor, inverter: Inverter) -> tuple[dict[str, Any], str]:
    """Period and amplitude as `fluxlock injection` prints them, and why there are none."""
    fastest_rpm = injection_ranges().target[1] * motor.max_speed_rpm
    most = feasible(Rule.from_motor(motor), d.carrier_hz, fastest_rpm, motor.pole_pairs).largest_n(strict=False)
    found = list(choices(motor, inverter, d.carrier_hz, most))
    taken = best(found)
    chosen = taken or found[0]
    keys = {"method": "iq", "period": chosen.period, "amplitude_v": float(f"{chosen.amplitude_v:.4g}")}
    return keys, "" if taken else chosen.refused


def injection_life(draw: InjectionDraw) -> InjectionLife:
    """The life of a machine."""
    p = parts(draw)
    keys, unsettled = _settings(draw, p.motor, p.inverter)
    target_rpm = float(round(draw.target * p.motor.max_speed_rpm))
    scenario = Scenario(
        name=f"population-injection-{draw.name}",
        description=f"Salient machine {draw.index} of the population with seed {draw.seed}",
        motor=p.motor,
        inverter=p.inverter,
        duration_s=2 * RUN_S + SEARCH_S,
        seed=draw.index,
        drive=Drive.model_validate(
            {
                "method": "vector",
                "carrier_hz": float(round(draw.carrier_hz)),
                "current_limit_a": p.current_limit_a,
                "start": {"restart_retries": 0},
                "vector": {"update": "single", "injection": keys},
            }
        ),
        load=p.load,
        event=[
            Event(at_s=0.01, command=f"set speed_rpm {target_rpm:.0f}"),
            Event(at_s=0.02, command="start"),
        ],
    )
    return InjectionLife(draw, scenario, p.machine, p.load_nm, unsettled)


def injection_refusals(life: InjectionLife) -> list[str]:
    """Why the life is refused before the start, as the file checks name it; empty if it is not."""
    if life.unsettled:
        return [life.unsettled]
    return refusals(life.scenario)


@one_at_a_time()
def play_injection(life: InjectionLife) -> InjectionRun:
    """Run a life on the host, until its end or a fault."""
    d, base_rpm = life.draw, life.scenario.motor.max_speed_rpm
    run = InjectionRun(
        life.scenario,
        theta_deg=d.theta_deg,
        target_rpm=life.target_rpm,
        machine=life.machine,
        seed=d.index,
        begun_rpm=d.turning * base_rpm,
    )
    if d.blocked:
        run.chip.imposed_rpm = 0.0
    if run.start(SEARCH_S):
        run.run(life.run_s)
        shaft = life.scenario.shaft_load
        friction = {"coulomb_nm": shaft.coulomb_nm + life.load_nm}
        run.chip.set_load(Load.model_validate(shaft.model_dump() | friction))
        run.run(life.run_s)
    return run
