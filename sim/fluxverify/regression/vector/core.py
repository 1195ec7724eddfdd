# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the soft core has to do at the control tick, and how long the hardware takes from a sample to its voltage."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fluxlock.clock import CLOCK_HZ
from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import LogKind
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, event, timeline

LOAD_PERCENT = 60.0
LATENCY_US = 2.0
CORE_LATENCY_US = 10.0
CORE_LATENCY_PERCENT = 99.9
TICK_HZ = 20_000
# Handler of the deferred line that burns half of its time, and lines of the console meanwhile.
IRQ_LOAD_CYCLES = 20_000
LINES = ("status", "get", "stats")


@dataclass(frozen=True)
class Rates:
    """Carrier and samples; the control tick comes at 20 kHz."""

    name: str
    carrier_hz: int
    update: str
    observer_every: int
    regulator: str = "rtl"
    emf: str = "sinusoidal"

    @property
    def sample_hz(self) -> int:
        """1 / T_s."""
        return self.carrier_hz * (2 if self.update == "double" else 1)


RATES = (
    Rates("20khz-double", 20_000, "double", 2),
    Rates("20khz-single", 20_000, "single", 1),
    Rates("100khz-single", 100_000, "single", 5),
)
# The harmonics of the EMF take the load beyond the limit at this tick: it is shown, and no step may come late.
TRAPEZOID = Rates("20khz-double-trapezoid", 20_000, "double", 2, emf="trapezoidal")
ON_CORE = Rates("20khz-single-c", 20_000, "single", 1, "c")


@dataclass(frozen=True)
class Times:
    """Speed that is asked for, windows, s: ramp, steady, and with console and interrupts busy."""

    speed_rpm: int
    windows: tuple[tuple[str, float, float], ...]
    duration_s: float


FULL = Times(24_000, (("ramp", 0.23, 0.29), ("steady", 0.36, 0.42), ("busy", 0.43, 0.48)), 0.485)
# From a speed at which the rotor is caught.
QUICK = Times(24_000, (("ramp", 0.045, 0.065), ("steady", 0.10, 0.12), ("busy", 0.13, 0.14)), 0.145)
QUICK_FROM_RPM = 20_000


def _run(runner: Runner, rates: Rates) -> tuple[Run, Times]:
    """One run for both cases: the core's idle time is asked for at the borders of ramp and steady window."""
    times = QUICK if runner.quick else FULL
    events = [event(0.002, "speed_rpm", times.speed_rpm), event(0.003, "command", "start")]
    for name, begin, end in times.windows:
        if name != "busy":
            events += [event(at, "command", "get idle") for at in (begin, end)]
        else:
            events.append(event(begin - 0.002, "command", f"set irq_load {IRQ_LOAD_CYCLES}"))
            events += [event(begin + 0.001 * k, "command", line) for k, line in enumerate(LINES)]
    run = runner.drive(
        "vector/start.toml",
        rates.name,
        f"drive.carrier_hz={rates.carrier_hz}",
        f"drive.vector.update={rates.update}",
        f"drive.vector.observer_every={rates.observer_every}",
        f"drive.vector.current_regulator={rates.regulator}",
        f"motor.emf={rates.emf}",
        "expect=[]",
        *((f"initial.speed_rpm={QUICK_FROM_RPM}",) if runner.quick else ()),
        *timeline(times.duration_s, events, times.windows),
    )
    return run, times


def _conditions(rates: Rates, run: Run, times: Times) -> dict[str, Condition]:
    return {
        "motor": run.scenario.motor.name,
        "emf": run.scenario.motor.emf,
        "carrier_hz": rates.carrier_hz,
        "sample_hz": rates.sample_hz,
        "tick_hz": rates.sample_hz // rates.observer_every,
        "current_regulator": rates.regulator,
        "speed_rpm": times.speed_rpm,
        "delay": run.scenario.drive.vector.delay or 0.0,
    }


def load_percent(console: str, spans: int) -> list[float]:
    """Load of the core between the first and second, third and fourth ... reading of `get idle`, so many pairs."""
    found = [(int(a), int(b)) for a, b in re.findall(r"^idle (\d+) (\d+)\s*$", console, re.MULTILINE)][: 2 * spans]
    pairs = zip(found[::2], found[1::2], strict=True)
    return [100.0 * (1.0 - ((b[0] - a[0]) % 2**32) / ((b[1] - a[1]) % 2**32)) for a, b in pairs]


def late_commits(run: Run, window: str, tick_cycles: int) -> int:
    """Control ticks of a window at which no new settings took effect: the step before came too late."""
    span = next(w for w in run.scenario.window if w.name == window)
    cycles = run.data.rows(LogKind.UPDATE)[:, 0]
    inside = cycles[(cycles >= span.from_s * CLOCK_HZ) & (cycles < span.to_s * CLOCK_HZ)]
    return int(np.sum(np.diff(inside) // tick_cycles - 1))


@case("vector/core-load")
def core_load(runner: Runner) -> Iterator[Row]:
    """Load of the soft core with observer and speed loop at 20 kHz, regulators at 20, 40 and 100 kHz."""
    for rates in RATES[:1] if runner.quick else (*RATES, TRAPEZOID):
        run, times = _run(runner, rates)
        loads = dict(zip(("ramp", "steady"), load_percent(run.console(), 2), strict=True))
        control = run.result["run"]["isr"]["control"]
        values: dict[str, Number] = {f"load_percent.{name}": load for name, load in loads.items()}
        limits: Limits = {} if rates is TRAPEZOID else {name: (0.0, LOAD_PERCENT) for name in values}
        for name in loads:
            values[f"late_commits.{name}"] = late_commits(run, name, round(CLOCK_HZ / TICK_HZ))
            limits[f"late_commits.{name}"] = (0, 0)
        values |= {
            "speed_rpm.mean": run.metrics["steady"]["speed_rpm"]["mean"],
            "control_cycles.mean": control["mean"],
            "control_cycles.max": control["max"],
            "overruns": run.result["run"]["overruns"],
            "trips": len(run.result["trips"]),
        }
        limits |= {
            "speed_rpm.mean": (times.speed_rpm * 0.97, times.speed_rpm * 1.03),
            "overruns": (0, 0),
            "trips": (0, 0),
        }
        yield Row(
            f"vector/core-load/{rates.name}",
            _conditions(rates, run, times),
            values,
            limits,
            "Everything that is not the idle loop: control step, design of the gains, entry and exit of interrupts. "
            "Clocks of the control step and overruns are those of the whole run.",
        )


def _latencies(run: Run, times: Times) -> tuple[NDArray[np.int64], int]:
    """Clocks from strobe to compares of the samples whose tick took new settings over; number of all samples."""
    instants, updates = (run.data.rows(kind)[:, 0] for kind in (LogKind.ANGLE, LogKind.UPDATE))
    begin, end = times.windows[0][1] * CLOCK_HZ, times.windows[-1][2] * CLOCK_HZ
    updates = updates[(updates >= begin) & (updates < end)]
    cycles = updates - instants[np.searchsorted(instants, updates, side="right") - 1]
    return cycles, int(np.sum((instants >= begin) & (instants < end)))


def _latency_on_core(runner: Runner) -> Row:
    """With the regulators in C: share within the limit, a sample without new compares counts as beyond it."""
    run, times = _run(runner, ON_CORE)
    cycles, samples = _latencies(run, times)
    within = int(np.sum(cycles <= CORE_LATENCY_US * 1e-6 * CLOCK_HZ))
    values: dict[str, Number] = {
        "within_10us_percent": 100.0 * min(within / samples, 1.0),
        "latency_us.max": 1e6 * float(cycles.max()) / CLOCK_HZ,
        "latency_us.median": 1e6 * float(np.median(cycles)) / CLOCK_HZ,
        "latency_us.min": 1e6 * float(cycles.min()) / CLOCK_HZ,
        "without_update": max(samples - int(cycles.size), 0),
        "samples": samples,
        "load_interrupts": int(run.result["run"]["isr"]["load"]["count"]),
        "overruns": run.result["run"]["overruns"],
        "trips": len(run.result["trips"]),
    }
    limits: Limits = {
        "within_10us_percent": (CORE_LATENCY_PERCENT, None),
        "load_interrupts": (1, None),
        "overruns": (0, 0),
        "trips": (0, 0),
    }
    for name, load in zip(("ramp", "steady"), load_percent(run.console(), 2), strict=True):
        values[f"load_percent.{name}"] = load
    return Row(
        f"vector/latency/{ON_CORE.name}",
        _conditions(ON_CORE, run, times) | {"irq_load_cycles": IRQ_LOAD_CYCLES},
        values,
        limits,
        "The current regulator in C, a control tick a sample; from the strobe on, the worst is max. "
        "A sample whose tick took no settings over (without_update) has no latency and counts as beyond the limit.",
    )


@case("vector/latency", tested=True)
def latency(runner: Runner) -> Iterator[Row]:
    """From the strobe of the current sample to its compares in the shadow registers, whatever the core does."""
    yield _latency_on_core(runner)
    for rates in RATES[:1] if runner.quick else RATES:
        run, times = _run(runner, rates)
        cycles, _ = _latencies(run, times)
        conversion = round(run.scenario.inverter.sensing.conversion_s * CLOCK_HZ)
        load = run.result["run"]["isr"]["load"]
        values: dict[str, Number] = {
            "latency_us.max": 1e6 * float(cycles.max()) / CLOCK_HZ,
            "from_codes_us.max": 1e6 * float(cycles.max() - conversion) / CLOCK_HZ,
            "latency_cycles.min": int(cycles.min()),
            "latency_cycles.max": int(cycles.max()),
            "latency_cycles.spread": int(np.ptp(cycles)),
            "samples": int(cycles.size),
            "load_interrupts": int(load["count"]),
            "trips": len(run.result["trips"]),
        }
        limits: Limits = {
            "latency_us.max": (None, LATENCY_US),
            "latency_cycles.spread": (0, 0),
            "load_interrupts": (1, None),
            "trips": (0, 0),
        }
        yield Row(
            f"vector/latency/{rates.name}",
            _conditions(rates, run, times) | {"irq_load_cycles": IRQ_LOAD_CYCLES},
            values,
            limits,
            "Of the samples with a control tick, which follows their compares; from the strobe on; from_codes_us is "
            "without the conversion. Half of the core's time goes to the load generator in the last window.",
        )
