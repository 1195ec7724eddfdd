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
from fluxlock.config.errors import SET_OPTION, Problem
from fluxlock.config.fields import (
    Model,
    PhaseValues,
    ProfilePoint,
    SectorValues,
    conflict,
    quantity,
    range_text,
    with_unit,
)
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import RPM_PER_RAD_S, Load, Motor
from fluxlock.config.vector import Vector
from fluxlock.firmware.specs import (
    CURRENT_LOOP_LAG_RAD,
    CURRENT_LOOP_LAG_TICKS,
    OVERSPEED_RATIO,
    TICK_HZ,
    current_bandwidth_max_hz,
)
from fluxlock.interface.kinds import (
    Balance,
    Commutation,
    DriveFault,
    HallMode,
    Method,
    Mode,
    Pattern,
    TripCause,
    ZcdMethod,
    ZcdSource,
)

Channel = Literal["va", "vb", "vc", "ia", "ib", "ic", "vdc", "idc", "vsm"]

# Metrics of a measuring window, dotted. The analysis computes exactly these.
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
        "late_crossings",
    ),
    "vector": ("angle_error_deg",),
}

# Zoom window that is chosen when the scenario names none: length in electrical turns, and its upper limit.
ZOOM_TURNS = 2.5
ZOOM_MAX_S = 0.02
# Limit of the whole advance (sw/control/advance.h).
ADVANCE_MAX_DEG = 30.0


class Zcd(Model):
    """Zero-crossing detection."""

    method: ZcdMethod = Field(
        default="averaged",
        description="Time of a crossing: `first` sample after it; `interpolated` between the last sample before and "
        "the first after; `averaged` between the means of four samples before and four after, else of two and two. "
        "The chip falls back to `interpolated`, crossing by crossing, where samples are missing or unsuitable.",
    )
    source: ZcdSource = Field(
        default="terminal",
        description="Signal searched for crossings: `terminal` voltage of the open phase, or the virtual third "
        "harmonic, measured at the `star_point` of the sense resistors or as the `mean` of the three terminals.",
    )
    sampling: Literal["continuous", "carrier"] = Field(
        default="continuous",
        description="Samples while running: `continuous` at the converter's period (oversampling), or one every "
        "`carrier`, at a fixed time into its pulse (conventional). Trips see no more samples than that.",
    )
    compute_back: bool = Field(
        default=False,
        description="A crossing that the freewheeling diode overrides is computed back from the first valid sample.",
    )
    correction_a: bool = Field(
        default=False,
        description="Delay to the commutation from the last three crossing intervals (correction A): evens out "
        "unequal inductances, amplifies errors of the divider gains: not advised with unequal dividers.",
    )
    threshold: SectorValues = quantity(
        "Crossing threshold as a fraction of the DC-link voltage: one number, or six for sectors I to VI.",
        "",
        0.05,
        0.95,
        default=(0.5,) * 6,
    )
    balance: Balance = Field(
        default="none",
        description="Thresholds that adapt until the crossings are even (correction B): `vertical` for divider gains, "
        "`both` for unequal inductances too.",
    )
    balance_bandwidth_hz: float | None = quantity(
        "Bandwidth of that loop.", "Hz", 0.1, 500, default=None, absent="1.5 times that of the speed loop"
    )
    miss_limit: int = quantity("Missed crossings in a row that mean a lost lock.", "", 1, 255, default=6)


class Hall(Model):
    """Hall sensors, as the drive uses them."""

    mode: HallMode = Field(
        default="off",
        description="`sensored`: the edges commutate from standstill on; `fallback`: they take over when the crossings "
        "are lost, until these agree again. Both need `[hall]` of the motor file.",
    )
    learn: bool = Field(
        default=True,
        description="Learn where the edges sit, from their intervals and from the crossings.",
    )
    offset_deg: PhaseValues = quantity(
        "Misplacement that the drive begins with: how late the edges of a sensor come at positive speed, electrical. "
        "One number, or three for sensors A, B, C.",
        "deg",
        -29,
        29,
        default=(0.0, 0.0, 0.0),
    )
    filter_s: float = quantity(
        f"Time for which a code must be stable to count; below a sector at {OVERSPEED_RATIO:g} `max_speed_rpm`.",
        "s",
        0,
        1e-3,
        default=1e-6,
    )


class Start(Model):
    """Start-up and restart. What is left out follows from the motor file."""

    current_a: float | None = quantity(
        "DC current of alignment and open-loop ramp.", "A", 0.01, 2000, default=None, absent="from the motor"
    )
    carrier_hz: float | None = quantity(
        "Carrier frequency until the hand-over; not above `drive.carrier_hz`, at least six carriers a sector.",
        "Hz",
        1e3,
        200e3,
        default=None,
        absent="8 kHz",
    )
    catch: bool = Field(
        default=True, description="A rotor that spins is caught at its speed instead of waited for until it is slow."
    )
    retries: int = quantity("Attempts after a failed start-up.", "", 0, 20, default=3)
    restart_retries: int = quantity("Restarts after a lost lock.", "", 0, 20, default=3)


class MotorError(Model):
    """What the firmware is told of the machine, over what the machine is. The plant is not touched."""

    resistance: float = quantity("Factor of the resistance.", "", 0.5, 2.0, default=1.0)
    inductance: float = quantity("Factor of the inductance.", "", 0.5, 2.0, default=1.0)
    flux: float = quantity("Factor of the flux.", "", 0.5, 2.0, default=1.0)


class Drive(Model):
    """Settings of the drive."""

    method: Method = Field(
        default="six-step",
        description="What drives the machine. With `vector` only the keys `carrier_hz`, `current_limit_a`, "
        "`accel_rpm_per_s`, `brake_current_limit_a`, `start.catch`, `start.retries`, `start.restart_retries`, "
        "`motor_error` and those of `[drive.vector]` may be given; all others belong to `six-step`.",
    )
    commutation: Commutation = Field(default="CSC", description="When a commutation reaches the gates.")
    pattern: Pattern = Field(default="ON-PWM", description="Which switch chops.")
    carrier_hz: float = quantity("Carrier frequency.", "Hz", 1e3, 200e3)
    sync_rect: bool = Field(
        default=False, description="The other switch of the chopping leg conducts while the pulse is off."
    )
    duty_max: float = quantity("Largest duty.", "", 0.05, 1.0, default=1.0)
    current_limit_a: float | None = quantity(
        "Limit of the DC current through two phases; with `vector` of the amplitude of the phase currents.",
        "A",
        0.05,
        2000,
        default=None,
        absent="rated current",
    )
    brake_current_limit_a: float | None = quantity(
        "Limit of the current that brakes, with `sync_rect` or `vector`; it falls to 0 as the DC link nears its "
        "over-voltage trip.",
        "A",
        0.0,
        2000,
        default=None,
        absent="half of rated current",
    )
    accel_rpm_per_s: float | None = quantity(
        "Slope of the speed target.",
        "r/min/s",
        1,
        1e8,
        default=None,
        absent="a quarter of the acceleration at rated torque without load (`fluxlock motor info`)",
    )
    speed_bandwidth_hz: float | None = quantity(
        "Bandwidth of the speed loop.", "Hz", 0.1, 2000, default=None, absent="from the motor"
    )
    linearity: bool = Field(
        default=False,
        description="CSC: duty corrected for the pulse that a commutation cuts; no effect under RSC and NSC.",
    )
    current_loop: bool = Field(
        default=False,
        description="DC-current loop inside of the speed loop; `false`: the speed regulator sets the voltage.",
    )
    current_bandwidth_hz: float | None = quantity(
        "Bandwidth of the current loop; highest: a lag of "
        f"{CURRENT_LOOP_LAG_RAD:g} rad over {CURRENT_LOOP_LAG_TICKS} ticks of the control at "
        f"{TICK_HZ:.0f} Hz, {CURRENT_LOOP_LAG_RAD:g}/2π · {TICK_HZ:.0f}/{CURRENT_LOOP_LAG_TICKS}.",
        "Hz",
        1,
        math.floor(current_bandwidth_max_hz(TICK_HZ)),
        default=None,
        absent="100 Hz",
    )
    mode: Mode = Field(
        default="speed", description="What the target is. `torque`: a current, with `current_loop` only."
    )
    torque_mnm: float | None = quantity(
        "Target torque in torque mode; negative brakes (`sync_rect`).", "mN*m", -1e7, 1e7, default=None, absent="0"
    )
    advance_deg: float = quantity("Commutation advance, electrical; positive = earlier.", "deg", -30, 30, default=0.0)
    advance_deg_at_max_speed: float = quantity(
        "Further advance at the motor's `max_speed_rpm`, proportional to speed; the sum stays within 30 deg.",
        "deg",
        -30,
        30,
        default=0.0,
    )
    advance_deg_at_rated_current: float = quantity(
        "Further advance at rated current, proportional to current.", "deg", -30, 30, default=0.0
    )
    zcd: Zcd = Field(default_factory=Zcd, description="Zero-crossing detection.")
    hall: Hall = Field(default_factory=Hall, description="Hall sensors.")
    start: Start = Field(default_factory=Start, description="Start-up.")
    vector: Vector = Field(default_factory=Vector, description="Vector control.")
    motor_error: MotorError = Field(default_factory=MotorError, description="Wrong motor values in the firmware.")

    @model_validator(mode="after")
    def _mode(self) -> Self:
        if self.mode == "torque" and not self.current_loop:
            raise conflict("mode", 'mode = "torque" needs current_loop = true')
        if self.torque_mnm is not None and self.mode != "torque":
            raise conflict("torque_mnm", 'belongs to mode = "torque"')
        if (self.torque_mnm or 0.0) < 0 and not self.sync_rect:
            raise conflict("torque_mnm", f"{with_unit(self.torque_mnm or 0.0, 'mN*m')} brakes: needs sync_rect = true")
        for key in ("learn", "offset_deg", "filter_s") if self.hall.mode == "off" else ():
            if key in self.hall.model_fields_set and (key != "offset_deg" or any(self.hall.offset_deg)):
                raise conflict(f"hall.{key}", 'has no effect with hall.mode = "off": set hall.mode, or leave it out')
        return self

    @model_validator(mode="after")
    def _advance(self) -> Self:
        """No sum of the advances from standstill to highest speed and rated current may meet the drive's limit."""
        parts = (self.advance_deg_at_max_speed, self.advance_deg_at_rated_current)
        for total in (
            self.advance_deg + sum(max(x, 0.0) for x in parts),
            self.advance_deg + sum(min(x, 0.0) for x in parts),
        ):
            if abs(total) > ADVANCE_MAX_DEG:
                text = (
                    "with advance_deg_at_max_speed and advance_deg_at_rated_current comes to "
                    f"{with_unit(total, 'deg')}, permitted {range_text(-ADVANCE_MAX_DEG, ADVANCE_MAX_DEG, 'deg')}"
                )
                raise conflict("advance_deg", text)
        return self


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


class Fault(Model):
    """A fault of the plant."""

    kind: Literal["shorted_winding", "open_phase", "stuck_high", "stuck_low", "fault_pin", "stuck_channel", "clear"] = (
        Field(
            description="`shorted_winding`: a part of the turns of `phases` is bridged (two phases: a short "
            "between terminals); `open_phase`: the legs of `phases` lose the machine, whose terminals float; "
            "`stuck_high`, `stuck_low`: the upper or lower switch of their legs conducts for ever, and where the other "
            "one is asked for the driver holds it off and reports a fault; `fault_pin`: the gate driver reports a "
            "fault; `stuck_channel`: a converter channel keeps one code; `clear`: all faults end."
        )
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
    code: int | None = quantity("Code of the stuck channel.", "", 0, 4095, default=None, absent="the code at that time")

    @model_validator(mode="after")
    def _belongs(self) -> Self:
        legs = ("open_phase", "stuck_high", "stuck_low")
        allowed = {"shorted_winding": {"phases", "turns_fraction"}, "stuck_channel": {"channel", "code"}}
        allowed |= {kind: {"phases"} for kind in legs}
        for key in ("phases", "turns_fraction", "channel", "code"):
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
        "active; `speed`: with any limit or none; `lost_angle`: the drive runs and its angle is not the rotor's; "
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
    """One closed-loop run. The files of motor and inverter are read and checked with it."""

    name: str = Field(min_length=1, description="Name for tables and plots.")
    description: str = Field(default="", description="Free text.")
    motor: Motor = Field(description="Motor file, relative to this file.")
    inverter: Inverter = Field(description="Inverter file, relative to this file.")
    duration_s: float = quantity("Simulated time.", "s", 1e-4, 3600)
    seed: int = quantity("Seed of the noise; `--seed` overrides it.", "", 0, 2**31 - 1, default=1)
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
    def current_limit_a(self) -> float:
        """DC-current limit that applies."""
        return self.drive.current_limit_a if self.drive.current_limit_a is not None else self.motor.rated_current_a

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

    def zoom_window_s(self) -> tuple[float, float]:
        """Span in which every event is recorded: as stated, else the end of the first window or run."""
        if self.record.zoom_from_s is not None and self.record.zoom_to_s is not None:
            return self.record.zoom_from_s, self.record.zoom_to_s
        end_s = self.window[0].to_s if self.window else self.duration_s
        turns_hz = self.motor.electrical_hz(self.speed_target_at(end_s))
        length_s = min(ZOOM_TURNS / turns_hz if turns_hz > 0 else ZOOM_MAX_S, ZOOM_MAX_S)
        return max(0.0, end_s - length_s), end_s
