# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A run as a moving scope: speed, error and phase currents while they happen, as an animated SVG.

Without its animation the picture shows the whole run: to a viewer that knows no SMIL, or wants no motion.
Three screens. Speed and error fill from left to right, on one axis of time. For a six-step drive it is the error of the
zero crossings, for a vector drive that of the estimated angle. The phase currents of the last two electrical turns
stand over the true rotor angle, which triggers the screen: the curves move, the picture stands.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fluxlock.digits import NO_BREAK, thousands
from fluxlock.results.angles import phase_currents
from fluxlock.results.metrics import Analysis
from fluxlock.results.rundata import FloatArray, RunData
from fluxlock.results.verdict import STATES

TOTAL_S, SWEEP_S = 8.0, 7.2  # of the viewer: one turn of the picture; the rest shows the whole run
FRAMES = 72  # of the currents, over the sweep
READOUTS = 36  # of the numbers: slow enough to be read
GRID_DEG = 4  # of the currents
GLYPH = 8  # width of a character at most, px

WIDTH, HEIGHT = 800, 470
LEFT, RIGHT = 74, 780
SPEED, ERROR, CURRENT = (66, 186), (202, 292), (344, 444)  # upper and lower edge of each screen
INK, DIM, SCREEN, GLASS, LINE = "#e6edf3", "#9da7b3", "#0d1117", "#161b22", "#30363d"
SPEED_COLOUR, ERROR_COLOUR, BEYOND_COLOUR = "#56b4e9", "#f0e442", "#d55e00"
# What the caption names, in this order. Six-step drives have the first two, vector drives the last one.
ERRORS = {
    "crossing error": "zcp_error_deg",
    "commutation error": "commutation_error_deg",
    "angle error": "angle_error_deg",
}
PHASE_COLOURS = ("#56b4e9", "#e69f00", "#2fbf8f", "#cc79a7", "#f0e442")


@dataclass(frozen=True)
class Axis:
    """A range of values onto a range of pixels."""

    low: float
    high: float
    first: float
    last: float

    def at(self, value: float) -> float:
        """Pixel of a value, at the nearest edge for what lies beyond."""
        share = (min(max(value, self.low), self.high) - self.low) / (self.high - self.low)
        return self.first + share * (self.last - self.first)


def _step(span: float, most: int) -> float:
    """Distance of ticks, 1, 2 or 5 times a power of ten, for at most so many of them."""
    power = 10.0 ** math.floor(math.log10(span / most))
    return next(power * factor for factor in (1, 2, 5, 10) if span / (power * factor) <= most)


def _window(data: RunData, result: dict[str, Any]) -> tuple[tuple[float, float], dict[str, Any]]:
    """Span (s) and metrics that the caption is of: the run's first window, else its second half."""
    spans = {entry["name"]: (entry["from_s"], entry["to_s"]) for entry in result["scenario"]["settings"]["window"]}
    for name, metrics in result["metrics"].items():
        return spans[name], metrics
    half = (data.duration_s / 2, data.duration_s)
    return half, Analysis(data).window(*half)


def caption(data: RunData, result: dict[str, Any]) -> str:
    """One sentence with the numbers of the run: each error that the method has is named."""
    (from_s, to_s), metrics = _window(data, result)
    low, high = (thousands(metrics["speed_rpm"][end], NO_BREAK) for end in ("min", "max"))
    found = {name: metrics[key]["rms"] for name, key in ERRORS.items() if metrics[key]["rms"] is not None}
    errors = ", ".join(f"{name} {value:.3f}° rms" for name, value in found.items())
    turns = f"The simulated rotor turns at {low} to {high} r/min from {from_s:g} to {to_s:g} s"
    return f"{turns}: {errors}." if errors else f"{turns}."


def _marks(data: RunData, result: dict[str, Any]) -> list[tuple[float, str]]:
    """Instants that the speed's screen names, s."""
    settings = result["scenario"]["settings"]
    marks = []
    for event in settings.get("event", []):
        if event.get("command"):
            marks.append((event["at_s"], event["command"].split()[0]))
        if event.get("load_factor") is not None:
            marks.append((event["at_s"], f"load × {event['load_factor']:g}"))
    states = data.states()
    running = np.flatnonzero(states["state"] == STATES.index("running"))
    if running.size:
        marks.append((float(states["t_s"][running[0]]), "lock"))
    return sorted(marks)


def _sweep(attribute: str, first: float, last: float) -> str:
    """Animation of an attribute over the sweep, then still to the end."""
    times = f"0;{SWEEP_S / TOTAL_S:g};1"
    return (
        f'<animate attributeName="{attribute}" dur="{TOTAL_S:g}s" repeatCount="indefinite" '
        f'values="{first:g};{last:g};{last:g}" keyTimes="{times}"/>'
    )


def _text(x: float, y: float, text: str, anchor: str = "start", colour: str = DIM, size: int = 13) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" fill="{colour}" font-size="{size}">{text}</text>'


def _screen(edges: tuple[int, int], name: str, vertical: Axis, ticks: Iterable[float], digits: int) -> list[str]:
    """Glass, lines and numbers of one screen; its name is above the numbers."""
    top, bottom = edges
    parts = [f'<rect x="{LEFT}" y="{top}" width="{RIGHT - LEFT}" height="{bottom - top}" fill="{GLASS}"/>']
    for tick in ticks:
        y = vertical.at(tick)
        parts.append(f'<path d="M{LEFT} {y:.1f}H{RIGHT}" stroke="{LINE}"/>')
        parts.append(_text(LEFT - 8, y + 4.5, f"{tick:.{digits}f}".replace("-", "−"), "end"))
    middle = (top + bottom) / 2
    parts.append(
        f'<text transform="translate(20 {middle:.0f}) rotate(-90)" text-anchor="middle" fill="{INK}" '
        f'font-size="13">{name}</text>'
    )
    return parts


def _ticks(low: float, high: float, most: int) -> tuple[list[float], int]:
    step = _step(high - low, most)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)], max(0, -math.floor(math.log10(step) + 1e-9))


def _polyline(x: FloatArray, y: FloatArray) -> str:
    """Path through points, to a tenth of a pixel."""
    return "M" + " ".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _dots(x: FloatArray, y: FloatArray, colour: str) -> str:
    points = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(x, y, strict=True))
    return f'<path d="{points}" stroke="{colour}" stroke-width="2.4" stroke-linecap="round"/>' if points else ""


class _Run:
    """Series of the run that the screens show."""

    def __init__(self, data: RunData, result: dict[str, Any]) -> None:
        self.data, self.result = data, result
        self.analysis = Analysis(data)
        records = data.records
        self.time_s = np.asarray(records["t_cycle"] / data.clock_hz, dtype=np.float64)
        self.krpm = np.asarray(records["omega_e"], dtype=np.float64) * 0.03 / math.pi / data.pole_pairs
        self.theta_deg = np.maximum.accumulate(np.abs(np.degrees(records["theta_e"] - records["theta_e"][0])))
        found = self.analysis.crossings
        self.six_step = found.cycle.size > 0
        self.error_name = "crossing error" if self.six_step else "angle error"
        series = found if self.six_step else self.analysis.angles
        self.error_s, self.error_deg = series.cycle / data.clock_hz, series.error_deg
        self.end_s = data.duration_s

    def frame_s(self, frames: int) -> FloatArray:
        """Instants of the run that so many frames show; the first is its beginning, the last its end."""
        return np.linspace(0.0, self.end_s, frames)

    def recent_error(self, at_s: float) -> float | None:
        """Error over the last 10 ms, rms; None: too few values for one."""
        inside = (self.error_s > at_s - 0.01) & (self.error_s <= at_s)
        return float(np.sqrt(np.mean(self.error_deg[inside] ** 2))) if inside.sum() >= 3 else None

    def last_running_s(self) -> float:
        """Last instant at which the drive said that it runs, else the end."""
        states = self.data.states()
        running = states["t_s"][states["state"] == STATES.index("running")]
        return float(running[-1]) if running.size else self.end_s

    def state(self, at_s: float) -> str:
        """The drive by its own account."""
        states = self.data.states()
        k = int(np.searchsorted(states["t_s"], at_s, side="right")) - 1
        return STATES[int(states["state"][k])] if k >= 0 else STATES[0]


def _error_range(run: _Run) -> float:
    """Half range of the angle's screen: nearly all values after the start."""
    late = np.abs(run.error_deg[run.error_s > 0.3 * run.end_s])
    late = late[np.isfinite(late)]
    wanted = 1.6 * float(np.percentile(late, 99.5)) if late.size else 1.0
    return next(f * 10.0**p for p in range(-2, 3) for f in (1, 2, 4, 6, 8) if f * 10.0**p >= wanted)


def _over_time(run: _Run) -> list[str]:
    """Screens of speed and error with their axis of time."""
    time = Axis(0.0, run.end_s, LEFT, RIGHT)
    speed = Axis(min(0.0, 1.3 * float(run.krpm.min())), 1.3 * float(run.krpm.max()), SPEED[1], SPEED[0])
    limit = _error_range(run)
    error = Axis(-limit, limit, ERROR[1], ERROR[0])
    ticks, digits = _ticks(speed.low, speed.high, 4)
    parts = _screen(SPEED, "1000 r/min", speed, ticks, digits)
    parts += _screen(
        ERROR, f"{run.error_name} / °", error, (-limit / 2, 0.0, limit / 2), max(0, 2 - round(math.log10(limit)) - 1)
    )
    ticks, digits = _ticks(0.0, run.end_s, 9)
    for tick in ticks:
        x = time.at(tick)
        for top, bottom in (SPEED, ERROR):
            parts.append(f'<path d="M{x:.1f} {top}V{bottom}" stroke="{LINE}"/>')
        unit = " s" if tick == ticks[-1] else ""
        parts.append(_text(x, ERROR[1] + 17, f"{tick:.{digits}f}{unit}", "middle"))
    shown = np.linspace(0, run.time_s.size - 1, min(run.time_s.size, 700)).astype(int)
    across = np.array([time.at(t) for t in run.time_s[shown]])
    curve = _polyline(across, np.array([speed.at(v) for v in run.krpm[shown]]))
    parts.append(f'<g clip-path="url(#seen)"><path d="{curve}" stroke="{SPEED_COLOUR}" stroke-width="2.2"/>')
    beyond = ~(np.abs(run.error_deg) <= limit)
    for chosen, colour in ((~beyond, ERROR_COLOUR), (beyond & np.isfinite(run.error_deg), BEYOND_COLOUR)):
        ex = np.array([time.at(t) for t in run.error_s[chosen]])
        parts.append(_dots(ex, np.array([error.at(v) for v in run.error_deg[chosen]]), colour))
    taken = 0.0  # right end of the last name
    for at_s, name in _marks(run.data, run.result):
        x_mark = time.at(at_s)
        parts.append(f'<path d="M{x_mark:.1f} {SPEED[0]}V{ERROR[1]}" stroke="{DIM}" stroke-dasharray="3 4"/>')
        room = GLYPH * len(name) + 5
        left = x_mark + room > RIGHT
        # A name that would cover the one before goes to the lower edge.
        y = SPEED[1] - 8 if (x_mark - room if left else x_mark) < taken else SPEED[0] + 15
        parts.append(_text(x_mark + (-5 if left else 5), y, name, "end" if left else "start", INK))
        taken = x_mark + (0 if left else room)
    parts.append("</g>")
    return parts


def _waves(run: _Run, at_s: float, names: Sequence[str]) -> list[FloatArray]:
    """Currents over the two electrical turns before an instant, from a multiple of a turn to the next but one."""
    theta = float(np.interp(at_s, run.time_s, run.theta_deg))
    end = 360.0 * math.floor(theta / 360.0)
    grid = end - 720.0 + np.arange(0.0, 720.0 + GRID_DEG, GRID_DEG)
    times = np.interp(grid, run.theta_deg, run.time_s)
    waves = []
    for name in names:
        current = np.interp(times, run.time_s, np.asarray(run.data.records[name], dtype=np.float64))
        waves.append(np.where(grid < 0.0, 0.0, current))
    return waves


def _over_angle(run: _Run, moving: bool) -> list[str]:
    """Screen of the currents."""
    names = phase_currents(run.data.records)
    frames = [_waves(run, at_s, names) for at_s in run.frame_s(FRAMES + 1)]
    largest = 1.1 * max(float(np.abs(wave).max()) for waves in frames for wave in waves) or 1.0
    axis = Axis(-largest, largest, CURRENT[1], CURRENT[0])
    angle = Axis(0.0, 720.0, LEFT, RIGHT)
    ticks, digits = _ticks(-largest, largest, 5)
    parts = _screen(CURRENT, "current / A", axis, ticks, digits)
    for line in range(30 if run.six_step else 0, 721, 60):
        parts.append(f'<path d="M{angle.at(line):.1f} {CURRENT[0]}V{CURRENT[1]}" stroke="{LINE}"/>')
    for tick in range(0, 721, 180):
        x = angle.at(tick)
        last = tick == 720
        parts.append(_text(x, CURRENT[1] + 17, f"{tick}°{' el.' if last else ''}", "end" if last else "middle"))
    scale = (RIGHT - LEFT) / (720 / GRID_DEG)
    parts.append(f'<g transform="translate({LEFT} 0) scale({scale:.5f} .1)" stroke-width="2">')
    # Where nothing moves the end of the run is shown, and that has no currents: take the last instant of the drive.
    still = next((w for w in reversed(frames) if max(float(np.abs(v).max()) for v in w) > 0.3 * largest), frames[-1])
    for phase, colour in zip(range(len(names)), PHASE_COLOURS, strict=False):
        curves = [waves[phase] for waves in [*frames, still]]
        paths = ["M" + " ".join(f"{k} {10 * axis.at(v):.0f}" for k, v in enumerate(curve)) for curve in curves]
        animation = ""
        if moving:
            times = ";".join(f"{SWEEP_S / TOTAL_S * k / FRAMES:.4f}" for k in range(FRAMES + 1))
            animation = (
                f'<animate attributeName="d" dur="{TOTAL_S:g}s" repeatCount="indefinite" '
                f'values="{";".join([*paths[:-1], paths[-2]])}" keyTimes="{times};1"/>'
            )
        parts.append(f'<path d="{paths[-1]}" stroke="{colour}" vector-effect="non-scaling-stroke">{animation}</path>')
    parts.append("</g>")
    lines = ", lines at the ideal commutations" if run.six_step else ""
    parts.append(
        _text(LEFT, CURRENT[0] - 8, f"phase currents of the last two electrical turns over the true angle{lines}")
    )
    return parts


def _error_text(error_deg: float | None) -> str:
    if error_deg is None:
        return "–"
    return f"{error_deg:.3f}°" if error_deg < 1.0 else "> 1°"


def _readouts(run: _Run, moving: bool) -> list[str]:
    """Numbers in the head, and the state that the drive reports."""
    times = run.frame_s(READOUTS + 1)[1:] if moving else np.array([run.last_running_s()])
    parts = []
    for k, at_s in enumerate(times):
        speed = 1e3 * float(np.interp(at_s, run.time_s, run.krpm))
        text = [
            _text(500, 40, f"{thousands(abs(speed), NO_BREAK)}\u00a0r/min", "end", SPEED_COLOUR, 22),
            _text(RIGHT, 40, f"{run.error_name} {_error_text(run.recent_error(at_s))}", "end", ERROR_COLOUR, 22),
            _text(LEFT, 40, run.state(at_s), "start", INK, 22),
        ]
        if moving:
            begin, end = (SWEEP_S / TOTAL_S * share / READOUTS for share in (k, k + 1))
            first, last = k == 0, k == READOUTS - 1
            steps = [(0.0, "visible" if first else "hidden")]
            steps += [] if first else [(begin, "visible")]
            steps += [] if last else [(end, "hidden")]
            values, shown = ";".join(value for _, value in steps), ";".join(f"{share:.5f}" for share, _ in steps)
            animation = (
                f'<animate attributeName="visibility" calcMode="discrete" dur="{TOTAL_S:g}s" '
                f'repeatCount="indefinite" values="{values}" keyTimes="{shown}"/>'
            )
            visible = "visible" if last else "hidden"
            parts.append(f'<g visibility="{visible}">{animation}{"".join(text)}</g>')
        else:
            parts += text
    return parts


def svg(data: RunData, result: dict[str, Any], moving: bool = True) -> str:
    """The picture; not moving: the whole run at once."""
    run = _Run(data, result)
    settings = result["scenario"]["settings"]
    title = f"{settings['motor']['name']}: {settings['description'] or settings['name']}"
    sweep = _sweep("width", 0, RIGHT - LEFT) if moving else ""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        'font-family="DejaVu Sans, Verdana, Arial, sans-serif" fill="none" role="img">',
        f"<title>{title.replace('&', '&amp;').replace('<', '&lt;')}</title>",
        f"<desc>{caption(data, result)}</desc>",
        f'<defs><clipPath id="seen"><rect x="{LEFT}" y="0" width="{RIGHT - LEFT}" height="{HEIGHT}">{sweep}</rect>'
        "</clipPath></defs>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="10" fill="{SCREEN}"/>',
        *_over_time(run),
        *_over_angle(run, moving),
        *_readouts(run, moving),
    ]
    if moving:
        cursor = f'<path d="M0 {SPEED[0]}V{ERROR[1]}" stroke="{INK}" transform="translate({RIGHT} 0)">'
        moves = (
            f'<animateTransform attributeName="transform" type="translate" dur="{TOTAL_S:g}s" '
            f'repeatCount="indefinite" values="{LEFT} 0;{RIGHT} 0;{RIGHT} 0" keyTimes="0;{SWEEP_S / TOTAL_S:g};1"/>'
        )
        parts.append(f"{cursor}{moves}</path>")
    return "\n".join([*parts, "</svg>", ""])
