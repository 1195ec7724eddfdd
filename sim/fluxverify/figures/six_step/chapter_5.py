# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chapter 5: delay of the carrier, stability of the crossing loop, carrier-synchronised commutation."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from fluxlock.cosim.outcome import Run
from fluxlock.results.plots import PHASE_COLOURS
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.fourier import sequence_lines
from fluxlock.theory.six_step.linearity import compensated_duty
from fluxlock.theory.six_step.patterns import LOWER_LEG, UPPER_LEG, Commutation, gate_sequence
from fluxlock.theory.six_step.plots import finish
from fluxlock.theory.six_step.spectrum import analytic_lines, line_numbers, weighted_distortion
from fluxlock.theory.six_step.stability import commutation_errors_deg, freewheel_limit_deg, stable_freewheel_deg
from fluxverify.figures import panels
from fluxverify.figures.figure import DRAWN, Drawing, Entry, figure, near
from fluxverify.figures.six_step.support import FAMILY, SETTLED_S, at_speed, drive, numbers, whole
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.ramp import Variant, drive_ramp
from fluxverify.regression.six_step.support import highest_hz

CARRIER_HZ = 20e3
LINE = 3.0  # radius of the boundaries in figure 5.4
BENCH = "Motor-I, 25 V, 20 kHz, ON-PWM"
COMPARED_HZ = 800.0  # at which figure 5.16 compares the currents
NEAR_HZ = 20.0
MUCH_SMALLER = 0.7
AFTER_TRIP_S = 0.05
NOT_RUN = "not in the short run"


@figure(FAMILY, "5.4")
def inverter_output(runner: Runner) -> Drawing:
    """Output of the inverter under RSC at f_c/f_e = 17.9, 18, 18.1."""
    drawn, grid = panels.page("5.4: RSC, sectors over the rotor's angle (a ring a turn)", 1, 3, (11.0, 4.2))
    turns = 6 if runner.quick else 12
    rows = []
    for axes, ratio in zip(grid[0], (17.9, 18.0, 18.1), strict=True):
        n = ratio / 6
        sequence = gate_sequence("RSC", n, 0.5, turns=turns, start_deg=10.0)
        late = np.mod((sequence.commutations * 360.0 + 10.0), 60.0)
        edges = np.append(sequence.commutations, sequence.length)
        for k, sector in enumerate(sequence.sectors):
            angle = np.radians(np.linspace(edges[k], edges[k + 1], 40) * 360.0 + 10.0)
            radius = 1.0 + 0.15 * angle / (2 * np.pi)
            axes.plot(radius * np.cos(angle), radius * np.sin(angle), color=f"C{int(sector)}", linewidth=2)
        for boundary in np.radians(np.arange(0.0, 360.0, 60.0)):
            axes.plot([0, LINE * np.cos(boundary)], [0, LINE * np.sin(boundary)], color="#888888", linewidth=0.6)
        axes.set_aspect("equal")
        axes.set_axis_off()
        panels.title(axes, f"$f_c/f_e$ = {ratio:g}")
        moves = float(np.ptp(late))
        rows.append(
            Entry(
                f"{ratio:g}: delay of the commutations (deg)",
                "constant, not zero" if ratio == 18.0 else "moves from turn to turn",
                f"{panels.span_text(late)}" + (" (constant)" if moves < 1e-6 else f", up to 60/N = {60 / n:.1f}"),
                "no run",
                (moves < 1e-6 and float(late.min()) > 0) if ratio == 18.0 else moves > 1.0,
                "At 18 the delay is what the carrier's phase happens to be: here 10° at the start"
                if ratio == 18
                else "",
            )
        )
    return Drawing("Definition of RSC (`analysis.six_step.patterns`), colours: sectors; duty 0.5.", drawn, tuple(rows))


@figure(FAMILY, "5.7")
def stable_domain(runner: Runner) -> Drawing:
    """Stable domain of the crossing loop in N and freewheel angle, with two examples."""
    n = np.linspace(1.0, 6.0, 51 if runner.quick else 301)
    drawn, grid = panels.page("5.7: stability of the crossing loop under RSC", 1, 3, (12.0, 4.2))
    left, unbounded, bounded = grid[0]
    found = stable_freewheel_deg(n, sectors=500 if runner.quick else 2000, resolution_deg=0.05)
    left.plot(n, found, ".", markersize=3, color=PHASE_COLOURS[0], label="map (5.4) to (5.8)")
    closed = freewheel_limit_deg(n)
    left.plot(n, closed, "-", color="black", linewidth=0.8, label="60 floor(N)/N − 30")
    left.plot(n, freewheel_limit_deg(n, back_computed=True), "--", color=PHASE_COLOURS[2], label="computed back")
    finish(left, "carriers a sector N", "freewheel angle / deg el.")
    panels.legend(left, 1, "lower right")
    examples = {}
    for axes, ratio in ((unbounded, 2.9), (bounded, 3.1)):
        error = commutation_errors_deg(ratio, 15.0, 40)
        examples[ratio] = error
        axes.plot(np.arange(1, 41), error, ".-", linewidth=0.8, color=PHASE_COLOURS[1])
        finish(axes, "commutation", "lateness / deg el.")
        panels.title(axes, f"φ = 15°, N = {ratio}")
    apart = float(np.abs(found - closed).max())
    below = freewheel_limit_deg(np.array([2.0, 3.0, 4.0, 5.0]) - 1e-6)
    return Drawing(
        "Map of section 5.3 followed for 2000 sectors, and the closed form found from it.",
        drawn,
        (
            Entry(
                "boundary",
                "zigzag, jumps at integer N",
                f"the same; closed form within {apart:.3f}° of the map",
                "no run",
                apart < 0.05,
            ),
            Entry(
                "largest angle just below N = 3 (deg)",
                "10",
                f"{below[1]:.2f}",
                "no run",
                near(10, float(below[1]), 0.5),
            ),
            Entry("just below N = 2, 4, 5 (deg)", "drawn", numbers(below[[0, 2, 3]]), "no run", None, DRAWN),
            Entry(
                "φ = 15°, N = 2.9: lateness after 40 commutations (deg)",
                "unbounded",
                f"{examples[2.9][-1]:.0f}",
                "no run",
                bool(examples[2.9][-1] > examples[2.9][:20].max() + 10.0),
            ),
            Entry(
                "φ = 15°, N = 3.1: largest lateness (deg)",
                "bounded",
                f"{examples[3.1].max():.1f}",
                "no run",
                bool(examples[3.1][20:].max() <= examples[3.1][:20].max() + 1e-9),
            ),
        ),
    )


def csc_distortion(n: float, duty: float = 0.5) -> float:
    """Weighted distortion of CSC at any N (taken to a hundredth)."""
    ratio = Fraction(n).limit_denominator(100)
    return weighted_distortion(analytic_lines("CSC", ratio, duty, line_numbers(ratio, 300.0)))


def weighted_fifth(n: float) -> float:
    """Fifth line of CSC at duty 0.5 over its order and over the fundamental, at any N (taken to a hundredth)."""
    ratio = Fraction(n).limit_denominator(100)
    lines = analytic_lines("CSC", ratio, 0.5, np.array([0, -1]) * ratio.denominator)
    first, fifth = np.abs(lines.amplitude)
    return float(fifth / 5 / first)


def stray_line(n: float) -> float:
    """Largest line of ideal CSC gates at whole orders other than 1 + 6 k, to order 25."""
    sequence = gate_sequence("CSC", n, 0.5, turns=1)
    orders = np.arange(-25.0, 26.0)
    other = np.abs((orders - 1.0) % 6.0) > 1e-9
    return float(np.abs(sequence_lines(sequence, orders[other])).max())


@figure(FAMILY, "5.10")
def csc_spectrum(runner: Runner) -> Drawing:
    """Line spectrum and weighted distortion of CSC for N = 2 to 6, M = 0.5."""
    n = np.round(np.linspace(2.0, 6.0, 21 if runner.quick else 81), 2)
    orders = np.array([-5, 7, -11, 13, -17, 19, -23, 25])
    size = np.empty((orders.size, n.size))
    for column, ratio in enumerate(n):
        fraction = Fraction(str(ratio))
        lines = analytic_lines("CSC", fraction, 0.5, (orders - 1) // 6 * fraction.denominator)
        size[:, column] = np.abs(lines.amplitude)
    distortion = np.array([csc_distortion(float(ratio)) for ratio in n])
    drawn, grid = panels.page("5.10: CSC, duty 0.5", 1, 2, (11.0, 4.4))
    for k, order in enumerate(orders):
        grid[0][0].plot(n, size[k], color=f"C{k}", label=f"{abs(order)}")
    finish(grid[0][0], "carriers a sector N", "line / Vdc")
    panels.legend(grid[0][0], 4)
    grid[0][1].plot(n, distortion, color="black")
    finish(grid[0][1], "carriers a sector N", "weighted distortion")
    three, between, four = (csc_distortion(value) for value in (3.0, 3.3, 4.0))
    fine = np.linspace(2.0, 6.0, 401)
    step = (
        max(abs(csc_distortion(b) - csc_distortion(a)) for a, b in pairwise(fine))
        if not runner.quick
        else float(np.abs(np.diff(distortion)).max())
    )
    fifth = [100 * weighted_fifth(value) for value in (3.0, 3.5, 4.0)]
    same_mean = csc_distortion(3.3, float(compensated_duty(0.5, 3.3)))
    return Drawing(
        "(5.13), (5.15): only the orders 6k ± 1 exist. Weighted distortion over the orders to 300.",
        drawn,
        (
            Entry(
                "largest line at other orders, ideal gates at N = 3.3 (Vdc)",
                "none",
                f"{stray_line(3.3):.1e}",
                "no run",
                stray_line(3.3) < 1e-9,
                "Rounding of the computation",
            ),
            Entry(
                "weighted distortion at N = 3, 3.3, 4",
                "3.3 between its neighbours",
                f"{three:.4f}, {between:.4f}, {four:.4f}; 3.3 with the duty for a mean of 0.5: {same_mean:.4f}",
                "no run",
                min(three, four) < between < max(three, four),
                "Not so here, with lines over their order and over the fundamental: the cut last pulse makes 3.3 "
                "better than both neighbours. The thesis does not print its weighting",
            ),
            Entry(
                "weighted distortion over N",
                "falls gradually with N, no jumps",
                f"{distortion[0]:.4f} at N = 2 to {distortion[-1]:.4f} at N = 6; largest step between points "
                f"{step:.4f}",
                "no run",
                False,
                "No jumps, but it falls from whole N to whole N only and rises before each. Whole carriers have the "
                "same mean everywhere in the sector: low orders as without chopping, the fifth over its order and the "
                f"fundamental {fifth[0]:.1f} and {fifth[2]:.1f} % at N = 3 and 4 (1/25 unchopped). A last carrier "
                "cut down to its pulse raises the mean at the end of the sector, which takes the fifth to "
                f"{fifth[1]:.1f} % at N = 3.5; as its gap grows back, the fifth returns, faster than the lines of the "
                "carrier fall with N",
            ),
        ),
    )


def ramp_text(runs: Sequence[Run]) -> str:
    """Slope of the speed target as the runs had it: one for all, or one each."""
    slopes = list(dict.fromkeys(f"{run.scenario.accel_rpm_per_s:,.0f}".replace(",", " ") for run in runs))
    begins = list(dict.fromkeys(f"{run.scenario.initial.speed_rpm:,.0f}".replace(",", " ") for run in runs))
    return f"from {' and '.join(begins)} r/min, slope {' and '.join(slopes)} r/min/s"


def _over_speed(axes: Axes, run: Run, until_s: float) -> None:
    """Phase current A over the frequency of a ramp."""
    records = run.data.records
    records = records[
        (records["t_cycle"] >= 0.05 * run.data.clock_hz) & (records["t_cycle"] <= until_s * run.data.clock_hz)
    ]
    axes.plot(records["omega_e"] / (2 * np.pi), records["ia"], color=PHASE_COLOURS[0], linewidth=0.4)
    for carriers in (7, 6, 5, 4, 3):
        axes.axvline(CARRIER_HZ / 6 / carriers, color="#888888", linewidth=0.8, linestyle=":")
    finish(axes, "fundamental / Hz; dotted: N = 7, 6, 5, 4, 3", "current A / A")


@figure(FAMILY, "5.12")
def failures(runner: Runner) -> Drawing:
    """RSC while the speed rises: failure just below an integer N."""
    drawn, grid = panels.page("5.12: RSC, 20 kHz, ramp at 20 and 30 mN·m", 2, 2, (11.0, 6.0))
    rows, runs = [], []
    for line, load_mnm, printed in zip(grid, (20, 30), ("1111 Hz (N = 3)", "833 Hz (N = 4)"), strict=True):
        run = drive_ramp(runner, Variant("RSC", False, load_mnm, fails_below=4))
        runs.append(run)
        trips = run.result["trips"]
        end_s = trips[0]["time_s"] if trips else run.data.duration_s
        _over_speed(line[0], run, end_s + 0.002)
        panels.title(line[0], f"{load_mnm} mN·m")
        part = run.analysis.commutations.between((end_s - 0.006) * run.data.clock_hz, end_s * run.data.clock_hz)
        line[1].plot((part.cycle / run.data.clock_hz - end_s) * 1e3, part.error_deg, ".-", linewidth=0.6, color="black")
        finish(line[1], "time before the end / ms", "commutation late / deg el.")
        line[1].set_ylim(-5, 90)
        reached = highest_hz(run)
        rows.append(
            Entry(
                f"{load_mnm} mN·m: fails at",
                printed,
                f"{reached:.0f} Hz (N = {CARRIER_HZ / 6 / reached:.2f}), {panels.trip_text(run)}",
                "drive",
                near((1111.0, 833.0)[load_mnm == 30], reached, 0.5) and bool(trips),
                "Below an integer N as in figure 5.7; the trip follows when the lateness has grown. Just below N = 4 "
                "15° are left for the freewheeling and the first sample that counts after it; the thesis does not say "
                "when a sample counts in its model",
            )
        )
    return Drawing(
        f"{BENCH}, constant torque, seen crossings, first sample after; {ramp_text(runs)}: the runs of the regression.",
        drawn,
        tuple(rows),
    )


def at_1_khz(runner: Runner, commutation: Commutation) -> Run:
    """60 000 r/min at 20 kHz, for figures 5.14 and 5.15."""
    end_s = SETTLED_S + (0.02 if runner.quick else 0.06)
    run = drive(
        runner,
        "six-step/figures/carrier-20khz.toml",
        f"1khz-{commutation}",
        *at_speed(60_000),
        f"drive.commutation={commutation}",
        "record.period_s=2e-6",
        "load.fan_torque_nm=0.020",
        "drive.zcd.compute_back=true",
        f"duration_s={end_s:g}",
        "window=[]",
    )
    return whole(run)


PAIR: tuple[Commutation, ...] = ("RSC", "CSC")


@figure(FAMILY, "5.14")
def gate_signals(runner: Runner) -> Drawing:
    """Gates under RSC and CSC at 1 kHz, 20 kHz carrier."""
    drawn, grid = panels.page("5.14: gates at 1 kHz, 20 kHz; dotted: commutations due", 2, 1, (11.0, 6.0))
    rows = []
    for line, commutation in zip(grid, PAIR, strict=True):
        run = at_1_khz(runner, commutation)
        end_s = run.data.duration_s - 0.001
        panels.gates(line[0], run.data, end_s - 0.0012, end_s)
        panels.mark_commutations(line[0], run.analysis, end_s - 0.0012, end_s)
        panels.title(line[0], commutation)
        part = run.analysis.commutations.between(0.1 * run.data.clock_hz, end_s * run.data.clock_hz)
        counts = pulses_a_sector(run, 0.1, end_s)
        rows.append(
            Entry(
                f"{commutation}: delay of the gates (deg); pulses begun a sector",
                "delayed at every gate signal; 3 or 4" if commutation == "RSC" else "none; last pulse cut",
                f"{panels.span_text(part.error_deg, 2)}, mean {part.error_deg.mean():.2f}; "
                f"{counts.min()} … {counts.max()}, mean {counts.mean():.2f}",
                "drive",
                bool(part.error_deg.mean() > 1.0 and set(counts.tolist()) == {3, 4})
                if commutation == "RSC"
                else bool(np.abs(part.error_deg).max() < 0.5),
                "One carrier is 18°: at N = 10/3 the delay takes three values and those between where the speed wanders"
                if commutation == "RSC"
                else "",
            )
        )
    return Drawing(f"{BENCH}, 60 000 r/min, N = 10/3, fan 20 mN·m, crossings computed back.", drawn, tuple(rows))


def pulses_a_sector(run: Run, from_s: float, to_s: float) -> FloatArray:
    """Pulses that begin between successive commutations (a pulse that starts with the sector counts)."""
    series = run.analysis.commutations.between(from_s * run.data.clock_hz, to_s * run.data.clock_hz)
    rows = panels.gate_rows(run.data, from_s, to_s)
    states = rows[:, 1]
    counts = []
    for k in range(series.cycle.size - 1):
        sector = int(series.sector[k])
        pair = (1 << 2 * int(UPPER_LEG[sector])) | (2 << 2 * int(LOWER_LEG[sector]))
        inside = (rows[:, 0] >= series.cycle[k]) & (rows[:, 0] < series.cycle[k + 1])
        on = (states[inside] & pair) == pair
        counts.append(int(np.count_nonzero(on[1:] & ~on[:-1])) + int(on.size > 0 and bool(on[0])))
    return np.array(counts)


@figure(FAMILY, "5.15")
def currents_1_khz(runner: Runner) -> Drawing:
    """Currents under RSC and CSC at 60 000 r/min."""
    drawn, grid = panels.page("5.15: 60 000 r/min, 20 kHz", 2, 2, (11.0, 6.0))
    ripple, envelope = {}, {}
    for line, commutation in zip(grid, PAIR, strict=True):
        run = at_1_khz(runner, commutation)
        end_s = run.data.duration_s
        panels.currents(line[0], run.data, end_s - 0.003, end_s)
        panels.title(line[0], f"{commutation}: three phases")
        panels.currents(line[1], run.data, end_s - 0.02, end_s, ("ia",))
        panels.title(line[1], "phase A, longer")
        ripple[commutation] = panels.peak_to_peak_a(run, 0.1, end_s)
        envelope[commutation] = turn_peaks_a(run, 0.1, end_s)
    most = max(abs(value) for line in grid for axes in line for value in axes.get_ylim())
    for line in grid:
        for axes in line:
            axes.set_ylim(-most, most)
    return Drawing(
        f"{BENCH}, fan 20 mN·m at 60 000 r/min, crossings computed back (RSC would lose lock just below N = 4).",
        drawn,
        (
            Entry(
                "phase current, peak to peak: RSC, CSC (A)",
                "CSC much smaller",
                f"{ripple['RSC']:.1f}, {ripple['CSC']:.1f}",
                "drive",
                ripple["CSC"] < MUCH_SMALLER * ripple["RSC"],
                "At N = 10/3 the delays of RSC repeat every half turn; a speed beside it beats slowly, as printed",
            ),
            Entry(
                "spread of the positive peak from turn to turn: RSC, CSC (A)",
                "drastic, flat",
                f"{np.ptp(envelope['RSC']):.2f}, {np.ptp(envelope['CSC']):.2f}",
                "drive",
                bool(np.ptp(envelope["CSC"]) < MUCH_SMALLER * np.ptp(envelope["RSC"])),
                "How far RSC spreads depends on how far the speed is from N = 10/3",
            ),
        ),
    )


def turn_peaks_a(run: Run, from_s: float, to_s: float) -> FloatArray:
    """Largest current of phase A in each electrical turn of a span."""
    records = run.data.records
    records = records[
        (records["t_cycle"] >= from_s * run.data.clock_hz) & (records["t_cycle"] < to_s * run.data.clock_hz)
    ]
    turn = np.floor(records["theta_e"] / (2 * np.pi)).astype(np.int64)
    whole = np.unique(turn)[1:-1]
    return np.array([records["ia"][turn == k].max() for k in whole])


@figure(FAMILY, "5.16")
def acceleration(runner: Runner) -> Drawing:
    """Acceleration to 1300 Hz under RSC and CSC."""
    begin = "short ramps" if runner.quick else "667 Hz"
    drawn, grid = panels.page(f"5.16: {begin} to 1300 Hz, 20 kHz, 20 mN·m", 2, 2, (11.0, 6.0))
    rows, runs, largest = [], [], []
    for column, commutation in enumerate(PAIR):
        run = drive_ramp(runner, Variant(commutation, False, 20, fails_below=4 if commutation == "RSC" else 0))
        runs.append(run)
        panels.speed(grid[0][column], run.data)
        panels.title(grid[0][column], commutation)
        records = run.data.records
        grid[1][column].plot(
            records["t_cycle"] / run.data.clock_hz, records["ia"], color=PHASE_COLOURS[0], linewidth=0.3
        )
        grid[1][column].set_ylim(-50, 50)
        finish(grid[1][column], "time / s", "current A / A")
        if run.result["trips"]:
            # The constant load turns the rotor backward then.
            for axes in (grid[0][column], grid[1][column]):
                axes.set_xlim(0.0, run.result["trips"][0]["time_s"] + AFTER_TRIP_S)
            grid[0][column].set_ylim(0.0, 90.0)
        reached = highest_hz(run)
        rows.append(
            Entry(
                f"{commutation}: highest frequency",
                "fails at 1111 Hz (N = 3)" if commutation == "RSC" else "1300 Hz",
                f"{reached:.0f} Hz (N = {CARRIER_HZ / 6 / reached:.2f}), {panels.trip_text(run)}",
                "drive",
                near(1111.0 if commutation == "RSC" else 1300.0, reached, 5.0),
                "Fails at the integer before: see figure 5.12"
                if commutation == "RSC"
                else "The speed waves where the mean of CSC changes with N: `drive.linearity` is off",
            )
        )
        largest.append(largest_current_a(run, COMPARED_HZ))
    of_rsc, of_csc = largest
    lower = None if of_rsc is None or of_csc is None else of_csc < of_rsc
    rows.append(
        Entry(
            f"largest current near {COMPARED_HZ:.0f} Hz: RSC, CSC (A)",
            "CSC lower from 700 Hz on",
            ", ".join(NOT_RUN if value is None else f"{value:.1f}" for value in largest),
            "drive",
            lower,
            "A short run does not pass there" if lower is None else "" if lower else "Cause not known",
        )
    )
    return Drawing(
        f"{BENCH}, 20 mN·m, {ramp_text(runs)}, seen crossings: first sample after (RSC), interpolated (CSC).",
        drawn,
        tuple(rows),
    )


def largest_current_a(run: Run, frequency_hz: float) -> float | None:
    """Largest current of phase A within 20 Hz of a frequency, before a trip; None if the run does not pass there."""
    records = run.data.records
    near = np.abs(records["omega_e"] / (2 * np.pi) - frequency_hz) < NEAR_HZ
    if run.result["trips"]:
        near &= records["t_cycle"] < run.result["trips"][0]["time_s"] * run.data.clock_hz
    return float(np.abs(records["ia"][near]).max()) if near.any() else None
