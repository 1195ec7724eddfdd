# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Independent solution of the plant's circuit for the tests: nodal equations, scipy's integrator and events.

Shares no formula with the kernel: unknowns are di/dt of the phases, the star voltage and the terminal voltages of one
system a topology (7 x 7 with three phases, 11 x 11 with five); the state of the diodes is found by trying every
combination and looking ahead. Five phases: inductances from winding functions, term by term in the phase axes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

from fluxlock.plant import MachineParams, PlantParams
from fluxlock.plant.magnetics import FluxMap

OPEN, SWITCH_H, SWITCH_L, DIODE_L, DIODE_H = "open", "H", "L", "dL", "dH"
LOOK_AHEAD_S = 2e-10
LINK_BAND = 1e-10  # hysteresis of the supply diode, relative
ZERO_SEQUENCE = 0.3  # inductance over L_d of a salient machine; no current flows that could show it
PHASE_ANGLES = np.array([0.0, 2.0, 4.0]) * np.pi / 3


def wound(m: MachineParams, theta: float) -> tuple[np.ndarray, np.ndarray]:
    """Inductances of a five-phase machine and their derivative by the angle, from its winding functions.

    Each phase has turns that vary as cos and as cos of three times the angle. Through a gap with a wave of permeance
    the first meet as mean and cos 2 theta, the second as mean and cos 6 theta, and both each other as cos 2 theta.
    """
    assert m.third is not None and m.l_q_h is not None
    l_d, l_q, t = m.l_h[0], m.l_q_h, m.third
    value, slope = np.zeros((5, 5)), np.zeros((5, 5))
    terms = (  # amplitude, wave of the angle, lag of x, lag of y
        ((l_d + l_q) / 5, 0, 1, -1),
        ((l_d - l_q) / 5, 2, 1, 1),
        ((t.l_d_h + t.l_q_h) / 5, 0, 3, -3),
        ((t.l_d_h - t.l_q_h) / 5, 6, 3, 3),
        (2 * t.mutual_h / 5, 2, -1, 3),
        (2 * t.mutual_h / 5, 2, 3, -1),
    )
    for x in range(5):
        for y in range(5):
            for amplitude, wave, lag_x, lag_y in terms:
                angle = wave * theta - 2 * np.pi / 5 * (lag_x * x + lag_y * y)
                value[x, y] += amplitude * np.cos(angle)
                slope[x, y] -= amplitude * wave * np.sin(angle)
    return value, slope


def saturated(m: MachineParams, theta: float, i: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Incremental inductances, flux linkages and their derivative by the angle, differenced, of the phases."""
    flux, n = FluxMap(m), m.phases

    def axes(at: float) -> np.ndarray:
        rows = []
        for h in (1, 3)[: n // 2]:
            angle = h * (at - 2 * np.pi / n * np.arange(n))
            rows += [np.cos(angle), -np.sin(angle)]
        return np.array(rows)

    def linkages(at: float) -> np.ndarray:
        return np.asarray(flux.flux(2 / n * axes(at) @ i) @ axes(at))

    a, step = axes(theta), 1e-4
    slope = (8 * (linkages(theta + step) - linkages(theta - step)) - linkages(theta + 2 * step)) / (12 * step)
    slope = slope + linkages(theta - 2 * step) / (12 * step)
    return 2 / n * a.T @ flux.inductance(2 / n * a @ i) @ a, linkages(theta), slope


@dataclass
class Reference:
    """Circuit state `y` at time `t`, advanced by `run_to`. `method`, `rtol`: of solve_ivp."""

    p: PlantParams
    y: np.ndarray
    rtol: float = 1e-11
    method: str = "DOP853"
    max_step: float = 2e-6
    t: float = 0.0
    gates: int = 0
    source_on: bool = True
    chopper_on: bool = False
    legs: tuple[str, ...] = ()
    broken: tuple[int, ...] = ()
    log: list[tuple[float, str, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        m = self.p.machine
        self.n = m.phases
        self.legs = self.legs or (OPEN,) * self.n
        self.lmat = np.diag(m.l_h)
        if self.n == 3:
            (ab, bc, ca), (la, lb, lc) = m.m_h, m.l_h
            self.lmat = np.array([[la, ab, ca], [ab, lb, bc], [ca, bc, lc]])
        self._inverse: dict[tuple[str, ...], np.ndarray] = {}

    # ---------------------------------------------------------------- equations
    def inductance(self, theta: float) -> tuple[np.ndarray, np.ndarray]:
        """Inductance matrix and its derivative by the electrical angle; salient: turned from d, q and zero sequence."""
        m = self.p.machine
        if self.n == 5:
            return wound(m, theta)
        if m.l_q_h is None:
            return self.lmat, np.zeros((3, 3))
        axes = np.diag([m.l_h[0], m.l_q_h, ZERO_SEQUENCE * m.l_h[0]])
        c, s = np.cos(theta - PHASE_ANGLES), np.sin(theta - PHASE_ANGLES)
        to_phases, to_axes = np.array([c, -s, np.ones(3)]).T, np.array([c, -s, np.full(3, 0.5)]) * 2 / 3
        turned_phases, turned_axes = np.array([-s, -c, np.zeros(3)]).T, np.array([-s, -c, np.zeros(3)]) * 2 / 3
        return to_phases @ axes @ to_axes, turned_phases @ axes @ to_axes + to_phases @ axes @ turned_axes

    def emf(self, theta: float, omega: float) -> np.ndarray:
        m = self.p.machine
        if self.n == 5:
            angles, third = theta - 0.4 * np.pi * np.arange(5), m.third.psi_vs if m.third else 0.0
            return -omega * (np.array(m.psi_vs) * np.sin(angles) + 3 * third * np.sin(3 * angles))
        angles = theta - PHASE_ANGLES
        if m.emf == "sinusoidal":
            g = np.sin(angles)
        else:
            edge = (180.0 - m.flat_top_deg) / 2
            xs = [0, edge, 180 - edge, 180 + edge, 360 - edge, 360]
            g = np.interp(np.degrees(angles) % 360.0, xs, [0, 1, 1, -1, -1, 0])
        return -np.array(m.psi_vs) * omega * g

    def leg_law(self, leg: str) -> tuple[float, float, float]:
        """Rail, constant voltage and resistance of a conducting leg."""
        q = self.p.inverter
        return {
            SWITCH_H: (1.0, 0.0, q.r_on_ohm),
            SWITCH_L: (0.0, 0.0, q.r_on_ohm),
            DIODE_L: (0.0, -q.diode_drop_v, q.diode_r_ohm),
            DIODE_H: (1.0, q.diode_drop_v, q.diode_r_ohm),
        }[leg]

    def system(self, legs: tuple[str, ...], lmat: np.ndarray) -> np.ndarray:
        """Inverse matrix for the unknowns (di of the phases, v_n, v of the phases)."""
        if legs not in self._inverse or lmat is not self.lmat:
            n = self.n
            a = np.zeros((2 * n + 1, 2 * n + 1))
            for x in range(n):
                a[x, 0:n] = -lmat[x]
                a[x, n] = -1.0
                a[x, n + 1 + x] = 1.0
                a[n + x, x if legs[x] == OPEN else n + 1 + x] = 1.0
            a[2 * n, 0:n] = 1.0
            if all(leg == OPEN for leg in legs):
                a[2 * n] = [0] * (n + 1) + [1] * n  # equal sense resistors
            # Inductances are tiny beside the ones: scale di by the mean inductance.
            scale = np.diag([1 / self.lmat[0, 0]] * n + [1.0] * (n + 1))
            self._inverse[legs] = scale @ np.linalg.inv(a @ scale)
        return self._inverse[legs]

    def vdc(self, y: np.ndarray, legs: tuple[str, ...]) -> float:
        q = self.p.inverter
        return float(y[self.n]) if q.dc_link_c_f > 0 else q.supply_v - q.supply_r_ohm * self.idc(y, legs)

    def idc(self, y: np.ndarray, legs: tuple[str, ...]) -> float:
        return sum(float(y[x]) for x in range(self.n) if legs[x] in (SWITCH_H, DIODE_H))

    def solve(self, y: np.ndarray, legs: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        """di/dt and terminal voltages."""
        n, (theta, omega) = self.n, y[self.n + 1 : self.n + 3]
        vdc = self.vdc(y, legs)
        b = np.zeros(2 * n + 1)
        if self.p.machine.saturation:
            lmat, _, turning = saturated(self.p.machine, theta, y[:n])
            b[0:n] = np.array(self.p.machine.r_ohm) * y[0:n] + omega * turning
        else:
            lmat, slope = self.inductance(theta)
            b[0:n] = np.array(self.p.machine.r_ohm) * y[0:n] + self.emf(theta, omega) + omega * (slope @ y[0:n])
        for x in range(n):
            if legs[x] != OPEN:
                rail, v, r = self.leg_law(legs[x])
                b[n + x] = rail * vdc + v - r * y[x]
        u = self.system(legs, lmat) @ b
        v = u[n + 1 :].copy()
        if all(leg == OPEN for leg in legs):
            with_diodes = [v[x] for x in range(n) if x not in self.broken]
            v += max(0.0, -self.p.inverter.diode_drop_v - min(with_diodes))  # lower diode of the lowest terminal
        return u[0:n], v

    def torque(self, theta: float, i: np.ndarray) -> float:
        """Torque from unit-speed EMF and co-energy; saturated: from the flux linkages in rotor axes."""
        m, n = self.p.machine, self.n
        if not m.saturation:
            return m.pole_pairs * float((self.emf(theta, 1.0) + 0.5 * self.inductance(theta)[1] @ i) @ i)
        total = 0.0
        _, flux, _ = saturated(m, theta, i)
        for h in (1, 3)[: n // 2]:
            turn = 2 / n * np.exp(-1j * h * (theta - 2 * np.pi / n * np.arange(n)))
            total += h * (np.conj(turn @ flux) * (turn @ i)).imag
        return n / 2 * m.pole_pairs * total

    def rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        q, mech, m, n = self.p.inverter, self.p.mechanics, self.p.machine, self.n
        d = np.zeros(2 * n + 4)
        d[0:n], v = self.solve(y, self.legs)
        if q.dc_link_c_f > 0:
            source = (q.supply_v - y[n]) / q.supply_r_ohm if self.source_on else 0.0
            chopper = y[n] / q.chopper_ohm if self.chopper_on else 0.0
            d[n] = (source - chopper - self.idc(y, self.legs)) / q.dc_link_c_f
        d[n + 1] = y[n + 2]
        if mech.mode == "free":
            # Friction as while moving forward.
            torque = self.torque(y[n + 1], y[0:n])
            w = y[n + 2] / m.pole_pairs
            load = mech.constant_nm + mech.viscous_nm_s_per_rad * w + mech.fan_nm_s2_per_rad2 * w * abs(w)
            d[n + 2] = m.pole_pairs * (torque - load - mech.coulomb_nm * np.sign(w)) / mech.inertia_kgm2
        elif mech.profile:
            (t0, w0), (t1, w1) = mech.profile
            d[n + 2] = m.pole_pairs * (w1 - w0) / (t1 - t0)
        tau = self.p.sensing.divider_pole_s
        if tau > 0:
            d[n + 3 : 2 * n + 3] = (v - y[n + 3 : 2 * n + 3]) / tau
            d[2 * n + 3] = (self.vdc(y, self.legs) - y[2 * n + 3]) / tau
        return d

    # ---------------------------------------------------------------- topology
    def choose_legs(self) -> None:
        """Take the combination of diode states that is least wrong a moment later."""
        options: list[tuple[str, ...]] = []
        for x in range(self.n):
            g = self.gates >> (2 * x) & 3
            if x in self.broken:
                options.append((OPEN,))
            elif g:
                options.append((SWITCH_H,) if g == 1 else (SWITCH_L,))
            elif self.y[x] > 0:
                options.append((DIODE_L,))
            elif self.y[x] < 0:
                options.append((DIODE_H,))
            else:
                options.append((OPEN, DIODE_L, DIODE_H))
        old = self.legs
        best, best_wrong = None, np.inf
        for legs in itertools.product(*options):
            if sum(leg != OPEN for leg in legs) == 1 and any(leg in (DIODE_L, DIODE_H) for leg in legs):
                continue
            wrong = self.wrongness(legs)
            if wrong < best_wrong - 1e-12:
                best, best_wrong = legs, wrong
        assert best is not None
        self.legs = best
        for x in range(self.n):
            if self.y[x] == 0 and best[x] in (DIODE_L, DIODE_H) and old[x] != best[x]:
                self.log.append((self.t, "on", x))

    def wrongness(self, legs: tuple[str, ...]) -> float:
        """By how many volts the legs contradict their diodes, LOOK_AHEAD_S after now."""
        before, self.legs = self.legs, legs
        middle = self.y + 0.5 * LOOK_AHEAD_S * self.rhs(0.0, self.y)
        ahead = self.y + LOOK_AHEAD_S * self.rhs(0.0, middle)
        self.legs = before
        _, v = self.solve(ahead, legs)
        drop, vdc = self.p.inverter.diode_drop_v, self.vdc(ahead, legs)
        volts_per_amp = self.lmat[0, 0] / LOOK_AHEAD_S
        wrong = 0.0
        for x in range(self.n):
            if x in self.broken:
                continue
            if legs[x] == OPEN:
                wrong += max(0.0, -drop - v[x], v[x] - vdc - drop)
            elif legs[x] == DIODE_L:
                wrong += max(0.0, -ahead[x] * volts_per_amp)
            elif legs[x] == DIODE_H:
                wrong += max(0.0, ahead[x] * volts_per_amp)
        return wrong

    def choose_link(self) -> None:
        q = self.p.inverter
        if q.dc_link_c_f == 0:
            return
        vdc = self.y[self.n]
        if q.supply_diode and abs(vdc - q.supply_v) > LINK_BAND * q.supply_v:
            self.source_on = bool(vdc < q.supply_v)
        if q.chopper_ohm > 0:
            if vdc >= q.chopper_on_v - 1e-9:
                self.chopper_on = True
            elif vdc <= q.chopper_off_v + 1e-9:
                self.chopper_on = False

    # ---------------------------------------------------------------- run
    def events(self) -> list[tuple[str, int, object]]:
        drop, q = self.p.inverter.diode_drop_v, self.p.inverter
        found: list[tuple[str, int, object]] = []

        def add(kind: str, x: int, f: object) -> None:
            f.terminal, f.direction = True, -1  # type: ignore[attr-defined]
            found.append((kind, x, f))

        n = self.n
        for x in range(n):
            if x in self.broken:
                continue
            if self.legs[x] == DIODE_L:
                add("off", x, lambda t, y, x=x: y[x])
            elif self.legs[x] == DIODE_H:
                add("off", x, lambda t, y, x=x: -y[x])
            elif self.legs[x] == OPEN and any(leg != OPEN for leg in self.legs):
                add("on", x, lambda t, y, x=x: self.solve(y, self.legs)[1][x] + drop)
                add("on", x, lambda t, y, x=x: self.vdc(y, self.legs) + drop - self.solve(y, self.legs)[1][x])
        if all(leg == OPEN for leg in self.legs):
            able = [x for x in range(n) if x not in self.broken]
            add("on", -1, lambda t, y: self.vdc(y, self.legs) + 2 * drop - np.ptp(self.emf(*y[n + 1 : n + 3])[able]))
        if q.dc_link_c_f > 0 and q.supply_diode:
            band = LINK_BAND * q.supply_v
            add("link", -1, lambda t, y: (q.supply_v - y[n]) * (1 if self.source_on else -1) + 2 * band)
        if q.chopper_ohm > 0:
            if self.chopper_on:
                add("link", -1, lambda t, y: y[n] - q.chopper_off_v)
            else:
                add("link", -1, lambda t, y: q.chopper_on_v - y[n])
        return found

    def run_to(self, t_end: float) -> None:
        """Advance to t_end with the present gates."""
        for _ in range(200):
            if self.t >= t_end:
                return
            self.choose_link()
            self.choose_legs()
            # A diode current that starts from zero must leave it before its end can be looked for.
            fresh = any(leg in (DIODE_L, DIODE_H) and self.y[x] == 0 for x, leg in enumerate(self.legs))
            events = [] if fresh else self.events()
            until = min(t_end, self.t + LOOK_AHEAD_S) if fresh else t_end
            out = solve_ivp(
                self.rhs, (self.t, until), self.y, method=self.method, rtol=self.rtol, atol=self.atol(),
                events=[f for _, _, f in events], max_step=self.max_step,
            )  # fmt: skip
            assert out.success, out.message
            self.t, self.y = float(out.t[-1]), out.y[:, -1].copy()
            for (kind, x, _), times in zip(events, out.t_events or (), strict=True):
                if len(times) and out.status == 1:
                    self.finish(kind, x)
            self.y[: self.n] -= self.residue()
        raise AssertionError("reference: too many events")

    def residue(self) -> np.ndarray:
        """Spread the rounding of the current sum over the conducting legs."""
        on = np.array([leg != OPEN and self.y[x] != 0 for x, leg in enumerate(self.legs)], float)
        return on * self.y[: self.n].sum() / max(on.sum(), 1)

    def finish(self, kind: str, x: int) -> None:
        if kind == "off":
            self.y[x] = 0.0
            self.log.append((self.t, "off", x))
            if sum(leg != OPEN for leg in self.legs) == 2:
                for other in range(self.n):
                    if other != x and self.legs[other] in (DIODE_L, DIODE_H):
                        self.log.append((self.t, "off", other))
                self.y[: self.n] = 0.0

    def atol(self) -> np.ndarray:
        amps = self.p.inverter.supply_v * 1e-5 / self.lmat[0, 0]
        volts = self.p.inverter.supply_v
        return 1e-12 * np.array([amps] * self.n + [volts, 1.0, 1e3] + [volts] * (self.n + 1))
