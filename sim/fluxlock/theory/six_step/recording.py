# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Gate edges of a run, and the window of whole turns over which their lines are taken."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from fluxlock.results.angles import AngleTrack
from fluxlock.results.rundata import FloatArray, LogKind, RunData
from fluxlock.theory.six_step.fourier import ComplexArray, cut_edges, line_amplitudes, space_vector
from fluxlock.theory.six_step.linearity import compensated_duty
from fluxlock.theory.six_step.patterns import Commutation
from fluxlock.theory.six_step.spectrum import Lines, analytic_lines, line_numbers

# A measured N is no fraction of small numbers; of the series' fractions the nearest up to this denominator is taken.
MAX_DENOMINATOR = 100
# Eight for the highest order of the torque ripple.
RECORDS_A_TURN = 48


@dataclass(frozen=True)
class Window:
    """Clock cycles (fractional) between which the rotor makes `turns` electrical turns."""

    first_cycle: float
    last_cycle: float
    turns: int

    def fundamental_hz(self, clock_hz: float) -> float:
        """Mean electrical frequency."""
        return clock_hz * self.turns / (self.last_cycle - self.first_cycle)


def whole_turns(run: RunData, from_s: float, to_s: float, multiple: int = 1) -> Window:
    """Longest window of whole electrical turns that begins at from_s and ends by to_s, by the plant's angle.

    multiple: the number of turns is a multiple of it (q of N = p/q: lines every 6/q of the fundamental).
    """
    track = AngleTrack(run.records, run.clock_hz)
    grid = np.linspace(from_s * run.clock_hz, to_s * run.clock_hz, 1 + max(2, round((to_s - from_s) * 1e6)))
    inside = (grid >= track.first_cycle) & (grid <= track.last_cycle)
    grid = grid[inside]
    if grid.size < 2:
        raise ValueError(f"{from_s:g} s to {to_s:g} s: outside of the recorded run")
    turned = np.abs(track.theta_rad(grid) - track.theta_rad(grid[:1])) / (2.0 * np.pi)
    turns = int(turned[-1]) // multiple * multiple
    if turns < 1 or np.any(np.diff(turned) <= 0.0):
        raise ValueError(f"{from_s:g} s to {to_s:g} s: less than one electrical turn, or the direction changes")
    return Window(float(grid[0]), float(np.interp(turns, turned, grid)), turns)


def recorded_spectrum(run: RunData, window: Window, max_order: float) -> Lines:
    """Lines of the excitation of a run at all orders j / turns up to max_order.

    The order is relative to the mean speed of the window; backward rotation has its fundamental at -1.
    """
    rows = run.rows(LogKind.GATES)
    at, gates = cut_edges(rows[:, 0], rows[:, 2], window.first_cycle, window.last_cycle, window.turns)
    most = int(max_order * window.turns)
    orders: FloatArray = np.arange(-most, most + 1) / window.turns
    return Lines(orders, line_amplitudes(at, space_vector(gates), float(window.turns), orders))


def current_lines(run: RunData, window: Window, orders: FloatArray) -> Lines:
    """Lines of the current space vector (2/3)(ia + a ib + a^2 ic), A, at `orders` of the rotor's angle.

    From the records on their regular grid: orders far below f_record / f_e, multiples of 1 / turns.
    """
    time, vector, theta = _recorded(run, window)
    amplitude = [np.mean(vector * np.exp(-1j * order * theta) * _weight(theta, time)) for order in orders]
    return Lines(orders, np.array(amplitude))


def torque_lines(run: RunData, window: Window, orders: FloatArray) -> Lines:
    """Lines of the torque, N*m, at `orders` of the rotor's angle (peak of a line above 0: twice its size)."""
    inside = (run.records["t_cycle"] >= window.first_cycle) & (run.records["t_cycle"] < window.last_cycle)
    time, _, theta = _recorded(run, window)
    torque = run.records["torque_nm"][inside]
    amplitude = [np.mean(torque * np.exp(-1j * order * theta) * _weight(theta, time)) for order in orders]
    return Lines(orders, np.array(amplitude))


def torque_ripple(run: RunData, window: Window) -> Lines:
    """Lines of the torque below six times the fundamental, at all multiples of 1 / turns; amplitude: peak, N*m.

    Raises ValueError with fewer than RECORDS_A_TURN records a turn.
    """
    inside = (run.records["t_cycle"] >= window.first_cycle) & (run.records["t_cycle"] < window.last_cycle)
    found = np.count_nonzero(inside) / window.turns
    if found < RECORDS_A_TURN:
        raise ValueError(
            f"{found:.1f} records a turn, the torque's lines need {RECORDS_A_TURN}: "
            "shorten record.period_s of the scenario"
        )
    orders: FloatArray = np.arange(1, 6 * window.turns) / window.turns
    return Lines(orders, 2 * torque_lines(run, window, orders).amplitude)


def _recorded(run: RunData, window: Window) -> tuple[FloatArray, ComplexArray, FloatArray]:
    records = run.records[(run.records["t_cycle"] >= window.first_cycle) & (run.records["t_cycle"] < window.last_cycle)]
    a = np.exp(2j * np.pi / 3)
    vector = (records["ia"] + a * records["ib"] + a * a * records["ic"]) * (2 / 3)
    return records["t_cycle"], vector, records["theta_e"]


def _weight(theta: FloatArray, time: FloatArray) -> FloatArray:
    """Angle of a sample relative to the mean one: makes means over samples means over the angle."""
    step: FloatArray = np.gradient(theta, time)
    return step / np.mean(step)


def mean_excitation(run: RunData, window: Window) -> float:
    """Share of the window in which a pair of phases is excited: the mean of the output, 0..1."""
    rows = run.rows(LogKind.GATES)
    at, gates = cut_edges(rows[:, 0], rows[:, 2], window.first_cycle, window.last_cycle, window.turns)
    return float(np.abs(space_vector(gates)) @ np.diff(at, append=window.turns)) / window.turns


def expected_spectrum(
    run: RunData, window: Window, commutation: Commutation, carrier_hz: float, max_order: float
) -> Lines:
    """Series of chapter 6 at the mean and the carriers a sector of a recording.

    Initial phase arbitrary: compare sizes, of lines that do not depend on it.
    """
    mean = mean_excitation(run, window)
    exact = Fraction(carrier_hz) / (6 * Fraction(window.fundamental_hz(run.clock_hz)))
    ratio = exact.limit_denominator(MAX_DENOMINATOR)
    duty = float(compensated_duty(mean, float(ratio))) if commutation == "CSC" else mean
    return analytic_lines(commutation, ratio, duty, line_numbers(ratio, max_order), start_deg=5.0)


def harmonics(lines: Lines) -> tuple[dict[int, float], float]:
    """Sizes of the lines 1 + 6 k by order, and the rms of all others together, unit: Vdc."""
    own = np.abs((lines.order - 1.0 + 3.0) % 6.0 - 3.0) < 1e-9
    size = np.abs(lines.amplitude)
    found = {round(float(order)): float(a) for order, a in zip(lines.order[own], size[own], strict=True)}
    return found, float(np.sqrt(np.sum(size[~own] ** 2)))
