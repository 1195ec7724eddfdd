# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Locks lost on purpose: the drive finds the rotor again or stops with a named fault; the gates stay under control."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fluxlock.cosim.outcome import Run
from fluxlock.results.gates import gate_safety
from fluxverify.regression.case import LOCK_MAY_GO, Condition, Number, Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import Limits, console_word, event, timeline
from fluxverify.regression.six_step.support import LOCKED_RMS_DEG

SPEED_RPM = 60_000
DISTURBED_S = 0.08
# The hardware is faster than this by far; the firmware cannot turn a gate on before its next tick.
OFF_CYCLES = 3
TICK_S = 100e-6

# Of the speed: regained within, disturbed beyond.
SPEED_SHARE = 0.01
# Crossings are 60 degrees apart, 120 if one is missing.
MISSED_DEG = 90.0
# Before the disturbance, locked: what the end is compared with.
BEFORE_S = (0.05, DISTURBED_S)

Change = dict[str, object]


@dataclass(frozen=True)
class Disturbance:
    """What happens, and the faults by whose names the drive may stop; none: it must run.

    changes: events, `at_s` after DISTURBED_S. must_stop: a stop by one of the faults is the only right end.
    overrides: of the scenario. end_s: length of the run.
    """

    description: str
    changes: tuple[Change, ...]
    faults: frozenset[str] = frozenset()
    must_stop: bool = False
    overrides: tuple[str, ...] = ()
    end_s: float = 0.30


def stuck(at_s: float, channel: str, code: int | None = None) -> Change:
    """A converter channel keeps a code, its present one by default."""
    fault = {"kind": "stuck_channel", "channel": channel} | ({} if code is None else {"code": code})
    return {"at_s": at_s, "fault": fault}


def dip(at_s: float, return_s: float) -> tuple[Change, Change]:
    """No supply for 20 ms; it returns within return_s."""
    return {"at_s": at_s, "supply_v": 0.0}, {"at_s": at_s + 0.020, "supply_v": 25.0, "ramp_s": return_s}


def load(at_s: float, factor: float) -> Change:
    """A load step."""
    return {"at_s": at_s, "load_factor": factor}


def clear(at_s: float) -> Change:
    """All channels work again."""
    return {"at_s": at_s, "fault": {"kind": "clear"}}


# A diode keeps the link from feeding the failed supply.
DIODE = "inverter.supply_diode=true"
UNPROTECTED = (DIODE, "inverter.protection.under_voltage_v=0")
# Three times the load needs 36.3 A, beyond the rated current: with that limit the scenario is refused. Ripple and the
# rise before a commutation, 15 % and 2 A more, stay below the trip at 45 A.
STRONG = "drive.current_limit_a=37"
# Legs change over within a carrier: the dead time shows.
SYNC = "drive.sync_rect=true"
OVER_CURRENT = frozenset({"phase_over_current", "dc_over_current"})
CHANNEL_FAULTS = frozenset({"voltage_channel", "lost_lock"})
# The lock needs neither vdc nor the currents, but the protection does.
STILL = frozenset({"stuck_channel"})
WRONG_CURRENT = STILL | OVER_CURRENT | {"current_sum"}
STUCK = {
    "va": (None, CHANNEL_FAULTS),
    "va-high": (4095, CHANNEL_FAULTS),
    "vb-low": (0, CHANNEL_FAULTS),
    "vc": (None, CHANNEL_FAULTS),
    # 3 % below the link's voltage: plausible.
    "vdc-low": (3300, STILL),
    "ia": (None, WRONG_CURRENT),
    "ib-high": (4095, OVER_CURRENT),
    "ic-zero": (2048, WRONG_CURRENT),
    "idc": (None, STILL),
}

FULL: dict[str, Disturbance] = {
    "dip": Disturbance(
        "supply 0 V for 20 ms, back within 5 ms, no under-voltage trip", dip(0, 5e-3), overrides=UNPROTECTED
    ),
    "dip-step": Disturbance(
        "supply 0 V for 20 ms, back at once, no under-voltage trip", dip(0, 0), OVER_CURRENT, overrides=UNPROTECTED
    ),
    "dip-trip": Disturbance(
        "supply 0 V for 20 ms, trip at 15 V", dip(0, 0), frozenset({"under_voltage"}), True, (DIODE,), end_s=0.15
    ),
    "dip-trip-start": Disturbance(
        "supply 0 V for 20 ms, trip at 15 V, then clear and start",
        (*dip(0, 0), {"at_s": 0.04, "command": "clear"}, {"at_s": 0.06, "command": "start"}),
        overrides=(DIODE,),
    ),
    "load-step": Disturbance("3 x load from one instant on", (load(0, 3.0),), overrides=(STRONG,)),
    "stuck-va-5ms": Disturbance("va keeps its code for 5 ms", (stuck(0, "va"), clear(0.005))),
    "stuck-va-5ms-sync": Disturbance(
        "va keeps its code for 5 ms, synchronous rectification", (stuck(0, "va"), clear(0.005)), overrides=(SYNC,)
    ),
    **{
        f"stuck-{name}": Disturbance(
            f"{name.partition('-')[0]} keeps {'its code' if code is None else f'code {code}'} from one instant on",
            (stuck(0, name.partition("-")[0], code),),
            faults,
            must_stop=not name.startswith("v") or faults >= STILL,
        )
        for name, (code, faults) in STUCK.items()
    },
}
QUICK: dict[str, Disturbance] = {
    "sequence": Disturbance(
        "3 x load for 20 ms; va at code 4095 for 5 ms; supply 0 V for 20 ms, no under-voltage trip",
        (load(0, 3.0), load(0.020, 1.0), stuck(0.040, "va", 4095), clear(0.045), *dip(0.070, 5e-3)),
        overrides=(*UNPROTECTED, STRONG, SYNC),
        end_s=0.30,
    )
}


def _effect(run: Run) -> dict[str, Number]:
    """What the disturbance did: `disturbed` is 1 if anything."""
    clock_hz = run.data.clock_hz
    since = DISTURBED_S * clock_hz
    records, crossings = run.data.records, run.analysis.crossings
    before = records[(records["t_cycle"] >= BEFORE_S[0] * clock_hz) & (records["t_cycle"] < since)]
    after = records[records["t_cycle"] >= since]
    speed = float(np.mean(before["omega_e"]))
    deviation = float(np.max(np.abs(after["omega_e"] / speed - 1.0)))
    # Behind the last record there is no angle.
    gap_deg = float(np.max(crossings.between(since, run.analysis.track.last_cycle).intervals_deg(), initial=0.0))
    lost = int(console_word(run, "lost_locks") or 0)
    values: dict[str, Number] = {"speed_deviation_percent": 100 * deviation, "largest_crossing_interval_deg": gap_deg}
    disturbed = lost > 0 or bool(run.result["trips"]) or gap_deg > MISSED_DEG or deviation > SPEED_SHARE
    return values | {"disturbed": int(disturbed)}


def endings(disturbance: Disturbance, locked: bool, stopped: bool) -> dict[str, Number]:
    """How a run has ended: which of two ways, and whether it is a right one."""
    return {
        "relocked": int(locked),
        "stopped_by_name": int(stopped),
        "right_end": int(stopped if disturbance.must_stop else locked or stopped),
    }


def _row(run: Run, name: str, disturbance: Disturbance) -> Row:
    window = run.metrics["end"]
    rms_deg = window["commutation_error_deg"]["rms"]
    state, fault = console_word(run, "state"), console_word(run, "now")
    locked = state == "running" and rms_deg is not None and rms_deg < LOCKED_RMS_DEG
    safety = gate_safety(run.data)
    stopped = state == "fault" and fault in disturbance.faults and not safety.on_at_end
    lost, trips = int(console_word(run, "lost_locks") or 0), len(run.result["trips"])
    values: dict[str, Number] = {
        **endings(disturbance, locked, stopped),
        "commutation_error_deg.rms": rms_deg,
        "speed_rpm.mean": window["speed_rpm"]["mean"],
        "lost_locks": lost,
        "trips": trips,
        "shoot_throughs": safety.shoot_throughs,
        "least_dead_time_ns": None if safety.least_dead_time_s is None else 1e9 * safety.least_dead_time_s,
    }
    values |= _effect(run)
    dead_time_ns = 1e9 * run.scenario.inverter.dead_time_s
    limits: Limits = {"disturbed": (1, 1), "right_end": (1, 1), "shoot_throughs": (0, 0)}
    if state == "running":
        limits["speed_rpm.mean"] = ((1 - SPEED_SHARE) * SPEED_RPM, (1 + SPEED_SHARE) * SPEED_RPM)
    if values["least_dead_time_ns"] is not None:
        limits["least_dead_time_ns"] = (dead_time_ns - 1e-6, None)
    if safety.latest_off_cycles is not None and safety.shortest_off_s is not None:
        values |= {"trip_to_off_clocks": safety.latest_off_cycles, "off_after_trip_ms": 1e3 * safety.shortest_off_s}
        limits |= {"trip_to_off_clocks": (None, OFF_CYCLES), "off_after_trip_ms": (1e3 * TICK_S, None)}
    conditions: dict[str, Condition] = {
        "motor": "Motor-I",
        "speed_rpm": SPEED_RPM,
        "fan_mnm_at_60000": 20,
        "disturbance": disturbance.description,
        "state_at_end": state,
        "fault_at_end": fault,
    }
    return Row(f"six-step/lost-lock/{name}", conditions, values, limits)


@case("six-step/lost-lock")
def lost_lock(runner: Runner) -> Iterator[Row]:
    """Supply dip, stuck converter channel, load step: locked again or stopped by name, every gate under control."""
    for name, disturbance in (QUICK if runner.quick else FULL).items():
        events = [event(0.003, "speed_rpm", SPEED_RPM), event(0.004, "command", "start")]
        events += [change | {"at_s": DISTURBED_S + float(str(change["at_s"]))} for change in disturbance.changes]
        events.append(event(disturbance.end_s - 0.001, "command", "get lost_locks"))
        times = timeline(disturbance.end_s, events, [("end", disturbance.end_s - 0.03, disturbance.end_s)])
        may = dict.fromkeys(LOCK_MAY_GO, "the disturbance may cost the lock; the row says how the run must end")
        overrides = ("expect_trip=[]", *disturbance.overrides, *times)
        run = runner.drive("six-step/lost-lock.toml", name, *overrides, accept=may)
        yield _row(run, name, disturbance)
