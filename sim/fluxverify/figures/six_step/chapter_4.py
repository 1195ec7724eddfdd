# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Chapter 4: freewheeling, chopping patterns, safe operating area."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.cosim.outcome import Run
from fluxlock.results.angles import FLOATING_PHASE
from fluxlock.results.plots import PHASE_COLOURS
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.freewheel import Decay, freewheel_angle_deg, worst_over_carrier
from fluxlock.theory.six_step.machine import Machine
from fluxlock.theory.six_step.output import number
from fluxlock.theory.six_step.patterns import Chopping, freewheel_mode
from fluxlock.theory.six_step.plots import CHOPPING_COLOURS, finish
from fluxlock.theory.six_step.switched import ideal_inverter, worst_commutation_deg
from fluxverify.figures import panels
from fluxverify.figures.figure import DRAWN, Drawing, Entry, figure, near, rises
from fluxverify.figures.six_step.support import FAMILY, SETTLED_S, drive, motor_1, schedule, whole
from fluxverify.regression.case import LOCK_MAY_GO
from fluxverify.regression.runner import Runner

SUPPLY_V, CARRIER_HZ = 25.0, 40e3
SPEEDS_RPM = np.linspace(10e3, 120e3, 111)
MODES: tuple[Decay, ...] = ("mode 1", "mode 2")
MODE_COLOURS = {"mode 1": PHASE_COLOURS[0], "mode 2": PHASE_COLOURS[1]}
PATTERNS: tuple[Chopping, ...] = ("H_PWM-L_ON", "H_ON-L_PWM", "PWM-ON", "ON-PWM")
SCENARIO = "six-step/figures/patterns.toml"
STATED = "R = 20 mΩ, L = 20 µH, ψ = 1 mWb, 30 A, 25 V, D = 1"
CHAPTER_4_L_H = 20e-6
MUCH_SMALLER_DEG = 15.0  # than the 30 of mode 2
TRIPPING_S = 0.005  # before a trip: its last turns belong to the failure
DUTIES = (0.4, 0.6, 0.8, 1.0)


def duty_at(machine: Machine, speed_rpm: FloatArray, current_a: FloatArray | float) -> FloatArray:
    """Duty of the periodic state; NaN where the supply does not suffice."""
    duty = machine.steady_duty(SUPPLY_V, machine.omega_e(speed_rpm), current_a)
    return np.where(duty <= 1.0, duty, np.nan)


def carrier_range_deg(
    machine: Machine, speed_rpm: FloatArray, current_a: FloatArray | float, mode: Decay
) -> tuple[FloatArray, FloatArray]:
    """Least and largest freewheel angle over the carrier's phase; NaN beyond the supply."""
    duty = duty_at(machine, speed_rpm, current_a)
    n = machine.carriers_per_sector(speed_rpm, CARRIER_HZ)
    least, most = worst_over_carrier(
        machine, SUPPLY_V, machine.omega_e(speed_rpm), current_a, mode, duty=np.nan_to_num(duty, nan=1.0), n=n
    )
    return np.where(np.isnan(duty), np.nan, least), np.where(np.isnan(duty), np.nan, most)


def microseconds(angle_deg: FloatArray, speed_rpm: FloatArray, machine: Machine) -> FloatArray:
    """Duration of an angle."""
    return np.asarray(np.radians(angle_deg) / machine.omega_e(speed_rpm) * 1e6)


@figure(FAMILY, "4.9")
def durations(runner: Runner) -> Drawing:
    """Freewheel duration and angle of both modes over speed and current."""
    machine = Machine.from_motor(motor_1())
    speeds = SPEEDS_RPM[::10] if runner.quick else SPEEDS_RPM
    drawn, grid = panels.page("4.9: freewheeling, Motor-I, 25 V, 40 kHz; bands: phase of the carrier", 1, 2, (11, 4.8))
    largest: dict[tuple[str, float], FloatArray] = {}
    least_us: dict[tuple[str, float], FloatArray] = {}
    for mode in MODES:
        for current_a, alpha in ((10.0, 0.85), (20.0, 0.55), (30.0, 0.3)):
            least, most = carrier_range_deg(machine, speeds, current_a, mode)
            largest[mode, current_a] = most
            least_us[mode, current_a] = microseconds(most, speeds, machine)
            label = f"{mode}, {current_a:g} A"
            colour, x = MODE_COLOURS[mode], speeds / 1e3
            bands = ((microseconds(least, speeds, machine), least_us[mode, current_a]), (least, most))
            for axes, (low, high) in zip(grid[0], bands, strict=True):
                axes.fill_between(x, low, high, color=colour, alpha=alpha, linewidth=0.5, label=label)
    # The switched circuit, without the model's neglect of the incoming phase.
    points = np.array([40e3]) if runner.quick else np.array([20e3, 40e3, 60e3, 80e3])
    model_gap: dict[str, float] = {}
    for mode, chopping in (("mode 1", "ON-PWM"), ("mode 2", "PWM-ON")):
        gaps = []
        for speed in points:
            duty = float(duty_at(machine, np.array([speed]), 20.0)[0])
            circuit = worst_commutation_deg(
                motor_1(),
                ideal_inverter(SUPPLY_V),
                float(speed),
                20.0,
                duty=duty,
                carrier_hz=CARRIER_HZ,
                chopping="ON-PWM" if chopping == "ON-PWM" else "PWM-ON",
                phases=4 if runner.quick else 16,
            )
            grid[0][1].plot(speed / 1e3, circuit, "o", color=MODE_COLOURS[mode], markeredgecolor="black", markersize=5)
            gaps.append(float(np.interp(speed, speeds, largest[mode, 20.0])) - circuit)
        model_gap[mode] = max(gaps, key=abs)
    grid[0][1].plot([], [], "o", color="white", markeredgecolor="black", label="switched circuit, 20 A")
    finish(grid[0][0], "speed / (1000 r/min)", "duration / µs")
    grid[0][0].set_ylim(0, 160)
    grid[0][1].set_ylim(0, 60)
    finish(grid[0][1], "speed / (1000 r/min)", "freewheel angle / deg el.")
    grid[0][1].axhline(30.0, color="red", linewidth=0.8)
    panels.legend(grid[0][1], 2, "upper left")
    always = all(
        bool(np.all((largest["mode 1", i] <= largest["mode 2", i] + 1e-9)[~np.isnan(largest["mode 1", i])]))
        for i in (10.0, 20.0, 30.0)
    )
    one, two = least_us["mode 1", 20.0], least_us["mode 2", 20.0]
    end = np.flatnonzero(~np.isnan(one))[-1]
    return Drawing(
        "Model of section 4.3 at the duty of the periodic state, to where the supply ends; points: switched circuit, "
        "worst carrier phase, ideal switches.",
        drawn,
        (
            Entry("mode 1 shorter than mode 2 everywhere", "yes", "yes" if always else "no", "no run", always),
            Entry(
                "20 A: longest duration of mode 1, 20 000 r/min → end of the supply (µs)",
                "nearly constant",
                f"{np.interp(20e3, speeds, one):.1f} → {one[end]:.1f}",
                "no run",
                near(1.0, float(one[end] / np.interp(20e3, speeds, one)), 0.1),
                "In mode 1 the off time is the faster one; its share shrinks as the duty rises",
            ),
            Entry(
                "20 A: longest duration of mode 2 (µs)",
                "falls with the speed, in steps of a carrier",
                f"{np.interp(20e3, speeds, two):.1f} → {two[end]:.1f}",
                "no run",
                bool(two[end] < np.interp(20e3, speeds, two)),
                "The off time, in which only the EMF acts, shrinks with the duty",
            ),
            Entry(
                "angles of both modes at duty 1",
                "equal",
                f"{largest['mode 1', 20.0][end]:.2f}, {largest['mode 2', 20.0][end]:.2f} at {speeds[end]:.0f} r/min",
                "no run",
                near(float(largest["mode 1", 20.0][end]), float(largest["mode 2", 20.0][end]), 0.5),
                "The last point of the curve lies just below duty 1",
            ),
            Entry(
                "model less switched circuit at 20 A (deg)",
                "",
                f"mode 1 {model_gap['mode 1']:+.2f}, mode 2 {model_gap['mode 2']:+.2f}",
                "no run",
                None,
                "At 14 A and 60 000 r/min mode 2 of the circuit is up to 3° shorter: its incoming current ends in "
                "the off time",
            ),
        ),
    )


@figure(FAMILY, "4.10")
def contours(runner: Runner) -> Drawing:
    """Freewheel angle of both modes over current and speed."""
    machine = Machine.from_motor(motor_1())
    speeds = np.linspace(10e3, 120e3, 23 if runner.quick else 111)
    amperes = np.linspace(1.0, 40.0, 20 if runner.quick else 79)
    drawn, grid = panels.page(
        "4.10: largest freewheel angle over the carrier's phase, Motor-I, 25 V, 40 kHz", 1, 2, (11, 4.8)
    )
    rows, area = [], {}
    for axes, mode in zip(grid[0], MODES, strict=True):
        _, most = carrier_range_deg(machine, speeds[None, :], amperes[:, None], mode)
        filled = axes.contourf(speeds / 1e3, amperes, np.clip(most, 0, 60), levels=np.arange(0, 61, 5), cmap="viridis")
        lines = axes.contour(speeds / 1e3, amperes, np.clip(most, 0, 60), levels=[25, 30], colors="white")
        axes.clabel(lines, fmt="%g°", fontsize=panels.SMALL)
        finish(axes, "speed / (1000 r/min)", "current at the commutation / A")
        panels.title(axes, mode)
        limits = {}
        for at in (40e3, 60e3, 80e3):
            column = most[:, np.argmin(np.abs(speeds - at))]
            within = np.flatnonzero(column <= 30.0)
            limits[at] = float(amperes[within[-1]]) if within.size else 0.0
        area[mode] = float(np.sum(most <= 30.0) / np.sum(~np.isnan(most)))
        rows.append(
            Entry(
                f"{mode}: largest current with 30° at 40 / 60 / 80 000 r/min (A)",
                "contours, no numbers legible",
                " / ".join(f"{value:.1f}" for value in limits.values()),
                "no run",
                None,
                f"{DRAWN}. 40: the edge of the map; where the supply ends first, its limit",
            )
        )
    drawn.colorbar(filled, ax=grid[0], label="deg el.")
    rows.append(
        Entry(
            "share of the reachable plane within 30°, mode 1, mode 2",
            "mode 1 broader",
            f"{area['mode 1']:.2f}, {area['mode 2']:.2f}",
            "no run",
            area["mode 1"] > area["mode 2"],
        )
    )
    return Drawing(
        "Model of section 4.3 at the duty of the periodic state; blank: beyond the supply.", drawn, tuple(rows)
    )


def _influence(
    number: str, name: str, cases: Mapping[str, tuple[Machine, float, float, Decay]], quick: bool
) -> tuple[Figure, dict[str, FloatArray], FloatArray]:
    """Durations and angles over the speed for machines, supplies, duties at 30 A."""
    speeds = SPEEDS_RPM[::10] if quick else SPEEDS_RPM
    drawn, grid = panels.page(f"{number}: freewheeling for various {name}, 30 A", 1, 2, (11, 4.4))
    angles = {}
    for k, (label, (machine, supply_v, duty, decay)) in enumerate(cases.items()):
        omega = machine.omega_e(speeds)
        if duty >= 1.0:
            most = freewheel_angle_deg(machine, supply_v, omega, 30.0, "bound")
        else:
            n = machine.carriers_per_sector(speeds, CARRIER_HZ)
            _, most = worst_over_carrier(machine, supply_v, omega, 30.0, decay, duty=duty, n=n)
        angles[label] = most
        style = "--" if decay == "mode 2" else "-"
        grid[0][0].plot(speeds / 1e3, microseconds(most, speeds, machine), style, color=f"C{k % 10}", label=label)
        grid[0][1].plot(speeds / 1e3, most, style, color=f"C{k % 10}", label=label)
    finish(grid[0][0], "speed / (1000 r/min)", "duration / µs")
    finish(grid[0][1], "speed / (1000 r/min)", "freewheel angle / deg el.")
    grid[0][0].set_ylim(bottom=0)
    grid[0][1].set_ylim(0, 90)
    panels.legend(grid[0][1], 2, "upper left")
    return drawn, angles, speeds


def _at_60(angles: Mapping[str, FloatArray], speeds: FloatArray) -> str:
    return ", ".join(f"{label}: {np.interp(60e3, speeds, values):.1f}" for label, values in angles.items())


def _at_60_entry(angles: Mapping[str, FloatArray], speeds: FloatArray) -> Entry:
    return Entry("angle at 60 000 r/min (deg)", "curves, no numbers", _at_60(angles, speeds), "no run", None, DRAWN)


def _change(angles: Mapping[str, FloatArray], speeds: FloatArray) -> list[float]:
    """All cases at 60 000 r/min (deg)."""
    return [float(np.interp(60e3, speeds, curve)) for curve in angles.values()]


def _from_to(values: Sequence[float]) -> str:
    return f"{values[0]:.1f} → {values[-1]:.1f}"


def _stated_machine() -> Machine:
    return replace(Machine.from_motor(motor_1()), l_h=CHAPTER_4_L_H)


@figure(FAMILY, "4.14")
def resistances(runner: Runner) -> Drawing:
    """Freewheeling for various resistances."""
    cases = {f"{r} mΩ": (replace(_stated_machine(), r_ohm=r * 1e-3), SUPPLY_V, 1.0, MODES[0]) for r in (10, 20, 30, 40)}
    drawn, angles, speeds = _influence("4.14", "resistances", cases, runner.quick)
    change = _change(angles, speeds)
    return Drawing(
        f"(4.24), {STATED}.",
        drawn,
        (
            _at_60_entry(angles, speeds),
            Entry(
                "10 → 40 mΩ at 60 000 r/min (deg)",
                "very small influence",
                _from_to(change),
                "no run",
                near(1.0, change[-1] / change[0], 0.05),
                "L/R is far longer than the freewheeling",
            ),
        ),
    )


@figure(FAMILY, "4.15")
def inductances(runner: Runner) -> Drawing:
    """Freewheeling for various inductances."""
    cases = {
        f"{henry} µH": (replace(_stated_machine(), l_h=henry * 1e-6), SUPPLY_V, 1.0, MODES[0])
        for henry in (10, 20, 30, 40)
    }
    drawn, angles, speeds = _influence("4.15", "inductances", cases, runner.quick)
    change = _change(angles, speeds)
    return Drawing(
        f"(4.24), {STATED}.",
        drawn,
        (
            _at_60_entry(angles, speeds),
            Entry(
                "10 → 40 µH at 60 000 r/min (deg)",
                "large influence, rising",
                _from_to(change),
                "no run",
                rises(change) and change[-1] > 2 * change[0],
            ),
        ),
    )


@figure(FAMILY, "4.16")
def supplies(runner: Runner) -> Drawing:
    """Freewheeling for various DC-link voltages."""
    cases = {f"{volt} V": (_stated_machine(), float(volt), 1.0, MODES[0]) for volt in (15, 20, 25, 30)}
    drawn, angles, speeds = _influence("4.16", "DC-link voltages", cases, runner.quick)
    change = _change(angles, speeds)
    return Drawing(
        f"(4.24), {STATED} but the voltage.",
        drawn,
        (
            _at_60_entry(angles, speeds),
            Entry("15 → 30 V at 60 000 r/min (deg)", "falls", _from_to(change), "no run", rises(change[::-1])),
        ),
    )


@figure(FAMILY, "4.17")
def duties(runner: Runner) -> Drawing:
    """Freewheeling for various duties, both modes."""
    cases = {
        f"{mode}, {duty:g}": (_stated_machine(), SUPPLY_V, duty, mode)
        for mode in MODES
        for duty in (0.4, 0.6, 0.8, 1.0)
    }
    drawn, angles, speeds = _influence("4.17", "duties", cases, runner.quick)
    ones = [float(np.interp(60e3, speeds, angles[f"mode 1, {d:g}"])) for d in DUTIES]
    twos = [float(np.interp(60e3, speeds, angles[f"mode 2, {d:g}"])) for d in DUTIES]
    return Drawing(
        f"Model of section 4.3 at the worst carrier phase, {STATED} but the duty; solid mode 1, dashed mode 2.",
        drawn,
        (
            Entry(
                "mode 1 at 60 000 r/min, duty 0.4 / 0.6 / 0.8 / 1 (deg)",
                "rises with the duty",
                " / ".join(number(value) for value in ones),
                "no run",
                rises(ones),
            ),
            Entry(
                "mode 2 (deg)",
                "falls with the duty",
                " / ".join(number(value, 1, "above 90") for value in twos),
                "no run",
                rises([value for value in twos if np.isfinite(value)][::-1]),
                "A commutation at the start of an off time is the worst; with the printed curves the phase is not "
                "stated",
            ),
            Entry(
                "both at duty 1", "equal", f"{ones[-1]:.2f}, {twos[-1]:.2f}", "no run", near(ones[-1], twos[-1], 0.05)
            ),
        ),
    )


def _patterns(runner: Runner, name: str, load_nm: float) -> tuple[Run, dict[Chopping, tuple[float, float]]]:
    """One run at 60 000 r/min through all four patterns; spans in which each has settled."""
    each_s = 0.02 if runner.quick else 0.04
    starts = {pattern: SETTLED_S + k * each_s for k, pattern in enumerate(PATTERNS)}
    end_s = SETTLED_S + len(PATTERNS) * each_s
    run = drive(
        runner,
        SCENARIO,
        name,
        schedule(60_000, *((at_s, "command", f"set pattern {pattern}") for pattern, at_s in starts.items())),
        f"load.fan_torque_nm={load_nm:g}",
        f"duration_s={end_s + 0.001:g}",
    )
    return whole(run), {pattern: (at_s + each_s / 2, at_s + each_s) for pattern, at_s in starts.items()}


def freewheeling(run: Run, from_s: float, to_s: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Per commutation of a span: cycle, sector entered, freewheel angle (deg), outgoing current (A)."""
    low, high = from_s * run.data.clock_hz, to_s * run.data.clock_hz
    series = run.analysis.commutations
    inside = np.flatnonzero((series.cycle[:-1] >= low) & (series.cycle[1:] < high))
    angle = run.analysis.freewheel_deg(low, high)
    records = run.data.records
    current = np.stack([np.interp(series.cycle[inside], records["t_cycle"], records[name]) for name in panels.PHASES])
    sector = series.sector[inside]
    outgoing = np.abs(current[FLOATING_PHASE[sector], np.arange(inside.size)])
    return series.cycle[inside], sector.astype(np.float64), angle, outgoing


def _mode_angles(run: Run, pattern: Chopping, span: tuple[float, float]) -> dict[int, FloatArray]:
    """Freewheel angles by mode."""
    _, sector, angle, _ = freewheeling(run, *span)
    mode = freewheel_mode(pattern, sector.astype(np.int64))
    return {m: angle[mode == m] for m in (1, 2) if (mode == m).any()}


@figure(FAMILY, "4.8")
def pattern_currents(runner: Runner) -> Drawing:
    """Phase currents of the four chopping patterns at 60 000 r/min, about 20 A."""
    run, spans = _patterns(runner, "patterns-20a", 0.030)
    drawn, grid = panels.page("4.8: 60 000 r/min, about 20 A at the commutation", 2, 4, (12.0, 5.4))
    rows = []
    for column, pattern in enumerate(PATTERNS):
        end_s = spans[pattern][1]
        panels.currents(grid[0][column], run.data, end_s - 0.003, end_s)
        panels.title(grid[0][column], pattern)
        panels.currents(grid[1][column], run.data, end_s - 0.0006, end_s)
        panels.mark_commutations(grid[1][column], run.analysis, end_s - 0.0006, end_s)
        amperes = freewheeling(run, *spans[pattern])[3]
        found = _mode_angles(run, pattern, spans[pattern])
        rows.append(
            Entry(
                f"{pattern}: freewheel angle by mode (deg), current at the commutation (A)",
                {
                    "PWM-ON": "mode 2 almost 30",
                    "ON-PWM": "mode 1 much smaller",
                }.get(pattern, "one diode mode 1, the other mode 2 almost 30"),
                "; ".join(f"mode {m} {panels.span_text(values)}" for m, values in found.items())
                + f"; {amperes.mean():.1f} A",
                "drive",
                (1 not in found or bool(found[1].max() < MUCH_SMALLER_DEG))
                and (2 not in found or near(30.0, float(found[2].max()), 3.0)),
                "Mode 2 depends on the carrier's phase at the commutation; CSC always begins with a pulse, the "
                "thesis's carrier runs on"
                if 2 in found
                else "",
            )
        )
    for axes in grid[0] + grid[1]:
        axes.set_ylim(-30, 30)
    return Drawing(
        "Motor-I, 25 V, 40 kHz, CSC, fan 30 mN·m at 60 000 r/min, crossings computed back. One run; the pattern is "
        "changed at the console. The thesis simulates, here the chip drives. Lower row: one turn enlarged.",
        drawn,
        tuple(rows),
    )


@figure(FAMILY, "4.11")
def torques(runner: Runner) -> Drawing:
    """Torque of the four chopping patterns at 60 000 r/min, 20 mN·m."""
    run, spans = _patterns(runner, "patterns-14a", 0.020)
    drawn, grid = panels.page("4.11: torque at 60 000 r/min, load 20 mN·m", 2, 2, (10.0, 5.4))
    rows, ripples = [], {}
    for axes, pattern in zip(grid[0] + grid[1], PATTERNS, strict=True):
        from_s, to_s = spans[pattern]
        records = panels.records_between(run.data, to_s - 0.002, to_s)
        axes.plot(
            panels.ms(records["t_cycle"], run.data, to_s - 0.002),
            records["torque_nm"] * 1e3,
            color="black",
            linewidth=0.7,
        )
        axes.set_ylim(0, 40)
        finish(axes, "time / ms", "torque / (mN m)")
        panels.title(axes, pattern)
        torque = run.analysis.window(from_s, to_s)["torque_nm"]
        ripples[pattern] = torque["ripple_pp"] * 1e3
        rows.append(
            Entry(
                f"{pattern}: mean, ripple peak to peak (mN·m)",
                "drawn",
                f"{torque['mean'] * 1e3:.2f}, {ripples[pattern]:.2f}",
                "drive",
                None,
                DRAWN,
            )
        )
    least = min(ripples, key=lambda p: ripples[p])
    rows.append(
        Entry(
            "pattern with the least ripple",
            "PWM-ON",
            least,
            "drive",
            least == "PWM-ON",
            "In mode 2 the outgoing current falls more slowly and fills the notch of the commutation",
        )
    )
    return Drawing("Motor-I, 25 V, 40 kHz, CSC, fan 20 mN·m at 60 000 r/min. The chip drives.", drawn, tuple(rows))


@figure(FAMILY, "4.12")
def pattern_voltages(runner: Runner) -> Drawing:
    """Terminal voltage of the four chopping patterns at 60 000 r/min, about 14 A."""
    run, spans = _patterns(runner, "patterns-14a", 0.020)
    drawn, grid = panels.page("4.12: 60 000 r/min, fan 20 mN·m: terminal voltage and current of A", 2, 4, (12.0, 5.4))
    rows = []
    for column, pattern in enumerate(PATTERNS):
        from_s, to_s = spans[pattern]
        begin_s = to_s - 0.0012
        records = panels.records_between(run.data, begin_s, to_s)
        time = panels.ms(records["t_cycle"], run.data, begin_s)
        grid[0][column].plot(time, records["va"], color=PHASE_COLOURS[0], linewidth=0.6)
        crossings = run.analysis.crossings.between(begin_s * run.data.clock_hz, to_s * run.data.clock_hz)
        own = FLOATING_PHASE[crossings.sector] == 0
        at = panels.ms(crossings.cycle[own], run.data, begin_s)
        grid[0][column].plot(at, np.full(at.size, SUPPLY_V / 2), "o", color="black", markersize=4)
        panels.title(grid[0][column], pattern)
        finish(grid[0][column], "time / ms", "v_A / V")
        panels.currents(grid[1][column], run.data, begin_s, to_s, ("ia",))
        grid[1][column].set_ylim(-30, 30)
        found = _mode_angles(run, pattern, (from_s, to_s))
        amperes = freewheeling(run, from_s, to_s)[3]
        text = "; ".join(
            f"mode {m}: {panels.span_text(values / 0.36, 0)} µs ({panels.span_text(values)}°)"
            for m, values in found.items()
        )
        rows.append(
            Entry(
                f"{pattern}: freewheeling; current at the commutation",
                {"ON-PWM": "mode 1 < 25 µs (9°); 14 A", "PWM-ON": "mode 2 > 50 µs (about 20°); 14 A"}.get(
                    pattern, "mode 1 < 25 µs, mode 2 > 50 µs; 14 A"
                ),
                f"{text}; {amperes.mean():.1f} A",
                "drive",
                (1 not in found or bool(found[1].max() < 9.0))
                and (2 not in found or bool(found[2].min() > 18.0))
                and near(14.0, float(amperes.mean()), 0.5),
                "Diode and switch drops shorten mode 2; CSC starts each sector with a pulse, so that mode 2 does not "
                "begin in an off time"
                if 2 in found
                else "The fan's torque is known at one point only: the current is a little larger",
            )
        )
    return Drawing(
        "Motor-I, 25 V, 40 kHz, CSC, fan 20 mN·m at 60 000 r/min; dots: crossings that the chip reports. One run; the "
        "pattern is changed at the console.",
        drawn,
        tuple(rows),
    )


HELD_RPM, QUICK_HELD_RPM = (80_000, 84_000, 86_000, 88_000, 90_000), (44_000, 45_000)
HELD_S, STAIR_RPM_PER_S = 0.06, 25_000  # the stairs' slope takes 1.3 mN m, the fan 40
HELD_H = (22e-6, CHAPTER_4_L_H)  # ours, and the one that the thesis states for figures 4.14 to 4.17
WHY_HELD = (
    "The analysis has 30° at 86 900 r/min with 22 µH and at 89 400 r/min with 20 µH, the thesis's other value; a "
    "sample counts only some time after the freewheeling"
)


def _held_entry(runner: Runner, axes: Axes, inductance_h: float) -> Entry:
    """ON-PWM up stairs of speeds that the drive holds: bar of the angles of each, and how far it gets."""
    held = QUICK_HELD_RPM if runner.quick else HELD_RPM
    # The rotor coasts until it is caught, some 8 % below; from there on the slope holds.
    at_s, before, events, spans = 0.06, 0.9 * held[0], [], []
    for rpm in held:
        events.append((at_s, "speed_rpm", rpm))
        at_s += (rpm - before) / STAIR_RPM_PER_S + HELD_S
        spans.append((at_s - HELD_S / 2, at_s))
        before = rpm
    run = drive(
        runner,
        SCENARIO,
        f"stairs-{inductance_h * 1e6:g}uh",
        f"initial.speed_rpm={held[0]}",
        schedule(0.9 * held[0], *events),
        f"motor.inductance_h={inductance_h:g}",
        "drive.zcd.compute_back=false",
        "drive.commutation=NSC",
        f"drive.accel_rpm_per_s={STAIR_RPM_PER_S}",
        "record.period_s=4e-6",
        "window=[]",
        f"duration_s={at_s + 0.001:g}",
        accept=dict.fromkeys(LOCK_MAY_GO, "the stairs go on until the freewheeling costs the lock"),
    )
    trips = run.result["trips"]
    end_s = trips[0]["time_s"] - TRIPPING_S if trips else at_s
    shown, last = [], 0.0
    for from_s, to_s in spans:
        if to_s > end_s:
            break
        angle = freewheeling(run, from_s, to_s)[2]
        cycles = np.linspace(from_s, to_s, 50) * run.data.clock_hz
        last = float(run.analysis.track.omega_rad_s(cycles).mean()) * RPM_PER_RAD_S
        middle = (float(angle.max()) + float(angle.min())) / 2
        colour = "black" if inductance_h == HELD_H[0] else "grey"
        axes.errorbar(last / 1e3, middle, float(np.ptp(angle)) / 2, color=colour, capsize=3)
        shown.append(f"{last:.0f}: {panels.span_text(angle)}")
    return Entry(
        f"ON-PWM, {inductance_h * 1e6:g} µH, held speeds (r/min): angle (deg)",
        "90 000: 30",
        f"{'; '.join(shown)}; {panels.trip_text(run)}",
        "drive",
        near(90_000, last, 900) and near(30.0, float(angle.max()), 0.5) if not trips and shown else False,
        WHY_HELD,
    )


@figure(FAMILY, "4.13")
def load_line(runner: Runner) -> Drawing:
    """Freewheel angles along the fan's load from 30 000 to 90 000 r/min."""
    top_rpm, slope = (45_000, 150_000) if runner.quick else (90_000, 75_000)
    start_s = 0.06
    end_s = start_s + (top_rpm - 30_000) / slope + 0.03
    machine = Machine.from_motor(motor_1())
    drawn, ((axes,),) = panels.page("4.13: freewheel angle along the fan's load, chip", 1, 1, (9.0, 5.2))
    reached, rows = {}, []
    right = axes.twinx()
    bins = np.arange(30_000, 90_001, 2_500)
    for chopping in ("ON-PWM", "PWM-ON"):
        run = drive(
            runner,
            SCENARIO,
            f"ramp-{chopping}",
            "initial.speed_rpm=30000",
            schedule(30_000, (start_s, "speed_rpm", top_rpm)),
            "drive.zcd.compute_back=false",
            f"drive.pattern={chopping}",
            "drive.commutation=NSC",
            f"drive.accel_rpm_per_s={slope}",
            "record.period_s=4e-6",
            f"duration_s={end_s:g}",
            accept=dict.fromkeys(LOCK_MAY_GO, "the ramp goes on until the freewheeling costs the lock"),
        )
        trips = run.result["trips"]
        last_s = trips[0]["time_s"] if trips else end_s
        cycle, _, angle, current = freewheeling(run, start_s - 0.01, last_s)
        rpm = run.analysis.track.omega_rad_s(cycle) * 30 / np.pi
        reached[chopping] = float(rpm.max())
        colour = CHOPPING_COLOURS["ON-PWM" if chopping == "ON-PWM" else "PWM-ON"]
        axes.plot(rpm / 1e3, angle, ".", color=colour, markersize=2, label=f"{chopping}, every commutation")
        if chopping == "ON-PWM":
            vdc = np.interp(cycle, run.data.records["t_cycle"], run.data.records["vdc"])
            bound = freewheel_angle_deg(machine, float(vdc.mean()), machine.omega_e(rpm), current)
            axes.plot(rpm / 1e3, bound, ".", color="black", markersize=1, label="upper bound (4.24) at its current")
            above = float(np.mean(angle > bound + 0.05))
            right.plot(rpm / 1e3, current, ".", color="#bbbbbb", markersize=1)
            mean_a = [float(current[np.abs(rpm - b) < 1250].mean()) for b in bins if (np.abs(rpm - b) < 1250).any()]
        at = 60_000 if not runner.quick else 40_000
        near_deg = angle[np.abs(rpm - at) < 1_500]
        holds = (
            reached[chopping] > 89_000 if chopping == "ON-PWM" else near(72_000, reached[chopping], 500) and bool(trips)
        )
        rows.append(
            Entry(
                f"{chopping}: angle near {at} r/min; highest speed (deg, r/min)",
                "reaches 90 000 r/min" if chopping == "ON-PWM" else "fails at 72 000 r/min, where 30° is reached",
                f"{panels.span_text(near_deg)}; {reached[chopping]:.0f}, {panels.trip_text(run)}",
                "drive",
                holds,
                "The ramp's torque comes on top of the fan's; the fan's torque and the motor's inductance are known at "
                "one point only",
            )
        )
    rows += [_held_entry(runner, axes, inductance_h) for inductance_h in HELD_H]
    finish(axes, "speed / (1000 r/min)", "freewheel angle / deg el.")
    right.set_ylabel("current at the commutation (ON-PWM, grey) / A")
    axes.axhline(30.0, color="red", linewidth=0.8)
    axes.set_ylim(0, 62)
    right.set_ylim(0, 62)
    axes.legend(loc="upper left", fontsize=panels.SMALL, markerscale=5)
    rows.append(
        Entry(
            "ON-PWM: share of commutations above the bound",
            "none",
            f"{100 * above:.1f} %",
            "drive",
            above == 0.0,
            "The bound holds for commutations that are on time; diode drops make the true angle smaller",
        )
    )
    rows.append(
        Entry(
            "current at the commutation over the range (A)",
            "grey curve, about 14 at 60 000 r/min",
            f"{mean_a[0]:.1f} … {mean_a[-1]:.1f}",
            "drive",
            None,
            f"{DRAWN} but at 60 000 r/min",
        )
    )
    return Drawing(
        f"Motor-I, 25 V, 40 kHz, NSC (as the thesis's, the carrier runs on), seen crossings only, fan 20 mN·m at "
        f"60 000 r/min, slope {slope} r/min/s; bars: held speeds, black 22 µH, grey 20 µH.",
        drawn,
        tuple(rows),
    )
