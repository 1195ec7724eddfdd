"""Six-step cases (Yang 2020, chapters 2 to 6). Scenarios: scenarios/six-step."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fluxlock.analysis.rundata import FloatArray
from fluxlock.analysis.six_step.patterns import Commutation
from fluxlock.analysis.six_step.recording import (
    current_lines,
    expected_spectrum,
    recorded_spectrum,
    torque_lines,
    whole_turns,
)
from fluxlock.cosim.outcome import Outcome
from fluxlock.regression.case import Condition, Row, case
from fluxlock.regression.runner import Runner

START_SEEDS = (1, 2, 3)
LOCKED_RMS_DEG = 1.0


def highest_hz(run: Outcome) -> float:
    """Highest electrical frequency that the rotor reached under control, before the first trip."""
    records = run.data.records
    trips = run.result["trips"]
    end = trips[0]["time_s"] * run.data.clock_hz if trips else math.inf
    return float(np.max(records["omega_e"][records["t_cycle"] < end])) / (2 * math.pi)


def locked(run: Outcome) -> bool:
    """Whether the crossings carry the machine at the end: forward, commutations within 1 degree rms, no trip."""
    window = run.metrics["locked"]
    rms_deg = window["commutation_error_deg"]["rms"]
    forward = window["speed_rpm"]["min"] > 0
    return not run.result["trips"] and forward and rms_deg is not None and rms_deg < LOCKED_RMS_DEG


@case("six-step/starts")
def starts(runner: Runner) -> Iterator[Row]:
    """Starts from random rotor angles: every one locks, in the right direction, without a trip."""
    count = 1 if runner.quick else 100
    seeds = START_SEEDS[:1] if runner.quick else START_SEEDS
    for seed in seeds:
        angles = np.random.default_rng(seed).uniform(0, 360, count)
        runs = [
            runner.drive("six-step/start.toml", f"{seed}-{i}", f"initial.theta_deg={angle:.2f}", seed=seed)
            for i, angle in enumerate(angles)
        ]
        good = sum(locked(run) for run in runs)
        yield Row(
            f"six-step/starts/seed-{seed}",
            {"motor": "Motor-I", "load": "fan 20 mN*m at 60 000 r/min", "seed": seed, "starts": count},
            {"locks": good, "trips": sum(len(run.result["trips"]) for run in runs)},
            {"locks": (count, count), "trips": (0, 0)},
        )


@case("six-step/ramp-1300hz")
def ramp_1300hz(runner: Runner) -> Iterator[Row]:
    """CSC passes every integer N on the way to 1300 Hz with a 20 kHz carrier; RSC fails just below one."""
    loads = (20,) if runner.quick else (20, 30)
    for load_mnm in loads:
        for commutation in ("CSC", "RSC"):
            run = runner.drive(
                "six-step/ramp-1300hz.toml",
                f"{commutation}-{load_mnm}",
                f"drive.commutation={commutation}",
                f"load.fan_torque_nm={load_mnm / 1000}",
                *(() if commutation == "CSC" else ("window=[]",)),
            )
            frequency_hz = highest_hz(run)
            values: dict[str, float | int | None] = {"highest_hz": frequency_hz, "trips": len(run.result["trips"])}
            conditions: dict[str, Condition] = {
                "motor": "Motor-I",
                "carrier_hz": 20_000,
                "commutation": commutation,
                "pattern": "ON-PWM",
                "fan_mnm_at_60000": load_mnm,
            }
            row_id = f"six-step/ramp-1300hz/{commutation}-{load_mnm}mNm"
            if commutation == "CSC":
                values["speed_rpm.mean"] = run.metrics["top"]["speed_rpm"]["mean"]
                yield Row(row_id, conditions, values, {"trips": (0, 0), "speed_rpm.mean": (77_600, 78_400)})
            else:
                values["carriers_per_sector"] = 20_000 / (6 * frequency_hz)
                yield Row(row_id, conditions, values, {"trips": (1, None), "highest_hz": (None, 1300)})


# 64 000 r/min at 20 kHz: N = 25/8, lines every 6/8 of the fundamental.
SPECTRUM_Q = 8
SPECTRUM_COMMUTATIONS: tuple[Commutation, ...] = ("RSC", "NSC", "CSC")


def sideband_orders(most: float) -> FloatArray:
    """Orders 1 + 0.75 k up to `most` that are not of the form 1 + 6 k."""
    steps = np.arange(-int(most * SPECTRUM_Q / 6) - 8, int(most * SPECTRUM_Q / 6) + 8)
    steps = steps[(steps % SPECTRUM_Q != 0) & (np.abs(1 + 6 / SPECTRUM_Q * steps) <= most)]
    orders: FloatArray = 1 + 6 / SPECTRUM_Q * steps
    return orders


@case("six-step/spectrum")
def spectrum(runner: Runner) -> Iterator[Row]:
    """64 000 r/min, N = 25/8: gate lines follow the theory; CSC's sidebands and torque ripple lie far below RSC's."""
    current_a: dict[str, float] = {}
    ripple_nm: dict[str, float] = {}
    for commutation in SPECTRUM_COMMUTATIONS:
        short = ("duration_s=0.225", "window=[]") if runner.quick else ()
        run = runner.drive("six-step/spectrum.toml", commutation, f"drive.commutation={commutation}", *short)
        begin, end = (0.2, 0.22) if runner.quick else (0.2, 0.31)
        window = whole_turns(run.data, begin, end, SPECTRUM_Q)
        orders = sideband_orders(6)
        current_a[commutation] = float(np.max(np.abs(current_lines(run.data, window, orders).amplitude)))
        below = np.arange(1, 6 * SPECTRUM_Q // 6) * 6 / SPECTRUM_Q
        ripple_nm[commutation] = float(2 * np.max(np.abs(torque_lines(run.data, window, below).amplitude)))
        series = expected_spectrum(run.data, window, commutation, 20_000, 17)
        lines = recorded_spectrum(run.data, window, 17)
        found = np.interp(series.order, lines.order, np.abs(lines.amplitude))
        fundamental = float(np.abs(series.amplitude)[np.argmin(np.abs(series.order - 1))])
        worst = float(np.max(np.abs(found - np.abs(series.amplitude))))
        yield Row(
            f"six-step/spectrum/{commutation}",
            {"motor": "Motor-I", "speed_rpm": 64_000, "carrier_hz": 20_000, "pattern": "ON-PWM", "turns": window.turns},
            {
                "line_deviation_percent": 100 * worst / fundamental,
                "current_sideband_a": current_a[commutation],
                "torque_ripple_below_6fe_mnm": 1000 * ripple_nm[commutation],
                "trips": len(run.result["trips"]),
            },
            {"line_deviation_percent": (None, 1.0), "trips": (0, 0)},
        )
    yield Row(
        "six-step/spectrum/CSC-against-RSC",
        {"motor": "Motor-I", "speed_rpm": 64_000, "carrier_hz": 20_000, "pattern": "ON-PWM"},
        {
            "current_sideband_db": 20 * math.log10(current_a["RSC"] / current_a["CSC"]),
            "torque_ripple_ratio": ripple_nm["RSC"] / ripple_nm["CSC"],
        },
        {"current_sideband_db": (40, None), "torque_ripple_ratio": (20, None)},
    )
