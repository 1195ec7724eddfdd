# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Crossing signals on both kinds of EMF, advance, current loop, braking and reversal of the sensorless drive."""

from __future__ import annotations

from collections.abc import Iterator

from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, event, timeline

SCENARIO = "six-step/patterns.toml"
SHORT = ("duration_s=0.1", "window.steady.from_s=0.07", "window.steady.to_s=0.1")
# As in the other rows of commutation errors.
LIMIT_DEG = 0.3
# Of the speed: what the host tests of the same regulators allow. Driving they give the torque within 5 %; braking, with
# half a sector of freewheeling, the current of the conducting pair that is set is not all that makes torque.
SPEED_SHARE, TORQUE_SHARE = 0.005, 0.1
SPEED_RPM, PUMP_RPM = 60_000, 6_000
SOURCES = ("terminal", "star_point", "mean")
# Advance: constant part, at the motor's largest speed, at rated current.
ADVANCE_DEG = (5.0, 9.4, 3.0)
BRAKE_MNM = 10.0


def _errors(run: Run, window: str) -> dict[str, Number]:
    metrics = run.metrics[window]
    return {
        **{
            f"commutation_error_deg.{kind}": metrics["commutation_error_deg"][kind]
            for kind in ("mean", "std", "rms", "max")
        },
        "speed_rpm.mean": metrics["speed_rpm"]["mean"],
        "late_crossings": metrics["late_crossings"],
        "trips": len(run.result["trips"]),
    }


def _limits(speed_rpm: float) -> Limits:
    """Commutations where they are wanted, at the speed, no trip."""
    return {
        "commutation_error_deg.mean": (-LIMIT_DEG, LIMIT_DEG),
        "commutation_error_deg.std": (None, LIMIT_DEG),
        "speed_rpm.mean": (speed_rpm - SPEED_SHARE * abs(speed_rpm), speed_rpm + SPEED_SHARE * abs(speed_rpm)),
        "trips": (0, 0),
    }


@case("six-step/zcd-source")
def zcd_source(runner: Runner) -> Iterator[Row]:
    """Terminal voltage, third harmonic of the star point and of the mean of three, sinusoidal and trapezoidal EMF."""
    for source in ("mean",) if runner.quick else SOURCES:
        signal = f"drive.zcd.source={source}"
        run = runner.drive(SCENARIO, f"sinusoidal-{source}", signal, *(SHORT if runner.quick else ()))
        yield Row(
            f"six-step/zcd-source/sinusoidal-{source}",
            {"motor": "Motor-I", "emf": "sinusoidal", "speed_rpm": SPEED_RPM, "carrier_hz": 40_000, "source": source},
            _errors(run, "steady"),
            _limits(SPEED_RPM),
        )
    for source in () if runner.quick else SOURCES:
        events = [event(0.003, "speed_rpm", PUMP_RPM), event(0.004, "command", "start")]
        times = timeline(0.5, events, [("steady", 0.4, 0.5)])
        start = f"initial.speed_rpm={PUMP_RPM}"
        run = runner.drive(
            "own-pump.toml", f"trapezoidal-{source}", f"drive.zcd.source={source}", start, "expect=[]", *times
        )
        yield Row(
            f"six-step/zcd-source/trapezoidal-{source}",
            {
                "motor": run.scenario.motor.name,
                "emf": "trapezoidal",
                "speed_rpm": PUMP_RPM,
                "carrier_hz": 20_000,
                "source": source,
            },
            _errors(run, "steady"),
            _limits(PUMP_RPM),
        )


@case("six-step/drive-modes", tested=True)
def drive_modes(runner: Runner) -> Iterator[Row]:
    """Advance by speed and current, current loop under the speed loop, braking by torque, reversal without a sensor."""
    short = SHORT if runner.quick else ()
    conditions: dict[str, Condition] = {"motor": "Motor-I", "carrier_hz": 40_000, "speed_rpm": SPEED_RPM}

    constant_deg, speed_deg, current_deg = ADVANCE_DEG
    run = runner.drive(
        SCENARIO,
        "advance",
        f"drive.advance_deg={constant_deg}",
        f"drive.advance_deg_at_max_speed={speed_deg}",
        f"drive.advance_deg_at_rated_current={current_deg}",
        *short,
    )
    motor = run.scenario.motor
    current_a = run.metrics["steady"]["torque_nm"]["mean"] / motor.torque_per_amp_nm
    wanted_deg = (
        constant_deg
        + speed_deg * SPEED_RPM / motor.max_speed_rpm
        + current_deg * current_a / run.scenario.rated_current_a
    )
    yield Row(
        "six-step/drive-modes/advance",
        conditions | {"advance_deg": constant_deg, "at_max_speed": speed_deg, "at_rated_current": current_deg},
        _errors(run, "steady") | {"wanted_advance_deg": wanted_deg, "current_a": current_a},
        _limits(SPEED_RPM),
        "The error is that against the wanted advance, by the plant's speed and current.",
    )

    run = runner.drive(SCENARIO, "current-loop", "drive.current_loop=true", *short)
    yield Row(
        "six-step/drive-modes/current-loop",
        conditions | {"current_loop": True},
        _errors(run, "steady"),
        _limits(SPEED_RPM),
    )
    if runner.quick:
        return
    yield _braking(runner)
    yield _reversal(runner)


def _braking(runner: Runner) -> Row:
    events = [
        event(0.003, "speed_rpm", 50_000),
        event(0.004, "command", "start"),
        event(0.10, "command", f"set torque_mnm -{BRAKE_MNM:g}"),
    ]
    run = runner.drive(
        SCENARIO,
        "braking",
        "initial.speed_rpm=48000",
        "drive.sync_rect=true",
        "drive.current_loop=true",
        "drive.mode=torque",
        "drive.torque_mnm=12.8",
        "drive.zcd.compute_back=true",
        *timeline(0.15, events, [("braking", 0.11, 0.15)]),
    )
    metrics = run.metrics["braking"]
    wanted = -BRAKE_MNM
    return Row(
        "six-step/drive-modes/braking",
        {"motor": "Motor-I", "carrier_hz": 40_000, "torque_mnm": wanted, "sync_rect": True, "compute_back": True},
        _errors(run, "braking")
        | {
            "torque_mnm.mean": 1000 * metrics["torque_nm"]["mean"],
            "speed_rpm.max": metrics["speed_rpm"]["max"],
            "speed_rpm.min": metrics["speed_rpm"]["min"],
        },
        {
            "torque_mnm.mean": (wanted * (1 + TORQUE_SHARE), wanted * (1 - TORQUE_SHARE)),
            "commutation_error_deg.mean": (-LIMIT_DEG, LIMIT_DEG),
            "commutation_error_deg.std": (None, LIMIT_DEG),
            "trips": (0, 0),
        },
    )


def _reversal(runner: Runner) -> Row:
    speed_rpm = 20_000
    events = [
        event(0.003, "speed_rpm", speed_rpm),
        event(0.004, "command", "start"),
        event(0.10, "command", f"set speed_rpm -{speed_rpm}"),
    ]
    run = runner.drive(
        SCENARIO,
        "reversal",
        f"initial.speed_rpm={speed_rpm}",
        "drive.sync_rect=true",
        "record.period_s=4e-6",
        *timeline(1.5, events, [("backward", 1.40, 1.50)]),
    )
    return Row(
        "six-step/drive-modes/reversal",
        {"motor": "Motor-I", "carrier_hz": 40_000, "speed_rpm": -speed_rpm, "from_rpm": speed_rpm, "sync_rect": True},
        _errors(run, "backward"),
        _limits(-speed_rpm),
    )
