# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Settings of the drive in a scenario file."""

from __future__ import annotations

import math
from typing import Literal, Self

from pydantic import Field, model_validator

from fluxlock.config.fields import Model, PhaseValues, SectorValues, conflict, quantity, range_text, with_unit
from fluxlock.config.motor import OVERSPEED_RATIO
from fluxlock.config.vector import Vector
from fluxlock.interface.kinds import Commutation, HallMode, Method, Mode, Pattern

TICK_HZ = 10e3  # control tick of six-step operation
# Phase that dead time (two ticks from the mean of the measurement to the mean of the voltage) and filter of the current
# loop may cost at its bandwidth.
CURRENT_LOOP_LAG_RAD = 0.7
LOOP_FILTER_SHIFT = 2
CURRENT_LOOP_LAG_TICKS = 2 + (1 << LOOP_FILTER_SHIFT)
CURRENT_BANDWIDTH_MAX_HZ = CURRENT_LOOP_LAG_RAD * TICK_HZ / (2.0 * math.pi * CURRENT_LOOP_LAG_TICKS)

ZcdSampling = Literal["continuous", "carrier"]

# Limit of the whole advance (sw/control/advance.h).
ADVANCE_MAX_DEG = 30.0


class Zcd(Model, settings="zcd"):
    """Zero-crossing detection."""

    sampling: ZcdSampling = Field(
        default="continuous",
        description="Samples while running: `continuous` at the converter's period (oversampling), or one every "
        "`carrier`, at a fixed time into its pulse (conventional). Trips see no more samples than that.",
    )
    threshold: SectorValues = quantity(
        "Crossing threshold as a fraction of the DC-link voltage: one number, or six for sectors I to VI.",
        "",
        0.05,
        0.95,
        default=(0.5,) * 6,
    )
    settle_us: float | None = quantity(
        "Time from a change of any gate, and from a commutation, to the first sample that counts.",
        "us",
        0.0,
        1000,
        default=None,
        absent="6 time constants of the dividers, at least 0.4, and a sample. With `[sensing.edge]` until the edges "
        "are below 3 times the noise of a sample, at most 15 % of a carrier",
    )
    balance_bandwidth_hz: float | None = quantity(
        "Bandwidth of that loop.", "Hz", 0.1, 500, default=None, absent="1.5 times that of the speed loop"
    )
    miss_limit: int = quantity("Missed crossings in a row that mean a lost lock.", "", 1, 255, default=6)


class Hall(Model, settings="hall"):
    """Hall sensors, as the drive uses them."""

    mode: HallMode = Field(
        default="off",
        description="`sensored`: the edges commutate from standstill on; `fallback`: they take over when the crossings "
        "are lost, until these agree again. Both need `[hall]` of the motor file.",
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


class Start(Model, settings="start"):
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
    inertia: float = quantity("Factor of the inertia.", "", 0.5, 2.0, default=1.0)
    encoder_lines: float = quantity("Factor of the encoder's lines.", "", 0.5, 2.0, default=1.0)
    encoder_offset_deg: float = quantity(
        "Added to the mounting of the encoder's index, mechanical.", "deg", -360, 360, default=0.0
    )


class Drive(Model, settings=""):
    """Settings of the drive."""

    method: Method = Field(
        default="six-step",
        description="What drives the machine. With `vector` only the keys `carrier_hz`, `current_limit_a`, "
        "`accel_rpm_per_s`, `brake_current_limit_a`, `start.catch`, `start.retries`, `start.restart_retries`, "
        "`motor_error` and those of `[drive.vector]` may be given; all others belong to `six-step`.",
    )
    commutation: Commutation = Field(
        default="CSC",
        description="When a commutation reaches the gates. CSC: carriers of a firm drive or a light rotor may run on.",
    )
    pattern: Pattern = Field(default="ON-PWM", description="Which switch chops.")
    carrier_hz: float = quantity("Carrier frequency.", "Hz", 1e3, 200e3)
    sync_rect: bool | None = Field(
        default=None,
        description="The other switch of the chopping leg conducts while the pulse is off, and the drive may brake. "
        "Left out: the diodes conduct, except for currents below that of the shortest pulse that shows a crossing. "
        "`false`: always the diodes; a load below that current is driven too fast, and `limit` is `duty_min`.",
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
    freewheel_limit: bool = Field(
        default=True,
        description="The current stays below what hides the zero crossing: freewheeling must end before it, with "
        "`zcd.compute_back` before the next commutation.",
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
        math.floor(CURRENT_BANDWIDTH_MAX_HZ),
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
