# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Tables of the vector theory over speed, delay and parameters: what commands and figures share."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.vector.controllers import (
    GAMMA,
    KINDS,
    Kind,
    cross_peak,
    gains,
    settling_samples,
    step_response,
)
from fluxlock.theory.vector.frequency import (
    Loop,
    current_loop,
    gain_margin,
    phase_bandwidth,
    phase_margin_deg,
    tracking_bandwidth,
)
from fluxlock.theory.vector.model import ComplexArray, Park, Sampling, SmoothMachine, coefficients
from fluxlock.theory.vector.sensorless import Course, Drive, rest, simulate

FOLLOWED = 400  # samples of a step
DELAYS = (0.25, 0.5, 0.75, 1.0)
SPEEDS = (0.05, 0.1)  # f_e / f_s
# (T_d, T'_d) over T_s
DELAY_PAIRS = ((0.25, 0.0), (0.5, 0.0), (0.75, 0.0), (0.75, 1.0), (0.5, 1.0), (0.25, 1.0))


@dataclass(frozen=True)
class Bench:
    """Machine, sample frequency (Hz) and inverse Park of a study."""

    machine: SmoothMachine
    fs_hz: float = 15e3
    park: Park = "held"

    def sampling(self, delay: float) -> Sampling:
        """At a delay over T_s."""
        return Sampling.at(self.fs_hz, delay, self.park)

    def omega(self, speed: float) -> float:
        """Electrical speed (rad/s) of a speed over f_s."""
        return 2.0 * math.pi * speed * self.fs_hz

    def loop(self, kind: Kind, speed: float, delay: float, gamma: float = GAMMA) -> Loop:
        """The current loop."""
        omega, sampling = self.omega(speed), self.sampling(delay)
        chosen = gains(kind, self.machine, omega, sampling, gamma=gamma)
        return current_loop(coefficients(self.machine, omega, sampling), chosen)

    def step(
        self, kind: Kind, speed: float, delay: float, samples: int = FOLLOWED, gamma: float = GAMMA
    ) -> ComplexArray:
        """Current after a step of 1 A of the d reference."""
        omega, sampling = self.omega(speed), self.sampling(delay)
        chosen = gains(kind, self.machine, omega, sampling, gamma=gamma)
        return step_response(coefficients(self.machine, omega, sampling), chosen, samples)


@dataclass(frozen=True)
class Step:
    """Peak of |i_q| (per cent of an i_d step), overshoot of i_d (per cent) and settling to 5 % (samples; -1: none)."""

    kind: Kind
    speed: float
    delay: float
    peak_percent: float
    overshoot_percent: float
    settling: int


def steps(bench: Bench, speeds: tuple[float, ...] = SPEEDS, delays: tuple[float, ...] = DELAYS) -> list[Step]:
    """Steps of all controllers at speeds over f_s and delays over T_s; an unstable loop has no numbers."""
    found = []
    for speed in speeds:
        for delay in delays:
            for kind in KINDS:
                if not bench.loop(kind, speed, delay).stable:
                    found.append(Step(kind, speed, delay, math.nan, math.nan, -1))
                    continue
                response = bench.step(kind, speed, delay)
                try:
                    settling = settling_samples(response)
                except ValueError:
                    settling = -1
                peak, over = 100.0 * cross_peak(response), 100.0 * (float(response.real.max()) - 1.0)
                found.append(Step(kind, speed, delay, peak, max(0.0, over), settling))
    return found


@dataclass(frozen=True)
class Bandwidth:
    """Bandwidths (Hz) by the 90 degree rule and by -3 dB of P, phase margin (deg), gain margin (factor)."""

    delay: float
    gamma: float
    phase_hz: float
    minus_3db_hz: float
    phase_margin_deg: float
    gain_margin: float


def bandwidths(
    bench: Bench, kind: Kind, speed: float, delays: tuple[float, ...], gammas: tuple[float, ...]
) -> list[Bandwidth]:
    """Bandwidth and margins at a speed over f_s."""
    found = []
    for delay in delays:
        for gamma in gammas:
            loop = bench.loop(kind, speed, delay, gamma)
            hz = (bench.fs_hz * phase_bandwidth(loop), bench.fs_hz * tracking_bandwidth(loop))
            found.append(Bandwidth(delay, gamma, *hz, phase_margin_deg(loop), gain_margin(loop)))
    return found


@dataclass(frozen=True)
class DelayError:
    """Steady angle error (deg) of an observer that believes in another delay, in closed form and followed in time."""

    speed: float
    delay: float
    believed: float
    closed_deg: float
    simulated_deg: float


def delay_course(bench: Bench, speed: float, delay: float, believed: float, current_a: float, samples: int) -> Course:
    """The loop from the right estimate on; current_a: on q along the motion, speed over f_s, signed."""
    return simulate(delay_drive(bench, speed, delay, believed, current_a), bench.omega(speed), samples)


def delay_drive(bench: Bench, speed: float, delay: float, believed: float, current_a: float) -> Drive:
    """Motor drive whose observer and controller believe in another delay."""
    current = complex(0.0, math.copysign(current_a, speed))
    return replace(Drive.usual(bench.machine, bench.sampling(delay), current), believed_delay=believed)


def delay_errors(
    bench: Bench,
    current_a: float,
    speeds: tuple[float, ...] = SPEEDS,
    pairs: tuple[tuple[float, float], ...] = DELAY_PAIRS,
    samples: int = 800,
) -> list[DelayError]:
    """Errors over speeds (over f_s, signed) and pairs of delays (T_d, T'_d over T_s)."""
    found = []
    for speed in speeds:
        for delay, believed in pairs:
            drive = delay_drive(bench, speed, delay, believed, current_a)
            closed = float(rest(drive, bench.omega(speed), drive.current).error_deg)
            course = simulate(drive, bench.omega(speed), samples)
            found.append(DelayError(speed, delay, believed, closed, float(course.error_deg[-1])))
    return found


def speed_range(highest_hz: float, points: int = 41) -> FloatArray:
    """Speeds (Hz) from a twentieth of the highest to it."""
    return np.linspace(highest_hz / 20.0, highest_hz, points)
