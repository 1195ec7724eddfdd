# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the sense chain of an inverter leaves in the commutations of a machine, and the pole that suits both.

Six-step, crossings of the open terminal, no load: duty = line EMF over supply. Angles are electrical, in degrees rms.
Slope of the open terminal at its crossing, V/rad, with E = psi omega: 3/2 E for a sinusoidal EMF, E over the ramp's
angle (rad) for a trapezoidal one (docs/theory/six-step.md).

- noise: sigma_v = step sqrt(noise_lsb^2 + 1/12), with half of it again from the link's channel. A crossing is the line
  through the means of n samples on each side, n = 4, 2 or 1 as pulses hold them: sigma_v / slope / sqrt(n) times
  sqrt(D/2 + (1 - D) 2/3), the mean over its place in a carrier with the duty D. The commutation half an interval later
  is 1.5 crossings less 0.5 of the one before: sqrt(2.5) of that.
- edges: the mean of what the first n samples of a pulse still hold of the last edge, rms over where the edge lies
  between two samples. A term h exp(lambda t) is behind the pole h (exp(lambda t) - exp(-t/tau)) / (1 + lambda tau); the
  open terminal's own jump leaves -J exp(-t/tau). Crossings in a gap take a share x in 0..1 of it, rms sqrt(1/3).
- lobe: what the end of the last pulse, (1 - D) T earlier, still leaves in these samples, h t / t_l exp(1 - t / t_l),
  late by the pole. Every crossing has it, and the commutation as much: with short gaps more than the edges.
- lag: the chip takes the pole's lag off. What resistors and capacitor are off by stays: omega tau tolerance.
- dividers: a gain that is off moves the threshold by half of the supply's share. It stays the same from turn to turn.
  `drive.zcd.balance` learns it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fluxlock.config import Inverter, Motor
from fluxlock.config.drive import Drive
from fluxlock.config.settling import OWN_JUMP, Settling, crossing_settling
from fluxlock.plant.edge_params import EdgeParams
from fluxlock.results.rundata import FloatArray

HALF_INTERVAL = math.sqrt(2.5)  # of a crossing's error: 1.5 of the last one less 0.5 of the one before
AGREED = 1.1  # of the least error: any pole within this is as good, the longest filters most that no file knows
LAG_MAX_RAD = math.radians(15.0)  # pole and settle time at the highest speed: half of the way to the commutation
SUPPLY_SHARE = 0.5  # of the supply: threshold of the open terminal
PLACES = 16  # of an edge between two samples
POLES_S = tuple(float(t) for t in np.geomspace(20e-9, 20e-6, 61))


@dataclass(frozen=True)
class Parts:
    """Tolerances of the divider's parts, as shares: both resistors alike."""

    resistor: float
    capacitor: float


@dataclass(frozen=True)
class Budget:
    """Errors of the commutations at one speed, deg el. rms; samples: that a crossing takes on each side."""

    speed_rpm: float
    samples: int
    noise_deg: float
    edges_deg: float
    lag_deg: float
    dividers_deg: float

    @property
    def total_deg(self) -> float:
        """With the dividers' gains learnt."""
        return math.sqrt(self.noise_deg**2 + self.edges_deg**2 + self.lag_deg**2)


@dataclass(frozen=True)
class Choice:
    """A pole of the dividers with what follows; stretched_rpm: below it the drive stretches its carriers.

    runs: a carrier holds the samples of a crossing, and the highest speed leaves them time.
    """

    pole_s: float
    settling: Settling
    stretched_rpm: float
    runs: bool
    budgets: tuple[Budget, ...]

    @property
    def worst_deg(self) -> float:
        """Largest error over the speeds."""
        return max(b.total_deg for b in self.budgets)


def slope_v_per_rad(motor: Motor, speed_rpm: float) -> float:
    """Of the open terminal at its crossing."""
    peak_v = sum(motor.psi_vs) / len(motor.psi_vs) * motor.omega_e(speed_rpm)
    if motor.emf == "sinusoidal":
        return 1.5 * peak_v
    return peak_v / math.radians((180.0 - motor.flat_top_deg) / 2)


def left_v(edge: EdgeParams | None, pole_s: float, jump_v: float, t_s: FloatArray) -> FloatArray:
    """What the open terminal's channel holds of a leg's jump and its own (V), t_s after the end of its slew."""
    pole = np.exp(-t_s / pole_s) if pole_s else np.zeros_like(t_s)
    total = -OWN_JUMP * jump_v * pole
    if edge is None:
        return total
    scale = (abs(edge.coupling) + OWN_JUMP * abs(edge.own)) * jump_v / edge.reference_v
    step, ring = -1 / (edge.step_tau_s or 1.0), complex(-1 / (edge.ring_tau_s or 1.0), 2 * math.pi * edge.ring_hz)
    for height_v, decay in ((edge.step_v, complex(step)), (edge.ring_v, ring)):
        if height_v:
            total = total + scale * height_v * ((np.exp(decay * t_s) - pole) / (1 + decay * pole_s)).real
    return total


def lobe_v(edge: EdgeParams | None, pole_s: float, jump_v: float, t_s: FloatArray) -> FloatArray:
    """What the open terminal's channel holds of the lobe (V), t_s after a switch has turned off; t_s above the pole."""
    if edge is None or not edge.lobe_v:
        return np.zeros_like(t_s)
    peaks = (t_s - pole_s) / edge.lobe_s
    return abs(edge.coupling) * edge.lobe_v * jump_v / edge.reference_v * peaks * np.exp(1.0 - peaks)


def budget(motor: Motor, inverter: Inverter, drive: Drive, speed_rpm: float, parts: Parts) -> Budget:
    """Errors at a speed above 0."""
    sensing, settling = inverter.sensing, crossing_settling(drive, inverter)
    omega, slope = motor.omega_e(speed_rpm), slope_v_per_rad(motor, speed_rpm)
    duty = min(1.0, motor.line_flux_vs * omega / inverter.supply_v)
    period_s = max(1.0 / drive.carrier_hz, settling.least_s / duty)
    a_pulse = 1 + math.floor((duty * period_s - settling.settle_s) / sensing.sample_period_s)
    held = max(1.0, a_pulse * LAG_MAX_RAD / omega / period_s)
    samples = 4 if held >= 4 else 2 if held >= 2 else 1
    one_deg = math.degrees(HALF_INTERVAL / slope)
    noise_v = math.sqrt(1.25) * sensing.step_v * math.hypot(sensing.noise_lsb, 1 / math.sqrt(12))
    place = math.sqrt((duty / 2 + (1 - duty) * 2 / 3) / samples)
    edge, pole_s = sensing.edge.params(sensing.current_full_scale_a), sensing.divider_pole_s
    # A row for each place of the edge between two samples.
    number = np.arange(min(samples, max(1, a_pulse))) + (np.arange(PLACES)[:, None] + 0.5) / PLACES
    late_s = settling.settle_s + sensing.sample_period_s * number - (0.0 if edge is None else edge.slew_s)
    rest_v = float(np.sqrt(np.mean(np.mean(left_v(edge, pole_s, inverter.supply_v, late_s), axis=1) ** 2)))
    gap_s = (1 - duty) * period_s
    lobe = float(np.mean(lobe_v(edge, pole_s, inverter.supply_v, gap_s + late_s))) if gap_s else 0.0
    lag = pole_s * math.hypot(math.sqrt(0.5) * parts.resistor, parts.capacitor)
    # Of a divider with a small ratio: its gain is off by both resistors, and so is the link's.
    gain = 2.0 * parts.resistor * SUPPLY_SHARE * inverter.supply_v
    return Budget(
        speed_rpm,
        samples,
        one_deg * noise_v * place,
        math.hypot(one_deg * rest_v * math.sqrt((1 - duty) / 3), math.degrees(lobe / slope)),
        math.degrees(omega * lag),
        one_deg * gain,
    )


def choose(
    motor: Motor, inverter: Inverter, drive: Drive, speeds_rpm: tuple[float, ...], parts: Parts
) -> tuple[Choice, list[Choice]]:
    """The present pole, and every one of POLES_S that can run at these speeds (ascending)."""
    omega, volts_per_rpm = motor.omega_e(speeds_rpm[-1]), motor.line_flux_vs * motor.omega_e(1.0)

    def at(pole_s: float) -> Choice:
        found = inverter.with_pole(pole_s)
        settling = crossing_settling(drive, found)
        held = settling.least_s * drive.carrier_hz
        runs = held <= 1.0 and omega * (pole_s + settling.settle_s) <= LAG_MAX_RAD
        budgets = tuple(budget(motor, found, drive, n, parts) for n in speeds_rpm)
        return Choice(pole_s, settling, held * inverter.supply_v / volts_per_rpm, runs, budgets)

    return at(inverter.sensing.divider_pole_s), [c for c in map(at, POLES_S) if c.runs]


def advised(now: Choice, runs: list[Choice]) -> Choice:
    """The longest pole within AGREED of the least worst error, of those that stretch no further carriers."""
    stretched_rpm = max(now.stretched_rpm, now.budgets[0].speed_rpm)
    quick = [c for c in runs if c.stretched_rpm <= stretched_rpm] or runs
    least = min(c.worst_deg for c in quick)
    return max((c for c in quick if c.worst_deg <= AGREED * least), key=lambda c: c.pole_s)
