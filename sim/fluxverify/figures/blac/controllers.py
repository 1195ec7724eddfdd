# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Section 7.3: plant, tracking and decoupling of the current controllers, steps of the d current."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.plots import GREY, finish
from fluxlock.theory.vector.controllers import GAMMA, KINDS, Kind, cross_peak, settling_samples
from fluxlock.theory.vector.frequency import Loop, plant_zero, tracking_bandwidth, tracking_decoupling
from fluxlock.theory.vector.model import Coefficients, ComplexArray, coefficients
from fluxlock.theory.vector.study import DELAYS
from fluxverify.figures import panels
from fluxverify.figures.blac.support import ANALYTIC, CONTROLLER_COLOURS, FAMILY, bench, identified, percent
from fluxverify.figures.figure import Drawing, Entry, Speed, figure, near, rises
from fluxverify.regression.runner import Runner
from fluxverify.regression.vector.current_bench import STEP_A, Setting, id_step
from fluxverify.regression.vector.sines import Tracking, excited, tracking

LOWEST = 1e-3  # of f_s
SHOWN = 20  # samples of a step
INNER_DELAYS = (0.25, 0.5, 0.75)
WHY_Q = "Near f_s/2 both pass little of the reference; there the smaller gain of B counts"
WHY_SIX = "The thesis names no band; 5 % of the vector here, sample 0 is that of the step"
TONES = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 17, 20, 25, 31)  # in 64 samples
IDENTIFIED_TONES = [sign * k for k in (1, 3, 5, 8, 12, 17, 23, 29) for sign in (1, -1)]
CHIP_STEPS = (
    f"Lines: exact discrete model. Points: the chip with the switched inverter, i_d stepped by {STEP_A:g} A, less the "
    "same run without the step."
)
CHIP_TONES = (
    f"Lines: exact discrete model. Points: the chip with the switched inverter, {len(TONES)} sines on the reference of "
    "i_d, as large as the current's limit and the voltage leave room for; filled those of B."
)
WHY_CIRCLE = (
    "Γ1 and Γ2 are what the new and the old voltage do in a period: equal near T_d = T_s / 2, which R moves a little. "
    "The thesis gives no number"
)
WHY_ZERO = (
    "What is left is dead time and noise. The ripple in a single sample at 0.25 and 0.75 T_s, which follows the "
    "voltage of now, is taken off: it follows from the plant's current at the borders of the voltage's period"
)
NO_MORE = "T_d > T_s, (7.10) to (7.14), is not here: `drive.vector.delay` ends at 1"
WHY_FINE = "0 but for the rounding of the computation"
WHY_RIPPLE = "Beside the middle of pulse and gap the sample holds ripple; what the step changes of it stays"
WHY_OFFSET = "What the dead time leaves; most around f_e, where the reference asks for a constant phase current"
WHY_REST = "Noise of the current converter, whose step is 0.024 A or 0.12 % of the step, and what the dead time leaves"
RIPPLED = (0.25, 0.75)
NOTHING = 0.03  # of the step, which is the 3 % of the steps' row in the regression
COUPLING = dict(zip(DELAYS, (*(3 * ["A most, B less, C least"]), "A; none with B and C"), strict=True))


@figure(FAMILY, "7.4")
def pole_zero_map(runner: Runner) -> Drawing:
    """Poles and zero of the plant over delay and fundamental frequency."""
    drawn, grid = panels.page("7.4: plant $(Γ_1 z + Γ_2) / (z (z − Φ))$", 1, 2, (10.0, 4.8))
    delays = np.linspace(0.0, 0.995, 40 if runner.quick else 400)
    crossing = {}
    found: dict[tuple[float, float], complex] = {}
    on_chip = {} if runner.quick else {speed: _identified(runner, speed) for speed in (0.05, 0.1)}
    for axes, zoomed in zip(grid[0], (False, True), strict=True):
        turn = np.linspace(0.0, 2 * np.pi, 361)
        axes.plot(np.cos(turn), np.sin(turn), color=GREY, linewidth=0.8)
        for number, speed in enumerate((0.01, 0.05, 0.1)):
            colour = CONTROLLER_COLOURS[KINDS[number]]
            models = [coefficients(bench().machine, bench().omega(speed), bench().sampling(float(d))) for d in delays]
            zeros = np.array([complex(plant_zero(model)) for model in models])
            phi = complex(models[0].phi)
            axes.plot(zeros.real, zeros.imag, color=colour, label=percent(speed))
            axes.plot([phi.real, 0.0], [phi.imag, 0.0], "x", color=colour, markersize=7)
            for delay in INNER_DELAYS:
                at = complex(plant_zero(coefficients(bench().machine, bench().omega(speed), bench().sampling(delay))))
                axes.plot([at.real], [at.imag], "o", color=colour, markersize=4, fillstyle="none")
            for delay, model in on_chip.get(speed, {}).items():
                at, pole = complex(plant_zero(model)), complex(model.phi)
                axes.plot([at.real], [at.imag], "s", color=colour, markersize=5)
                axes.plot([pole.real], [pole.imag], "+", color=colour, markersize=9)
                found[speed, delay] = at
            crossing[speed] = float(np.interp(1.0, np.abs(zeros), delays))
        axes.set_aspect("equal")
        limit = 1.15 if zoomed else 4.0
        axes.set_xlim(-limit, 0.2 * limit if not zoomed else limit)
        axes.set_ylim(-0.6 * limit if not zoomed else -limit, 0.6 * limit if not zoomed else limit)
        finish(axes, "real part", "imaginary part")
        panels.title(axes, "poles x, zero over $T_d$ (o: 0.25, 0.5, 0.75 $T_s$)")
    panels.legend(grid[0][0], 1, "upper left")
    where = ", ".join(f"{d:.3f}" for d in crossing.values())
    at_zero = max(abs(complex(plant_zero(coefficients(bench().machine, bench().omega(speed), bench().sampling(0.0)))))
                  for speed in crossing)  # fmt: skip
    lines = [
        Entry("size of the zero at T_d = 0", "origin", f"{at_zero:.3g}", "no run", at_zero < 1e-9),
        Entry(
            "T_d / T_s at which it leaves the unit circle, f_e/f_s 0.01, 0.05, 0.1",
            "as T_d approaches T_s",
            where,
            "no run",
            False,
            WHY_CIRCLE,
        ),
    ]
    for speed in on_chip:
        exact = [complex(plant_zero(coefficients(bench().machine, bench().omega(speed), bench().sampling(d))))
                 for d in INNER_DELAYS]  # fmt: skip
        chip = [found[speed, d] for d in INNER_DELAYS]
        values = (", ".join(f"{abs(zero):.2f}" for zero in zeros) for zeros in (exact, chip))
        text = "model {}; chip {}".format(*values)
        quantity = f"size of the zero at T_d = 0.25, 0.5, 0.75 T_s, f_e/f_s {speed:g}"
        lines.append(Entry(quantity, "", text, "imposed", None, WHY_ZERO))
    identification = (
        "Squares and +: zero and pole by least squares from currents and voltages on the chip with the switched "
        f"inverter and controller C, {len(IDENTIFIED_TONES)} turning sines on the reference, as large as there is room "
        "for; less the same run without them and the carrier's ripple."
    )
    return Drawing(
        f"Motor-I, f_s 15 kHz. {NO_MORE}. {ANALYTIC if runner.quick else identification}", drawn, tuple(lines)
    )


def _identified(runner: Runner, speed: float) -> dict[float, Coefficients]:
    """The plant on the chip by delay, with controller C."""
    return {d: identified(excited(runner, Setting("C", speed, d), IDENTIFIED_TONES)) for d in INNER_DELAYS}


def _frequencies(quick: bool) -> FloatArray:
    return np.geomspace(LOWEST, 0.5, 200 if quick else 1000)


def _decibel(axes: Axes, frequency: FloatArray, value: ComplexArray, colour: str, style: str, label: str) -> None:
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(np.abs(value))
    axes.semilogx(frequency, level, style, color=colour, label=label, linewidth=1)


def _finish_bode(axes: Axes, name: str, lowest: float) -> None:
    axes.axhline(-3.0, color=GREY, linewidth=0.6, linestyle=":")
    axes.set_xlim(LOWEST, 0.5)
    axes.set_ylim(lowest, 12.0)
    finish(axes, "f / $f_s$", f"|{name}| / dB")


@figure(FAMILY, "7.5")
def tracking_full_delay(runner: Runner) -> Drawing:
    """Tracking P at a delay of one sample period, over the gain."""
    drawn, grid = panels.page("7.5: P(z) at $T_d = T_s$, $f_e$ = 0.05 $f_s$, B = C", 1, 2, (10.0, 3.8))
    size, phase = grid[0]
    f = _frequencies(runner.quick)
    found, coupling = {}, 0.0
    on_chip: dict[float, Tracking] = {}
    for number, gamma in enumerate((0.1, 0.2, 0.3, 0.4)):
        loop = bench().loop("C", 0.05, 1.0, gamma)
        p, q = tracking_decoupling(loop, f)
        found[gamma] = tracking_bandwidth(loop)
        coupling = max(coupling, float(np.abs(q).max()))
        _decibel(size, f, p, f"C{number}", "-", f"γ = {gamma:g}")
        phase.semilogx(f, np.degrees(np.unwrap(np.angle(p))), color=f"C{number}", linewidth=1)
        if not runner.quick:
            seen = on_chip[gamma] = tracking(runner, Setting("C", 0.05, 1.0, gamma=gamma), TONES)
            _points(size, seen.frequency, seen.p, f"C{number}")
            lag = np.degrees(np.unwrap(np.angle(seen.p)))
            phase.semilogx(seen.frequency, lag, "o", color=f"C{number}", markersize=3, fillstyle="none")
    _finish_bode(size, "P", -30.0)
    panels.legend(size, 1, "lower left")
    phase.set_xlim(LOWEST, 0.5)
    finish(phase, "f / $f_s$", "phase of P / deg")
    lines = [
        Entry(
            "-3 dB bandwidth over f_s, γ = 0.1, 0.2, 0.3, 0.4",
            "rises with γ",
            ", ".join(f"{b:.3f}" for b in found.values()),
            "no run",
            rises(list(found.values())),
        ),
        Entry("largest |Q|", "0", f"{coupling:.1e}", "no run", coupling < 1e-12, WHY_FINE),
    ]
    if on_chip:
        largest = max(_decibels(np.abs(seen.q).max()) for seen in on_chip.values())
        lines += [
            Entry(
                "the same on the chip",
                "rises with γ",
                ", ".join(f"{seen.bandwidth:.3f}" for seen in on_chip.values()),
                "imposed",
                rises([seen.bandwidth for seen in on_chip.values()]),
                WHY_OFFSET,
            ),
            Entry("largest |Q| on the chip (dB)", "none", f"{largest:.1f}", "imposed", False, WHY_OFFSET),
            _tones_entry(on_chip.values()),
        ]
    return Drawing(f"Motor-I, f_s 15 kHz. {CHIP_TONES if on_chip else ANALYTIC}", drawn, tuple(lines))


def _decibels(size: float) -> float:
    return 20 * math.log10(size)


def _points(axes: Axes, frequency: FloatArray, value: ComplexArray, colour: str, filled: bool = False) -> None:
    style = "full" if filled else "none"
    axes.semilogx(frequency, 20 * np.log10(np.abs(value)), "o", color=colour, markersize=3, fillstyle=style)


Case = tuple[str, Loop, Loop]  # label, B, C


def _compare(axes: Sequence[Axes], loops: Sequence[Case], f: FloatArray) -> list[tuple[FloatArray, ...]]:
    """Draw P and Q of B (dashed) and C (solid) by case; sizes of Q of B and C."""
    sizes = []
    for number, (label, of_b, of_c) in enumerate(loops):
        both = []
        for loop, style, kind in ((of_b, "--", "B"), (of_c, "-", "C")):
            p, q = tracking_decoupling(loop, f)
            _decibel(axes[0], f, p, f"C{number}", style, f"{kind}, {label}")
            _decibel(axes[1], f, q, f"C{number}", style, f"{kind}, {label}")
            both.append(np.abs(q))
        sizes.append(tuple(both))
    _finish_bode(axes[0], "P", -30.0)
    _finish_bode(axes[1], "Q", -80.0)
    panels.legend(axes[0], 2, "lower left")
    return sizes


def _compare_on_chip(
    runner: Runner, axes: Sequence[Axes], settings: Sequence[tuple[float, float]]
) -> tuple[list[Tracking], list[Tracking]]:
    """Measure B and C at settings (speed, gamma), T_d = T_s/2, and draw them: B filled."""
    found: tuple[list[Tracking], list[Tracking]] = ([], [])
    for number, (speed, gamma) in enumerate(settings):
        for part, kind in zip(found, KINDS[1:], strict=True):
            seen = tracking(runner, Setting(kind, speed, 0.5, gamma=gamma), TONES)
            part.append(seen)
            for panel, value in zip(axes, (seen.p, seen.q), strict=True):
                _points(panel, seen.frequency, value, f"C{number}", kind == "B")
    return found


def _chip_entries(on_chip: tuple[list[Tracking], list[Tracking]]) -> list[Entry]:
    widths = (", ".join(f"{seen.bandwidth:.3f}" for seen in part) for part in on_chip)
    sizes = (", ".join(f"{_decibels(np.abs(seen.q).max()):.1f}" for seen in part) for part in on_chip)
    return [
        Entry("bandwidths of P over f_s on the chip", "", "B {}; C {}".format(*widths), "imposed", None, WHY_OFFSET),
        Entry("largest |Q| on the chip (dB)", "", "B {}; C {}".format(*sizes), "imposed", None, WHY_OFFSET),
        _tones_entry([*on_chip[0], *on_chip[1]]),
    ]


def _tones_entry(runs: Iterable[Tracking]) -> Entry:
    """Amplitude of the sines, and the current in which the dead time acts otherwise."""
    values = (
        sorted({round(value, 1) for value in part})
        for part in zip(*((r.amplitude_a, r.band_a) for r in runs), strict=True)
    )
    amplitude, band = (" … ".join(f"{value:g}" for value in dict.fromkeys((part[0], part[-1]))) for part in values)
    text = f"{amplitude}; {band}"
    return Entry(
        "amplitude of each sine; phase current below which the dead time costs nothing (A)", "", text, "imposed", None
    )


def _bandwidths(cases: Sequence[Case]) -> tuple[list[float], list[float]]:
    """-3 dB bandwidths over f_s of B and C."""
    return [tracking_bandwidth(b) for _, b, _ in cases], [tracking_bandwidth(c) for _, _, c in cases]


def _smaller(sizes: Sequence[tuple[FloatArray, ...]], f: FloatArray) -> tuple[str, Speed, bool, str]:
    """Up to where Q of C is below that of B in all cases, and by how much B is below C beyond: the end of a row."""
    first = min((float(f[c >= b][0]) for b, c in sizes if np.any(c >= b)), default=math.nan)
    if math.isnan(first):
        return "at every frequency", "no run", True, ""
    most = max(float((c - b).max()) for b, c in sizes)
    return f"up to {first:.2f} f_s; above it B by at most {most:.4f}", "no run", False, WHY_Q


@figure(FAMILY, "7.6")
def decoupling_over_gain(runner: Runner) -> Drawing:
    """Tracking P and decoupling Q at half a sample period, over the gain."""
    drawn, grid = panels.page("7.6: $T_d = 0.5 T_s$, $f_e$ = 0.05 $f_s$; dashed B, solid C", 1, 2, (11.0, 4.2))
    f = _frequencies(runner.quick)
    gammas = (0.2, 0.3, 0.4)
    cases: list[Case] = [
        (f"γ = {g:g}", bench().loop("B", 0.05, 0.5, g), bench().loop("C", 0.05, 0.5, g)) for g in gammas
    ]
    sizes = _compare(grid[0], cases, f)
    chip = [] if runner.quick else _chip_entries(_compare_on_chip(runner, grid[0], [(0.05, g) for g in gammas]))
    of_b, of_c = (", ".join(f"{value:.3f}" for value in part) for part in _bandwidths(cases))
    q_of_b, q_of_c = (
        ", ".join(f"{20 * math.log10(size.max()):.1f}" for size in part) for part in zip(*sizes, strict=True)
    )
    return Drawing(
        f"Motor-I, f_s 15 kHz; γ' of B is γ / 2. {CHIP_TONES if chip else ANALYTIC}",
        drawn,
        (
            Entry(
                "-3 dB bandwidth of P over f_s, γ = 0.2, 0.3, 0.4",
                "rises, B and C alike",
                f"B {of_b}; C {of_c}",
                "no run",
                all(rises(part) for part in _bandwidths(cases)),
                "C is wider by 4 to 7 %: γ = 2 γ' makes both alike only approximately, as the thesis says",
            ),
            Entry(
                "largest |Q| (dB)",
                "rises with γ",
                f"B {q_of_b}; C {q_of_c}",
                "no run",
                all(rises([float(size.max()) for size in part]) for part in zip(*sizes, strict=True)),
            ),
            Entry("|Q| of C below that of B", "from 0 to 0.5 f_s", *_smaller(sizes, f)),
            *chip,
        ),
    )


@figure(FAMILY, "7.7")
def decoupling_over_speed(runner: Runner) -> Drawing:
    """Tracking P and decoupling Q at half a sample period, over the sampling ratio."""
    drawn, grid = panels.page("7.7: $T_d = 0.5 T_s$, γ = 2γ' = 0.4; dashed B, solid C", 1, 2, (11.0, 4.2))
    f = _frequencies(runner.quick)
    speeds = (0.01, 0.05, 0.1)
    cases: list[Case] = [
        (f"$f_e$ = {s:g} $f_s$", bench().loop("B", s, 0.5, 0.4), bench().loop("C", s, 0.5, 0.4)) for s in speeds
    ]
    sizes = _compare(grid[0], cases, f)
    chip = [] if runner.quick else _chip_entries(_compare_on_chip(runner, grid[0], [(s, 0.4) for s in speeds]))
    of_b, of_c = _bandwidths(cases)
    change = of_c[-1] / of_c[0] - 1
    return Drawing(
        f"Motor-I, f_s 15 kHz. {CHIP_TONES if chip else ANALYTIC}",
        drawn,
        (
            Entry(
                "B: -3 dB bandwidth over f_s from f_e = 0.01 to 0.1 f_s",
                "0.11 to 0.092 (-16 %)",
                f"{of_b[0]:.3f} to {of_b[-1]:.3f} ({100 * (of_b[-1] / of_b[0] - 1):+.0f} %)",
                "no run",
                near(0.11, of_b[0], 0.005) and near(0.092, of_b[-1], 0.0005),
            ),
            Entry(
                "C: the same",
                "almost independent",
                f"{of_c[0]:.3f} to {of_c[-1]:.3f} ({100 * change:+.1f} %)",
                "no run",
                abs(change) < 0.02,
            ),
            Entry("|Q| of C below that of B", "at any f_e", *_smaller(sizes, f)),
            *chip,
        ),
    )


def _draw_step(axes: Sequence[Axes], kind: Kind, speed: float, delay: float) -> ComplexArray:
    """Draw i_d and i_q of the exact model and return them."""
    response = bench().step(kind, speed, delay)
    shown = np.arange(SHOWN)
    for panel, part in zip(axes, (response.real, response.imag), strict=True):
        panel.plot(shown, part[:SHOWN], "-", color=CONTROLLER_COLOURS[kind], linewidth=0.8, label=kind)
    return response


def _draw_chip(axes: Sequence[Axes], runner: Runner, kind: Kind, speed: float, delay: float) -> ComplexArray:
    """Draw i_d and i_q of the chip and return them over the step."""
    step = id_step(runner, Setting(kind, speed, delay)).current
    for panel, part in zip(axes, (step.real, step.imag), strict=True):
        panel.plot(np.arange(SHOWN), part[:SHOWN], "o", color=CONTROLLER_COLOURS[kind], markersize=3, fillstyle="none")
    return step


def _as_stated(steps: Mapping[Kind, ComplexArray], delay: float, nothing: float) -> bool:
    """Whether the q currents have the thesis's order: A > B > C; at T_d = T_s A alone above `nothing` of the step."""
    a, b, c = (cross_peak(steps[kind]) for kind in KINDS)
    return a > b > c if delay < 1.0 else a > nothing >= max(b, c)


def draw_steps(number: str, speed: float, runner: Runner, on_chip: Sequence[float]) -> Drawing:
    """Steps at a speed over f_s; on_chip: delays at which the chip stands beside."""
    drawn, grid = panels.page(f"{number}: step of $i_d^*$ at {percent(speed)}, γ = {GAMMA:g}", 2, 4, (13.0, 5.2))
    lines: list[Entry] = []
    for column, delay in enumerate(DELAYS):
        panel = (grid[0][column], grid[1][column])
        exact = {kind: _draw_step(panel, kind, speed, delay) for kind in KINDS}
        chip = {kind: _draw_chip(panel, runner, kind, speed, delay) for kind in KINDS if delay in on_chip}
        panels.title(panel[0], f"$T_d$ = {delay:g} $T_s$")
        panel[0].axhline(1.0, color=GREY, linewidth=0.6)
        for axes, name in zip(panel, ("$i_d$", "$i_q$"), strict=True):
            axes.set_xlim(0, SHOWN - 1)
            finish(axes, "sample", f"{name} / step")
        panel[0].set_ylim(-0.1, 1.6)
        panel[1].set_ylim(-0.9, 0.9)
        peaks, seen = (" / ".join(f"{100 * cross_peak(i):.1f}" for i in part.values()) for part in (exact, chip))
        settled = " / ".join(str(settling_samples(i)) for i in exact.values())
        quantity = f"T_d = {delay:g} T_s: peak |i_q|, A / B / C (% of the step)"
        lines.append(Entry(quantity, COUPLING[delay], peaks, "no run", _as_stated(exact, delay, 1e-9)))
        if chip:
            why = WHY_RIPPLE if delay in RIPPLED else "" if delay < 1.0 else WHY_REST
            lines.append(Entry("on the chip", COUPLING[delay], seen, "imposed", _as_stated(chip, delay, NOTHING), why))
        agrees = settling_samples(exact["C"]) <= 6
        lines.append(Entry("samples to 5 %, A / B / C", "C within six samples", settled, "no run", agrees, WHY_SIX))
    panels.legend(grid[0][0], 3, "lower right")
    what = CHIP_STEPS if on_chip else ANALYTIC
    return Drawing(f"Motor-I, f_s 15 kHz, held inverse Park, currents at the samples. {what}", drawn, tuple(lines))


@figure(FAMILY, "7.8")
def steps_at_750_hz(runner: Runner) -> Drawing:
    """Step of the d current at 750 Hz with controllers A, B, C."""
    return draw_steps("7.8", 0.05, runner, () if runner.quick else DELAYS)


@figure(FAMILY, "7.9")
def steps_at_1500_hz(runner: Runner) -> Drawing:
    """Step of the d current at 1500 Hz with controllers A, B, C."""
    return draw_steps("7.9", 0.1, runner, () if runner.quick else DELAYS)
