# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What switching edges leave in the sense chain: against scipy, in closed form, and nothing where there is no term."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from fluxlock.plant import EdgeParams, Plant, PlantParams
from fluxlock.plant import layout as L
from tests.plant.circuits import CLOCK_S, random_five_phase, random_gates, random_params
from tests.plant.drives import drive, motor_1
from tests.plant.reference import SWITCH_H, SWITCH_L, Reference

LIMIT = 1e-4  # of full scale
DURATION_CYCLES = 40_000
BITS = 24
ALL_TERMS = EdgeParams(
    reference_v=48.0, step_v=2.0, step_tau_s=600e-9, ring_v=1.2, ring_hz=700e3, ring_tau_s=4e-6, lobe_v=0.69,
    lobe_s=3.5e-6, slew_s=150e-9, own=0.4, coupling=1.0, current_step_a=0.3, current_tau_s=900e-9,
)  # fmt: skip


class EdgeReference(Reference):
    """The independent circuit with the terms of its edges as further unknowns, integrated with it.

    Behind the unknowns of the circuit: a row of six a channel (step, ring twice, lobe twice, output of the pole), then
    the errors of the phase currents and of the link's.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        assert self.p.sensing.edge is not None
        self.edge = self.p.sensing.edge
        self.base = self.y.size
        self.y = np.concatenate([self.y, np.zeros(7 * self.n + 1)])
        self.ramp = np.zeros((self.n, 2))  # instant at which a terminal is there, slope of its way

    def ramps(self, t: float) -> np.ndarray:
        """Slewing terminals less their new voltages."""
        return self.ramp[:, 1] * np.minimum(0.0, t - self.ramp[:, 0])

    def disturbance(self, t: float, rows: np.ndarray) -> np.ndarray:
        """What stands before the pole."""
        return np.asarray(rows[:, 0] + rows[:, 1] + rows[:, 4] + self.ramps(t))

    def rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        e = self.edge
        d = np.zeros(self.y.size)
        d[: self.base] = super().rhs(t, y)[: self.base]
        rows = y[self.base : self.base + 6 * self.n].reshape(self.n, 6)
        out = np.zeros((self.n, 6))
        if e.step_tau_s:
            out[:, 0] = -rows[:, 0] / e.step_tau_s
        if e.ring_tau_s:
            w = 2 * np.pi * e.ring_hz
            out[:, 1] = -rows[:, 1] / e.ring_tau_s - w * rows[:, 2]
            out[:, 2] = -rows[:, 2] / e.ring_tau_s + w * rows[:, 1]
        if e.lobe_s:
            out[:, 3] = -rows[:, 3] / e.lobe_s
            out[:, 4] = (rows[:, 3] - rows[:, 4]) / e.lobe_s
        tau = self.p.sensing.divider_pole_s
        if tau:
            out[:, 5] = (self.disturbance(t, rows) - rows[:, 5]) / tau
        d[self.base : self.base + 6 * self.n] = out.ravel()
        if e.current_tau_s:
            d[self.base + 6 * self.n :] = -y[self.base + 6 * self.n :] / e.current_tau_s
        return d

    def choose_legs(self) -> None:
        """Take the legs, and start the terms of those that changed."""
        old, idc = self.legs, self.idc(self.y, self.legs)
        before = self.solve(self.y, self.legs)[1]
        super().choose_legs()
        if self.legs == old:
            return
        e, jump = self.edge, self.solve(self.y, self.legs)[1] - before
        rows = self.y[self.base : self.base + 6 * self.n].reshape(self.n, 6)  # a view: it writes to y
        rest = self.ramps(self.t)
        for x in range(self.n):
            if e.slew_s and abs(jump[x]) > 1e-6:
                self.ramp[x] = self.t + e.slew_s, (jump[x] - rest[x]) / e.slew_s
            if old[x] == self.legs[x]:
                continue
            self.y[self.base + 6 * self.n + x] += e.current_step_a * jump[x] / e.reference_v
            for channel in range(self.n):
                share = jump[x] / e.reference_v * (e.own if channel == x else e.coupling)
                rows[channel, 0] += share * e.step_v
                rows[channel, 1] += share * e.ring_v
                if old[x] in (SWITCH_H, SWITCH_L):
                    rows[channel, 3] += share * e.lobe_v * math.e
        if e.current_tau_s:
            self.y[self.base + 7 * self.n] -= self.idc(self.y, self.legs) - idc

    def atol(self) -> np.ndarray:
        return np.concatenate([super().atol(), np.full(7 * self.n + 1, 1e-12 * self.p.inverter.supply_v)])

    def channels(self) -> np.ndarray:
        """Values of the channels, V and A."""
        n, tau = self.n, self.p.sensing.divider_pole_s
        rows = self.y[self.base : self.base + 6 * n].reshape(n, 6)
        clean = self.y[n + 3 : 2 * n + 3] if tau else self.solve(self.y, self.legs)[1]
        volts = clean + (rows[:, 5] if tau else self.disturbance(self.t, rows))
        errors = self.y[self.base + 6 * n :]
        link = self.y[2 * n + 3] if tau else self.vdc(self.y, self.legs)
        amps = self.y[:n] + errors[:n]
        return np.array([*volts, *amps, link, self.idc(self.y, self.legs) + errors[n], volts.mean()])


def edged(base: PlantParams, edge: EdgeParams) -> PlantParams:
    """A circuit with edge terms, 24 bits, no noise and room below 0 V."""
    n = base.machine.phases
    offsets = (2.0**22,) * n + (0.0,) * (n + 2) + (2.0**22,)
    sensing = dataclasses.replace(base.sensing, bits=BITS, noise_lsb_rms=0.0, offset_lsb=offsets, edge=edge)
    return dataclasses.replace(base, sensing=sensing)


def largest_difference(params: PlantParams, seed: int, edge: EdgeParams = ALL_TERMS) -> float:
    """Largest difference of a channel between plant and scipy, of full scale, at instants all over a sequence.

    edge: the terms that scipy is given.
    """
    n, sensing = params.machine.phases, params.sensing
    plant = Plant(params, seed=seed, mode="py")
    m, y = params.mechanics, np.zeros(2 * n + 4)
    y[n : n + 3] = params.inverter.supply_v, m.theta_e_rad, m.omega_m_rad_s * params.machine.pole_pairs
    y[n + 3 :] = plant.state[L.FILTERED : L.FILTERED + n + 1]
    reference = EdgeReference(edged(params, edge), y)
    rows = random_gates(np.random.default_rng(seed), DURATION_CYCLES, n)
    offsets = np.array(sensing.offset_lsb)
    full = np.array([sensing.v_full_scale_v] * n + [2 * sensing.i_full_scale_a] * n + [sensing.v_full_scale_v])
    full = np.append(full, [2 * sensing.i_full_scale_a, sensing.v_full_scale_v])
    middle = np.array([0.0] * n + [0.5] * n + [0.0, 0.5, 0.0])
    worst = 0.0
    for (t, gates), (following, _) in zip(rows, [*rows[1:], (DURATION_CYCLES, 0)], strict=True):
        plant.advance(t)
        reference.run_to(t * CLOCK_S)
        plant.step(t, gates, 2)
        reference.gates = gates
        for at in sorted({t + 40, t + 700, t + 3000, following - 1}):
            if t < at < following:
                codes = plant.sample(at).astype(float)
                reference.run_to(at * CLOCK_S)
                wanted = reference.channels() / full + middle + offsets / 2**BITS
                inside = (wanted > 0.0) & (wanted < 1.0)
                worst = max(worst, float(np.abs(codes / 2**BITS - wanted)[inside].max()))
    return worst


@pytest.mark.parametrize("seed", range(6))
def test_against_an_independent_solver(seed: int) -> None:
    """All terms at once, over random circuits and sequences, with and without a divider pole.

    The pole of seed 2 is the time constant of the step, that of seed 4 of the lobe.

    Verifies: PLANT-40
    """
    pole_s = (0.0, 200e-9, 600e-9, 1e-6, 3.5e-6, 40e-9)[seed]
    params = edged(random_params(np.random.default_rng(seed), "imposed", pole_s), ALL_TERMS)
    assert largest_difference(params, seed) < LIMIT


def test_five_legs() -> None:
    """The same with five legs.

    Verifies: PLANT-40
    """
    params = edged(random_five_phase(np.random.default_rng(3), "imposed", 300e-9), ALL_TERMS)
    assert largest_difference(params, 3) < LIMIT


@pytest.mark.parametrize("term", ["step_v", "ring_v", "lobe_v", "slew_s", "current_step_a", "current_tau_s"])
def test_the_comparison_sees_each_term(term: str) -> None:
    """Without one of its terms the plant differs from the solver by more than the limit.

    Verifies: PLANT-40
    """
    params = edged(random_params(np.random.default_rng(1), "imposed", 200e-9), ALL_TERMS)
    changes = {term: 0.0} | ({"current_step_a": 0.0} if term == "current_tau_s" else {})
    assert largest_difference(params, 1, dataclasses.replace(ALL_TERMS, **changes)) > 2 * LIMIT


def one_edge(edge: EdgeParams, pole_s: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Error of the open terminal's channel, V, from an edge of leg A on: times (s), values. B is on below, C open."""
    params = edged(motor_1(mechanics__mode="locked", inverter__supply_r_ohm=0.0, sensing__divider_pole_s=pole_s), edge)
    clean = dataclasses.replace(params, sensing=dataclasses.replace(params.sensing, edge=None))
    found = []
    for p in (params, clean):
        plant = Plant(p, seed=1, mode="py")
        plant.set_gates(0b001000)
        plant.advance(1000)
        plant.set_gates(0b001001)
        found.append(np.array([plant.sample(t)[2] for t in range(1001, 1400)], float))
    scale = params.sensing.v_full_scale_v / 2**BITS
    return 20e-9 * np.arange(1, 400), (found[0] - found[1]) * scale


def test_terms_are_what_they_are_called() -> None:
    """A step decays, a ring swings, each with the height of its own jump; without slew the rest is exact.

    Verifies: PLANT-40
    """
    t, v = one_edge(EdgeParams(reference_v=25.0, step_v=2.0, step_tau_s=600e-9))
    assert v == pytest.approx(2.0 * np.exp(-t / 600e-9), abs=0.01)
    t, v = one_edge(EdgeParams(reference_v=50.0, ring_v=1.2, ring_hz=700e3, ring_tau_s=4e-6))
    assert v == pytest.approx(0.6 * np.exp(-t / 4e-6) * np.cos(2 * np.pi * 700e3 * t), abs=0.01)
    t, v = one_edge(EdgeParams(slew_s=1e-6))
    assert v == pytest.approx(-12.5 * np.clip(1 - t / 1e-6, 0, None), abs=0.01)
    assert np.abs(v[t >= 1e-6]).max() < 1e-5


def test_lobe_follows_a_switch_that_turns_off() -> None:
    """Its height is reached at its time; an edge that only turns a switch on has none.

    Verifies: PLANT-40
    """
    edge = EdgeParams(reference_v=25.0, lobe_v=0.5, lobe_s=1e-6)
    _, v = one_edge(edge)
    assert np.abs(v).max() == 0.0
    params = edged(motor_1(mechanics__mode="locked", inverter__diode_drop_v=0.0, sensing__divider_pole_s=0.0), edge)
    plant = Plant(params, seed=1, mode="py")
    plant.set_gates(0b001001)
    plant.advance(500)
    plant.set_gates(0b001000)  # A's current goes on through its lower diode: 25 V down
    heights = []
    for t in range(501, 700):
        plant.sample(t)
        heights.append(plant.state[L.EDGE_OUT + 2])
    assert min(heights) == pytest.approx(-0.5, abs=0.005) and int(np.argmin(heights)) + 1 == pytest.approx(50, abs=1)


def test_edges_do_not_touch_the_circuit() -> None:
    """Currents, link, rotor and noise are the same bits with edge terms as without; so are all codes before an edge.

    Verifies: PLANT-41
    """
    clean = Plant(motor_1(), seed=3, mode="py")
    base = motor_1()
    noisy = dataclasses.replace(base, sensing=dataclasses.replace(base.sensing, edge=ALL_TERMS))
    edges = Plant(noisy, seed=3, mode="py")
    for plant in (clean, edges):
        drive(plant, 1500)
    for first, count in ((L.I, 3), (L.VDC, 1), (L.THETA, 1), (L.OMEGA, 1), (L.SAMPLE, 1), (L.FILTERED, 4)):
        assert clean.state[first : first + count].tobytes() == edges.state[first : first + count].tobytes()
    assert not np.array_equal(clean.io[:9], edges.io[:9])


def test_compiled_edges_are_the_same_bits() -> None:
    """Plain Python and compiled code agree bit for bit with all terms.

    Verifies: PLANT-06
    """
    base = motor_1()
    params = dataclasses.replace(base, sensing=dataclasses.replace(base.sensing, edge=ALL_TERMS))
    py, jit = (Plant(params, seed=5, mode=mode) for mode in ("py", "jit"))
    for plant in (py, jit):
        drive(plant, 1500)
    assert py.state.tobytes() == jit.state.tobytes() and py.io.tobytes() == jit.io.tobytes()


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"step_tau_s": -1e-9}, "step_tau_s"),
        ({"reference_v": 0.0}, "reference_v"),
        ({"ring_v": math.nan}, "ring_v"),
        ({"ring_v": 1.0, "ring_hz": 1e6}, "ring_tau_s"),
        ({"ring_v": 1.0, "ring_tau_s": 1e-6}, "ring_hz"),
        ({"step_v": 1.0}, "step_tau_s"),
        ({"lobe_v": 1.0}, "lobe_s"),
        ({"current_step_a": 1.0}, "current_tau_s"),
        ({"slew_s": math.inf}, "slew_s"),
    ],
)
def test_refused(changes: dict[str, Any], named: str) -> None:
    """Impossible terms are refused by name.

    Verifies: PLANT-13
    """
    with pytest.raises(ValueError, match=named):
        EdgeParams(**changes)
