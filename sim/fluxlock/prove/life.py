# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""One life of a machine, made from its motor and inverter file: an ordinary scenario.

From rest to half of the highest speed, light; the load comes in a step and goes; the supply sags and comes back under
load; the highest speed, light and loaded; the lowest speed; and half of the highest speed backwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fluxlock.config.drive import Drive, MotorError
from fluxlock.config.inverter import Inverter
from fluxlock.config.least_speed import least_six_step_rpm, least_vector_rpm
from fluxlock.config.motor import RPM_PER_RAD_S, Load, Motor
from fluxlock.config.scenario import Event, Expect, Initial, Scenario, Window
from fluxlock.interface.kinds import Method

LOW_SHARE, MIDDLE_SHARE = 0.1, 0.5  # of the highest speed
LEAST_MARGIN = 1.5  # over the least speed by rule
LIGHT = 0.1  # load over the full one
FULL_SHARE = 0.8  # rated torque at the highest speed that a file without load is given, as a fan
SAG_SHARE, SAG_S = 0.85, 0.1  # of the supply's voltage
RAMP_SHARE = 0.3  # of the acceleration at rated torque
SPEED_TOLERANCE = 0.01  # set before any result was seen: that of every verdict
START_S, SETTLE_S, HOLD_S = 1.5, 0.35, 0.1  # a start has time for a second try
SETTLE_TURNS, HOLD_TURNS = 12.0, 6.0  # electrical, at the speed that is held
CARRIER_HZ = (20e3, 45e3)
CARRIERS_A_TURN = {"six-step": 36.0, "vector": 20.0}  # electrical; six-step cuts a pulse at each commutation


@dataclass(frozen=True)
class Machine:
    """Motor, inverter and how they are driven.

    high: share of the highest speed that is held with load. least_rpm: below it the drive raises a target.
    """

    motor: Motor
    inverter: Inverter
    method: Method
    carrier_hz: float
    high: float = 1.0
    least_rpm: float = 0.0

    @property
    def load(self) -> Load:
        """Of the file, else a fan with `FULL_SHARE` of the rated torque at the highest speed."""
        if self.motor.load.torque_nm(self.motor.max_speed_rpm) > 0.0:
            return self.motor.load
        torque_nm = float(f"{FULL_SHARE * self.motor.rated_torque_nm:.4g}")
        return Load(fan_torque_nm=torque_nm, fan_speed_rpm=self.motor.max_speed_rpm)

    @property
    def low_rpm(self) -> float:
        """Lowest speed that is held: a tenth of the highest, or above the least one by rule."""
        vector = self.method == "vector"
        least = least_vector_rpm(self.motor, self.inverter) if vector else least_six_step_rpm(self.motor)
        return max(LOW_SHARE * self.motor.max_speed_rpm, LEAST_MARGIN * max(least, self.least_rpm))


def fitting_carrier_hz(motor: Motor, supply_v: float, method: Method) -> float:
    """Carrier with enough periods a turn at the highest speed, and a ripple below the rated current where it can be."""
    quiet_hz = supply_v / (8 * min(motor.inductance_h) * motor.rated_current_a)
    turns_hz = CARRIERS_A_TURN[method] * motor.electrical_hz(motor.max_speed_rpm)
    return float(1000 * math.ceil(max(turns_hz, min(max(quiet_hz, CARRIER_HZ[0]), CARRIER_HZ[1])) / 1000))


@dataclass
class _Clock:
    """Events and windows as time goes on."""

    accel: float
    pole_pairs: int
    now_s: float = 0.02
    rpm: float = 0.0
    events: list[Event] = field(default_factory=list)
    windows: list[Window] = field(default_factory=list)
    expect: list[Expect] = field(default_factory=list)

    def _turn_s(self) -> float:
        return 60.0 / (abs(self.rpm) * self.pole_pairs)

    def settle(self) -> None:
        self.now_s += max(SETTLE_S, SETTLE_TURNS * self._turn_s())

    def speed(self, rpm: float, more_s: float = 0.0) -> None:
        """Change the target and wait until the ramp must have ended."""
        at_s, rpm = round(self.now_s, 4), math.floor(abs(rpm)) * math.copysign(1.0, rpm)
        given: dict[str, object] = {"speed_rpm": rpm} if rpm > 0 else {"command": f"set speed_rpm {rpm:.0f}"}
        self.events.append(Event.model_validate({"at_s": at_s, **given}))
        self.now_s += abs(rpm - self.rpm) / self.accel * 1.3 + more_s
        self.rpm = rpm
        self.settle()

    def change(self, **what: float) -> None:
        """Change load or supply."""
        self.events.append(Event.model_validate({"at_s": round(self.now_s, 4), **what}))
        self.settle()

    def hold(self, name: str) -> None:
        """Watch; the mean speed must be the target."""
        end_s = self.now_s + max(HOLD_S, HOLD_TURNS * self._turn_s())
        self.windows.append(Window(name=name, from_s=round(self.now_s, 4), to_s=round(end_s, 4)))
        low, high = sorted(((1 - SPEED_TOLERANCE) * self.rpm, (1 + SPEED_TOLERANCE) * self.rpm))
        self.expect.append(Expect(window=name, metric="speed_rpm.mean", min=round(low, 3), max=round(high, 3)))
        self.now_s = end_s


def life(m: Machine, error: MotorError, theta_deg: float = 0.0, *, whole: bool = True, load: float = LIGHT) -> Scenario:
    """The life of a machine of which the drive is told other values.

    error: file over machine. theta_deg: where the rotor rests, electrical. whole: else the start alone. load: over the
    full one, at the start. Raises ConfigError for what the file checks refuse.
    """
    motor = m.motor
    accel = float(f"{RAMP_SHARE * motor.rated_torque_nm / motor.inertia_kgm2 * RPM_PER_RAD_S:.4g}")
    clock = _Clock(accel, motor.pole_pairs)
    middle = max(MIDDLE_SHARE * motor.max_speed_rpm, m.low_rpm)
    clock.events += [Event(at_s=0.0, load_factor=load), Event(at_s=0.02, command="start")]
    clock.now_s = 0.01
    clock.speed(middle, START_S)
    clock.hold("start" if not whole else "middle")
    if whole:
        clock.change(load_factor=1.0)
        clock.hold("load")
        clock.change(supply_v=round(SAG_SHARE * m.inverter.supply_v, 3))
        clock.hold("sag")
        clock.change(supply_v=m.inverter.supply_v)
        clock.change(load_factor=LIGHT)
        clock.speed(m.high * motor.max_speed_rpm)
        clock.hold("high")
        clock.change(load_factor=1.0)
        clock.hold("high-load")
        clock.change(load_factor=LIGHT)
        clock.speed(m.low_rpm)
        clock.hold("low")
        clock.speed(-middle, START_S)
        clock.hold("reverse")
    keys: dict[str, object] = {"method": m.method, "carrier_hz": m.carrier_hz, "accel_rpm_per_s": accel}
    if m.method == "six-step":
        keys["sync_rect"] = True  # without it nothing brakes a light machine
    drive = Drive.model_validate({**keys, "motor_error": error})
    return Scenario(
        name="prove",
        motor=motor,
        inverter=m.inverter,
        duration_s=round(clock.now_s + 0.005, 4),
        seed=1,
        drive=drive,
        load=m.load,
        initial=Initial(theta_deg=theta_deg),
        event=sorted(clock.events, key=lambda event: event.at_s),
        window=clock.windows,
        expect=clock.expect,
    )
