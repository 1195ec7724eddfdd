# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The sensorless current loop, sample by sample: machine, controller, observer and phase-locked loop.

Everything is relative to the true rotor at a given speed course, so that a steady operation is a fixed point: its
stability follows from the eigenvalues of the step.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.vector.controllers import GAMMA, Kind, gains
from fluxlock.theory.vector.model import (
    Coefficients,
    ComplexArray,
    Sampling,
    SmoothMachine,
    coefficients,
    emf,
    steady_voltage,
)
from fluxlock.theory.vector.observer import (
    POLES,
    Observer,
    SteadyState,
    detected_angle,
    observer_gains,
    steady_state,
)
from fluxlock.theory.vector.pll import LARGEST, Order, PllGains, pll_gains

DIFFERENCE = 1e-6  # of the numerical derivative


@dataclass(frozen=True)
class Drive:
    """What the loop is made of.

    sampling: of the plant; believed, believed_delay (of T_s): machine and delay of controller and observer, as the
    plant's without. current: reference (A) in the estimated frame. signed: the detector knows the sign of the speed.
    """

    machine: SmoothMachine
    sampling: Sampling
    current: complex
    pll: PllGains
    believed: SmoothMachine | None = None
    believed_delay: float | None = None
    kind: Kind = "C"
    gamma: float = GAMMA
    poles: tuple[complex, complex] = POLES
    signed: bool = True

    @classmethod
    def usual(cls, machine: SmoothMachine, sampling: Sampling, current: complex, bandwidth_hz: float = 100.0) -> Drive:
        """With a second-order loop of a bandwidth (Hz)."""
        return cls(machine, sampling, current, pll_gains(2, bandwidth_hz, sampling.ts_s))

    @property
    def model_of(self) -> SmoothMachine:
        """The machine that controller and observer believe in."""
        return self.believed or self.machine

    @property
    def timing_of(self) -> Sampling:
        """The sampling that they believe in."""
        return self.sampling if self.believed_delay is None else self.sampling.with_delay(self.believed_delay)


@dataclass
class State:
    """i (A) and u of the sample before (V) in the rotor's frame; the rest in the estimated one.

    error_rad: theta^ - theta; omega, accel: estimated (rad/s, rad/s^2).
    """

    i: complex
    u: complex
    error_rad: float
    omega: float
    accel: float = 0.0
    regulator_u: complex = 0j
    regulator_error: complex = 0j
    observer: Observer = field(default_factory=Observer)

    def vector(self) -> FloatArray:
        """All values in a row."""
        o = self.observer
        complex_ones = (self.i, self.u, self.regulator_u, self.regulator_error, o.i, o.e, o.u)
        parts = [part for z in complex_ones for part in (z.real, z.imag)]
        return np.array([*parts, self.error_rad, self.omega, self.accel])

    @classmethod
    def of(cls, values: FloatArray) -> State:
        """The state of such a row."""
        z = [complex(values[2 * k], values[2 * k + 1]) for k in range(7)]
        error_rad, omega, accel = (float(v) for v in values[14:17])
        return cls(z[0], z[1], error_rad, omega, accel, z[2], z[3], Observer(*z[4:7]))


def steady_start(drive: Drive, omega: float) -> State:
    """The operation of a drive whose estimate is right: reference current, its voltage, no angle error."""
    model, back = coefficients(drive.machine, omega, drive.sampling), complex(emf(drive.machine, omega))
    u = complex(steady_voltage(model, drive.current, back))
    return State(drive.current, u, 0.0, omega, 0.0, u, 0j, Observer(drive.current, back, u))


def step(drive: Drive, state: State, omega: float, accel: float = 0.0) -> State:
    """One sample: measure, regulate, observe, turn the frame. omega (rad/s) at the sample, accel (rad/s^2) in it."""
    ts = drive.sampling.ts_s
    seen = state.i * cmath.exp(-1j * state.error_rad)
    timing, believed = drive.timing_of, drive.model_of
    chosen = gains(drive.kind, believed, state.omega, timing, gamma=drive.gamma)
    wanted = drive.current - seen
    u_seen = state.regulator_u + chosen.g * wanted - chosen.h * state.regulator_error
    model = coefficients(believed, state.omega, timing)
    observer = replace(state.observer)
    eps = detected_angle(observer.e, state.omega if drive.signed else 1.0)
    observer.step(model, observer_gains(model, drive.poles), seen, u_seen)
    jump = drive.pll.a * eps
    observer.turn(jump)
    # The plant. The exact inverse Park is carried out with the estimated speed.
    mean = omega + accel * ts / 2
    lead = float(timing.lead_rad(state.omega)) - float(drive.sampling.lead_rad(mean))
    u = u_seen * cmath.exp(1j * (state.error_rad + lead))
    plant = coefficients(drive.machine, mean, drive.sampling)
    i = plant.phi * state.i + plant.gamma1 * u + plant.gamma2 * state.u + plant.gamma_e * emf(drive.machine, mean)
    return State(
        i=complex(i),
        u=u,
        error_rad=state.error_rad + (state.omega - mean) * ts + jump,
        omega=state.omega + ts * state.accel + drive.pll.b * eps,
        accel=state.accel + drive.pll.c * eps,
        regulator_u=u_seen,
        regulator_error=wanted,
        observer=observer,
    )


@dataclass(frozen=True)
class Course:
    """Samples: error_deg (theta^ - theta, unwrapped), estimated emf (V), true current (A), estimated omega (rad/s)."""

    error_deg: FloatArray
    emf: ComplexArray
    current: ComplexArray
    omega: FloatArray
    last: State


def simulate(
    drive: Drive,
    omega: float,
    samples: int,
    *,
    start: State | None = None,
    accel: Callable[[int], float] = lambda _: 0.0,
) -> Course:
    """Follow the loop from the right estimate, or from a state; the speed (rad/s) changes by accel(k) (rad/s^2)."""
    state = start or steady_start(drive, omega)
    error, emf_, current, speed = (np.empty(samples, dtype=d) for d in (float, complex, complex, float))
    for k in range(samples):
        error[k], emf_[k] = math.degrees(state.error_rad), state.observer.e
        current[k], speed[k] = state.i, state.omega
        state = step(drive, state, omega, accel(k))
        omega += accel(k) * drive.sampling.ts_s
    return Course(error, emf_, current, speed, state)


def _acting(drive: Drive, omega: npt.ArrayLike) -> Coefficients:
    """The machine with its own delay, and the lead of the inverse Park that the drive believes in."""
    true = coefficients(drive.machine, omega, replace(drive.sampling, park="held"))
    lead = np.exp(1j * drive.timing_of.lead_rad(omega))
    return replace(true, gamma1=true.gamma1 * lead, gamma2=true.gamma2 * lead)


def rest(drive: Drive, omega: npt.ArrayLike, current: npt.ArrayLike) -> SteadyState:
    """Where the loop rests, in closed form, at speeds (rad/s) and currents (A, estimated frame) that broadcast."""
    believed = coefficients(drive.model_of, omega, drive.timing_of)
    return steady_state(drive.machine, _acting(drive, omega), believed, omega, current)


def rest_state(drive: Drive, omega: float) -> State:
    """The state of the loop at rest; ValueError if there is none."""
    found = rest(drive, omega, drive.current)
    error = math.radians(float(found.error_deg))
    if math.isnan(error):
        raise ValueError(f"no rest at {omega:g} rad/s, {drive.current:g} A: the estimated EMF has no angle")
    turn = cmath.exp(1j * error)
    u = complex(steady_voltage(_acting(drive, omega), drive.current, emf(drive.machine, omega) / turn))
    lead = float(drive.timing_of.lead_rad(omega)) - float(drive.sampling.lead_rad(omega))
    observer = Observer(drive.current, complex(found.emf), u)
    return State(drive.current * turn, u * turn * cmath.exp(1j * lead), error, omega, 0.0, u, 0j, observer)


def eigenvalues(drive: Drive, omega: float) -> ComplexArray:
    """Eigenvalues of the step around the rest: the operation is stable if all lie inside the unit circle."""
    at = rest_state(drive, omega)
    centre = at.vector()
    size = np.concatenate([np.full(14, max(1.0, abs(at.i))), [1.0, max(1.0, abs(omega)), max(1.0, abs(omega))]])
    columns = []
    for k in range(centre.size):
        moved = []
        for sign in (1.0, -1.0):
            values = centre.copy()
            values[k] += sign * DIFFERENCE * size[k]
            moved.append(step(drive, State.of(values), omega).vector())
        columns.append((moved[0] - moved[1]) / (2.0 * DIFFERENCE * size[k]))
    jacobian = np.stack(columns, axis=1)
    if drive.pll.c == 0.0:  # the acceleration is no state of the second order
        jacobian = jacobian[:-1, :-1]
    return np.asarray(np.linalg.eigvals(jacobian).astype(np.complex128))


def bandwidth_limit_hz(drive: Drive, omega: float, order: Order, damping: float = 1.0) -> float:
    """Largest bandwidth (Hz) of the phase-locked loop with which small deviations fade, by bisection to 1 Hz.

    inf if it is above what `pll_gains` makes.
    """

    def stable(bandwidth_hz: float) -> bool:
        run = replace(drive, pll=pll_gains(order, bandwidth_hz, drive.sampling.ts_s, damping))
        return bool(np.abs(eigenvalues(run, omega)).max() < 1.0)

    low, high = 1.0, LARGEST / drive.sampling.ts_s
    if stable(high):
        return math.inf
    while high - low > 1.0:
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
