# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Scenario file: one closed-loop run with its drive settings, events, measuring windows and expectations.

`Scenario` is the root. It holds the checked motor and inverter, whose files it names. Each key is a field with unit,
range and description; the schema page of the docs is generated from these.

Units: SI, but r/min for mechanical speed and degrees for angles. A key ends with its unit: `duration_s`, `speed_rpm`.
Errors: `ConfigError` lists every problem with file, key, value and permitted range. Checks between keys are in the
validators here, those between files in `checks.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from fluxlock.config.can import Can
from fluxlock.config.console import line_problem, speed_of_line
from fluxlock.config.drive import Drive
from fluxlock.config.errors import SET_OPTION, Problem
from fluxlock.config.fields import (
    Model,
    ProfilePoint,
    conflict,
    quantity,
    with_unit,
)
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import RPM_PER_RAD_S, Load, Motor
from fluxlock.interface.kinds import DriveFault, TripCause

Channel = Literal["va", "vb", "vc", "ia", "ib", "ic", "vdc", "idc", "vsm"]

# Metrics of a measuring window, dotted. The analysis computes exactly these.
SEED_MAX = 2**31 - 1

METRICS = (
    "speed_rpm.mean",
    "speed_rpm.min",
    "speed_rpm.max",
    *(
        f"{error}.{kind}"
        for error in ("zcp_error_deg", "commutation_error_deg")
        for kind in ("mean", "std", "rms", "max")
    ),
    "sector_interval_deg.min",
    "sector_interval_deg.max",
    "commutation_interval_deg.min",
    "commutation_interval_deg.max",
    "phase_current_pp_a",
    "freewheel_deg.mean",
    "freewheel_deg.max",
    "demagnetisation_margin_deg",
    "pwm_phase_error_pp_deg",
    "torque_nm.mean",
    "torque_nm.ripple_pp",
    "late_crossings",
    *(f"angle_error_deg.{kind}" for kind in ("mean", "rms", "max")),
    "id_a",
    "iq_a",
)

# Those of them that only one method has, by the part before the dot.
METHOD_METRICS = {
    "six-step": (
        "zcp_error_deg",
        "commutation_error_deg",
        "sector_interval_deg",
        "commutation_interval_deg",
        "freewheel_deg",
        "demagnetisation_margin_deg",
        "pwm_phase_error_pp_deg",
        "late_crossings",
    ),
    "vector": ("angle_error_deg",),
}

# Zoom window that is chosen when the scenario names none: length in electrical turns, and its upper limit.
ZOOM_TURNS = 2.5
ZOOM_MAX_S = 0.02


class Initial(Model):
    """State of the rotor at time 0."""

    theta_deg: float = quantity("Electrical angle of the d axis against phase A.", "deg", -360, 360, default=0.0)
    speed_rpm: float = quantity(
        "Mechanical speed. With an imposed speed, where its profile begins: left out, or the same.",
        "r/min",
        -2e6,
        2e6,
        default=0.0,
    )


class Mechanics(Model):
    """How the rotor moves."""

    mode: Literal["free", "imposed", "locked"] = Field(
        default="free", description="Free: inertia and load; imposed: speed profile; locked: standstill."
    )
    profile: list[ProfilePoint] = Field(
        default_factory=list,
        description="Pairs `[time in s, speed in r/min]` of the imposed speed, linear between them.",
    )

    @model_validator(mode="after")
    def _profile(self) -> Self:
        if (self.mode == "imposed") != bool(self.profile):
            raise conflict("profile", 'must be given with mode = "imposed" and only there')
        times = [t for t, _ in self.profile]
        if any(b <= a for a, b in pairwise(times)):
            raise conflict("profile", "times must increase")
        if not all(0 <= t <= 3600 and abs(rpm) <= 2e6 for t, rpm in self.profile):
            raise conflict("profile", "is out of range, permitted times 0 to 3600 s, speeds -2e6 to 2e6 r/min")
        return self


HALL_GLITCH_S, DEAD_CORE_S = 1e-3, 5e-3
NOISY_LSB = 100.0


class Fault(Model):
    """A fault of the plant."""

    kind: Literal[
        "shorted_winding",
        "open_phase",
        "stuck_high",
        "stuck_low",
        "fault_pin",
        "stuck_channel",
        "noisy_channels",
        "stuck_rotor",
        "hall_glitch",
        "dead_core",
        "clear",
    ] = Field(
        description="`shorted_winding`: a part of the turns of `phases` is bridged (two phases: a short "
        "between terminals); `open_phase`: the legs of `phases` lose the machine, whose terminals float; "
        "`stuck_high`, `stuck_low`: the upper or lower switch of their legs conducts for ever, and where the other "
        "one is asked for the driver holds it off and reports a fault; `fault_pin`: the gate driver reports a "
        "fault; `stuck_channel`: a converter channel keeps one code; `noisy_channels`: all of them have more noise; "
        "`stuck_rotor`: the rotor stands at once; `hall_glitch`: Hall sensor A shows the wrong level for "
        f"{1e3 * HALL_GLITCH_S:g} ms; `dead_core`: the soft core hangs in its control interrupt for "
        f"{1e3 * DEAD_CORE_S:g} ms; `clear`: all faults end."
    )
    phases: list[Literal["A", "B", "C", "D", "E"]] | None = Field(
        default=None, min_length=1, max_length=5, description="Phases that have the fault."
    )
    turns_fraction: float | None = quantity(
        "Part of the turns that still acts.",
        "",
        0.001,
        1.0,
        default=None,
        absent="0.05 for a shorted winding",
    )
    channel: Channel | None = Field(default=None, description="Channel that is stuck.")
    noise_lsb: float | None = quantity(
        "Noise of the converter's codes, rms.",
        "LSB",
        0.0,
        2048,
        default=None,
        absent=f"{NOISY_LSB:g} for noisy channels",
    )
    code: int | None = quantity("Code of the stuck channel.", "", 0, 4095, default=None, absent="the code at that time")

    @model_validator(mode="after")
    def _belongs(self) -> Self:
        legs = ("open_phase", "stuck_high", "stuck_low")
        allowed = {"shorted_winding": {"phases", "turns_fraction"}, "stuck_channel": {"channel", "code"}}
        allowed["noisy_channels"] = {"noise_lsb"}
        allowed |= {kind: {"phases"} for kind in legs}
        for key in ("phases", "turns_fraction", "channel", "code", "noise_lsb"):
            if getattr(self, key) is not None and key not in allowed.get(self.kind, set()):
                raise conflict(key, f'does not belong to kind = "{self.kind}"')
        for kind, key in (*((k, "phases") for k in ("shorted_winding", *legs)), ("stuck_channel", "channel")):
            if self.kind == kind and getattr(self, key) is None:
                raise conflict(key, f'required key is missing for kind = "{kind}"')
        for phase in self.phases or ():
            if (self.phases or []).count(phase) > 1:
                raise conflict("phases", f"names {phase} twice; a short between terminals needs two phases")
        return self


# First moment at which the console takes a line.
BOOT_S = 1e-3

ACTIONS = ("command", "speed_rpm", "accel_rpm_per_s", "load_factor", "supply_v", "fault")


class Event(Model):
    """Something that happens at one instant: exactly one action."""

    at_s: float = quantity("Time of the event.", "s", 0.0, 3600)
    command: str | None = Field(default=None, min_length=1, description="Line sent to the drive's console as it is.")
    speed_rpm: float | None = quantity(
        'New speed target; backward by `command = "set speed_rpm -20000"`.',
        "r/min",
        1,
        2e6,
        default=None,
        below='backward: command = "set speed_rpm -20000", to stop: command = "stop"',
    )
    accel_rpm_per_s: float | None = quantity("New slope of the speed target.", "r/min/s", 1, 1e8, default=None)
    load_factor: float | None = quantity("New factor of the load torque.", "", 0.0, 100, default=None)
    supply_v: float | None = quantity("New supply voltage.", "V", 0.0, 1500, default=None)
    fault: Fault | None = Field(default=None, description="A fault of the plant.")
    ramp_s: float = quantity("Time in which `load_factor` or `supply_v` changes linearly.", "s", 0.0, 3600, default=0.0)

    @model_validator(mode="after")
    def _one_action(self) -> Self:
        given = [name for name in ACTIONS if getattr(self, name) is not None]
        if len(given) != 1:
            raise conflict("", f"needs exactly one action of {', '.join(ACTIONS)}, has {', '.join(given) or 'none'}")
        if self.ramp_s > 0 and given[0] not in ("load_factor", "supply_v"):
            raise conflict("ramp_s", f"has no meaning beside {given[0]}")
        if given[0] in ("command", "speed_rpm", "accel_rpm_per_s") and self.at_s < BOOT_S:
            text = f"{with_unit(self.at_s, 's')} is too early for {given[0]}: the drive boots until {BOOT_S:g} s"
            raise conflict("at_s", text)
        problem = None if self.command is None else line_problem(self.command)
        if problem is not None:
            raise conflict("command", problem)
        return self

    @property
    def action(self) -> str:
        """Name of the action's key."""
        return next(name for name in ACTIONS if getattr(self, name) is not None)

    @property
    def speed_target_rpm(self) -> float | None:
        """Speed target that the event sets, signed, by its key or by a console line; None if it sets none."""
        return self.speed_rpm if self.command is None else speed_of_line(self.command)


class Window(Model):
    """A measuring window: its metrics appear under its name in the result."""

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9_-]+$", description="Letters, digits, `_` and `-`.")
    from_s: float = quantity("Start.", "s", 0.0, 3600)
    to_s: float = quantity("End.", "s", 0.0, 3600)

    @model_validator(mode="after")
    def _order(self) -> Self:
        if self.to_s <= self.from_s:
            raise conflict("to_s", f"{self.to_s:g} s is not after from_s ({self.from_s:g} s)")
        return self


class Expect(Model):
    """A limit that the result must keep, else the run counts as failed."""

    window: str = Field(description="Name of a window.")
    metric: str = Field(description="Metric of that window, dotted, such as `commutation_error_deg.rms`.")
    min: float | None = Field(default=None, description="Least permitted value.")
    max: float | None = Field(default=None, description="Largest permitted value.")

    @model_validator(mode="after")
    def _limit(self) -> Self:
        if self.min is None and self.max is None:
            raise conflict("", "needs min or max")
        for key in ("min", "max"):
            if not math.isfinite(getattr(self, key) or 0.0):
                raise conflict(key, f"must be a finite number, not {getattr(self, key):g}")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise conflict("min", f"{self.min:g} is above max ({self.max:g})")
        return self


class Accept(Model):
    """Something for which a run would fail by itself, and why it may happen in this one."""

    what: Literal[
        "duty_min", "voltage", "current", "speed", "lost_angle", "lost_lock", "end_state", "rejected", "trip", "fault"
    ] = Field(
        description="`duty_min`, `voltage`, `current`: the speed is off its target while this limit of the drive is "
        "active; with the last two the check before a run lets targets pass that need more; `speed`: with any "
        "limit or none; `lost_angle`: the drive runs and its angle is not the rotor's; "
        "`lost_lock`: it noticed and started again; `end_state`: it ends otherwise than start and stop have told it; "
        "`rejected`: it refused a console line; `trip`, `fault`: a trip, a final fault that may come or not, where "
        "`expect_trip` and `expect_fault` say that it must."
    )
    window: str | None = Field(
        default=None, description="Name of a window, for the first four; left out: everywhere, also at the end."
    )
    why: str = Field(min_length=1, description="The reason; it stands in the verdict.")

    @model_validator(mode="after")
    def _window(self) -> Self:
        if self.window is not None and self.what not in ("duty_min", "voltage", "current", "speed"):
            raise conflict("window", f'does not belong to what = "{self.what}"')
        return self


class Record(Model):
    """What is recorded."""

    period_s: float = quantity("Period of the waveform records.", "s", 1e-6, 1e-3, default=10e-6)
    zoom_from_s: float | None = quantity(
        "Start of the span in which every event is recorded, with `--waves` every clock edge of the chip.",
        "s",
        0.0,
        3600,
        default=None,
        absent="the last turns of the first window",
    )
    zoom_to_s: float | None = quantity(
        "End of that span.", "s", 0.0, 3600, default=None, absent="with `zoom_from_s`: the same"
    )

    @model_validator(mode="after")
    def _pair(self) -> Self:
        if (self.zoom_from_s is None) != (self.zoom_to_s is None):
            raise conflict("zoom_to_s", "zoom_from_s and zoom_to_s go together")
        if self.zoom_from_s is not None and self.zoom_to_s is not None:
            if self.zoom_to_s <= self.zoom_from_s:
                raise conflict("zoom_to_s", f"{self.zoom_to_s:g} s is not after zoom_from_s ({self.zoom_from_s:g} s)")
            if self.zoom_to_s - self.zoom_from_s > 0.1:
                raise conflict("zoom_to_s", "the span is longer than 0.1 s")
        return self


@dataclass(frozen=True)
class Sources:
    """Files that a scenario was read from, as messages name them, and the keys that `--set` gave, split at the dots."""

    scenario: str
    motor: str
    inverter: str
    overrides: tuple[tuple[str, ...], ...] = ()

    def is_override(self, key: str) -> bool:
        """Whether the value of a dotted key, or a part of it, was given by `--set`."""
        parts = tuple(key.replace("[", ".").replace("]", "").split("."))
        return any(parts[: len(o)] == o[: len(parts)] for o in self.overrides if o not in (("motor",), ("inverter",)))

    def problem(self, key: str, message: str) -> Problem:
        """Problem of a key, dotted from the scenario, charged to where its value comes from."""
        part, _, below = key.partition(".")
        if self.is_override(key):
            return Problem(SET_OPTION, key, message)
        if part in ("motor", "inverter"):
            return Problem(self.motor if part == "motor" else self.inverter, below, message)
        return Problem(self.scenario, key, message)

    def charged(self, problem: Problem) -> Problem:
        """The problem of motor or inverter file, charged to `--set` if its value comes from there."""
        key = {self.motor: "motor.", self.inverter: "inverter."}.get(problem.file, "") + problem.key
        return Problem(SET_OPTION, key, problem.message) if self.is_override(key) else problem


class Scenario(Model):
    """One closed-loop run. The files of motor and inverter are read and checked with it.

    >>> from fluxlock import load_scenario
    >>> loaded = load_scenario("scenarios/own-spindle.toml")
    >>> loaded.motor.name, loaded.drive.commutation, loaded.duration_s  # s
    ('Spindle 48 V', 'CSC', 1.2)
    """

    name: str = Field(min_length=1, description="Name for tables and plots.")
    description: str = Field(default="", description="Free text.")
    motor: Motor = Field(description="Motor file, relative to this file.")
    inverter: Inverter = Field(description="Inverter file, relative to this file.")
    duration_s: float = quantity("Simulated time.", "s", 1e-4, 3600)
    seed: int = quantity("Seed of the noise; `--seed` overrides it.", "", 0, SEED_MAX, default=1)
    expect_trip: list[TripCause] = Field(
        default_factory=list, description="Trips that must happen, all others fail the run."
    )
    expect_fault: DriveFault | None = Field(
        default=None,
        description="Fault in which the drive must end; any other fails the run, unless an expected trip means it.",
    )
    drive: Drive = Field(description="Settings of the drive.")
    can: Can | None = Field(default=None, description="CAN bus; left out: the chip has no CAN controller.")
    load: Load | None = Field(default=None, description="Load; left out: the load of the motor file.")
    initial: Initial = Field(default_factory=Initial, description="State of the rotor at time 0.")
    mechanics: Mechanics = Field(default_factory=Mechanics, description="How the rotor moves.")
    record: Record = Field(default_factory=Record, description="What is recorded.")
    event: list[Event] = Field(default_factory=list, description="What happens, in any order.")
    window: list[Window] = Field(default_factory=list, description="Measuring windows.")
    expect: list[Expect] = Field(default_factory=list, description="Limits that the result must keep.")
    accept: list[Accept] = Field(default_factory=list, description="What may go wrong in this run, and why.")

    _sources: Sources = PrivateAttr(default=Sources("scenario", "motor", "inverter"))

    @property
    def sources(self) -> Sources:
        """Files it was read from."""
        return self._sources

    @property
    def shaft_load(self) -> Load:
        """Load that applies: the scenario's, else the motor's."""
        return self.load if self.load is not None else self.motor.load

    @property
    def rated_current_a(self) -> float:
        """Rated current as the method counts currents: DC through two phases, with vector control the amplitude."""
        return self.motor.rated_current_a if self.drive.method == "vector" else self.motor.rated_dc_current_a

    @property
    def current_limit_a(self) -> float:
        """Limit of the current that applies, as the method counts it."""
        return self.drive.current_limit_a if self.drive.current_limit_a is not None else self.rated_current_a

    @property
    def accel_rpm_per_s(self) -> float:
        """Slope of the speed target that applies at the start."""
        if self.drive.accel_rpm_per_s is not None:
            return self.drive.accel_rpm_per_s
        return 0.25 * self.motor.rated_torque_nm / self.motor.inertia_kgm2 * RPM_PER_RAD_S

    def events_in_order(self) -> list[Event]:
        """Events by time; those at the same time as in the file."""
        return sorted(self.event, key=lambda e: e.at_s)

    def speed_targets(self) -> list[tuple[float, float]]:
        """Times and speed targets of the events by time: `speed_rpm` and `command = "set speed_rpm ..."`."""
        return [(e.at_s, target) for e in self.events_in_order() if (target := e.speed_target_rpm) is not None]

    def speed_target_at(self, t_s: float) -> float:
        """Speed target set by the last event until `t_s` (without its slope)."""
        targets = [target for at_s, target in self.speed_targets() if at_s <= t_s]
        return targets[-1] if targets else self.initial.speed_rpm

    def start_s(self) -> float:
        """Time of the first start command; 0 without one."""
        return next((e.at_s for e in self.events_in_order() if (e.command or "").split()[:1] == ["start"]), 0.0)

    def largest_load_factor(self, from_s: float, to_s: float) -> float:
        """Of the load, in a span of time."""
        factors = [1.0]
        for e in self.events_in_order():
            if e.load_factor is None or e.at_s > to_s:
                continue
            factors = [e.load_factor] if e.at_s + e.ramp_s <= from_s else [*factors, e.load_factor]
        return max(factors)

    def zoom_window_s(self) -> tuple[float, float]:
        """Span in which every event is recorded: as stated, else the end of the first window or run."""
        if self.record.zoom_from_s is not None and self.record.zoom_to_s is not None:
            return self.record.zoom_from_s, self.record.zoom_to_s
        end_s = self.window[0].to_s if self.window else self.duration_s
        turns_hz = self.motor.electrical_hz(self.speed_target_at(end_s))
        length_s = min(ZOOM_TURNS / turns_hz if turns_hz > 0 else ZOOM_MAX_S, ZOOM_MAX_S)
        return max(0.0, end_s - length_s), end_s
