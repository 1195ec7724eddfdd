# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commands `fluxlock vector ...`: tables of the vector theory. Defaults: Motor-I at 15 kHz, as in the thesis.

What is slow to import is imported by the commands.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import typer

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, Problem, load_motor
from fluxlock.help import example
from fluxlock.theory.six_step.output import number, prepare_folder, print_table, write_figure

if TYPE_CHECKING:
    from fluxlock.config import Motor
    from fluxlock.theory.vector.study import Bench

app = typer.Typer(
    help="Vector control at few samples per turn: controllers, observer, phase-locked loop.",
    no_args_is_help=True,
)

MOTOR_1 = ROOT / "motors" / "motor-1.toml"
LARGEST_SPEED = 0.25  # of f_s
SETTLED_PERIODS = 10.0  # of the phase-locked loop's bandwidth
ParkChoice = Literal["held", "exact"]
KindChoice = Literal["A", "B", "C"]

MotorArgument = Annotated[Path, typer.Argument(help="Motor file (TOML).", show_default="Motor-I of the thesis")]
RateOption = Annotated[float, typer.Option("--rate", min=100.0, max=1e6, help="Sample frequency f_s, Hz.")]
ParkOption = Annotated[
    ParkChoice, typer.Option(help="Angle of the inverse Park: that of the sample, or of the voltage's middle.")
]
SpeedOption = Annotated[
    list[float] | None,
    typer.Option("--speed", help="Electrical speed, Hz, negative in reverse; repeat for more.", show_default="f_s/20"),
]
DelayOption = Annotated[
    list[float] | None, typer.Option("--delay", min=0.0, max=1.0, help="T_d / T_s; repeat for more.")
]
CurrentOption = Annotated[float, typer.Option(min=0.0, max=5000.0, help="q current along the motion, A.")]
LoopOption = Annotated[float, typer.Option("--loop", min=1.0, help="Bandwidth of the phase-locked loop, Hz.")]


def _bench(motor: Path, rate: float, park: ParkChoice) -> tuple[Bench, Motor]:
    from fluxlock.theory.vector.model import SmoothMachine
    from fluxlock.theory.vector.study import Bench

    loaded = load_motor(motor)
    return Bench(SmoothMachine.from_motor(loaded), rate, park), loaded


def _speeds(given: list[float] | None, rate: float, usual: tuple[float, ...]) -> tuple[float, ...]:
    """Speeds over f_s."""
    for hz in given or []:
        if not 0.0 < abs(hz) <= LARGEST_SPEED * rate:
            limit = LARGEST_SPEED * rate
            text = f"is not possible; permitted above 0 to {limit:g} Hz (a quarter of --rate), either sign"
            raise ConfigError([Problem("--speed", f"{hz:g}", text)])
    return tuple(hz / rate for hz in given) if given else usual


def _check_loop(loop: float, rate: float) -> None:
    from fluxlock.theory.vector.pll import LARGEST

    if loop > LARGEST * rate:
        text = f"is too fast; permitted to {LARGEST * rate:g} Hz ({LARGEST:g} of --rate)"
        raise ConfigError([Problem("--loop", f"{loop:g}", text)])


def _at(bench: Bench, speed: float) -> str:
    return f"{speed * bench.fs_hz:g}"


@app.command(epilog=example("fluxlock vector steps"))
def steps(
    motor: MotorArgument = MOTOR_1,
    rate: RateOption = 15e3,
    park: ParkOption = "held",
    speed: SpeedOption = None,
    delay: DelayOption = None,
) -> None:
    """Controllers A, B, C: coupling, overshoot and settling of a d current step."""
    from fluxlock.theory.vector import study

    bench, _ = _bench(motor, rate, park)
    speeds = _speeds(speed, rate, study.SPEEDS)
    found = study.steps(bench, speeds, tuple(delay) if delay else study.DELAYS)
    rows = []
    for k in range(0, len(found), 3):
        three = found[k : k + 3]
        rows.append(
            [
                _at(bench, three[0].speed),
                f"{three[0].delay:g}",
                *(number(s.peak_percent, 1, "unstable") for s in three),
                *(number(s.overshoot_percent) for s in three),
                *(str(s.settling) if s.settling >= 0 else f"> {study.FOLLOWED}" for s in three),
            ]
        )
    headers = ["f_e Hz", "T_d/T_s"]
    headers += [f"{what} {kind}" for what in ("i_q", "over", "5 %") for kind in "ABC"]
    print_table(
        f"Step of i_d: peak |i_q| and overshoot in %, samples to 5 %; T_d over T_s; f_s {rate:g} Hz, {park}",
        headers,
        rows,
    )


@app.command(epilog=example("fluxlock vector bandwidth"))
def bandwidth(
    motor: MotorArgument = MOTOR_1,
    rate: RateOption = 40e3,
    speed: SpeedOption = None,
    delay: DelayOption = None,
    kind: Annotated[KindChoice, typer.Option(help="Controller.")] = "C",
    gamma: Annotated[
        list[float] | None, typer.Option(min=0.01, max=1.0, help="Gain of B and C; repeat for more.")
    ] = None,
) -> None:
    """Bandwidth of the current loop by the 90 degree rule, with margins.

    A rate of 40 kHz is a carrier of 20 kHz that is updated twice.
    """
    from fluxlock.theory.vector import study

    bench, _ = _bench(motor, rate, "held")
    (at, *more) = _speeds(speed, rate, (1500.0 / rate if rate >= 6000.0 else LARGEST_SPEED,))
    if more:
        raise ConfigError([Problem("--speed", "", "this table is for one speed")])
    delays, gammas = tuple(delay or (0.08, 0.25, 0.5, 1.0)), tuple(gamma or (0.35, 0.45, 0.55))
    rows = [
        [
            f"{b.delay:g}",
            f"{b.gamma:g}",
            number(b.phase_hz, 0),
            number(b.minus_3db_hz, 0),
            number(b.phase_margin_deg),
            number(b.gain_margin, 2),
        ]
        for b in study.bandwidths(bench, kind, at, delays, gammas)
    ]
    headers = ("T_d/T_s", "gamma", "-90 deg Hz", "-3 dB of P Hz", "phase margin deg", "gain margin")
    print_table(f"Current loop, controller {kind}, f_s {rate:g} Hz, f_e {_at(bench, at)} Hz", headers, rows)


@app.command(epilog=example("fluxlock vector observer"))
def observer(
    motor: MotorArgument = MOTOR_1,
    rate: RateOption = 15e3,
    park: ParkOption = "held",
    speed: SpeedOption = None,
    current: CurrentOption = 10.0,
) -> None:
    """Angle error of an observer that believes in a wrong delay, in closed form and followed in time."""
    from fluxlock.theory.vector import study

    bench, _ = _bench(motor, rate, park)
    forward = (*study.SPEEDS, *(-s for s in study.SPEEDS))
    found = study.delay_errors(bench, current, _speeds(speed, rate, forward))
    count = len(study.DELAY_PAIRS)
    rows = []
    for k in range(0, len(found), count):
        line = found[k : k + count]
        rows.append([_at(bench, line[0].speed), "closed form", *(f"{e.closed_deg:+.2f}" for e in line)])
        rows.append(["", "simulated", *(f"{e.simulated_deg:+.2f}" for e in line)])
    headers = ("f_e Hz", "", *(f"{delay:g}→{believed:g}" for delay, believed in study.DELAY_PAIRS))
    title = f"Error of the estimate, deg; T_d → T'_d over T_s; i_q {current:g} A, {park}"
    print_table(title, headers, rows)


@app.command(epilog=example("fluxlock vector pll"))
def pll(
    motor: MotorArgument = MOTOR_1,
    rate: RateOption = 15e3,
    speed: SpeedOption = None,
    delay: Annotated[float, typer.Option(min=0.0, max=1.0, help="T_d / T_s.")] = 0.5,
    current: CurrentOption = 10.0,
    loop: LoopOption = 100.0,
) -> None:
    """Phase-locked loop: gains, largest stable bandwidth with the observer, poles without the sign of the speed."""
    from fluxlock.theory.vector import study
    from fluxlock.theory.vector.pll import LARGEST, ORDERS, error_poles, pll_gains
    from fluxlock.theory.vector.sensorless import Drive, bandwidth_limit_hz

    _check_loop(loop, rate)
    bench, _ = _bench(motor, rate, "held")
    ts, rows = 1.0 / rate, []
    for order in ORDERS:
        made = pll_gains(order, loop, ts)
        right, wrong = (float(np.abs(error_poles(made, ts, sign)).max()) for sign in (1.0, -1.0))
        rows.append(
            [str(order), f"{made.a:.5f}", f"{made.b:.2f}", f"{made.c:.1f}", f"{right:.4f}", f"{wrong:.4f}"],
        )
    gain_headers = ("order", "a", "b 1/s", "c 1/s^2", "largest pole", "wrong sign")
    print_table(f"Phase-locked loop of {loop:g} Hz, damping 1, f_s {rate:g} Hz", gain_headers, rows)
    rows = []
    for at in _speeds(speed, rate, (study.SPEEDS[0], -study.SPEEDS[0])):
        for pole in (0.7, 0.9):
            drive = Drive(
                bench.machine,
                bench.sampling(delay),
                complex(0.0, math.copysign(current, at)),
                pll_gains(2, loop, ts),
                poles=(pole, pole),
            )
            most = f"> {LARGEST * rate:g}"
            limits = [bandwidth_limit_hz(drive, bench.omega(at), order) for order in ORDERS]
            rows.append([_at(bench, at), f"{pole:g}", *(number(limit, 0, most) for limit in limits)])
    headers = ("f_e Hz", "observer's poles", "second order Hz", "third order Hz")
    print_table(f"Largest stable bandwidth, T_d/T_s {delay:g}", headers, rows)


@app.command(epilog=example("fluxlock vector parameters"))
def parameters(
    motor: MotorArgument = MOTOR_1,
    out: Annotated[Path, typer.Option(help="Folder for PNG and JSON.")] = Path("build/vector"),
    rate: RateOption = 15e3,
    park: ParkOption = "held",
    delay: Annotated[float, typer.Option(min=0.0, max=1.0, help="T_d / T_s.")] = 0.5,
    speed_max: Annotated[
        float | None, typer.Option(min=1.0, help="Highest electrical speed, Hz; default that of the motor file.")
    ] = None,
    current_max: Annotated[
        float | None, typer.Option(min=0.01, max=5000.0, help="Largest q current, A; default the rated one.")
    ] = None,
    loop: LoopOption = 100.0,
) -> None:
    """Map of the angle error over errors of R, L and psi, speed and load."""
    from fluxlock.theory.vector import parameters as theory
    from fluxlock.theory.vector import plots
    from fluxlock.theory.vector.sensorless import Drive
    from fluxlock.theory.vector.study import speed_range

    bench, loaded = _bench(motor, rate, park)
    highest = speed_max or loaded.max_speed_rpm * loaded.pole_pairs / 60.0
    if highest > LARGEST_SPEED * rate:
        text = f"{highest:g} Hz is above {LARGEST_SPEED * rate:g} Hz, a quarter of --rate; raise --rate or lower it"
        raise ConfigError([Problem("--speed-max", "", text)])
    _check_loop(loop, rate)
    prepare_folder(out, "parameters.png", "parameters.json")
    speeds = speed_range(highest)
    loads = np.linspace(0.0, current_max or loaded.rated_current_a, 31)
    drive = Drive.usual(bench.machine, bench.sampling(delay), 0j, loop)
    settled = math.ceil(SETTLED_PERIODS * rate / loop)
    rows, maps = [], {}
    for change in theory.SINGLE + theory.WORST_PAIRS:
        found = maps[change.text] = theory.error_map(drive, change, speeds, loads)
        full = float(loads[-1])
        course = theory.simulated_error(drive, change, highest, full, settled)
        rows.append(
            [
                change.text,
                number(float(np.nanmax(np.abs(found))), 2),
                f"{found[-1, -1]:+.2f}",
                f"{course:+.2f}",
                str(int(np.isnan(found).sum())),
                number(theory.lowest_speed_hz(drive, change, full, highest), 0),
            ]
        )
    span = f"{speeds[0]:.0f} .. {highest:.0f} Hz, to {loads[-1]:g} A, loop {loop:g} Hz"
    headers = ("machine to file", "largest", "at the top", "simulated", "no angle", "stable from Hz")
    print_table(f"Error of the estimate, deg; {span}", headers, rows)
    worst = theory.worst_case(drive, theory.CHANGES, np.concatenate([speeds, -speeds]), loads)
    rows = [[f"{worst.error_deg:+.2f}", worst.change.text, f"{worst.speed_hz:.0f}", f"{worst.load_a:g}"]]
    headers_worst = ("error deg", "machine to file", "f_e Hz", "i_q A")
    print_table(f"Worst of {len(theory.CHANGES)} combinations, both directions", headers_worst, rows)
    data = {"speed_hz": speeds, "load_a": loads, "error_deg": maps, "worst_deg": worst.error_deg}
    figure = plots.parameter_figure(f"{loaded.name}, f_s {rate / 1e3:g} kHz, T_d {delay:g} T_s", speeds, loads, maps)
    write_figure(out, "parameters", figure, data)
