# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chapter 6: spectra of RSC, NSC and CSC."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from matplotlib.axes import Axes

from fluxlock.cosim.outcome import Run
from fluxlock.results.plots import PHASE_COLOURS
from fluxlock.results.rundata import FloatArray, IntArray, RecordArray
from fluxlock.theory.six_step.fourier import ComplexArray
from fluxlock.theory.six_step.linearity import compensated_duty
from fluxlock.theory.six_step.machine import Machine
from fluxlock.theory.six_step.patterns import COMMUTATIONS, SECTORS, Commutation, gate_sequence
from fluxlock.theory.six_step.plots import draw_gates, finish, stems
from fluxlock.theory.six_step.recording import (
    current_lines,
    expected_spectrum,
    recorded_spectrum,
    whole_turns,
)
from fluxlock.theory.six_step.spectrum import Lines, analytic_lines, line_numbers
from fluxlock.theory.six_step.switched import duty_for_torque, ideal_inverter, waveforms
from fluxverify.figures import panels
from fluxverify.figures.figure import Drawing, Entry, figure, near
from fluxverify.figures.six_step.support import FAMILY, drive, motor_1, schedule
from fluxverify.regression.runner import RunFailed, Runner
from fluxverify.regression.six_step.ramp import Variant, drive_ramp
from fluxverify.regression.six_step.spectrum import spectrum_run
from fluxverify.regression.six_step.support import highest_hz

SPEED_RPM, CARRIER_HZ, SUPPLY_V = 64_000, 20e3, 25.0
RATIO = Fraction(25, 8)
TURNS = RATIO.denominator  # the pattern repeats after it
POINT = "Motor-I, 25 V, 20 kHz, ON-PWM, 64 000 r/min (N = 25/8, lines every 0.75 of the fundamental)"
MAX_ORDER = 10.0
ABUNDANT_A, NONE_A = 0.5, 0.01  # rms of lines; a line of the voltage: 1 % of the fundamental are none
ABUNDANT, REDUCED = 0.05, 0.2  # share beside the trajectories; CSC over RSC


@dataclass(frozen=True)
class Simulated:
    """Ideal circuit in its periodic state: records over `TURNS` turns, gates of the last of them, duty."""

    records: RecordArray
    gates_at: FloatArray
    gates: IntArray
    duty: float


def simulated(commutation: Commutation, torque_nm: float, samples: int) -> Simulated:
    """Switched circuit at the speed of the chapter with ideal commutations."""
    motor, circuit = motor_1(), ideal_inverter(SUPPLY_V)
    state = duty_for_torque(motor, circuit, SPEED_RPM, torque_nm, carrier_hz=CARRIER_HZ, commutation=commutation)
    if state is None:
        raise RunFailed(f"{commutation}: the supply does not suffice for {torque_nm:g} N m")
    settle = TURNS
    sequence = gate_sequence(commutation, float(RATIO), state.duty, turns=settle + TURNS)
    records = waveforms(motor, circuit, SPEED_RPM, sequence, settle_turns=settle, samples=samples)
    last = sequence.at >= settle
    at = np.append(sequence.at[last], sequence.length) - settle
    return Simulated(records, at, sequence.gates[last], state.duty)


def space_vector_a(records: RecordArray) -> ComplexArray:
    """Current space vector (2/3)(ia + a ib + a^2 ic), A."""
    a = np.exp(2j * np.pi / 3)
    return np.asarray((records["ia"] + a * records["ib"] + a * a * records["ic"]) * (2 / 3))


def _regular_lines(values: ComplexArray, turns: int, max_order: float) -> Lines:
    """Lines of samples evenly spread over whole turns, at all orders j / turns up to max_order."""
    most = int(max_order * turns)
    number = np.arange(-most, most + 1)
    return Lines(number / turns, np.fft.fft(values)[number] / values.size)


def _own(order: FloatArray) -> np.ndarray:
    """Whether an order is 1 + 6 k."""
    return np.asarray(np.abs((order - 1.0 + 3.0) % SECTORS - 3.0) < 1e-6)


def sideband_rms(lines: Lines) -> float:
    """Rms of all lines other than 1 + 6 k."""
    return float(np.sqrt(np.sum(np.abs(lines.amplitude[~_own(lines.order)]) ** 2)))


def _relative(lines: Lines) -> Lines:
    return Lines(lines.order, lines.amplitude / abs(lines.fundamental))


@figure(FAMILY, "6.9")
def simulated_waveforms(runner: Runner) -> Drawing:
    """Simulated currents, gates and torque under RSC, NSC and CSC at 64 000 r/min."""
    samples = 126 if runner.quick else 504  # multiples of 6: what is folded stays on the same orders
    drawn, grid = panels.page("6.9: 64 000 r/min, 20 mN·m, ideal circuit", 5, 3, (12.0, 11.0))
    rows, current_rms, torque_rms = [], {}, {}
    for column, commutation in enumerate(COMMUTATIONS):
        part = simulated(commutation, 0.020, samples)
        records = part.records
        turn = np.arange(records.size) / samples
        for name, colour in zip(panels.PHASES, PHASE_COLOURS, strict=True):
            grid[0][column].plot(turn, records[name], color=colour, linewidth=0.6)
        finish(grid[0][column], "turns", "current / A")
        grid[0][column].set_ylim(-40, 40)
        panels.title(grid[0][column], commutation)
        draw_gates(grid[1][column], part.gates_at, part.gates)
        grid[1][column].set_xlim(0, 2)
        grid[1][column].set_xlabel("turns")
        lines = _regular_lines(space_vector_a(records), TURNS, MAX_ORDER)
        stems(grid[2][column], _relative(lines), MAX_ORDER)
        grid[2][column].set_ylabel("current / fundamental")
        torque = records["torque_nm"]
        grid[3][column].plot(turn, torque * 1e3, color="#bbbbbb", linewidth=0.6)
        spectrum = np.fft.rfft(torque) / torque.size
        order = np.arange(spectrum.size) / TURNS
        low = spectrum.copy()
        low[order > 5.9] = 0.0
        grid[3][column].plot(turn, np.fft.irfft(low, torque.size) * torque.size * 1e3, color="black", linewidth=1.0)
        grid[3][column].set_ylim(0, 45)
        finish(grid[3][column], "turns", "torque, below 6 f_e / (mN m)")
        inside = (order > 0) & (order <= 12)
        grid[4][column].bar(order[inside], 2e3 * np.abs(spectrum[inside]), width=0.2, color=PHASE_COLOURS[1])
        grid[4][column].set_ylim(0, 10)
        finish(grid[4][column], "order", "torque line / (mN m)")
        current_rms[commutation] = sideband_rms(lines)
        below = (order > 0) & (order < 5.9)
        torque_rms[commutation] = float(np.sqrt(2 * np.sum(np.abs(spectrum[below]) ** 2)) * 1e3)
        rows.append(
            Entry(
                f"{commutation}: current lines other than 1 + 6 k, rms (A); torque below 6 f_e, rms (mN·m)",
                {
                    "RSC": "abundant; at 0.75 f_e and multiples",
                    "NSC": "somewhat less than RSC; torque ripple larger",
                    "CSC": "none; none",
                }[commutation],
                f"{current_rms[commutation]:.3f}; {torque_rms[commutation]:.3f}",
                "no run",
                {
                    "RSC": current_rms[commutation] > ABUNDANT_A,
                    "NSC": current_rms[commutation] < current_rms["RSC"]
                    and torque_rms[commutation] > torque_rms["RSC"],
                    "CSC": current_rms[commutation] < NONE_A,
                }[commutation],
            )
        )
    return Drawing(
        f"{POINT}; ideal switches, ideal commutation instants, duty for a mean torque of 20 mN·m. Black in the fourth "
        "row: torque without all orders from 6 on.",
        drawn,
        tuple(rows),
    )


@figure(FAMILY, "6.10")
def gate_spectra(runner: Runner) -> Drawing:
    """Analytic spectra of the gates against those recorded from the chip."""
    drawn, grid = panels.page("6.10: gates at 64 000 r/min; bars: series, crosses: chip", 3, 1, (9.0, 9.0))
    rows = []
    for line, commutation in zip(grid, COMMUTATIONS, strict=True):
        run, span = spectrum_run(runner, commutation)
        window = whole_turns(run.data, *span, TURNS)
        series = expected_spectrum(run.data, window, commutation, CARRIER_HZ, 17)
        lines = recorded_spectrum(run.data, window, 17)
        stems(line[0], series, 17)
        found = np.interp(series.order, lines.order, np.abs(lines.amplitude))
        drawn_too = found > 1e-4
        line[0].plot(series.order[drawn_too], found[drawn_too], "x", color="black", markersize=4)
        panels.title(line[0], commutation)
        fundamental = float(np.max(np.abs(series.amplitude[np.abs(series.order - 1) < 1e-9])))
        difference = np.abs(found - np.abs(series.amplitude)) / fundamental
        rows.append(
            Entry(
                f"{commutation}: largest difference of a line, over the fundamental; others than 1 + 6 k, rms",
                "agree (drawn)" if commutation != "CSC" else "agree; none",
                f"{100 * float(difference.max()):.2f} %; series {sideband_rms(series):.4f}, chip "
                f"{float(np.sqrt(np.sum(found[~_own(series.order)] ** 2))):.4f} Vdc",
                "imposed",
                float(difference.max()) < 0.01,
                "What differs: the chip has dead time and noise in its crossings",
            )
        )
        if commutation == "RSC":
            low, high = delays_at_the_jump(run, *span)
            rows.append(
                Entry(
                    "RSC: commutations that wait less than 0.06, more than 0.94 of a carrier",
                    "",
                    f"{low}, {high}",
                    "imposed",
                    None,
                    "Delays are eighths of a carrier apart. Where one of eight commutations is due at a carrier start, "
                    "noise decides between none and a whole carrier, and the lines are a mixture of two patterns",
                )
            )
    return Drawing(
        f"{POINT}, speed imposed, torque 10 mN·m, duty held. The thesis compares series and ideal numeric gates, here "
        f"series and gates of the chip; series against ideal gates agree within 3·10⁻¹⁴. {window.turns} turns.",
        drawn,
        tuple(rows),
    )


def delays_at_the_jump(run: Run, from_s: float, to_s: float) -> tuple[int, int]:
    """Commutations of a span that wait hardly, and those that wait nearly a whole carrier."""
    part = run.analysis.commutations.between(from_s * run.data.clock_hz, to_s * run.data.clock_hz)
    carriers = part.error_deg / 60.0 * float(RATIO)
    return int(np.count_nonzero(carriers < 0.06)), int(np.count_nonzero(carriers > 0.94))


@figure(FAMILY, "6.11")
def measured_currents(runner: Runner) -> Drawing:
    """Phase currents and current spectra of the chip under RSC, NSC and CSC at 64 000 r/min."""
    drawn, grid = panels.page("6.11: 64 000 r/min, currents of the chip's runs", 2, 3, (12.0, 6.0))
    rows, worst = [], {}
    for column, commutation in enumerate(COMMUTATIONS):
        run, span = spectrum_run(runner, commutation)
        window = whole_turns(run.data, *span, TURNS)
        panels.currents(grid[0][column], run.data, span[1] - 0.008, span[1])
        panels.title(grid[0][column], commutation)
        number = np.arange(-int(MAX_ORDER * TURNS), int(MAX_ORDER * TURNS) + 1)
        lines = current_lines(run.data, window, 1.0 + (number - TURNS) / TURNS)
        stems(grid[1][column], _relative(lines), MAX_ORDER)
        grid[1][column].set_ylabel("current / fundamental")
        beside = ~_own(lines.order) & (np.abs((lines.order * TURNS - TURNS) % SECTORS) < 1e-6)
        worst[commutation] = float(np.abs(lines.amplitude[beside]).max())
        rows.append(
            Entry(
                f"{commutation}: largest line at 1 + 0.75 k beside 1 + 6 k; of them all, rms (A)",
                "abundant" if commutation != "CSC" else "none",
                f"{worst[commutation]:.4f}; {float(np.sqrt(np.sum(np.abs(lines.amplitude[beside]) ** 2))):.4f}",
                "imposed",
                worst[commutation] < NONE_A if commutation == "CSC" else worst[commutation] > ABUNDANT_A,
            )
        )
    most = max(abs(value) for axes in grid[0] for value in axes.get_ylim())
    for axes in grid[0]:
        axes.set_ylim(-most, most)
    rows.append(
        Entry(
            "largest sideband, CSC below RSC (dB)",
            "cancelled",
            f"{20 * np.log10(worst['RSC'] / worst['CSC']):.1f}",
            "imposed",
            worst["CSC"] < 0.01 * worst["RSC"],
            "What is left under CSC are crossings that differ by the noise of their samples",
        )
    )
    return Drawing(f"{POINT}, speed imposed, torque 10 mN·m, duty held, interpolated crossings.", drawn, tuple(rows))


SWEEP_HZ = (477.0, 1100.0)


def _sweep(runner: Runner, commutation: Commutation) -> tuple[Run, float]:
    """Ramp from N = 7 to N = 3; the run and when the ramp begins."""
    slope = 300_000 if runner.quick else 90_000
    low_rpm, high_rpm = (60 * hertz for hertz in SWEEP_HZ)
    begin_s = 0.08
    run = drive(
        runner,
        "six-step/figures/carrier-20khz.toml",
        f"sweep-{commutation}",
        f"initial.speed_rpm={low_rpm:g}",
        schedule(low_rpm, (begin_s, "speed_rpm", high_rpm)),
        f"drive.commutation={commutation}",
        f"drive.accel_rpm_per_s={slope}",
        "drive.zcd.compute_back=true",
        "window=[]",
        f"duration_s={begin_s + (high_rpm - low_rpm) / slope + 0.02:g}",
    )
    return run, begin_s


def spectrogram(run: Run, from_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Short-time spectra of the current space vector: Hz [f], fundamental in Hz [t], size in A [t, f]."""
    records = run.data.records[run.data.records["t_cycle"] >= from_s * run.data.clock_hz]
    step_s = float(np.median(np.diff(records["t_cycle"]))) / run.data.clock_hz
    grid = np.arange(records["t_cycle"][0], records["t_cycle"][-1], step_s * run.data.clock_hz)
    vector = space_vector_a(records)
    even = np.interp(grid, records["t_cycle"], vector.real) + 1j * np.interp(grid, records["t_cycle"], vector.imag)
    omega = np.interp(grid, records["t_cycle"], records["omega_e"])
    length = round(0.01 / step_s)
    window = np.hanning(length)
    starts = np.arange(0, grid.size - length, max(1, length // 3))
    size = np.array([np.abs(np.fft.fft(even[k : k + length] * window)) / window.sum() for k in starts])
    hertz = np.fft.fftfreq(length, step_s)
    keep = np.abs(hertz) <= 10e3
    order = np.argsort(hertz[keep])
    return hertz[keep][order], omega[starts + length // 2] / (2 * np.pi), size[:, keep][:, order]


def _map(axes: Axes, hertz: FloatArray, fundamental: FloatArray, size: FloatArray, text: str) -> None:
    # Where the ramp begins and ends the speed goes back and forth by a little.
    rising = fundamental > np.maximum.accumulate(np.concatenate(([-np.inf], fundamental[:-1])))
    fundamental, size = fundamental[rising], size[rising]
    floor = 20 * np.log10(np.maximum(size / size.max(), 1e-4))
    axes.pcolormesh(hertz / 1e3, fundamental, floor, cmap="magma", vmin=-60, vmax=0, shading="nearest", rasterized=True)
    axes.set_xlabel("frequency / kHz")
    axes.set_ylabel("fundamental / Hz")
    panels.title(axes, text)


def trajectory_share(hertz: FloatArray, fundamental: FloatArray, size: FloatArray) -> float:
    """Energy further than 250 Hz from every 1 + 6 k trajectory over that of the fundamental's, square root."""
    rest, own = 0.0, 0.0
    for row, f_e in zip(size, fundamental, strict=True):
        distance = np.abs((hertz / f_e - 1.0 + 3.0) % SECTORS - 3.0) * f_e
        rest += float(np.sum(row[distance > 250.0] ** 2))
        own += float(np.sum(row[np.abs(hertz - f_e) <= 250.0] ** 2))
    return float(np.sqrt(rest / own))


@figure(FAMILY, "6.12")
def measured_spectrograms(runner: Runner) -> Drawing:
    """Spectrograms of the currents from 477 Hz to 1.1 kHz under RSC, NSC and CSC."""
    drawn, grid = panels.page(
        "6.12: current space vector of the chip's runs; dB of the largest line", 1, 3, (12.0, 4.6)
    )
    rows, share = [], {}
    for axes, commutation in zip(grid[0], COMMUTATIONS, strict=True):
        run, begin_s = _sweep(runner, commutation)
        hertz, fundamental, size = spectrogram(run, begin_s - 0.005)
        _map(axes, hertz, fundamental, size, commutation)
        share[commutation] = trajectory_share(hertz, fundamental, size)
        rows.append(
            Entry(
                f"{commutation}: rms beside the 1 + 6 k trajectories, over the fundamental; highest frequency",
                "abundant trajectories" if commutation != "CSC" else "remarkably reduced",
                f"{100 * share[commutation]:.2f} %; {highest_hz(run):.0f} Hz, {panels.trip_text(run)}",
                "drive",
                share["CSC"] < REDUCED * share["RSC"] if commutation == "CSC" else share[commutation] > ABUNDANT,
            )
        )
    return Drawing(
        "Motor-I, 25 V, 20 kHz, ON-PWM, fan 10 mN·m at 60 000 r/min, crossings computed back (so that RSC passes the "
        "integers N = 6, 5, 4); Hann windows of 10 ms.",
        drawn,
        tuple(rows),
    )


@figure(FAMILY, "6.13")
def predicted_spectrograms(runner: Runner) -> Drawing:
    """Predicted spectrograms of the gates from 477 Hz to 1.1 kHz under RSC, NSC and CSC."""
    drawn, grid = panels.page("6.13: series of the gates; dB of the largest line", 1, 3, (12.0, 4.6))
    machine = Machine.from_motor(motor_1())
    count = 40 if runner.quick else 160
    ratios = [Fraction(float(n)).limit_denominator(16) for n in np.linspace(3.0, 7.0, count)]
    rows = []
    for axes, commutation in zip(grid[0], COMMUTATIONS, strict=True):
        frequency, speed, level, rest, own = [], [], [], 0.0, 0.0
        for ratio in ratios:
            f_e = CARRIER_HZ / 6 / float(ratio)
            mean = float(machine.steady_duty(SUPPLY_V, 2 * np.pi * f_e, 6.0))
            duty = float(compensated_duty(mean, float(ratio))) if commutation == "CSC" else mean
            lines = analytic_lines(commutation, ratio, duty, line_numbers(ratio, 10e3 / f_e), start_deg=5.0)
            size = np.abs(lines.amplitude)
            keep = size > 1e-3
            frequency.append(lines.order[keep] * f_e)
            speed.append(np.full(int(keep.sum()), f_e))
            level.append(20 * np.log10(size[keep] / abs(lines.fundamental)))
            rest += float(np.sum(size[~_own(lines.order)] ** 2))
            own += abs(lines.fundamental) ** 2
        axes.scatter(
            np.concatenate(frequency) / 1e3,
            np.concatenate(speed),
            c=np.concatenate(level),
            s=3,
            cmap="magma",
            vmin=-60,
            vmax=0,
            linewidths=0,
        )
        axes.set_facecolor("black")
        axes.set_xlim(-10, 10)
        axes.set_xlabel("frequency / kHz")
        axes.set_ylabel("fundamental / Hz")
        panels.title(axes, commutation)
        rows.append(
            Entry(
                f"{commutation}: rms beside the 1 + 6 k lines, over the fundamental",
                "abundant, as measured" if commutation != "CSC" else "none",
                f"{100 * np.sqrt(rest / own):.2f} %",
                "no run",
                rest < 1e-6 * own if commutation == "CSC" else rest > ABUNDANT**2 * own,
                "Of the voltage; of its fundamental the EMF leaves little: the currents' share (6.12) is larger"
                if commutation == "RSC"
                else "",
            )
        )
    return Drawing(
        "Series of chapter 6 at N = p/q, q to 16, duty of the periodic state at 6 A; lines above 0.001 Vdc.",
        drawn,
        tuple(rows),
    )


@figure(FAMILY, "6.14")
def dynamic(runner: Runner) -> Drawing:
    """30 000 → 78 000 → 30 000 r/min under RSC, NSC and CSC."""
    slope = 120_000
    begin_s = 0.06
    down_s = begin_s + 48_000 / slope + 0.05
    end_s = down_s + 0.04 if runner.quick else down_s + 48_000 / slope + 0.1
    drawn, grid = panels.page(f"6.14: 30 000 → 78 000 → 30 000 r/min, {slope} r/min/s, 20 mN·m", 2, 3, (12.0, 5.6))
    printed = {"RSC": "trips at 1110 Hz", "NSC": "trips soon after 1300 Hz", "CSC": "completes"}
    printed_hz = {"RSC": 1110.0, "NSC": 1300.0}
    rows = []
    for column, commutation in enumerate(COMMUTATIONS):
        # RSC does not come back: the run of figure 5.12 shows it all.
        run = (
            drive_ramp(runner, Variant("RSC", False, 20, fails_below=4))
            if commutation == "RSC"
            else drive(
                runner,
                "six-step/ramp-1300hz.toml",
                f"both-ways-{commutation}",
                "initial.speed_rpm=30000",
                schedule(30_000, (begin_s, "speed_rpm", 78_000), (down_s, "speed_rpm", 30_000)),
                f"drive.commutation={commutation}",
                f"drive.accel_rpm_per_s={slope}",
                "window=[]",
                f"duration_s={end_s:g}",
            )
        )
        panels.speed(grid[0][column], run.data)
        grid[0][column].set_ylim(0, 90)
        panels.title(grid[0][column], commutation)
        trips = run.result["trips"]
        shown_s = trips[0]["time_s"] + 0.001 if trips else down_s
        panels.currents(grid[1][column], run.data, shown_s - 0.004, shown_s)
        grid[1][column].set_ylim(-50, 50)
        panels.title(grid[1][column], "before the trip" if trips else "at the top")
        peak = ""
        if not trips:
            peak = f"; largest current at the top {peak_a(run, down_s - 0.03, down_s):.1f} A"
        rows.append(
            Entry(
                f"{commutation}",
                printed[commutation],
                f"{highest_hz(run):.0f} Hz (N = {CARRIER_HZ / 6 / highest_hz(run):.2f}), {panels.trip_text(run)}{peak}",
                "drive",
                not trips
                if commutation == "CSC"
                else bool(trips) and near(printed_hz[commutation], highest_hz(run), 5.0),
                {
                    "RSC": "See figure 5.12",
                    "NSC": "Interpolated crossings keep their time in the gap, and the sector's first pulse may come "
                    "late: no error adds up. Current limit and load of the thesis are not printed",
                    "CSC": "Slope ten times the thesis's",
                }[commutation],
            )
        )
    return Drawing(
        "Motor-I, 25 V, 20 kHz, ON-PWM, 20 mN·m, seen crossings, interpolated. RSC: the run of 5.12, from 40 000 r/min "
        "with 12 000 r/min/s, first sample after.",
        drawn,
        tuple(rows),
    )


def peak_a(run: Run, from_s: float, to_s: float) -> float:
    """Largest magnitude of a phase current in a span."""
    records = panels.records_between(run.data, from_s, to_s)
    return float(max(np.abs(records[name]).max() for name in panels.PHASES))
