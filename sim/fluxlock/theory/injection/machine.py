# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine and inverter of the injection's float model between two samples, compiled by numba.

Two planes with saturation, mean voltages of a sample period with the dead time lost at the edges, mechanics. Steps of
Runge-Kutta's fourth order. Angles electrical, rad; SI units.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from fluxlock.base.paths import BUILD, content_hash
from fluxlock.config import Motor
from fluxlock.config.motor import machine_params
from fluxlock.plant.magnetics import FluxMap
from fluxlock.results.rundata import FloatArray

F = TypeVar("F", bound=Callable[..., object])
# numba looks at the file of a function only, not at those of the functions that it calls.
SOURCES = [Path(__file__).with_name(f"{name}.py") for name in ("machine", "kernel")]
FOLDER = BUILD / "injection" / content_hash(SOURCES)
# State: currents d, q, d3, q3, electrical angle and speed, torque.
THETA_AT, OMEGA_AT, TORQUE_AT = 4, 5, 6


def compiled(function: F) -> F:
    """Compile a function, kept below `build`."""
    # Loaded by name: numba's type stubs do not cover what is used here.
    numba: Any = importlib.import_module("numba")
    before = numba.config.CACHE_DIR
    FOLDER.mkdir(parents=True, exist_ok=True)
    numba.config.CACHE_DIR = str(FOLDER)
    try:
        made: F = numba.njit(cache=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before
    return made


class MachineSet(NamedTuple):
    """Machine and mechanics; cross: pieces of `FluxMap`, edge in column 0, then F and the powers of L_dq."""

    phases: int
    pole_pairs: float
    r: float
    l_d: float
    l_q: float
    psi: float
    l_d3: float
    l_q3: float
    l_13: float
    psi_3: float
    sat_on: int
    sat_a: float
    sat_b: float
    sat_i: float
    cross: FloatArray
    inertia: float
    viscous: float
    fan: float


class InverterSet(NamedTuple):
    """dead_vs: voltage-seconds that a late edge costs, V s. zone: current (A) at which it is lost for certain.

    compensation_zone (A): where the compensation is whole. predict: samples by which its current is extrapolated.
    model: the known HF current is moved on instead. edges: the currents at the same edges, extrapolated from one and
    two injection periods before, with switched. lsb: of the current, A (0: no converter); full_scale and noise in LSB;
    average: converter samples a current sample. switched: every edge at its instant instead of mean voltages, with the
    ripple of the carrier. lost: leg that has lost the machine with mean voltages, -1: none.
    """

    vdc: float
    dead_vs: float
    zone: float
    compensate: int
    compensation_zone: float
    predict: float
    model: int
    double: int
    lsb: float
    full_scale: float
    noise_lsb: float
    average: int
    switched: int
    edges: int
    lost: int = -1


def machine_set(motor: Motor, saturated: bool = True, viscous: float | None = None) -> MachineSet:
    """Of a motor file; saturated: with its saturation, if it has one."""
    params = machine_params(motor)
    flux = FluxMap(params)
    five = motor.phases == 5
    load = motor.load
    cross = np.concatenate([flux.edges[:, None], flux.cross], axis=1)
    return MachineSet(
        phases=motor.phases,
        pole_pairs=float(motor.pole_pairs),
        r=params.r_ohm[0],
        l_d=flux.l_d,
        l_q=flux.l_q,
        psi=flux.psi_1,
        l_d3=flux.l_d3 if five else 1.0,
        l_q3=flux.l_q3 if five else 1.0,
        l_13=flux.l_13,
        psi_3=flux.psi_3,
        sat_on=int(saturated and params.saturation is not None),
        sat_a=flux.sat_a,
        sat_b=flux.sat_b,
        sat_i=flux.sat_i,
        cross=np.ascontiguousarray(cross),
        inertia=motor.inertia_kgm2,
        viscous=load.viscous_nm_s_per_rad if viscous is None else viscous,
        fan=load.fan_nm_s2_per_rad2,
    )


@compiled
def flux_now(m: MachineSet, d: float, q: float, d3: float, q3: float, out: FloatArray) -> None:
    """Flux linkages 0..3 and incremental L_d, L_dq, L_q 4..6."""
    out[0] = m.psi + m.l_d * d + m.l_13 * d3
    out[1] = m.l_q * q + m.l_13 * q3
    out[2] = m.psi_3 + m.l_d3 * d3 + m.l_13 * d
    out[3] = m.l_q3 * q3 + m.l_13 * q
    out[4] = m.l_d
    out[5] = 0.0
    out[6] = m.l_q
    if m.sat_on:
        k = 0
        rows = m.cross.shape[0]
        while k < rows - 1 and q >= m.cross[k + 1, 0]:
            k += 1
        y = q - m.cross[k, 0]
        f, c0, c1, c2, c3 = m.cross[k, 1], m.cross[k, 2], m.cross[k, 3], m.cross[k, 4], m.cross[k, 5]
        integral = f + y * (c0 + y * (c1 / 2 + y * (c2 / 3 + y * c3 / 4)))
        l_dq = c0 + y * (c1 + y * (c2 + y * c3))
        slope = c1 + y * (2 * c2 + y * 3 * c3)
        u = d / m.sat_i
        v = math.tanh(u)
        rest = 1 - v * v
        log_cosh = abs(u) + math.log(0.5 * (1 + math.exp(-2 * abs(u))))
        bend = m.sat_i * (m.sat_a * log_cosh + m.sat_b * (u - v))
        out[0] += -m.l_d * bend + rest * integral
        out[1] += m.sat_i * v * l_dq
        out[4] = m.l_d * (1 - v * (m.sat_a + m.sat_b * v)) - 2 / m.sat_i * v * rest * integral
        out[5] = rest * l_dq
        out[6] = m.l_q + m.sat_i * v * slope


@compiled
def slope_now(
    m: MachineSet, i: FloatArray, v: FloatArray, theta: float, omega: float, work: FloatArray, out: FloatArray
) -> None:
    """Derivative of the currents (d, q, d3, q3) for stationary voltages v (two planes) at an angle."""
    flux_now(m, i[0], i[1], i[2], i[3], work)
    c, s = math.cos(theta), math.sin(theta)
    c3, s3 = math.cos(3 * theta), math.sin(3 * theta)
    r_d = c * v[0] + s * v[1] - m.r * i[0] + omega * work[1]
    r_q = c * v[1] - s * v[0] - m.r * i[1] - omega * work[0]
    r_d3 = c3 * v[2] + s3 * v[3] - m.r * i[2] + 3 * omega * work[3]
    r_q3 = c3 * v[3] - s3 * v[2] - m.r * i[3] - 3 * omega * work[2]
    a = work[4] - m.l_13 * m.l_13 / m.l_d3
    b = work[6] - m.l_13 * m.l_13 / m.l_q3
    x = r_d - m.l_13 / m.l_d3 * r_d3
    y = r_q - m.l_13 / m.l_q3 * r_q3
    det = a * b - work[5] * work[5]
    out[0] = (b * x - work[5] * y) / det
    out[1] = (a * y - work[5] * x) / det
    if m.phases == 5:
        out[2] = (r_d3 - m.l_13 * out[0]) / m.l_d3
        out[3] = (r_q3 - m.l_13 * out[1]) / m.l_q3
    else:
        out[2] = 0.0
        out[3] = 0.0


@compiled
def axis_tables(phases: int) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine of the phases' places in both planes."""
    cosine = np.zeros((2, phases))
    sine = np.zeros((2, phases))
    for x in range(phases):
        for plane in range(2):
            cosine[plane, x] = math.cos((1 + 2 * plane) * 2 * math.pi / phases * x)
            sine[plane, x] = math.sin((1 + 2 * plane) * 2 * math.pi / phases * x)
    return cosine, sine


@compiled
def scratch() -> FloatArray:
    """Room for `advance`."""
    return np.zeros((7, 7))


@compiled
def phase_current(i: FloatArray, theta: float, planes: int, cosine: FloatArray, sine: FloatArray, x: int) -> float:
    """Current of phase x."""
    current = 0.0
    for plane in range(planes):
        angle = (1 + 2 * plane) * theta
        alpha = math.cos(angle) * i[2 * plane] - math.sin(angle) * i[2 * plane + 1]
        beta = math.sin(angle) * i[2 * plane] + math.cos(angle) * i[2 * plane + 1]
        current += cosine[plane, x] * alpha + sine[plane, x] * beta
    return current


@compiled
def step_on(
    m: MachineSet,
    state: FloatArray,
    v: FloatArray,
    h: float,
    load: float,
    coulomb: float,
    imposed: float,
    room: FloatArray,
) -> None:
    """One Runge-Kutta step of currents with stationary voltages v (two planes), then of the mechanics."""
    i = state[:4]
    theta = state[THETA_AT]
    omega = state[OMEGA_AT]
    work = room[0]
    k1 = room[2]
    k2 = room[3]
    k3 = room[4]
    k4 = room[5]
    trial = room[6]
    slope_now(m, i, v, theta, omega, work, k1)
    for a in range(4):
        trial[a] = i[a] + 0.5 * h * k1[a]
    slope_now(m, trial, v, theta + 0.5 * h * omega, omega, work, k2)
    for a in range(4):
        trial[a] = i[a] + 0.5 * h * k2[a]
    slope_now(m, trial, v, theta + 0.5 * h * omega, omega, work, k3)
    for a in range(4):
        trial[a] = i[a] + h * k3[a]
    slope_now(m, trial, v, theta + h * omega, omega, work, k4)
    for a in range(4):
        i[a] += h / 6 * (k1[a] + 2 * k2[a] + 2 * k3[a] + k4[a])
    flux_now(m, i[0], i[1], i[2], i[3], work)
    torque = work[0] * i[1] - work[1] * i[0] + 3 * (work[2] * i[3] - work[3] * i[2])
    torque *= 0.5 * m.phases * m.pole_pairs
    before = omega
    if math.isnan(imposed):
        mechanical = omega / m.pole_pairs
        drive = torque - load - m.viscous * mechanical - m.fan * mechanical * abs(mechanical)
        if coulomb > 0.0:
            # The brake stops the rotor, and holds it, but never drives it.
            free = mechanical + h * drive / m.inertia
            most = h * coulomb / m.inertia
            mechanical = free - most if free > most else free + most if free < -most else 0.0
        else:
            mechanical += h * drive / m.inertia
        omega = mechanical * m.pole_pairs
    else:
        omega = imposed * m.pole_pairs
    theta += h * 0.5 * (before + omega)
    state[THETA_AT] = theta
    state[OMEGA_AT] = omega
    state[TORQUE_AT] = torque


@compiled
def hold_open(
    m: MachineSet,
    inv: InverterSet,
    state: FloatArray,
    v: FloatArray,
    h: float,
    load: float,
    coulomb: float,
    imposed: float,
    cosine: FloatArray,
    sine: FloatArray,
    room: FloatArray,
) -> None:
    """Turn the voltages v of a step into those with which the lost leg's current is 0 after it.

    The terminal finds its voltage by itself; the current follows it in proportion but for the saturation within a step.
    """
    n, k = m.phases, inv.lost
    planes = 2 if n == 5 else 1
    left = np.zeros(2)
    for trial in range(2):
        tried, pushed = state.copy(), v.copy()
        for plane in range(planes):
            pushed[2 * plane] += trial * inv.vdc * cosine[plane, k]
            pushed[2 * plane + 1] += trial * inv.vdc * sine[plane, k]
        step_on(m, tried, pushed, h, load, coulomb, imposed, room)
        left[trial] = phase_current(tried[:4], tried[THETA_AT], planes, cosine, sine, k)
    push = inv.vdc * left[0] / (left[0] - left[1])
    for plane in range(planes):
        v[2 * plane] += push * cosine[plane, k]
        v[2 * plane + 1] += push * sine[plane, k]


@compiled
def switched(
    m: MachineSet,
    inv: InverterSet,
    state: FloatArray,
    legs: FloatArray,
    ts: float,
    rising: bool,
    load: float,
    coulomb: float,
    imposed: float,
    cosine: FloatArray,
    sine: FloatArray,
    room: FloatArray,
    edges: FloatArray,
) -> None:
    """A sample period with every edge at its instant; an edge waits for the dead time if its current asks for that.

    edges: currents at the rising and the falling edges, of legs that have them.
    """
    n = m.phases
    share = 2.0 / n
    planes = 2 if n == 5 else 1
    v = room[1]
    halves = 1 if inv.double else 2
    length = ts / halves
    dead = inv.dead_vs / inv.vdc
    at = np.zeros(n)
    waits = np.zeros(n)
    level = np.zeros(n)
    most = length / 8
    for half in range(halves):
        up = rising if inv.double else half == 0
        for x in range(n):
            share_on = 0.5 + legs[x] / inv.vdc
            at[x] = length * (1.0 - share_on) if up else length * share_on
            waits[x] = 0.0
            level[x] = 0.0 if up else 1.0
        now = 0.0
        while now < length:
            k = -1
            until = length
            for x in range(n):
                if at[x] < until:
                    until = at[x]
                    k = x
            while until - now > 1e-12:
                h = min(most, until - now)
                for plane in range(planes):
                    v[2 * plane] = 0.0
                    v[2 * plane + 1] = 0.0
                    for x in range(n):
                        v[2 * plane] += share * cosine[plane, x] * level[x] * inv.vdc
                        v[2 * plane + 1] += share * sine[plane, x] * level[x] * inv.vdc
                step_on(m, state, v, h, load, coulomb, imposed, room)
                now += h
            now = until
            if k >= 0:
                current = phase_current(state[:4], state[THETA_AT], planes, cosine, sine, k)
                first = waits[k] == 0.0
                if first:
                    edges[0 if up else 1, k] = current
                if first and dead > 0.0 and (current > 0.0) == up:
                    waits[k] = 1.0
                    at[k] += dead
                else:
                    level[k] = 1.0 if up else 0.0
                    at[k] = 2 * length


@compiled
def advance(
    m: MachineSet,
    inv: InverterSet,
    state: FloatArray,
    legs: FloatArray,
    ts: float,
    substeps: int,
    first: int,
    last: int,
    rising: bool,
    load: float,
    coulomb: float,
    imposed: float,
    cosine: FloatArray,
    sine: FloatArray,
    room: FloatArray,
    edges: FloatArray,
) -> None:
    """Substeps first to last of a sample period with the legs' mean voltages; state and torque afterwards in `state`.

    rising: kind of this period's edges with double update. imposed: mechanical speed (rad/s), NaN: free. Switched: the
    whole period with its last substep; edges: currents there.
    """
    n = m.phases
    share = 2.0 / n
    planes = 2 if n == 5 else 1
    i = state[:4]
    v = room[1]
    h = ts / substeps
    if inv.switched:
        if last == substeps:
            switched(m, inv, state, legs, ts, rising, load, coulomb, imposed, cosine, sine, room, edges)
        return
    first_edge = substeps // 4 if not inv.double else substeps // 2
    second_edge = 3 * substeps // 4
    for sub in range(first, last):
        for plane in range(planes):
            v[2 * plane] = 0.0
            v[2 * plane + 1] = 0.0
        edge = 0
        if inv.dead_vs > 0.0:
            if inv.double:
                if sub == first_edge:
                    edge = 1 if rising else -1
            elif sub == first_edge:
                edge = 1
            elif sub == second_edge:
                edge = -1
        for x in range(n):
            u = legs[x]
            if edge != 0:
                current = phase_current(i, state[THETA_AT], planes, cosine, sine, x)
                on = min(max(0.5 + 0.5 * edge * current / inv.zone, 0.0), 1.0)
                u -= edge * on * inv.dead_vs / h
            for plane in range(planes):
                v[2 * plane] += share * cosine[plane, x] * u
                v[2 * plane + 1] += share * sine[plane, x] * u
        if inv.lost >= 0:
            hold_open(m, inv, state, v, h, load, coulomb, imposed, cosine, sine, room)
        step_on(m, state, v, h, load, coulomb, imposed, room)


@compiled
def converted(inv: InverterSet, current: float) -> float:
    """Current as the converter gives it, mean of its samples."""
    if inv.lsb > 0.0:
        total = 0.0
        for _ in range(inv.average):
            code = current / inv.lsb + inv.noise_lsb * np.random.normal()
            total += min(max(math.floor(code + 0.5), -inv.full_scale), inv.full_scale)
        current = total * inv.lsb / inv.average
    return current


@compiled
def triangle(turns: float) -> float:
    """HF current over its peak, turns after the rising edge of the voltage."""
    x = turns - math.floor(turns)
    return 4 * x - 1 if x < 0.5 else 3 - 4 * x


@compiled
def compensated(inv: InverterSet, current: float) -> float:
    """Share of the dead time that is given back, with its sign."""
    return min(max(current / inv.compensation_zone, -1.0), 1.0)


@compiled
def leg_voltages(
    inv: InverterSet,
    vector: FloatArray,
    seen_i: FloatArray,
    last_i: FloatArray,
    move: float,
    angle: float,
    rising: bool,
    learned: FloatArray,
    ts: float,
    cosine: FloatArray,
    sine: FloatArray,
    legs: FloatArray,
) -> None:
    """Legs' mean voltages of a vector in two planes, with what compensates the dead time.

    seen_i, last_i: sampled currents of now and of the period before; last_i becomes seen_i. move: HF current (A) on the
    d axis at `angle` from the sample to the effect. learned: what the currents of all legs (A) move from the sample to
    the rising and to the falling edge; rising: kind of the edge with double update.
    """
    n = legs.size
    low, high = 1e9, -1e9
    for x in range(n):
        u = cosine[0, x] * vector[0] + sine[0, x] * vector[1]
        if n == 5:
            u += cosine[1, x] * vector[2] + sine[1, x] * vector[3]
        legs[x] = u
        low, high = min(low, u), max(high, u)
    for x in range(n):
        u = legs[x] - 0.5 * (low + high)
        if inv.compensate:
            ahead = seen_i[x] + inv.predict * (seen_i[x] - last_i[x])
            ahead += move * (math.cos(angle) * cosine[0, x] + math.sin(angle) * sine[0, x])
            part = compensated(inv, ahead + learned[0, x])
            other = compensated(inv, ahead + learned[1, x])
            if not inv.double:
                part = 0.5 * (part + other)
            elif not rising:
                part = other
            u += part * inv.dead_vs / (ts * (2 if inv.double else 1))
        legs[x] = min(max(u, -0.5 * inv.vdc), 0.5 * inv.vdc)
        last_i[x] = seen_i[x]
