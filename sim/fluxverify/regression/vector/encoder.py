# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The encoder as the sensored twin: angle error against its resolution; least current of a salient machine."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fluxlock.config import Scenario
from fluxlock.config.machine import Machine
from fluxlock.config.motor import Motor
from fluxlock.config.vector_design import told_machine
from fluxlock.config.vector_loops import loops_of
from fluxlock.config.vector_modes import PLL_BANDWIDTH
from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, event, timeline

SCENARIO = "vector/encoder.toml"
CONDITIONS: dict[str, Condition] = {
    "motor": "IPM",
    "encoder_lines": 1024,
    "fan_nm_at_3000": 1.8,
    "carrier_hz": 20_000,
}
SPEED_RPM = 2_000
MTPA_PERCENT = 2.0
LEARNT_DEG = 5.0  # what an alignment under a swinging rotor may leave
QUICK_END_S = 0.34
MOUNTINGS = ("given", "learnt")


def resolution_deg(motor: Motor) -> float:
    """Electrical angle of a quarter of a line."""
    assert motor.encoder is not None
    return 360.0 * motor.pole_pairs / (4 * motor.encoder.lines)


def loop_lag_deg(scenario: Scenario) -> float:
    """Largest lag of the third-order loop after a step a of the acceleration, 2/e^2 a / omega_n^2: the ramp's slope."""
    omega_n = 2.0 * math.pi * loops_of(scenario).pll_hz / PLL_BANDWIDTH[3]
    slope = scenario.accel_rpm_per_s * math.pi / 30.0 * scenario.motor.pole_pairs
    return math.degrees(2.0 * math.exp(-2.0) * slope / omega_n**2)


def best_current_a(m: Machine, torque_nm: float) -> complex:
    """Current vector of the least amplitude for a torque of a salient machine, A; read from its curve to 1e-6."""
    half_a = m.psi_vs / m.saliency_h / 2
    i_q = np.linspace(0.0, 100.0 * m.motor.rated_current_a, 1_000_001)
    i_d = half_a - np.sqrt(half_a**2 + i_q**2)
    torque = 1.5 * m.motor.pole_pairs * (m.psi_vs - m.saliency_h * i_d) * i_q
    found = float(np.interp(abs(torque_nm), torque, i_q))
    return complex(half_a - math.hypot(half_a, found), math.copysign(found, torque_nm))


def drive(runner: Runner, mounting: str) -> Run:
    """The run; its short version ends with the window `forward`."""
    overrides = [f'drive.vector.mounting="{mounting}"']
    if runner.quick:
        events = [event(0.01, "speed_rpm", SPEED_RPM), event(0.02, "command", "start")]
        overrides += [*timeline(QUICK_END_S, events, [("forward", 0.30, 0.33)]), "expect=[]"]
    return runner.drive(SCENARIO, mounting, *overrides)


@case("vector/encoder", tested=True)
def encoder(runner: Runner) -> Iterator[Row]:
    """Sensored by the encoder from standstill to speed, reversal, zero speed: angle error against the resolution."""
    for mounting in MOUNTINGS[: 1 if runner.quick else None]:
        run = drive(runner, mounting)
        allowed = resolution_deg(run.scenario.motor) + (LEARNT_DEG if mounting == "learnt" else 0.0)
        values: dict[str, Number] = {"trips": len(run.result["trips"])}
        limits: Limits = {"trips": (0, 0)}
        for window, sign in (("forward", 1), ("reversal", 0), ("backward", -1), ("held", 0)):
            if window not in run.metrics:
                continue
            found = run.metrics[window]
            values |= {f"angle_error_deg.{kind}.{window}": found["angle_error_deg"][kind] for kind in ("rms", "max")}
            lag = loop_lag_deg(run.scenario) if window == "reversal" else 0.0
            limits[f"angle_error_deg.max.{window}"] = (None, allowed + lag)
            if window != "reversal":
                values[f"speed_rpm.{window}"] = found["speed_rpm"]["mean"]
                limits[f"speed_rpm.{window}"] = (sign * SPEED_RPM - 20, sign * SPEED_RPM + 20)
        yield Row(
            f"vector/encoder/{mounting}",
            CONDITIONS | {"mounting": mounting, "resolution_deg": round(resolution_deg(run.scenario.motor), 4)},
            values,
            limits,
            "A quarter of a line; while the speed changes, what the loop lags behind the ramp's slope comes to it; "
            "learnt, the middle of the rotor's swing about the aligning current.",
        )


@case("vector/mtpa", tested=True)
def mtpa(runner: Runner) -> Iterator[Row]:
    """Least current for the torque of a salient machine on the chip: i_d within 2 % of the optimum."""
    run = drive(runner, "given")
    machine = told_machine(run.scenario)
    for window in ("forward", "backward"):
        if window not in run.metrics:
            continue
        found = run.metrics[window]
        torque = found["torque_nm"]["mean"]
        best = best_current_a(machine, torque)
        yield Row(
            f"vector/mtpa/{window}",
            CONDITIONS | {"inductances_mh": "0.2/0.4", "speed_rpm": SPEED_RPM if window == "forward" else -SPEED_RPM},
            {
                "torque_nm": torque,
                "id_a": found["id_a"],
                "iq_a": found["iq_a"],
                "id_best_a": best.real,
                "iq_best_a": best.imag,
                "id_error_percent": 100.0 * (found["id_a"] / best.real - 1.0),
            },
            {"id_error_percent": (-MTPA_PERCENT, MTPA_PERCENT)},
            "Mean of the true current in the rotor's frame over the window, the optimum for the torque of the window.",
        )
