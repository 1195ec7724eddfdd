# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commands `fluxlock soa`, `stability`, `spectrum` and others: theory of six-step operation as table, PNG and JSON.

Defaults are the thesis's operating points with Motor-I. What is slow to import is imported by the commands.
"""

from __future__ import annotations

import math
import zlib
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal
from zipfile import BadZipFile

import numpy as np
import typer

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, Problem, load_inverter, load_motor
from fluxlock.help import THEORY, example
from fluxlock.interface.kinds import Commutation
from fluxlock.theory.six_step.output import (
    number,
    prepare_folder,
    print_table,
    progress_bars,
    write_figure,
)

if TYPE_CHECKING:
    from fluxlock.results.rundata import RunData
    from fluxlock.theory.six_step.soa_study import Study

TORQUE_LINES = 8  # printed

app = typer.Typer(
    help="Theory of six-step operation: safe area, stability, spectra, linearity. Writes PNG and JSON.",
    no_args_is_help=True,
)

MOTOR_1 = ROOT / "motors" / "motor-1.toml"
# Motor-I: figures 4.9 and 4.10 reach 120 000 r/min and, here, beyond their 30 A; its file says 94 000 and 30 A.
SPEED_OVER_MAX, CURRENT_OVER_RATED = 120 / 94, 2.0
MAX_DENOMINATOR = 100
N_RANGE = (Fraction(1, 10), Fraction(100))  # carriers a sector

OutOption = Annotated[Path, typer.Option(help="Folder for PNG and JSON.")]
CarrierOption = Annotated[float, typer.Option("--carrier", min=100.0, max=1e6, help="Carrier frequency, Hz.")]
OrderOption = Annotated[float, typer.Option(min=2.0, max=200.0, help="Highest order (multiple of the fundamental).")]


@app.command(
    rich_help_panel=THEORY, epilog=example("fluxlock soa motors/motor-1.toml --inverter inverters/bench-25v.toml")
)
def soa(
    motor: Annotated[Path, typer.Argument(help="Motor file (TOML).", show_default="Motor-I of the thesis")] = MOTOR_1,
    out: OutOption = Path("build/six-step"),
    inverter: Annotated[
        Path | None, typer.Option(help="Inverter file (TOML); without: ideal switches on a stiff supply.")
    ] = None,
    supply: Annotated[
        float, typer.Option(min=1.0, max=1500.0, help="Supply voltage, V; an inverter file's own counts.")
    ] = 25.0,
    carrier: CarrierOption = 40e3,
    speed_max: Annotated[
        float | None,
        typer.Option(min=1.0, max=2e6, help="Highest speed, r/min; default 1.28 x that of the motor file."),
    ] = None,
    current_max: Annotated[
        float | None, typer.Option(min=0.01, max=5000.0, help="Highest current, A; default 2 x rated current.")
    ] = None,
    late: Annotated[
        float, typer.Option(min=0.0, max=30.0, help="Latest commutation after the ideal instant, deg el.")
    ] = 0.0,
    settle: Annotated[
        float, typer.Option(min=0.0, max=1e-3, help="Settling time after pulse start and extinction, s.")
    ] = 2e-6,
    sample: Annotated[float, typer.Option(min=0.0, max=1e-3, help="Sample period, s.")] = 1e-6,
    simulate: Annotated[bool, typer.Option(help="Also simulate the switched circuit.")] = True,
    commutation: Annotated[
        Literal["NSC", "CSC"], typer.Option(help="Of the periodic states: load of the file, largest torque.")
    ] = "NSC",
    duties: Annotated[
        int, typer.Option(min=2, max=1000, help="Duties a speed, between which the largest torque is interpolated.")
    ] = 33,
) -> None:
    """Safe operating area: freewheel angle over speed and current, torque limits."""
    loaded = load_motor(motor)
    if loaded.phases != 3:
        raise ConfigError([Problem(str(motor), "phases", f"must be 3 for six-step operation, not {loaded.phases}")])
    power_stage = load_inverter(inverter) if inverter else None
    prepare_folder(out, "soa.png", "soa.json")
    from fluxlock.theory.six_step import plots
    from fluxlock.theory.six_step.override import SampleTiming
    from fluxlock.theory.six_step.soa_study import Settings, study
    from fluxlock.theory.six_step.switched import ideal_inverter, real_inverter

    settings = Settings(
        speed_max_rpm=speed_max if speed_max is not None else round(SPEED_OVER_MAX * loaded.max_speed_rpm),
        current_max_a=current_max if current_max is not None else CURRENT_OVER_RATED * loaded.rated_dc_current_a,
        carrier_hz=carrier,
        late_deg=late,
        timing=SampleTiming(settle_s=settle, period_s=sample, latency_s=sample),
        simulate=simulate,
        commutation=commutation,
        duties=duties,
    )
    circuit = real_inverter(power_stage) if power_stage else ideal_inverter(supply)
    with progress_bars() as begin:
        result = study(loaded, circuit, settings, begin)
    _print_study(result)
    write_figure(out, "soa", plots.soa_figure(result), result.document())


def _print_study(result: Study) -> None:
    # The speeds of a table are a twelfth of the highest apart, of the load line a twentieth.
    decimals = max(0, math.ceil(-math.log10(result.settings.speed_max_rpm / 20)))
    most, speeds, limits_a = result.settings.current_max_a, result.bound.speed_rpm, result.current_limits_a
    rows = []
    for k in range(0, speeds.size, 10):
        beyond = "supply" if result.supply_a[k] <= most else f"> {most:g}"
        rows.append([f"{speeds[k]:.{decimals}f}", *(number(values[k], missing=beyond) for values in limits_a.values())])
    print_table("Largest current at the commutation, A", ("speed r/min", "25°", "30°", "computed back", "supply"), rows)
    if result.limits:
        rows = []
        for s, speed in enumerate(result.coarse_rpm):
            values = [v[s] for x in result.limits.values() for v in (x.visible_nm, x.recovered_nm, x.supply_nm)]
            rows.append([f"{speed:.{decimals}f}", *(number(1e3 * value, 2) for value in values)])
        headers = [f"{c} {what}" for c in result.limits for what in ("30°", "computed back", "largest")]
        print_table(
            f"Largest mean torque of the switched circuit, {result.settings.commutation}, mN m",
            ("speed r/min", *headers),
            rows,
        )
    if result.lines:
        rows = []
        for states in zip(*result.lines.values(), strict=False):
            first = states[0]
            cells = [f"{first.speed_rpm:.{decimals}f}", f"{first.torque_nm * 1e3:.1f}", f"{first.current_a.mean():.1f}"]
            cells += [f"{number(s.freewheel_deg.min())} … {number(s.freewheel_deg.max())}" for s in states]
            rows.append(cells)
        headers = [f"{chopping} deg" for chopping in result.lines]
        print_table("Freewheel angle at the load of the file", ("speed r/min", "mN m", "A", *headers), rows)


@app.command(rich_help_panel=THEORY, epilog=example("fluxlock stability"))
def stability(
    out: OutOption = Path("build/six-step"),
    n_min: Annotated[float, typer.Option(min=1.0, max=100.0, help="Least carriers a sector.")] = 1.0,
    n_max: Annotated[float, typer.Option(min=1.0, max=100.0, help="Most carriers a sector.")] = 6.0,
    points: Annotated[int, typer.Option(min=2, max=5000, help="Values of N.")] = 501,
    sectors: Annotated[int, typer.Option(min=10, max=100_000, help="Sectors that the map is followed.")] = 2000,
    freewheel: Annotated[
        float, typer.Option(min=0.0, max=60.0, help="Freewheel angle of the examples at N = 2.9 and 3.1, deg el.")
    ] = 15.0,
) -> None:
    """Stability of the zero-crossing loop over N, the carriers per sector.

    The boundary of the map stands beside the closed form, figure 5.7.
    """
    if not n_min < n_max:
        raise ConfigError([Problem("--n-max", "", f"must be above --n-min ({n_min:g})")])
    prepare_folder(out, "stability.png", "stability.json")
    from fluxlock.theory.six_step import plots
    from fluxlock.theory.six_step import stability as theory

    n = np.linspace(n_min, n_max, points)
    cases: dict[str, tuple[Commutation, bool]] = {
        "RSC": ("RSC", False),
        "RSC, computed back": ("RSC", True),
        "CSC, NSC": ("CSC", False),
        "CSC, NSC, computed back": ("CSC", True),
    }
    found, closed = {}, {}
    with progress_bars() as begin:
        for name, (commutation, back) in cases.items():
            closed[name] = theory.freewheel_limit_deg(n, commutation=commutation, back_computed=back)
            found[name] = theory.stable_freewheel_deg(
                n, commutation=commutation, back_computed=back, sectors=sectors, progress=begin(name)
            )
    examples = {}
    for carriers, back in ((2.9, False), (2.9, True), (3.1, False)):
        label = f"RSC, N = {carriers}, {freewheel:g}°{', computed back' if back else ''}"
        examples[label] = theory.commutation_errors_deg(carriers, freewheel, 60, back_computed=back)
    difference = {name: float(np.abs(found[name] - closed[name]).max()) for name in cases}
    write_figure(
        out,
        "stability",
        plots.stability_figure(n, found, closed, examples),
        {
            "n": n,
            "map_deg": found,
            "closed_form_deg": closed,
            "largest_difference_deg": difference,
            "examples": examples,
        },
    )
    at = [1.999, 2.0, 2.999, 3.0, 25 / 8, 3.999, 4.0, 4.999, 5.0]
    rows = []
    for carriers in at:
        limits = [theory.freewheel_limit_deg(carriers, commutation=c, back_computed=back) for c, back in cases.values()]
        rows.append([f"{carriers:.3f}", *(number(float(limit)) for limit in limits)])
    print_table("Largest freewheel angle, closed form, deg el.", ("N", *cases), rows)
    rows = [[name, f"{value:.3f}"] for name, value in difference.items()]
    print_table(f"Map against closed form, {points} values of N", ("loop", "largest difference deg"), rows)


def _ratio(speed_rpm: float, pole_pairs: int, carrier_hz: float) -> tuple[Fraction, str]:
    """Carriers a sector as a fraction, and how to write it."""
    exact = Fraction(carrier_hz) * 10 / (Fraction(speed_rpm) * pole_pairs)
    if not N_RANGE[0] <= exact <= N_RANGE[1]:
        low, high = N_RANGE
        text = f"with --speed gives {float(exact):.9g} carriers a sector, permitted {float(low):g} to {float(high):g}"
        raise ConfigError([Problem("--carrier", "", text)])
    ratio = exact.limit_denominator(MAX_DENOMINATOR)
    return ratio, f"N = {ratio}" if ratio == exact else f"N = {float(exact):.6g}, taken as {ratio}"


@app.command(rich_help_panel=THEORY, epilog=example("fluxlock spectrum"))
def spectrum(
    out: OutOption = Path("build/six-step"),
    speed: Annotated[float, typer.Option(min=1.0, max=2e6, help="Speed, r/min.")] = 64_000.0,
    pole_pairs: Annotated[int, typer.Option(min=1, max=100, help="Pole pairs.")] = 1,
    carrier: CarrierOption = 20e3,
    mean: Annotated[float, typer.Option(min=0.0, max=1.0, help="Mean of the output, 0..1.")] = 0.6,
    compensate: Annotated[
        bool, typer.Option(help="CSC: duty of (5.18), so that the mean is as wanted; without: duty = mean.")
    ] = True,
    start: Annotated[
        float,
        typer.Option(
            min=0.0, max=360.0, help="Initial phase, deg el.; RSC jumps where a carrier start meets a commutation."
        ),
    ] = 5.0,
    max_order: OrderOption = 17.0,
) -> None:
    """Line spectra of the space vector under RSC, NSC and CSC.

    The series of chapter 6 stand beside generated gates.
    """
    if mean == 0.0:
        raise ConfigError([Problem("--mean", "", "must be above 0: there is no fundamental")])
    ratio, n_text = _ratio(speed, pole_pairs, carrier)
    prepare_folder(out, "spectrum.png", "spectrum.json")
    from fluxlock.theory.six_step import plots
    from fluxlock.theory.six_step.linearity import compensated_duty
    from fluxlock.theory.six_step.patterns import COMMUTATIONS
    from fluxlock.theory.six_step.spectrum_study import alignment_spectrum

    csc_duty = float(compensated_duty(mean, float(ratio))) if compensate else mean
    spectra = [
        alignment_spectrum(alignment, ratio, csc_duty if alignment == "CSC" else mean, start, max_order)
        for alignment in COMMUTATIONS
    ]
    rows = [
        [
            s.commutation,
            f"{s.duty:.4f}",
            f"{abs(s.lines.fundamental):.4f}",
            f"{s.others_rms:.4f}",
            number(s.distortion, 3, "infinite"),
            f"{s.largest_difference:.1e}",
        ]
        for s in spectra
    ]
    headers = ("alignment", "duty", "fundamental", "others rms", "weighted distortion", "series - gates")
    spacing = f"lines every {float(Fraction(6, ratio.denominator)):g} f_e; others: not 1 + 6 k, to order {max_order:g}"
    print_table(f"Space vector, unit Vdc, {n_text}, {spacing}", headers, rows)
    title = f"{speed:.0f} r/min, {carrier / 1e3:g} kHz: {n_text}; mean {mean:g}, initial phase {start:g}°"
    data = {
        "settings": {"n": [ratio.numerator, ratio.denominator], "mean": mean, "start_deg": start},
        "spectra": {
            s.commutation: {
                "duty": s.duty,
                "order": s.lines.order,
                "amplitude": s.lines.amplitude,
                "weighted_distortion": s.distortion,
                "largest_difference_to_gates": s.largest_difference,
            }
            for s in spectra
        },
    }
    write_figure(out, "spectrum", plots.spectrum_figure(title, spectra, max_order, start), data)


def read_trace(path: Path) -> RunData:
    """Read a trace; ConfigError says what is wrong with the file."""
    from fluxlock.results.rundata import load_trace

    try:
        return load_trace(path)
    except (FileNotFoundError, NotADirectoryError):
        text = "file not found"
    except IsADirectoryError:
        text = "is a folder, not a file"
    except OSError as error:
        text = f"cannot be read ({error.strerror or error})"
    # Whatever NumPy makes of other files: text, one array, archives that are cut or hold something else.
    except (ValueError, KeyError, TypeError, EOFError, BadZipFile, zlib.error):
        text = "is no trace of a run; name the trace.npz that fluxlock run has written"
    raise ConfigError([Problem(str(path), "", text)])


@app.command(rich_help_panel=THEORY, epilog=example("fluxlock recorded build/demo/trace.npz --from 0.66 --to 0.72"))
def recorded(
    trace: Annotated[Path, typer.Argument(help="trace.npz of a run.")],
    from_s: Annotated[float, typer.Option("--from", min=0.0, max=1e4, help="Begin of the window, s.")],
    to_s: Annotated[float, typer.Option("--to", min=0.0, max=1e4, help="End of the window, s.")],
    out: OutOption = Path("build/six-step"),
    commutation: Annotated[
        Commutation | None,
        typer.Option(help="Commutation alignment of the run: shows the series of chapter 6 beside."),
    ] = None,
    carrier: CarrierOption = 20e3,
    max_order: OrderOption = 17.0,
) -> None:
    """Line spectra of gates and torque ripple that a run recorded.

    They are taken over a whole number of turns.
    """
    from fluxlock.theory.six_step import plots
    from fluxlock.theory.six_step import recording as theory

    if not from_s < to_s:
        raise ConfigError([Problem("--to", "", f"must be above --from ({from_s:g})")])
    run = read_trace(trace)
    try:
        window = theory.whole_turns(run, from_s, to_s)
        torque = theory.torque_ripple(run, window)
    except ValueError as error:
        raise ConfigError([Problem("--from, --to", "", str(error))]) from None
    prepare_folder(out, "recorded.png", "recorded.json")
    lines = theory.recorded_spectrum(run, window, max_order)
    own, others = theory.harmonics(lines)
    hertz, mean = window.fundamental_hz(run.clock_hz), theory.mean_excitation(run, window)
    headers, columns = ["order", "Hz", "recorded / Vdc"], [(own, others)]
    data: dict[str, Any] = {
        "turns": window.turns,
        "fundamental_hz": hertz,
        "mean": mean,
        "order": lines.order,
        "amplitude": lines.amplitude,
        "torque": {"order": torque.order, "peak_nm": np.abs(torque.amplitude)},
    }
    if commutation is not None:
        series = theory.expected_spectrum(run, window, commutation, carrier, max_order)
        columns.append(theory.harmonics(series))
        headers.append(f"series of {commutation}")
        data["series"] = {"order": series.order, "size": np.abs(series.amplitude)}
    rows = [
        [f"{order:+d}", f"{order * hertz:.0f}", *(f"{sizes[order]:.4f}" for sizes, _ in columns)]
        for order in sorted(own, key=abs)
    ]
    rows.append(["others, rms", "", *(f"{rest:.4f}" for _, rest in columns)])
    print_table(f"{window.turns} turns at {hertz:.1f} Hz, mean of the output {mean:.4f}", headers, rows)
    peaks = np.abs(torque.amplitude)
    largest = np.argsort(peaks)[::-1][:TORQUE_LINES]
    rows = [[f"{torque.order[k]:.3f}", f"{torque.order[k] * hertz:.0f}", f"{1e3 * peaks[k]:.4f}"] for k in largest]
    print_table("largest torque lines below six times the fundamental", ["order", "Hz", "peak / mN*m"], rows)
    title = f"{trace}: {window.turns} turns from {from_s:g} s, fundamental {hertz:.1f} Hz"
    write_figure(out, "recorded", plots.recorded_figure(title, lines, max_order, torque), data)


@app.command(rich_help_panel=THEORY, epilog=example("fluxlock linearity"))
def linearity(
    out: OutOption = Path("build/six-step"),
    n_min: Annotated[float, typer.Option(min=0.1, max=100.0, help="Least carriers a sector.")] = 2.0,
    n_max: Annotated[float, typer.Option(min=0.1, max=100.0, help="Most carriers a sector.")] = 7.0,
    n_error: Annotated[
        float, typer.Option(min=0.0, max=0.5, help="Relative error of the N that the compensation uses.")
    ] = 0.05,
    min_pulse: Annotated[
        float, typer.Option(min=0.0, max=0.5, help="Shortest pulse and gap, carriers (0.4 us at 20 kHz: 0.008).")
    ] = 0.008,
) -> None:
    """Linearity of the output under CSC, with and without compensation.

    Compensation (5.18), wrong N, shortest pulse.
    """
    if not n_min < n_max:
        raise ConfigError([Problem("--n-max", "", f"must be above --n-min ({n_min:g})")])
    prepare_folder(out, "linearity.png", "linearity.json")
    from fluxlock.theory.six_step import plots
    from fluxlock.theory.six_step.linearity import compensated_duty, mean_output, mean_with_min_pulse

    wanted = np.linspace(0.0, 1.0, 501)
    n = np.linspace(n_min, n_max, 1001)[:, None]
    cases = {
        "no compensation": mean_output(np.broadcast_to(wanted, (n.size, wanted.size)), n),
        "compensated": mean_output(compensated_duty(wanted, n), n),
        f"compensated, N {n_error:+.0%} wrong": mean_output(compensated_duty(wanted, n * (1 + n_error)), n),
        f"compensated, N {-n_error:+.0%} wrong": mean_output(compensated_duty(wanted, n * (1 - n_error)), n),
        f"compensated, shortest pulse {min_pulse:g}": mean_with_min_pulse(compensated_duty(wanted, n), n, min_pulse),
    }
    errors = {name: (output - wanted) for name, output in cases.items()}
    ranges = {name: (error.min(axis=0), error.max(axis=0)) for name, error in errors.items()}
    outputs = {f"N = {number:g}": mean_output(wanted, number) for number in (2.1, 2.5, 3.125, 3.9)}
    data = {
        "wanted": wanted,
        "n": [n_min, n_max],
        "error": {name: {"min": low, "max": high} for name, (low, high) in ranges.items()},
    }
    write_figure(out, "linearity", plots.linearity_figure(wanted, outputs, ranges), data)
    rows = [[name, f"{error.min():+.4f}", f"{error.max():+.4f}"] for name, error in errors.items()]
    print_table(f"Error of the mean, N from {n_min:g} to {n_max:g}", ("case", "least", "largest"), rows)
