# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A random machine, its inverter, its load and the errors of its motor file, from a seed and an index.

`Draw.of` takes every number from `ranges`, the same for both methods. `parts` turns them into the models of the
input files. The inverter is what a designer would choose for the machine: `RESERVE` of voltage, a current limit of
`LIMIT_SHARE` times the rated current, and full scales and trips that leave room for the ripple.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fluxlock.config.drive import MotorError
from fluxlock.config.inverter import Inverter, Protection, Sensing
from fluxlock.config.motor import RPM_PER_RAD_S, Load, Motor
from fluxlock.population.ranges import Span, ranges

Method = Literal["six-step", "vector"]
METHODS: tuple[Method, ...] = ("six-step", "vector")
Population = Literal["six-step", "vector", "injection"]
POPULATIONS: tuple[Population, ...] = (*METHODS, "injection")

# Least supply voltage for base speed and rated torque -> supply voltage: file errors and regulation take of it.
RESERVE = 1.15
LIMIT_SHARE = 1.5
TRIP_SHARE = 1.6  # of the limit, beside half the ripple
# A converter that fits: carriers a sector at base speed, and the frequencies that chip and power stage reach.
CARRIERS_MOST, CARRIER_HZ = 20.0, (8e3, 45e3)
# Peak to peak over the rated current, where the carrier can be that high. A six-step commutation cuts a pulse: what is
# left of the ripple then drives the rotor.
RIPPLE_WANTED = {"vector": 1.0, "six-step": 0.25}
DEAD_TIME_SHARE, DEAD_TIME_S = 0.005, (100e-9, 1e-6)  # of a carrier
SWITCH_SHARE = 0.05  # of the resistance
# Full load at base speed over rated torque; the load that remains when it is taken off, over the full one.
LOAD_SHARE, LIGHT_SHARE = (0.5, 1.0), (0.02, 0.2)
SALIENT_SHARE = 0.5  # of the machines; the phases of the others have unequal inductances too

Phases = tuple[float, float, float]


@dataclass(frozen=True)
class Draw:
    """One machine in the quantities of `Ranges`. error: file over machine; load: shares of fan, viscous, Coulomb."""

    seed: int
    index: int
    power_w: float
    supply_v: float
    pole_pairs: int
    base_hz: float
    carriers: float
    resistance_pu: float
    inductance_pu: float
    emf: Literal["sinusoidal", "trapezoidal"]
    saliency: float
    unequal: tuple[Phases, Phases, Phases]
    run_up_s: float
    error: MotorError
    load: Phases
    light: float
    theta_deg: float

    @staticmethod
    def of(seed: int, index: int) -> Draw:
        """The machine with a number; equal on every host."""
        rng, r = np.random.default_rng(np.random.SeedSequence((seed, index))), ranges()

        def spread(span: Span) -> float:
            """Log-uniform."""
            return float(np.exp(rng.uniform(*np.log(span))))

        def even(span: Span) -> float:
            return float(rng.uniform(*span))

        def about_one(share: float) -> float:
            return six_digits(1.0 + share * float(rng.uniform(-1.0, 1.0)))

        def phases() -> Phases:
            return (about_one(r.phases_unequal), about_one(r.phases_unequal), about_one(r.phases_unequal))

        power_w, supply_v = spread(r.power_w), spread(r.supply_v)
        low, high = r.pole_pairs
        pairs = min(high, math.floor(spread((low, high + 1))))
        base_hz, carriers = spread(r.base_hz), spread((r.carriers_per_sector_min, CARRIERS_MOST))
        resistance_pu, inductance_pu = spread(r.resistance_pu), spread(r.inductance_pu)
        emf, saliency = str(rng.choice(r.emf)), even(r.saliency)
        salient = rng.uniform() < SALIENT_SHARE
        unequal = (phases(), phases(), phases())
        run_up_s, error = spread(r.run_up_s), r.file_error
        return Draw(
            seed=seed,
            index=index,
            power_w=power_w,
            supply_v=supply_v,
            pole_pairs=pairs,
            base_hz=base_hz,
            carriers=carriers,
            resistance_pu=resistance_pu,
            inductance_pu=inductance_pu,
            emf="trapezoidal" if emf == "trapezoidal" else "sinusoidal",
            saliency=saliency if salient else 1.0,
            unequal=unequal,
            run_up_s=run_up_s,
            error=MotorError(
                resistance=about_one(error.resistance),
                inductance=about_one(error.inductance),
                flux=about_one(error.flux),
                inertia=about_one(error.inertia),
            ),
            load=_load_parts(rng, even(LOAD_SHARE)),
            light=spread(LIGHT_SHARE),
            theta_deg=six_digits(even((-180.0, 180.0))),
        )

    @property
    def name(self) -> str:
        """Of its files and its results."""
        return f"{self.seed}-{self.index}"


def _load_parts(rng: np.random.Generator, total: float) -> Phases:
    fan, viscous, coulomb = (float(total * x) for x in rng.dirichlet((1.0, 1.0, 1.0)))
    return fan, viscous, coulomb


@dataclass(frozen=True)
class Parts:
    """Models of the input files. load: the light one; full_factor: the full one over it; base_rpm: highest speed."""

    motor: Motor
    inverter: Inverter
    load: Load
    full_factor: float
    carrier_hz: float
    current_limit_a: float

    @property
    def base_rpm(self) -> float:
        """Highest speed."""
        return self.motor.max_speed_rpm


def _carrier_hz(d: Draw, method: Method) -> float:
    """As many carriers as were drawn, more for a small ripple, within what chip and power stage reach."""
    least_hz = 6 * d.base_hz * ranges().carriers_per_sector_min
    # Largest ripple p-p of two phases in series: vdc T / (4 * 2 L), with vdc about 3.5 times the EMF.
    quiet_hz = 3.5 * 2 * math.pi * d.base_hz / (8 * d.inductance_pu * RIPPLE_WANTED[method])
    wanted_hz = max(6 * d.base_hz * d.carriers, quiet_hz, CARRIER_HZ[0])
    return float(round(max(least_hz, min(wanted_hz, CARRIER_HZ[1]))))


def usual_dead_time_s(carrier_hz: float) -> float:
    """A share of the carrier, within what gate drivers have; whole clocks of 50 MHz."""
    return math.ceil(min(max(DEAD_TIME_SHARE / carrier_hz, DEAD_TIME_S[0]), DEAD_TIME_S[1]) * 50e6) / 50e6


def stage(name: str, supply_v: float, switch_ohm: float, dead_s: float, trip_a: float) -> Inverter:
    """An inverter with full scales just above its supply and its trips."""
    return Inverter(
        name=name,
        supply_v=supply_v,
        on_resistance_ohm=six_digits(switch_ohm),
        dead_time_s=dead_s,
        min_pulse_s=2 * dead_s,
        sensing=Sensing(
            sample_period_s=1e-6,
            voltage_full_scale_v=six_digits(1.3 * supply_v),
            current_full_scale_a=six_digits(1.1 * trip_a),
            divider_pole_s=100e-9,
        ),
        protection=Protection(phase_current_a=six_digits(trip_a), dc_current_a=six_digits(trip_a)),
    )


def parts(d: Draw, method: Method) -> Parts:
    """Machine, inverter and load in SI units, for a method: it decides how much EMF the supply's voltage allows."""
    carrier_hz = _carrier_hz(d, method)
    dead_s = usual_dead_time_s(carrier_hz)
    omega = 2 * math.pi * d.base_hz
    fundamental = 4 * math.sin(math.pi / 6) / (math.pi * math.pi / 6) if d.emf == "trapezoidal" else 1.0
    l_d = 2 * d.inductance_pu / (1 + d.saliency)
    l_q = d.saliency * l_d
    # Supply voltage over the EMF's fundamental at base speed and rated torque; current of the method over the
    # amplitude of the phase currents.
    if method == "vector":
        ratio, shape = math.sqrt(3) * math.hypot(1 + d.resistance_pu, l_q), 1.0
        ratio /= 1 - 2 * 3 * dead_s * carrier_hz
    else:
        line = 2 / fundamental if d.emf == "trapezoidal" else 3 * math.sqrt(3) / math.pi
        shape = 1.5 / line
        ratio = line + shape * (2 * d.resistance_pu + 3 / math.pi * d.inductance_pu)
    emf_v = d.supply_v / (RESERVE * ratio)
    amplitude_a = d.power_w / (1.5 * emf_v)
    ohm = d.resistance_pu * emf_v / amplitude_a
    henry = emf_v / amplitude_a / omega
    psi = emf_v / omega / fundamental
    torque_nm = d.power_w * d.pole_pairs / omega
    ohm_shares, henry_shares, flux_shares = d.unequal
    salient = d.saliency > 1.0

    def of_phases(value: float, factors: Phases) -> Phases:
        a, b, c = factors
        return (six_digits(value * a), six_digits(value * b), six_digits(value * c))

    motor = Motor(
        name=f"Machine {d.name}",
        description=f"{d.power_w:.3g} W, {d.supply_v:.3g} V, {d.pole_pairs} pole pairs, {d.base_hz:.3g} Hz",
        pole_pairs=d.pole_pairs,
        resistance_ohm=of_phases(ohm * (1 - SWITCH_SHARE), ohm_shares),
        inductance_h=of_phases(henry * l_d, (1.0, 1.0, 1.0) if salient else henry_shares),
        inductance_q_h=six_digits(henry * l_q) if salient else None,
        psi_vs=of_phases(psi, flux_shares),
        emf=d.emf,
        inertia_kgm2=six_digits(d.run_up_s * torque_nm * d.pole_pairs / omega),
        rated_current_a=six_digits(amplitude_a),
        max_speed_rpm=six_digits(omega / d.pole_pairs * RPM_PER_RAD_S),
    )
    limit_a = six_digits(LIMIT_SHARE * shape * amplitude_a)
    ripple_a = d.supply_v / (8 * min(motor.inductance_h) * carrier_hz)
    trip_a = TRIP_SHARE * limit_a + ripple_a / 2
    supply_v = six_digits(d.supply_v)
    inverter = stage(f"Inverter {d.name}", supply_v, ohm * SWITCH_SHARE, dead_s, trip_a)
    fan, viscous, coulomb = (share * d.light * torque_nm for share in d.load)
    load = Load(
        fan_torque_nm=six_digits(fan),
        fan_speed_rpm=motor.max_speed_rpm,
        viscous_nm_s_per_rad=six_digits(viscous * d.pole_pairs / omega),
        coulomb_nm=six_digits(coulomb),
    )
    return Parts(motor, inverter, load, six_digits(1 / d.light), carrier_hz, limit_a)


def six_digits(value: float) -> float:
    """Six digits: a file says the same as the model."""
    return float(f"{value:.6g}")
