# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine of Yu 2022, filterless separation, exact angle sequence: angle error while speed and brake change."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from fluxverify.regression.case import Number, Row, case
from fluxverify.regression.five_phase.driven import angle_values, largest_mean_deg
from fluxverify.regression.five_phase.yu import SCENARIO
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline

LARGEST_RAD = 0.07
DEAD_TIMES_US = (0.0, 2.0)
RATED_NM, LIGHT_NM = 11.0, 3.0  # brake; of the short run, whose rotor breaks loose sooner
SEARCHED_S = 0.06  # the position at rest is known, the angle has settled
STEP_S = 0.075
CREEP_RPM, STEP_RPM, SPEED_RPM = 1.0, 50.0, 150.0
AT_ONCE, RAMP = 100_000.0, 2000.0  # r/min/s
# The printed speed regulator has the k_p of 5 Hz, the scenario's, and the k_i of 7.3 Hz. A smaller k_p makes the step
# without load smoother; up to 6 Hz k_i is so small that the brake's ramp stops the rotor.
BRAKE_SPEED_HZ = 7.3
AT_SPEED_S = 0.2
BRAKE_S, QUICK_SHARE = 0.4, 0.25  # ramp of the brake; share of the short run


def rows_of(
    runner: Runner,
    name: str,
    brake_nm: float,
    begin_s: float,
    end_s: float,
    events: Sequence[Mapping[str, object]],
    overrides: Sequence[str] = (),
) -> Iterator[Row]:
    """Row of each dead time, of 2 us alone in the short version: error from begin_s on."""
    first = [event(0.002, "speed_rpm", CREEP_RPM), event(0.004, "command", "start")]
    for dead_time_us in DEAD_TIMES_US[-1:] if runner.quick else DEAD_TIMES_US:
        run = runner.drive(
            SCENARIO,
            f"{name}-{dead_time_us:g}us",
            *timeline(end_s, [*first, *events], [("steady", begin_s, end_s)]),
            "expect=[]",
            f"drive.accel_rpm_per_s={AT_ONCE:g}",
            f"inverter.dead_time_s={dead_time_us * 1e-6:g}",
            *overrides,
        )
        largest = largest_mean_deg(run, begin_s)
        values: dict[str, Number] = {
            "largest_5ms_mean_rad": None if largest is None else math.radians(largest),
            **angle_values(run),
        }
        for kind in ("max", "min"):
            values[f"speed_rpm.{kind}"] = run.metrics["steady"]["speed_rpm"][kind]
        yield Row(
            f"five-phase/yu-{name}/{dead_time_us:g}us",
            {"motor": "Yu", "dead_time_us": dead_time_us, "brake_nm": brake_nm},
            values,
            {"largest_5ms_mean_rad": (None, LARGEST_RAD), "trips": (0, 0)},
        )


def braked(brake_nm: float) -> list[str]:
    """Overrides with a Coulomb brake."""
    return [f"load.coulomb_nm={brake_nm:g}", f"drive.vector.speed_hz={BRAKE_SPEED_HZ:g}"]


def speed_step(rpm: float) -> dict[str, object]:
    """The target, at once unless a ramp was asked for before."""
    return event(STEP_S, "command", f"set speed_rpm {rpm:g}")


@case("five-phase/yu-start")
def start(runner: Runner) -> Iterator[Row]:
    """Step to 50 r/min without load after the search at rest: largest 5 ms mean; short: 2 us of dead time alone."""
    yield from rows_of(runner, "start", 0.0, SEARCHED_S, 0.13 if runner.quick else 0.2, [speed_step(STEP_RPM)])


@case("five-phase/yu-start-brake")
def start_brake(runner: Runner) -> Iterator[Row]:
    """Step to 50 r/min against the rated Coulomb brake, which holds the rotor until i_q has come up: the same."""
    brake_nm, end_s = (LIGHT_NM, 0.3) if runner.quick else (RATED_NM, 1.1)
    events = [speed_step(STEP_RPM)]
    yield from rows_of(runner, "start-brake", brake_nm, SEARCHED_S, end_s, events, braked(brake_nm))


@case("five-phase/yu-brake")
def brake(runner: Runner) -> Iterator[Row]:
    """Rated brake at 150 r/min, applied and released by ramps of 0.4 s: the same; short: a quarter of both ramps."""
    share = QUICK_SHARE if runner.quick else 1.0
    ramp_s = share * BRAKE_S
    release_s = AT_SPEED_S + 1.1 * ramp_s
    end_s = release_s + 1.1 * ramp_s + (0.0 if runner.quick else 0.1)
    events = [
        event(0.0, "load_factor", 0.0),
        event(STEP_S - 0.005, "accel_rpm_per_s", RAMP),
        speed_step(SPEED_RPM),
        {**event(AT_SPEED_S, "load_factor", share), "ramp_s": ramp_s},
        {**event(release_s, "load_factor", 0.0), "ramp_s": ramp_s},
    ]
    yield from rows_of(runner, "brake", RATED_NM, AT_SPEED_S, end_s, events, braked(RATED_NM))
