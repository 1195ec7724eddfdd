# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Freewheel angle by chip, plant and switched circuit (chapter 4)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.firmware.compiler import FREEWHEEL_LSB
from fluxlock.results.angles import FLOATING_PHASE, thesis_angle_deg
from fluxlock.theory.six_step.patterns import Chopping, gate_sequence
from fluxlock.theory.six_step.switched import SteadyState, duty_for_torque, real_inverter, waveforms
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner

CARRIER_HZ = 40_000
CURRENTS_A = (10, 20, 30)
CHOPPINGS: tuple[Chopping, ...] = ("ON-PWM", "PWM-ON")
# A step of the current, the window at its end, instants in it at which the console is asked.
FIRST_S, STEP_S, WINDOW_S, READINGS = 0.05, 0.04, 0.01, 8
FROZEN_S = 0.003  # before the window
# The console prints hundredths of a degree, cut off.
PRINTED_DEG = 0.01
# Waveform of the switched circuit: turns until it is periodic, instants a turn (0.05 deg), what counts as no current.
SETTLE_TURNS, SAMPLES, NO_CURRENT_A = 8, 7200, 1e-6


def _events(currents_a: tuple[int, ...]) -> tuple[str, ...]:
    """Overrides: events and windows of a run through the currents, and its end."""
    events = ["{at_s=0.003, speed_rpm=120000}", '{at_s=0.004, command="start"}']
    windows = []
    for k, current_a in enumerate(currents_a):
        begin, end = FIRST_S + (k - 1) * STEP_S, FIRST_S + k * STEP_S
        events += [
            f'{{at_s={max(begin + 0.0005, 0.0035):.4f}, command="set current_ma {1000 * current_a}"}}',
            # A reading is of one control tick: without the regulators all commutations are alike.
            f'{{at_s={end - WINDOW_S - FROZEN_S:.4f}, command="set freeze 1"}}',
            f'{{at_s={end - 0.0005:.4f}, command="set freeze 0"}}',
        ]
        windows.append(f'{{name="i{current_a}", from_s={end - WINDOW_S:.4f}, to_s={end - 0.001:.4f}}}')
        events += [
            f'{{at_s={end - WINDOW_S + (i + 0.5) * (WINDOW_S - 0.001) / READINGS:.5f}, command="get freewheel_deg"}}'
            for i in range(READINGS)
        ]
    end_s = FIRST_S + (len(currents_a) - 1) * STEP_S + 0.001
    return f"event=[{', '.join(events)}]", f"window=[{', '.join(windows)}]", f"duration_s={end_s:.4f}"


def chip_angles_deg(run: Run) -> list[float]:
    """Means that the console has printed, in the order of the questions."""
    return [float(x) for x in re.findall(r"^freewheel_deg ([\d.]+)", run.console(), re.MULTILINE)]


def limit_a(run: Run) -> float:
    """Current below which the chip takes the outgoing phase for free: FREEWHEEL_LSB steps of its converter."""
    return FREEWHEEL_LSB * run.scenario.inverter.sensing.current_full_scale_a / 2**11


def decayed_deg(run: Run, low: float, high: float) -> float:
    """Median angle at which the plant's outgoing current falls below the chip's limit, of the commutations in a span.

    The chip cannot see less. From the records, which come with every sample.
    """
    least_a = limit_a(run)
    records, commutations = run.data.records, run.analysis.commutations
    time = records["t_cycle"]
    currents = np.stack([records[name] for name in ("ia", "ib", "ic")])
    angles = []
    for k in np.flatnonzero((commutations.cycle[:-1] >= low) & (commutations.cycle[1:] < high)):
        a, b = np.searchsorted(time, (commutations.cycle[k], commutations.cycle[k + 1]))
        current = currents[FLOATING_PHASE[commutations.sector[k]], a:b]
        current = current * np.sign(current[0])
        below = np.flatnonzero(current < least_a)
        if below.size == 0 or below[0] == 0:
            continue
        i = int(below[0])
        part = (current[i - 1] - least_a) / (current[i - 1] - current[i])
        at = time[a + i - 1] + part * (time[a + i] - time[a + i - 1])
        turned = run.analysis.track.theta_rad(np.array([at])) - commutations.theta_rad[k]
        angles.append(abs(float(np.degrees(turned)[0])))
    return float(np.median(angles))


def limit_to_zero_deg(run: Run, state: SteadyState, chopping: Chopping) -> float | None:
    """Median angle that the switched circuit takes from the chip's limit to no current, in a periodic state of CSC.

    Sectors in which the current does not end are left out; None if it ends in none.
    """
    motor, inverter = run.scenario.motor, real_inverter(run.scenario.inverter)
    n = CARRIER_HZ / (6 * motor.electrical_hz(state.speed_rpm))
    sequence = gate_sequence("CSC", n, state.duty, turns=SETTLE_TURNS + 1, chopping=chopping)
    records = waveforms(motor, inverter, state.speed_rpm, sequence, settle_turns=SETTLE_TURNS, samples=SAMPLES)
    prime_deg = thesis_angle_deg(records["theta_e"])
    angles = []
    for sector, phase in enumerate(FLOATING_PHASE):
        since_deg = (prime_deg - 30.0 - 60.0 * sector) % 360.0
        inside = np.flatnonzero(since_deg < 60.0)
        inside = inside[np.argsort(since_deg[inside])]
        # Behind its end the other diode may take up a current of the other sign.
        current = records[("ia", "ib", "ic")[phase]][inside]
        current = current * np.sign(current[0])
        low, gone = np.flatnonzero(current < limit_a(run)), np.flatnonzero(current < NO_CURRENT_A)
        if gone.size:
            angles.append(float(since_deg[inside][gone[0]] - since_deg[inside][low[0]]))
    return float(np.median(angles)) if angles else None


@case("six-step/freewheel")
def freewheel(runner: Runner) -> Iterator[Row]:
    """Freewheel angle, both modes, 30 to 90 000 r/min, 10 to 30 A: chip, plant and switched circuit agree."""
    currents = CURRENTS_A[:2] if runner.quick else CURRENTS_A
    for chopping in CHOPPINGS:
        for speed_rpm in (60_000,) if runner.quick else (30_000, 60_000, 90_000):
            run = runner.drive(
                "six-step/freewheel.toml",
                f"{chopping}-{speed_rpm}",
                *_events(currents),
                "motor.max_speed_rpm=125000",
                f"initial.speed_rpm={speed_rpm}",
                f"mechanics.profile=[[0.0, {speed_rpm}], [1.0, {speed_rpm}]]",
                f"drive.pattern={chopping}",
            )
            yield from _rows(run, chopping, speed_rpm, currents)


def _rows(run: Run, chopping: Chopping, speed_rpm: int, currents_a: tuple[int, ...]) -> Iterator[Row]:
    motor, inverter = run.scenario.motor, run.scenario.inverter
    sample_deg = 360.0 * motor.electrical_hz(speed_rpm) * inverter.sensing.sample_period_s
    readings = chip_angles_deg(run)
    for k, current_a in enumerate(currents_a):
        window, span = run.metrics[f"i{current_a}"], run.scenario.window[k]
        torque_nm = window["torque_nm"]["mean"]
        low, high = span.from_s * run.data.clock_hz, span.to_s * run.data.clock_hz
        angles_deg = run.analysis.freewheel_deg(low, high)
        # Medians: where the end lies at an edge of the pulse, single angles jump by degrees.
        plant_deg, limit_deg = float(np.median(angles_deg)), decayed_deg(run, low, high)
        own = readings[READINGS * k : READINGS * (k + 1)]
        chip_deg = float(np.median(own)) if len(own) == READINGS else None
        state = duty_for_torque(
            motor,
            real_inverter(inverter),
            speed_rpm,
            torque_nm,
            carrier_hz=CARRIER_HZ,
            commutation="CSC",
            chopping=chopping,
        )
        circuit_deg = float(np.median(np.minimum(state.freewheel_deg, 60.0))) if state else None
        limit = math.ceil(100 * (sample_deg + PRINTED_DEG)) / 100
        # Seen from the end of the current the chip is early by what the current takes from the chip's limit to zero.
        early_deg = limit_to_zero_deg(run, state, chopping) if state else None
        early_limit = math.ceil(100 * (sample_deg + PRINTED_DEG + (early_deg or 0.0))) / 100
        yield Row(
            f"six-step/freewheel/{chopping}-{speed_rpm}-{current_a}A",
            {
                "motor": "Motor-I",
                "supply_v": inverter.supply_v,
                "carrier_hz": CARRIER_HZ,
                "commutation": "CSC",
                "pattern": chopping,
                "speed_rpm": speed_rpm,
                "current_a": current_a,
                "sample_deg": sample_deg,
            },
            {
                "chip_deg": chip_deg,
                "plant_deg": plant_deg,
                "circuit_deg": circuit_deg,
                "plant_at_limit_deg": limit_deg,
                "plant_spread_deg": float(np.ptp(angles_deg)),
                "chip_less_plant_deg": None if chip_deg is None else chip_deg - plant_deg,
                "chip_less_plant_at_limit_deg": None if chip_deg is None else chip_deg - limit_deg,
                "circuit_less_plant_deg": None if circuit_deg is None else circuit_deg - plant_deg,
                "circuit_limit_to_zero_deg": early_deg,
                "torque_mnm": 1000 * torque_nm,
                "commutation_error_deg.rms": window["commutation_error_deg"]["rms"],
                "late_crossings": window["late_crossings"],
                "trips": len(run.result["trips"]),
            },
            {
                "chip_less_plant_deg": (-early_limit, limit),
                "chip_less_plant_at_limit_deg": (-limit, limit),
                "circuit_less_plant_deg": (-limit, limit),
                "trips": (0, 0),
            },
        )
