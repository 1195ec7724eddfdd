# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A random salient machine that injection starts from standstill: its file, what the machine is, inverter, begin.

`InjectionDraw.of` takes every number from `injection.toml`. `parts` turns them into the models of the input files. The
machine differs from its file by resistance, both inductances, flux and inertia. The inverter is what a designer would
choose for the file, and so are amplitude and period of the wave: those that `fluxlock injection` prints.
"""

from __future__ import annotations

import functools
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.config.inverter import Inverter, Protection, Sensing
from fluxlock.config.motor import RPM_PER_RAD_S, Load, Motor
from fluxlock.population.draw import LIMIT_SHARE, RESERVE, SWITCH_SHARE, TRIP_SHARE, six_digits
from fluxlock.population.ranges import Span, Table

PATH = Path(__file__).with_name("injection.toml")
WAVE_SHARE = 0.5  # of the rated current, room for the wave below the trip
CLOCK_S = 20e-9
MIN_PULSE_S = 100e-9
BITS = 12  # of the chip; a converter of fewer has noise of one of its own


class OverFile(Table):
    """Machine over file: 1 plus or minus; inertia: least and most."""

    resistance: float
    inductance: float
    flux: float
    inertia: Span


class InjectionRanges(Table):
    """`injection.toml`."""

    five_phase_every: int
    power_w: Span
    supply_v: Span
    pole_pairs: tuple[int, int]
    base_hz: Span
    carrier_hz: Span
    resistance_pu: Span
    inductance_pu: Span
    saliency: Span
    linear_share: float
    saturation: Span
    saturation_minus: Span
    cross_deg: Span
    third: Span
    run_up_s: Span
    dead_time_s: Span
    bits: tuple[int, int]
    coulomb: Span
    viscous: Span
    target: Span
    load: float
    turning_share: float
    turning: float
    blocked_share: float
    over_file: OverFile


@functools.cache
def injection_ranges() -> InjectionRanges:
    """Of the file."""
    return InjectionRanges.model_validate(tomllib.loads(PATH.read_text(encoding="utf-8")))


@dataclass(frozen=True)
class MachineOver:
    """Factors: machine over file."""

    resistance: float
    inductance_d: float
    inductance_q: float
    flux: float
    inertia: float


@dataclass(frozen=True)
class InjectionDraw:
    """One machine in the quantities of `InjectionRanges`, of the file. turning: speed at the start over base speed."""

    seed: int
    index: int
    phases: int
    power_w: float
    supply_v: float
    pole_pairs: int
    base_hz: float
    carrier_hz: float
    resistance_pu: float
    inductance_pu: float
    saliency: float
    linear: bool
    saturation: float
    saturation_minus: float
    cross_deg: float
    third: float
    run_up_s: float
    dead_time_s: float
    bits: int
    coulomb: float
    viscous: float
    target: float
    turning: float
    blocked: bool
    theta_deg: float
    over: MachineOver

    @staticmethod
    def of(seed: int, index: int) -> InjectionDraw:
        """The machine with a number; equal on every host."""
        rng, r = np.random.default_rng(np.random.SeedSequence((seed, index))), injection_ranges()

        def spread(span: Span) -> float:
            """Log-uniform."""
            return float(np.exp(rng.uniform(*np.log(span))))

        def even(span: Span) -> float:
            return float(rng.uniform(*span))

        def about_one(share: float) -> float:
            return 1.0 + share * float(rng.uniform(-1.0, 1.0))

        def sign() -> float:
            return float(rng.choice((-1.0, 1.0)))

        low, high = r.pole_pairs
        begin = float(rng.uniform())
        turns = r.blocked_share <= begin < r.blocked_share + r.turning_share
        over = r.over_file
        return InjectionDraw(
            seed=seed,
            index=index,
            phases=5 if index % r.five_phase_every == r.five_phase_every - 1 else 3,
            power_w=spread(r.power_w),
            supply_v=spread(r.supply_v),
            pole_pairs=min(high, math.floor(spread((low, high + 1)))),
            base_hz=spread(r.base_hz),
            carrier_hz=spread(r.carrier_hz),
            resistance_pu=spread(r.resistance_pu),
            inductance_pu=spread(r.inductance_pu),
            saliency=spread(r.saliency),
            linear=bool(rng.uniform() < r.linear_share),
            saturation=even(r.saturation),
            saturation_minus=even(r.saturation_minus),
            cross_deg=even(r.cross_deg),
            third=even(r.third),
            run_up_s=spread(r.run_up_s),
            dead_time_s=even(r.dead_time_s),
            bits=int(rng.integers(r.bits[0], r.bits[1] + 1)),
            coulomb=even(r.coulomb),
            viscous=even(r.viscous),
            target=sign() * spread(r.target),
            turning=even((-r.turning, r.turning)) if turns else 0.0,
            blocked=begin < r.blocked_share,
            theta_deg=even((0.0, 360.0)),
            over=MachineOver(
                resistance=about_one(over.resistance),
                inductance_d=about_one(over.inductance),
                inductance_q=about_one(over.inductance),
                flux=about_one(over.flux),
                inertia=spread(over.inertia),
            ),
        )

    @property
    def name(self) -> str:
        """Of its files and its results."""
        return f"{self.seed}-{self.index}"


@dataclass(frozen=True)
class InjectionParts:
    """Models of the input files, and the machine that is not quite its file's. load_nm: friction put on later."""

    motor: Motor
    machine: Motor
    inverter: Inverter
    load: Load
    load_nm: float
    current_limit_a: float


def parts(d: InjectionDraw) -> InjectionParts:
    """In SI units."""
    omega = 2 * math.pi * d.base_hz
    # Line to line with three phases; with five the linear range reaches 1.05 of half the supply.
    linear = math.sqrt(3) if d.phases == 3 else 2 * math.cos(math.pi / 10)
    emf_v = d.supply_v / (RESERVE * linear * math.hypot(1 + d.resistance_pu, d.saliency * d.inductance_pu))
    rated_a = d.power_w / (d.phases / 2 * emf_v)
    ohm, l_d = d.resistance_pu * emf_v / rated_a, d.inductance_pu * emf_v / rated_a / omega
    psi, torque_nm = emf_v / omega, d.power_w * d.pole_pairs / omega
    keys: dict[str, Any] = {
        "name": f"Machine {d.name}",
        "description": f"{d.power_w:.3g} W, {d.supply_v:.3g} V, {d.pole_pairs} pole pairs, {d.base_hz:.3g} Hz",
        "phases": d.phases,
        "pole_pairs": d.pole_pairs,
        "resistance_ohm": six_digits(ohm * (1 - SWITCH_SHARE)),
        "inductance_h": six_digits(l_d),
        "inductance_q_h": six_digits(d.saliency * l_d),
        "psi_vs": six_digits(psi),
        "emf": "sinusoidal",
        "inertia_kgm2": six_digits(d.run_up_s * torque_nm * d.pole_pairs / omega),
        "rated_current_a": six_digits(rated_a),
        "max_speed_rpm": six_digits(omega / d.pole_pairs * RPM_PER_RAD_S),
    }
    if d.phases == 5:
        keys["third"] = {"inductance_d_h": six_digits(d.third * l_d), "inductance_q_h": six_digits(d.third * l_d)}
    if not d.linear:
        keys["saturation"] = {
            "current_a": six_digits(rated_a),
            "plus": -six_digits(d.saturation),
            "minus": six_digits(d.saturation * d.saturation_minus),
            "angle_rad": [0.0, -six_digits(math.radians(d.cross_deg) / rated_a)],
        }
    motor, over = Motor.model_validate(keys), d.over
    real = {
        "resistance_ohm": six_digits(motor.resistance_ohm[0] * over.resistance),
        "inductance_h": six_digits(motor.inductance_h[0] * over.inductance_d),
        "inductance_q_h": six_digits(d.saliency * l_d * over.inductance_q),
        "psi_vs": six_digits(psi * over.flux),
        "inertia_kgm2": six_digits(motor.inertia_kgm2 * over.inertia),
    }
    limit_a = six_digits(LIMIT_SHARE * rated_a)
    trip_a = six_digits(TRIP_SHARE * limit_a + WAVE_SHARE * rated_a)
    dead_s = round(d.dead_time_s / CLOCK_S) * CLOCK_S
    inverter = Inverter(
        name=f"Inverter {d.name}",
        legs=d.phases,
        supply_v=six_digits(d.supply_v),
        on_resistance_ohm=six_digits(ohm * SWITCH_SHARE),
        dead_time_s=six_digits(dead_s),
        min_pulse_s=six_digits(max(2 * dead_s, MIN_PULSE_S)),
        sensing=Sensing(
            noise_lsb=float(2 ** (BITS - d.bits)),
            sample_period_s=1e-6,
            voltage_full_scale_v=six_digits(1.3 * d.supply_v),
            current_full_scale_a=six_digits(1.1 * trip_a),
            divider_pole_s=100e-9,
        ),
        protection=Protection(phase_current_a=trip_a, dc_current_a=trip_a),
    )
    load = Load(
        viscous_nm_s_per_rad=six_digits(d.viscous * torque_nm * d.pole_pairs / omega),
        coulomb_nm=six_digits(d.coulomb * torque_nm),
    )
    machine = Motor.model_validate(keys | real)
    return InjectionParts(motor, machine, inverter, load, six_digits(injection_ranges().load * torque_nm), limit_a)
