# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Everything the command `soa` shows, for one motor and circuit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fluxlock.config.motor import Motor
from fluxlock.plant import InverterParams
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step import soa
from fluxlock.theory.six_step.freewheel import freewheel_angle_deg
from fluxlock.theory.six_step.machine import Machine
from fluxlock.theory.six_step.override import SampleTiming
from fluxlock.theory.six_step.patterns import Chopping, Commutation
from fluxlock.theory.six_step.switched import SteadyState

# All commutations of ON-PWM are of mode 1, of PWM-ON of mode 2; the other patterns mix them.
CHOPPINGS: tuple[Chopping, ...] = ("ON-PWM", "PWM-ON")
LOAD_SPEEDS = (0.25, 0.75)  # of the highest speed: 30 000 to 90 000 r/min of 120 000, as figure 4.13
FINE, COARSE = (121, 111), (21, 12)  # currents and speeds of the bound's map and of the simulated ones
LOAD_POINTS = 11


@dataclass(frozen=True)
class Settings:
    """What to look at: speeds up to speed_max_rpm, currents up to current_max_a; late_deg: latest commutation.

    commutation: how the gates of the periodic states (load lines, torque limits) follow the carrier. duties: points a
    speed between which the torque limits are interpolated.
    """

    speed_max_rpm: float
    current_max_a: float
    carrier_hz: float
    late_deg: float
    timing: SampleTiming
    simulate: bool = True
    commutation: Commutation = "NSC"
    duties: int = 33


@dataclass
class Study:
    """Maps, load lines and torque limits; supply_a: [s] current at duty 1; load_nm: [s] at the coarse speeds."""

    machine: Machine
    supply_v: float
    settings: Settings
    bound: soa.SafeMap
    supply_a: FloatArray
    coarse_rpm: FloatArray
    load_nm: FloatArray
    simulated: dict[Chopping, soa.SafeMap] = field(default_factory=dict)
    lines: dict[Chopping, list[SteadyState]] = field(default_factory=dict)
    limits: dict[Chopping, soa.TorqueLimits] = field(default_factory=dict)

    @property
    def current_limits_a(self) -> dict[str, FloatArray]:
        """Largest currents [s] by what limits them."""
        return {
            "bound_25_deg": self.bound.current_limit_a(soa.SAMPLED_DEG),
            "bound_30_deg": self.bound.current_limit_a(soa.VISIBLE_DEG),
            "bound_computed_back": self.bound.current_limit_a(self.bound.usable_deg),
            "supply": self.supply_a,
        }

    def line_bound_deg(self) -> FloatArray:
        """Upper bound at the largest commutation current of each point of the ON-PWM load line."""
        states = self.lines["ON-PWM"]
        omega = self.machine.omega_e(np.array([state.speed_rpm for state in states]))
        current = np.array([state.current_a.max() for state in states])
        return freewheel_angle_deg(self.machine, self.supply_v, omega, current)

    def document(self) -> dict[str, Any]:
        """All values with units in their names, for JSON."""
        timing = self.settings.timing
        return {
            "settings": {
                "motor": self.machine.name,
                "supply_v": self.supply_v,
                "carrier_hz": self.settings.carrier_hz,
                "commutation": self.settings.commutation,
                "duties": self.settings.duties,
                "late_deg": self.settings.late_deg,
                "settle_s": timing.settle_s,
                "sample_s": timing.period_s,
                "latency_s": timing.latency_s,
            },
            "speed_rpm": self.bound.speed_rpm,
            "current_a": self.bound.current_a,
            "bound_deg": self.bound.angle_deg,
            "current_limit_a": self.current_limits_a,
            "simulated": {
                chopping: {
                    "speed_rpm": safe.speed_rpm,
                    "current_a": safe.current_a,
                    "worst_deg": safe.angle_deg,
                    "limit_25_deg_a": safe.current_limit_a(soa.SAMPLED_DEG),
                    "limit_30_deg_a": safe.current_limit_a(soa.VISIBLE_DEG),
                    "limit_computed_back_a": safe.current_limit_a(safe.usable_deg),
                }
                for chopping, safe in self.simulated.items()
            },
            "load": {
                chopping: [
                    {
                        "speed_rpm": state.speed_rpm,
                        "torque_nm": state.torque_nm,
                        "duty": state.duty,
                        "current_a": [state.current_a.min(), state.current_a.max()],
                        "freewheel_deg": [state.freewheel_deg.min(), state.freewheel_deg.max()],
                    }
                    for state in states
                ]
                for chopping, states in self.lines.items()
            },
            "torque_limit_nm": {
                chopping: {
                    "speed_rpm": limit.speed_rpm,
                    "freewheel_25_deg": limit.sampled_nm,
                    "freewheel_30_deg": limit.visible_nm,
                    "computed_back": limit.recovered_nm,
                    "largest": limit.supply_nm,
                }
                for chopping, limit in self.limits.items()
            },
        }


def study(
    motor: Motor, circuit: InverterParams, settings: Settings, begin: Callable[[str], Callable[[float], None]]
) -> Study:
    """Compute everything; begin: see `output.Begin`."""
    machine = Machine.from_motor(motor)
    top, most, carrier_hz = settings.speed_max_rpm, settings.current_max_a, settings.carrier_hz
    speeds, currents = np.linspace(top / 12, top, FINE[1]), np.linspace(0.0, most, FINE[0])
    coarse_rpm, coarse_a = np.linspace(top / 12, top, COARSE[1]), np.linspace(0.0, most, COARSE[0])
    done = begin("bound (4.24)")
    result = Study(
        machine=machine,
        supply_v=circuit.supply_v,
        settings=settings,
        bound=soa.bound_map(
            machine,
            circuit.supply_v,
            speeds,
            currents,
            carrier_hz=carrier_hz,
            timing=settings.timing,
            late_deg=settings.late_deg,
        ),
        supply_a=soa.supply_current_a(machine, circuit.supply_v, speeds),
        coarse_rpm=coarse_rpm,
        load_nm=np.array([motor.load.torque_nm(float(speed)) for speed in coarse_rpm]),
    )
    done(1.0)
    for chopping in CHOPPINGS if settings.simulate else ():
        result.simulated[chopping] = soa.simulated_map(
            motor,
            circuit,
            coarse_rpm,
            coarse_a,
            chopping=chopping,
            carrier_hz=carrier_hz,
            timing=settings.timing,
            late_deg=settings.late_deg,
            progress=begin(f"single commutations, {chopping}"),
        )
        states = soa.load_line(
            motor,
            circuit,
            np.linspace(LOAD_SPEEDS[0] * top, LOAD_SPEEDS[1] * top, LOAD_POINTS),
            chopping=chopping,
            carrier_hz=carrier_hz,
            commutation=settings.commutation,
            progress=begin(f"load of the motor file, {chopping}"),
        )
        result.lines[chopping] = [state for state in states if state is not None]
        result.limits[chopping] = soa.torque_limits(
            motor,
            circuit,
            coarse_rpm,
            chopping=chopping,
            carrier_hz=carrier_hz,
            timing=settings.timing,
            commutation=settings.commutation,
            steps=settings.duties,
            progress=begin(f"largest torque, {chopping}"),
        )
    return result
