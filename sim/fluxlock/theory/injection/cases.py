# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Settings found for the injection, and what the float model of the whole drive shows with them.

    python -m fluxlock.theory.injection.cases [SUBJECT ...] [--figures FOLDER]

prints setting, value and limit of each row; subjects: SUBJECTS, all without. Limits are those that the chip's runs must
reach. Errors theta_hat - theta, of the published estimate unless a row says raw; dynamic rows: largest 5 ms mean.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.config import Motor, load_motor
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.injection.chain import HfMachine
from fluxlock.theory.injection.loop import Course, Inverter, Loop, Schedule, Settings, designed_pll, printed_pll
from fluxlock.theory.injection.theory import sequence_error

DEAD_TIME_S = 2e-6
DEAD_TIMES = (0.0, DEAD_TIME_S)
ZONE_A = 0.05  # of the compensation

# Tian 2019: 10.3 kHz single update.
TIAN_TS = 1 / 10_300
LOCK_IN = Settings(
    "lock-in",
    "held-tian",
    TIAN_TS,
    period=40,
    amplitude_v=20.0,
    pll=printed_pll(80.0, 1200.0, TIAN_TS),
    current_hz=120.0,
    third_ratio=0.15,
)
CONVENTIONAL = replace(LOCK_IN, method="conventional")
TIAN_BEST = replace(
    LOCK_IN,
    method="iq",
    sequence="exact",
    period=16,
    amplitude_v=90.0,
    remove=True,
    current_hz=30.0,
    pll=designed_pll(3, 50.0, TIAN_TS),
)
TIAN_KINDS: dict[str, Settings] = {"conventional": CONVENTIONAL, "lock-in": LOCK_IN, "best": TIAN_BEST}

# Yu 2022: 4 kHz double update.
YU_TS = 125e-6
YU_PRINTED = Settings(
    "separator",
    "exact",
    YU_TS,
    period=4,
    amplitude_v=60.0,
    pll=printed_pll(115.0, 3306.0, YU_TS),
    double=True,
    current_gains=(16.2, 77.0, 18.8, 66.0),
    speed_p=0.07 / 9,
    speed_i=1.2 / 9,
    speed_hz=50.0,
    current_limit_a=7.0,
)
YU_BEST = replace(YU_PRINTED, pll=designed_pll(3, 90.0, YU_TS), compensation="following")

# Three-phase IPM at 20 kHz.
IPM_TS = 50e-6
IPM_BEST = Settings(
    "iq",
    "exact",
    IPM_TS,
    period=8,
    amplitude_v=6.0,
    pll=designed_pll(3, 120.0, 2 * IPM_TS),
    tick=2,
    remove=True,
    current_hz=300.0,
    speed_p=0.022,
    speed_i=0.5,
    speed_hz=150.0,
    current_limit_a=13.0,
    compensation="following",
)


@dataclass(frozen=True)
class Row:
    """A value beside its limit (both sizes, same unit); limit None: only shown."""

    name: str
    value: float
    unit: str
    limit: float | None = None

    @property
    def passed(self) -> bool:
        """Within the limit."""
        return self.limit is None or abs(self.value) <= self.limit

    def text(self) -> str:
        """One line."""
        limit = "" if self.limit is None else f"   limit {self.limit:g}   {'ok' if self.passed else 'MISSED'}"
        return f"{self.name:<66}{self.value:+9.4f} {self.unit}{limit}"


@lru_cache(maxsize=8)
def machine(name: str) -> Motor:
    """Motor file by its stem."""
    return load_motor(ROOT / "motors" / f"{name}.toml")


def inverter(
    full_scale_a: float, supply_v: float, dead_time_s: float, average: int = 1, noise: bool = True
) -> Inverter:
    """Compensation with the HF current moved to where the voltage acts."""
    return Inverter(
        supply_v,
        dead_time_s,
        compensation_zone_a=ZONE_A,
        model=True,
        current_full_scale_a=full_scale_a if noise else 0.0,
        average=average,
    )


def tian(settings: Settings, dead_time_s: float = 0.0, moved: bool = True) -> Loop:
    """Tian's drive; moved: compensation by the moved current, else by the sampled one."""
    found = replace(inverter(20.0, 200.0, dead_time_s), model=moved)
    return Loop(machine("five-phase-tian"), found, settings)


def yu(settings: Settings, dead_time_s: float = 0.0, saturated: bool = True, noise: bool = True) -> Loop:
    """Yu's drive, currents averaged over 16 converter samples."""
    return Loop(machine("five-phase-yu"), inverter(10.0, 350.0, dead_time_s, 16, noise), settings, saturated)


def ipm(settings: Settings, dead_time_s: float = 0.0) -> Loop:
    """Three-phase IPM, 48 V."""
    return Loop(machine("ipm-4pp-saturated"), inverter(25.0, 48.0, dead_time_s, 4), settings)


def _us(dead_time_s: float) -> str:
    return f"{1e6 * dead_time_s:g} us"


def _mean_sizes(courses: list[Course], begin_s: float) -> tuple[float, float]:
    """Worst mean and rms (deg)."""
    found = [c.statistics(begin_s).degrees() for c in courses]
    return max((s.mean for s in found), key=abs), max(s.rms for s in found)


def tian_steady(settings: Settings, dead_time_s: float, rpm: float, seconds: float = 3.0) -> Course:
    """Speed loop with the viscous load, from rest by a ramp of 1 s."""
    loop = tian(settings, dead_time_s)
    ramp = np.minimum(loop.times(seconds), 1.0)
    return loop.run(Schedule(seconds, speed_rad_s=ramp * loop.motor.omega_e(rpm)))


def tian_curves() -> list[Row]:
    """Error over speed of the printed methods; lock-in below conventional."""
    rows = []
    for dead in DEAD_TIMES:
        for rpm in (10.0, 25.0, 50.0, 85.0, 100.0):
            for kind in ("conventional", "lock-in"):
                found = tian_steady(TIAN_KINDS[kind], dead, rpm).statistics(2.0).degrees()
                rows.append(Row(f"tian {kind}, {rpm:g} r/min, dead time {_us(dead)}: mean", found.mean, "deg"))
    return rows


def tian_best() -> list[Row]:
    """Steady error of the best scheme: driven shaft, i_q 0 to 2 A, ten rest angles at standstill."""
    rows = []
    for dead, mean_limit, rms_limit in ((0.0, 0.3, 0.5), (DEAD_TIME_S, 1.0, None)):
        loop = tian(TIAN_BEST, dead)
        for rpm in (0.0, 5.0, 25.0, 50.0, 100.0):
            courses = []
            for i_q in (0.0, 0.3, 1.0, 2.0) if dead else (0.0, 2.0):
                for theta in np.arange(10) * math.pi / 50 if rpm == 0 and dead else (0.7,):
                    schedule = Schedule(
                        0.6 if rpm == 0 else 1.0,
                        imposed_rad_s=loop.motor.omega_e(rpm),
                        i_q_a=i_q,
                        theta_rad=float(theta),
                    )
                    courses.append(loop.run(schedule))
            mean, rms = _mean_sizes(courses, 0.3)
            text = f"tian best, {rpm:g} r/min, dead time {_us(dead)}"
            rows += [Row(f"{text}: mean", mean, "deg", mean_limit), Row(f"{text}: rms", rms, "deg", rms_limit)]
    return rows


def tian_start() -> list[Row]:
    """From 30 degrees off, free rotor, i_q 2 A at once: until within 5 degrees for good."""
    rows = []
    for kind, settings in TIAN_KINDS.items():
        for dead in DEAD_TIMES:
            runs = [
                tian(settings, dead).run(Schedule(1.0, i_q_a=2.0, error_rad=sign * math.pi / 6)) for sign in (-1.0, 1.0)
            ]
            limit_rad, text = math.radians(5), f"tian {kind}, start from 30 deg, dead time {_us(dead)}"
            rows.append(Row(f"{text}: first within", max(r.first_within(limit_rad) for r in runs), "s"))
            limit = 0.06 if kind == "best" else None
            rows.append(Row(f"{text}: for good", max(r.settled(limit_rad) for r in runs), "s", limit))
    return rows


def tian_event(settings: Settings, dead_time_s: float, event: str) -> tuple[Course, float]:
    """Torque reversal, load step or speed reversal at 2 s; the run and that instant."""
    loop = tian(settings, dead_time_s)
    at, seconds = 2.0, 4.0
    t = loop.times(seconds)
    after = t >= at
    speed = loop.motor.omega_e(60.0)
    if event == "torque reversal":
        schedule = Schedule(seconds, i_q_a=np.where(after, -2.0, 2.0))
    elif event == "load step 8 N m":
        schedule = Schedule(seconds, speed_rad_s=np.minimum(t, 1.0) * speed, load_nm=np.where(after, 8.0, 0.0))
    else:
        schedule = Schedule(seconds, speed_rad_s=np.where(after, -speed, np.minimum(t, 1.0) * speed))
    return loop.run(schedule), at


TIAN_EVENTS = ("torque reversal", "load step 8 N m", "speed reversal")


def tian_dynamic() -> list[Row]:
    """Largest errors of the three events."""
    rows = []
    for event in TIAN_EVENTS:
        for kind, settings in TIAN_KINDS.items():
            for dead in DEAD_TIMES:
                course, at = tian_event(settings, dead, event)
                value = math.degrees(course.largest_mean(at - 0.1))
                limit = 5.0 if kind == "best" else None
                rows.append(Row(f"tian {kind}, {event}, dead time {_us(dead)}", value, "deg", limit))
    return rows


def yu_sequences() -> list[Row]:
    """Raw error over the closed form, driven shaft, without saturation; published error of the exact sequence."""
    rows = []
    motor = machine("five-phase-yu")
    assert motor.inductance_q_h is not None
    hf = HfMachine(motor.resistance_ohm[0], motor.inductance_h[0], motor.inductance_q_h)
    for sequence in ("held", "half-step", "exact"):
        for rpm in (50.0, 150.0, 300.0, 600.0):
            loop = yu(replace(YU_PRINTED, sequence=sequence), saturated=False)
            omega = motor.omega_e(rpm)
            mean = loop.run(Schedule(2.0, imposed_rad_s=omega)).statistics(0.6, raw=True).mean
            expected = sequence_error(hf, omega * YU_TS, sequence)
            text = f"yu {sequence}, {rpm:g} r/min"
            if sequence == "exact":
                rows.append(Row(f"{text}: mean", mean, "rad", 0.005))
            else:
                rows.append(Row(f"{text}: raw", mean, "rad"))
                rows.append(Row(f"{text}: over the closed form {expected:+.4f}", 100 * (mean / expected - 1), "%", 3.0))
    return rows


def yu_loaded(settings: Settings, dead_time_s: float) -> Course:
    """150 r/min against the rated brake, applied by a ramp from 0.7 to 1.1 s, released from 1.8 to 2.2 s."""
    loop = yu(settings, dead_time_s)
    t = loop.times(2.6)
    brake = 11.0 * np.interp(t, [0.7, 1.1, 1.8, 2.2], [0.0, 1.0, 1.0, 0.0])
    return loop.run(Schedule(2.6, speed_rad_s=np.minimum(t / 0.3, 1) * loop.motor.omega_e(150.0), coulomb_nm=brake))


def yu_compensation() -> list[Row]:
    """Rated load at 150 r/min with the curve off and on."""
    rows = []
    for dead in DEAD_TIMES:
        off = yu_loaded(replace(YU_BEST, compensation="off"), dead).statistics(1.4, 1.8).mean
        course = yu_loaded(YU_BEST, dead)
        raw, on = (course.statistics(1.4, 1.8, raw=raw).mean for raw in (True, False))
        text = f"yu 150 r/min rated load, dead time {_us(dead)}"
        # Off altogether, the turned frame sends -i_q sin(0.3) into the d axis, which changes L_q: not 0.30 rad.
        rows.append(Row(f"{text}: no curve anywhere, mean", off, "rad"))
        rows.append(Row(f"{text}: curve in the frame only, raw less 0.30", raw - 0.30, "rad", 0.02))
        rows.append(Row(f"{text}: curve on, mean", on, "rad", 0.01))
    return rows


def yu_start(settings: Settings, dead_time_s: float, brake_nm: float, moved: bool = True) -> Course:
    """Step to 50 r/min at 0.3 s."""
    loop = yu(settings, dead_time_s)
    loop = replace(loop, inverter=replace(loop.inverter, model=moved))
    t = loop.times(2.3)
    return loop.run(Schedule(2.3, speed_rad_s=np.where(t > 0.3, loop.motor.omega_e(50.0), 0.0), coulomb_nm=brake_nm))


def yu_dynamic() -> list[Row]:
    """Starts without and against the rated brake, the brake applied and released."""
    rows = []
    printed = replace(YU_PRINTED, compensation="on")
    for name, settings, limit in (("printed loop", printed, None), ("best", YU_BEST, 0.07)):
        for dead in DEAD_TIMES:
            for text, brake in (("no load", 0.0), ("rated brake", 11.0)):
                value = yu_start(settings, dead, brake).largest_mean(0.2)
                rows.append(Row(f"yu {name}, 0 to 50 r/min {text}, dead time {_us(dead)}", value, "rad", limit))
            value = yu_loaded(settings, dead).largest_mean(0.6)
            rows.append(Row(f"yu {name}, brake on and off at 150 r/min, dead time {_us(dead)}", value, "rad", limit))
    return rows


def yu_slow() -> list[Row]:
    """5 r/min against the rated brake, from rest."""
    rows = []
    for dead in DEAD_TIMES:
        loop = yu(YU_BEST, dead)
        # The integral of the speed loop needs 8 s for the torque that moves the rotor.
        schedule = Schedule(16.0, speed_rad_s=loop.motor.omega_e(5.0), coulomb_nm=11.0)
        course = loop.run(schedule)
        found = course.statistics(12.0)
        text = f"yu 5 r/min full load, dead time {_us(dead)}"
        rows += [
            Row(f"{text}: speed", float(course.speed_rpm[course.time_s > 12.0].mean()), "r/min"),
            Row(f"{text}: mean", found.mean, "rad", 0.015),
            Row(f"{text}: rms", found.rms, "rad", 0.02),
            Row(f"{text}: largest", found.largest, "rad", 0.05),
        ]
    return rows


def yu_leakage() -> list[Row]:
    """Step of i_d by 5 A at standstill, exact currents: what gets into the HF current besides the injection."""
    from fluxlock.theory.injection.kernel import HF_D, HF_Q

    rows = []
    for text, hold in (("voltage changed at the zero crossings", True), ("at every update", False)):
        loop = yu(replace(YU_PRINTED, hold=hold), saturated=False, noise=False)
        t = loop.times(0.3)
        course = loop.run(Schedule(0.3, imposed_rad_s=0.0, i_d_a=np.where(t > 0.15, 5.0, 0.0)))
        leak = [np.abs(course.column(k) - course.column(k)[t < 0.15][-1])[t > 0.149].max() for k in (HF_D, HF_Q)]
        limit = 10.0 if hold else None
        rows.append(Row(f"yu 5 A step of i_d, {text}: leakage", 1e3 * max(leak), "mA", limit))
    return rows


def ipm_rows() -> list[Row]:
    """Three-phase IPM to a tenth of its speed, rated torque by ramps of 0.1 s, reversals."""
    rows = []
    motor = machine("ipm-4pp-saturated")
    top = motor.omega_e(0.1 * motor.max_speed_rpm)
    torque = motor.pole_pairs * 1.5 * motor.psi_vs[0] * motor.rated_current_a
    for dead in DEAD_TIMES:
        loop = ipm(IPM_BEST, dead)
        means, rms = [], []
        for part in (0.0, 0.1, 0.5, 1.0, -1.0):
            for share in (-1.0, 0.0, 1.0):
                t = loop.times(1.0)
                ramp = np.minimum(t / 0.2, 1.0)
                load = share * torque * np.interp(t, [0.2, 0.3], [0.0, 1.0])
                found = loop.run(Schedule(1.0, speed_rad_s=part * top * ramp, load_nm=load)).statistics(0.6).degrees()
                means.append(found.mean)
                rms.append(found.rms)
        text = f"ipm, dead time {_us(dead)}"
        rows.append(Row(f"{text}: settled, 0 to 10 %, 0 and +- rated torque: mean", max(means, key=abs), "deg", 0.5))
        rows.append(Row(f"{text}: the same, rms", max(rms), "deg", 1.0))
        t = loop.times(1.6)
        speed = top * np.interp(t, [0.0, 0.2, 0.5, 0.7, 1.2, 1.4], [0.0, 1.0, 1.0, -1.0, -1.0, 1.0])
        value = loop.run(Schedule(1.6, speed_rad_s=speed)).largest_mean(0.05)
        rows.append(Row(f"{text}: speed reversals +-10 %, ramps of 0.2 s", math.degrees(value), "deg", 5.0))
        load = torque * np.interp(t, [0.3, 0.4, 0.7, 0.9, 1.2, 1.3], [0.0, 1.0, 1.0, -1.0, -1.0, 0.0])
        value = loop.run(Schedule(1.6, speed_rad_s=0.5 * top * np.minimum(t / 0.2, 1), load_nm=load)).largest_mean(0.05)
        rows.append(Row(f"{text}: rated torque, its reversal and end at 5 %", math.degrees(value), "deg", 5.0))
    return rows


def _standstill(loop: Loop) -> float:
    """Largest mean error (deg) over six rest angles, i_q 0 and 0.3 A."""
    courses = [
        loop.run(Schedule(0.5, imposed_rad_s=0.0, i_q_a=i_q, theta_rad=float(theta)))
        for theta in np.arange(6) * math.pi / 30
        for i_q in (0.0, 0.3)
    ]
    return _mean_sizes(courses, 0.25)[0]


def tian_variants() -> list[Row]:
    """What each part of Tian's best scheme is worth: one of them changed."""
    rows = []
    extrapolated = tian(TIAN_BEST, DEAD_TIME_S, moved=False)
    extrapolated = replace(extrapolated, inverter=replace(extrapolated.inverter, predict=1.5))
    for text, loop in (
        ("HF current moved", tian(TIAN_BEST, DEAD_TIME_S)),
        ("extrapolated by 1.5 samples", extrapolated),
        ("sampled currents", tian(TIAN_BEST, DEAD_TIME_S, moved=False)),
        ("HF current moved, n = 40, 20 V", tian(replace(TIAN_BEST, period=40, amplitude_v=20.0), DEAD_TIME_S)),
    ):
        rows.append(Row(f"tian standstill, dead time 2 us, compensation {text}", _standstill(loop), "deg"))
    lock_in = replace(LOCK_IN, sequence="exact", remove=True)
    for text, settings in (
        ("best as it is", TIAN_BEST),
        ("best, inverse Park at the angle of the sample", replace(TIAN_BEST, sequence="held-tian")),
        ("best, HF current left in the regulators", replace(TIAN_BEST, remove=False)),
        ("best, R believed 20 % too large", replace(TIAN_BEST, machine_r_ohm=1.2 * 1.3)),
        ("lock-in, n = 40, 20 V, exact, HF removed", lock_in),
        ("the same, 8 samples a period", replace(lock_in, over=8)),
        ("conventional, current regulators of 60 Hz", replace(CONVENTIONAL, current_hz=60.0)),
        ("lock-in as printed, current regulators of 60 Hz", replace(LOCK_IN, current_hz=60.0)),
    ):
        found = tian_steady(settings, 0.0, 100.0).statistics(2.0).degrees().mean
        rows.append(Row(f"tian 100 r/min, {text}", found, "deg"))
    for text, settings in (
        ("as it is", TIAN_BEST),
        ("current regulators of 120 Hz", replace(TIAN_BEST, current_hz=120.0)),
        ("n = 20, 40 V", replace(TIAN_BEST, period=20, amplitude_v=40.0)),
        ("second-order loop", replace(TIAN_BEST, pll=designed_pll(2, 50.0, TIAN_TS))),
    ):
        course, at = tian_event(settings, 0.0, "torque reversal")
        rows.append(Row(f"tian torque reversal, best: {text}", math.degrees(course.largest_mean(at - 0.1)), "deg"))
    return rows


def yu_variants() -> list[Row]:
    """The same for Yu's machine and the three-phase one."""
    rows = []
    motor = machine("five-phase-yu")

    for brake, text in ((0.0, "no load"), (11.0, "rated brake")):
        value = yu_start(YU_BEST, DEAD_TIME_S, brake, moved=False).largest_mean(0.2)
        rows.append(Row(f"yu 0 to 50 r/min {text}, 2 us, compensation by sampled currents", value, "rad"))
    for text, settings in (
        ("as it is", YU_BEST),
        ("frame does not follow the curve", replace(YU_BEST, compensation="on")),
        ("second-order loop", replace(YU_BEST, pll=designed_pll(2, 90.0, YU_TS))),
        ("60 Hz", replace(YU_BEST, pll=designed_pll(3, 60.0, YU_TS))),
    ):
        rows.append(Row(f"yu brake on and off, best: {text}", yu_loaded(settings, 0.0).largest_mean(0.6), "rad"))
    for average in (1, 16):
        loop = yu(YU_BEST)
        loop = replace(loop, inverter=replace(loop.inverter, average=average))
        found = loop.run(Schedule(1.5, imposed_rad_s=motor.omega_e(150.0))).statistics(0.5)
        rows.append(Row(f"yu 150 r/min no load, best, {average} converter samples a current: rms", found.rms, "rad"))
    loop = yu(replace(YU_PRINTED, sequence="held-tian"), saturated=False)
    found = loop.run(Schedule(2.0, imposed_rad_s=motor.omega_e(50.0))).statistics(0.6, raw=True)
    rows.append(Row("yu 50 r/min, inverse Park at the angle of the sample (lead 0): raw", found.mean, "rad"))
    three = ipm(IPM_BEST, DEAD_TIME_S)
    t = three.times(1.6)
    top = 0.1 * three.motor.omega_e(three.motor.max_speed_rpm)
    reversal = Schedule(1.6, speed_rad_s=top * np.interp(t, [0.0, 0.2, 0.5, 0.7], [0.0, 1.0, 1.0, -1.0]))
    for text, predict in (("by sampled currents", 0.0), ("extrapolated by 1.5 samples", 1.5)):
        drive = replace(three, inverter=replace(three.inverter, model=False, predict=predict))
        value = math.degrees(drive.run(reversal).largest_mean(0.05))
        rows.append(Row(f"ipm speed reversal, 2 us, compensation {text}", value, "deg"))
    return rows


SUBJECTS: Mapping[str, Callable[[], list[Row]]] = {
    "tian-curves": tian_curves,
    "tian-best": tian_best,
    "tian-start": tian_start,
    "tian-dynamic": tian_dynamic,
    "yu-sequences": yu_sequences,
    "yu-compensation": yu_compensation,
    "yu-dynamic": yu_dynamic,
    "yu-slow": yu_slow,
    "yu-leakage": yu_leakage,
    "ipm": ipm_rows,
    "tian-variants": tian_variants,
    "yu-variants": yu_variants,
}


def curves_of(folder: Path) -> None:
    """Write the figures of docs/theory/five-phase.md into a folder."""
    from fluxlock.theory.injection.plots import curves_figure, running_mean
    from fluxlock.theory.six_step.plots import save

    folder.mkdir(parents=True, exist_ok=True)
    speeds = np.array([5.0, 10.0, 25.0, 50.0, 75.0, 100.0])
    curves: dict[str, tuple[FloatArray, FloatArray]] = {}
    for kind, settings in TIAN_KINDS.items():
        found = [abs(tian_steady(settings, 0.0, rpm).statistics(2.0).degrees().mean) for rpm in speeds]
        curves[kind] = (speeds, np.array(found))
    title = "Tian, steady error over speed, no dead time"
    save(curves_figure(title, curves, "speed / r/min", "|mean error| / deg el."), folder / "tian-curves.png")
    curves = {}
    for kind, settings in TIAN_KINDS.items():
        course, _ = tian_event(settings, 0.0, "torque reversal")
        window = (course.time_s > 1.8) & (course.time_s < 3.0)
        error = running_mean(np.degrees(course.error()), round(5e-3 / course.ts_s))
        curves[kind] = (course.time_s[window], error[window])
    title = "Tian, torque reversal from 2 A to -2 A at 2 s"
    save(curves_figure(title, curves, "time / s", "error, 5 ms mean / deg el."), folder / "tian-reversal.png")
    curves = {}
    for text, moved in (("HF current moved to the action", True), ("sampled currents", False)):
        course = yu_start(YU_BEST, DEAD_TIME_S, 0.0, moved)
        curves[text] = (course.time_s, running_mean(course.error(), round(5e-3 / course.ts_s)))
    title = "Yu, 0 to 50 r/min at 0.3 s, no load, dead time 2 us compensated by"
    save(curves_figure(title, curves, "time / s", "error, 5 ms mean / rad"), folder / "yu-start.png")


def main() -> None:
    """Print the rows of the chosen subjects; exit code 1 if a limit is missed."""
    parser = argparse.ArgumentParser(description="Injection: rows of the float model of the whole drive.")
    parser.add_argument("subjects", nargs="*", choices=[*SUBJECTS, []], metavar="SUBJECT", help=", ".join(SUBJECTS))
    parser.add_argument("--figures", type=Path, metavar="FOLDER", help="write the figures of the documentation instead")
    given = parser.parse_args()
    if given.figures:
        curves_of(given.figures)
        return
    missed = 0
    for name in given.subjects or SUBJECTS:
        for row in SUBJECTS[name]():
            print(row.text(), flush=True)
            missed += not row.passed
    if missed:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
