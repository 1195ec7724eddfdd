# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Square-wave injection from voltage to angle in floating point: machine, demodulators, angle sequences, closed forms.

Sources: B. Tian, Q.-T. An, M. Molinas, IEEE Access 2019 (sign-based lock-in); K. Yu, Z. Wang, L. Li, Energies 2022
(filterless separation, time sequences). Vectors are complex, d + jq; angles electrical, rad. Errors are
theta - theta_hat, as in Yu. Sample m is taken at m T_s; the voltage on <m-1, m> was computed with the estimate after
sample m - 2.
"""

from __future__ import annotations

import cmath
import math
from collections import deque
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np

Sequence = Literal["held", "half-step", "exact"]
SEQUENCES: tuple[Sequence, ...] = ("held", "half-step", "exact")


@dataclass(frozen=True)
class HfMachine:
    """Subspace 1 of a machine for small signals: r_ohm (0 allowed), inductances in H (above 0, L_q above L_d)."""

    r_ohm: float
    ld_h: float
    lq_h: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.r_ohm < math.inf:
            raise ValueError(f"r_ohm = {self.r_ohm:g}: must be finite and at least 0")
        if not 0.0 < self.ld_h < self.lq_h < math.inf:
            raise ValueError(f"ld_h = {self.ld_h:g}, lq_h = {self.lq_h:g}: must be above 0, lq_h above ld_h")

    @property
    def sum_h(self) -> float:
        """L_d + L_q."""
        return self.ld_h + self.lq_h

    @property
    def difference_h(self) -> float:
        """L_q - L_d."""
        return self.lq_h - self.ld_h

    def phasors(self, omega: float, omega_h: float, angle: float) -> tuple[complex, complex]:
        """Currents d, q (A a V) at omega_h for a voltage at `angle` to the rotor, which turns with omega (rad/s)."""
        z = np.array(
            [
                [self.r_ohm + 1j * omega_h * self.ld_h, -omega * self.lq_h],
                [omega * self.ld_h, self.r_ohm + 1j * omega_h * self.lq_h],
            ]
        )
        d, q = np.linalg.solve(z, np.array([math.cos(angle), math.sin(angle)], dtype=np.complex128))
        return complex(d), complex(q)


@dataclass(frozen=True)
class Injection:
    """Square wave of amplitude u_v and `period` samples (even) at sample period ts_s; it begins a quarter on."""

    u_v: float
    period: int
    ts_s: float

    def __post_init__(self) -> None:
        if self.period < 4 or self.period % 4:
            raise ValueError(f"period = {self.period}: must be a multiple of 4 samples")

    @property
    def omega_h(self) -> float:
        """Angular frequency (rad/s)."""
        return 2 * math.pi / (self.period * self.ts_s)

    def voltage(self, m: int) -> float:
        """Voltage on <m-1, m>; 0 before sample 1."""
        if m < 1:
            return 0.0
        return self.u_v if (m - 1 + self.period // 4) % self.period < self.period // 2 else -self.u_v

    def phase(self, m: int) -> int:
        """Phase of sample m: that of the voltage whose effect ends there."""
        return (m - 1 + self.period // 4) % self.period

    def angle(self, m: float) -> float:
        """Angle of the wave at sample m, 0 at its rising edge (rad)."""
        return 2 * math.pi * ((m + self.period / 4) / self.period % 1.0)


class HfCurrent(Protocol):
    """HF current of the machine."""

    def step(self, u_v: float, angle: float, theta: float) -> complex:
        """Current in the rotor's frame at theta, after u_v at the stationary `angle` for a sample period."""
        ...


@dataclass
class ExactHfCurrent:
    """Exact solution for a rotor turning with omega: resistance, rotation of the frame within the interval."""

    machine: HfMachine
    omega: float
    ts_s: float
    flux: complex = 0j

    def __post_init__(self) -> None:
        m, w = self.machine, self.omega
        # d, q flux and the voltage's direction, which turns backwards in the rotor's frame.
        a = np.array(
            [
                [-m.r_ohm / m.ld_h, w, 1.0, 0.0],
                [-w, -m.r_ohm / m.lq_h, 0.0, 1.0],
                [0.0, 0.0, 0.0, w],
                [0.0, 0.0, -w, 0.0],
            ]
        )
        step = a * (self.ts_s / 64)
        phi = np.eye(4)
        term = np.eye(4)
        for n in range(1, 12):
            term = term @ step / n
            phi += term
        self._phi = np.linalg.matrix_power(phi, 64)

    def step(self, u_v: float, angle: float, theta: float) -> complex:
        """See HfCurrent."""
        begin = angle - (theta - self.omega * self.ts_s)
        state = np.array([self.flux.real, self.flux.imag, u_v * math.cos(begin), u_v * math.sin(begin)])
        d, q = (self._phi @ state)[:2]
        self.flux = complex(d, q)
        return complex(d / self.machine.ld_h, q / self.machine.lq_h)


@dataclass
class AnalyticHfCurrent:
    """The formula behind the closed forms for the pattern ++--: at a peak T_s U [cos a / Ld, sin a / Lq], else 0.

    a is the angle of the voltage to the rotor in the middle of the interval.
    """

    machine: HfMachine
    omega: float
    ts_s: float
    last_v: float = 0.0

    def step(self, u_v: float, angle: float, theta: float) -> complex:
        """See HfCurrent."""
        peak, self.last_v = u_v == self.last_v, u_v
        if not peak:
            return 0j
        a = angle - theta + self.omega * self.ts_s / 2
        volt_seconds = self.ts_s * u_v
        return complex(volt_seconds * math.cos(a) / self.machine.ld_h, volt_seconds * math.sin(a) / self.machine.lq_h)


@dataclass
class Biquad:
    """Second-order section by the bilinear transform with f0 in its place: band-pass (1 at f0) or low-pass (1 at 0)."""

    kind: Literal["band", "low"]
    f0_hz: float
    fs_hz: float
    k: float
    _w1: complex = 0j
    _w2: complex = 0j

    def __post_init__(self) -> None:
        if not 0.0 < self.f0_hz < self.fs_hz / 2:
            raise ValueError(f"f0_hz = {self.f0_hz:g}: must be above 0 and below fs_hz / 2 = {self.fs_hz / 2:g}")
        g = math.tan(math.pi * self.f0_hz / self.fs_hz)
        norm = 1 + g * (g + self.k)
        self._a1, self._a2 = 2 * (g * g - 1) / norm, (1 - g * self.k + g * g) / norm
        b0 = (self.k * g if self.kind == "band" else g * g) / norm
        self._b0, self._b1, self._b2 = (b0, 0.0, -b0) if self.kind == "band" else (b0, 2 * b0, b0)

    def step(self, x: complex) -> complex:
        """Filter both axes of a vector."""
        y = self._b0 * x + self._w1
        self._w1 = self._b1 * x - self._a1 * y + self._w2
        self._w2 = self._b2 * x - self._a2 * y
        return y


class Demodulator(Protocol):
    """From the current in the estimated frame to the angle error."""

    def step(self, current: complex, phase: int, angle: float) -> float | None:
        """Error theta - theta_hat (rad), or None if this sample brings no new one."""
        ...


@dataclass
class LockIn:
    """Band-pass, product with sign(I_dh) or with sin(angle - lag), low-pass, error normalised by the d axis.

    k_band, k_low: 1/Q of the filters. lag_rad None: sign-based.
    """

    machine: HfMachine
    fs_hz: float
    f0_hz: float
    low_hz: float = 51.5
    k_band: float = 0.45
    k_low: float = math.sqrt(2)
    lag_rad: float | None = None
    hf: complex = 0j
    error: float = 0.0
    magnitude: float = 0.0

    def __post_init__(self) -> None:
        self._band = Biquad("band", self.f0_hz, self.fs_hz, self.k_band)
        self._low = Biquad("low", self.low_hz, self.fs_hz, self.k_low)

    def step(self, current: complex, phase: int, angle: float) -> float | None:
        """See Demodulator; the error is 0 as long as there is no amplitude."""
        self.hf = self._band.step(current)
        reference = float(np.sign(self.hf.real)) if self.lag_rad is None else math.sin(angle - self.lag_rad)
        low = self._low.step(self.hf * reference)
        self.magnitude, self.error = low.real, low.imag
        if abs(self.magnitude) < 1e-6:
            return 0.0
        return self.error / self.magnitude * self.machine.lq_h / self.machine.difference_h


@dataclass
class IqDemodulator:
    """Sums of whole periods against exp(-j angle), and the error whose imaginary part has no speed term."""

    machine: HfMachine
    injection: Injection
    _last: int = -1
    _known: bool = False
    _sum_d: complex = 0j
    _sum_q: complex = 0j

    def step(self, current: complex, phase: int, angle: float) -> float | None:
        """See Demodulator; a result at the first sample of the next period."""
        result = None
        if phase < self._last:
            if self._known:
                z = self.machine.r_ohm + 1j * self.injection.omega_h * self.machine.lq_h
                x = self._sum_q / self._sum_d * z
                result = x.imag / (self.injection.omega_h * self.machine.difference_h)
            self._known, self._sum_d, self._sum_q = True, 0j, 0j
        self._last = phase
        kernel = cmath.exp(-1j * angle)
        self._sum_d += current.real * kernel
        self._sum_q += current.imag * kernel
        return result


@dataclass
class Separator:
    """Yu's four samples: HF current between two zero crossings, normalised by K_norm."""

    machine: HfMachine
    injection: Injection
    amplitude: complex = 0j
    fundamental: complex = 0j
    _samples: deque[complex] = field(default_factory=lambda: deque(maxlen=3))

    def step(self, current: complex, phase: int, angle: float) -> float | None:
        """See Demodulator; a result at every zero crossing."""
        self._samples.append(current)
        if phase % 2:
            return None
        self.fundamental = current
        if len(self._samples) < 3:
            return None
        before, peak, after = self._samples
        self.amplitude = (peak - (before + after) / 2) * (1 if phase == 2 else -1)
        m, i = self.machine, self.injection
        t_h = i.period * i.ts_s
        return self.amplitude.imag * 4 * m.ld_h * m.lq_h / (t_h * i.u_v * m.difference_h)


@dataclass(frozen=True)
class Pll:
    """PI of the phase-locked loop on the error in rad: kp (1/s), ki (1/s^2)."""

    kp: float
    ki: float


@dataclass(frozen=True)
class Track:
    """Result of a run: error theta - theta_hat (rad) at each sample of the second half."""

    error: np.ndarray[tuple[int], np.dtype[np.float64]]

    @property
    def mean(self) -> float:
        """Mean error (rad)."""
        return float(np.mean(self.error))


def track(
    current: HfCurrent,
    demodulator: Demodulator,
    injection: Injection,
    pll: Pll,
    *,
    omega: float,
    sequence: Sequence,
    seconds: float,
    fundamental: complex = 0j,
    initial_error: float = 0.0,
) -> Track:
    """Close the loop at the imposed speed omega (electrical rad/s), loop and speed settled at the start.

    fundamental: constant current (A) in the rotor's frame that the machine carries besides.
    """
    if sequence not in SEQUENCES:
        raise ValueError(f"sequence = {sequence!r}: must be one of {', '.join(SEQUENCES)}")
    ts = injection.ts_s
    steps = int(seconds / ts)
    estimate, speed, epsilon = -initial_error, omega, 0.0
    before = estimate - omega * ts  # the estimate one sample older
    angles = deque([estimate, estimate], maxlen=2)  # of the voltages on <m-1, m> and <m, m+1>
    errors = np.zeros(steps)
    for m in range(steps):
        theta = omega * ts * m
        rotor = current.step(injection.voltage(m), angles[0], theta) + fundamental
        park = before + 0.5 * speed * ts if sequence == "half-step" else estimate
        seen = rotor * cmath.exp(1j * (theta - park))
        found = demodulator.step(seen, injection.phase(m), injection.angle(m))
        epsilon = epsilon if found is None else found
        if sequence == "exact":
            errors[m] = theta - estimate
        speed += pll.ki * epsilon * ts
        before, estimate = estimate, estimate + (speed + pll.kp * epsilon) * ts
        if sequence != "exact":
            errors[m] = theta - estimate
        angles.append(estimate + (0.5 * speed * ts if sequence == "exact" else 0.0))
    return Track(errors[steps // 2 :])


def settled_error(machine: HfMachine, delta: float, sequence: Sequence) -> float:
    """Yu's error theta - theta_hat (rad) at rest of the loop, delta = omega T_s, resistance neglected.

    Raises ValueError where the held sequence has none.
    """
    if sequence == "exact":
        return 0.0
    if sequence == "half-step":
        return -1.5 * delta
    x = machine.sum_h / machine.difference_h * math.sin(delta / 2)
    if abs(x) > 1:
        raise ValueError(f"delta = {delta:g}: the held sequence does not settle, (L_sum / L_dif) sin(delta/2) above 1")
    return -1.25 * delta + 0.5 * math.asin(x)


def settled_lock_in_error(
    machine: HfMachine, injection: Injection, omega: float, sequence: Sequence, k_band: float = 0.45
) -> float:
    """Error theta - theta_hat (rad) of the sign-based lock-in, from phasors: resistance, speed and sampling included.

    The root of the mean of h_q sign(h_d) over the samples of an injection period, nearest to that of settled_error;
    harmonics of the square wave up to 99.
    """
    delta = omega * injection.ts_s
    n = injection.period
    g = math.tan(math.pi / n)
    samples = np.arange(n)
    waves = []
    for h in range(1, 100, 2):
        s = 1j * math.tan(math.pi * h / n) / g if h % n != n // 2 else 1j * 1e12
        band = k_band * s / (s * s + k_band * s + 1)
        wave = 4 / math.pi / h * -1j * np.exp(1j * h * 2 * math.pi * (samples / n + 0.25))
        waves.append((h * injection.omega_h, band * wave))

    def product(error: float) -> float:
        # Voltage to the rotor in the middle of its interval; rotor's frame to that of Park.
        if sequence == "held":
            angle, turn = -error - 1.5 * delta, error + delta
        elif sequence == "half-step":
            angle, turn = -error - 1.5 * delta, error + 1.5 * delta
        else:
            angle, turn = -error, error
        d = np.zeros(n)
        q = np.zeros(n)
        for omega_h, wave in waves:
            z_d, z_q = machine.phasors(omega, omega_h, angle)
            d += (z_d * wave).real
            q += (z_q * wave).real
        h_d = d * math.cos(turn) - q * math.sin(turn)
        h_q = d * math.sin(turn) + q * math.cos(turn)
        return float(np.mean(h_q * np.sign(h_d)))

    error = settled_error(machine, delta, sequence)
    for _ in range(10):
        slope = (product(error + 1e-5) - product(error - 1e-5)) / 2e-5
        error -= product(error) / slope
    return error
