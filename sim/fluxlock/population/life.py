# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What happens to a machine of the population: an ordinary scenario that begins with the rotor turning.

The drive catches the rotor at 60 % of the base speed, where its EMF is plain, and so knows the angle. It comes down,
holds the lowest speed light, loaded and light again, then 60 % and 100 % loaded. It comes down to 60 % on a ramp, goes
up to 100 % light, and brakes from there to the lowest speed without a ramp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from fluxlock.config.drive import Drive, MotorError, Zcd
from fluxlock.config.least_speed import least_six_step_rpm, least_vector_rpm
from fluxlock.config.motor import RPM_PER_RAD_S, Motor
from fluxlock.config.scenario import Event, Expect, Initial, Scenario, Window
from fluxlock.config.vector_loops import loops_of
from fluxlock.cosim import parameters
from fluxlock.firmware.design import Design
from fluxlock.population.draw import Draw, Method, Parts, parts

LOWEST_SHARE, LEAST_MARGIN, REFUSED_SHARE = 0.2, 1.5, 0.5
MIDDLE_SHARE = 0.6
RAMP_SHARE = 0.3  # of the acceleration at rated torque
HARD = 20.0  # times that ramp
BRAKE_SHARE = 0.5  # torque of the hard deceleration at least, over the rated one
CATCH_S, CATCH_TURNS = 0.1, 12.0
LOAD_RAMP_S = 0.1
SETTLE_S, SETTLE_TURNS, SETTLE_CONSTANTS = 0.25, 10.0, 25.0  # at least each; time constants: of the speed loop
HOLD_S, HOLD_TURNS = 0.05, 6.0
SPEED_TOLERANCE = 0.005


@dataclass(frozen=True)
class Hold:
    """A time in which a speed is held."""

    name: str
    rpm: float
    from_s: float
    to_s: float


@dataclass(frozen=True)
class Change:
    """A change of the target, and the time until which nothing else happens."""

    from_rpm: float
    to_rpm: float
    from_s: float
    to_s: float


@dataclass(frozen=True)
class Life:
    """A drawn machine with what happens to it. caught_s: from then on the drive must run."""

    draw: Draw
    method: Method
    scenario: Scenario
    holds: tuple[Hold, ...]
    changes: tuple[Change, ...]
    caught_s: float
    lowest_rpm: float


def told_motor(motor: Motor, error: MotorError) -> Motor:
    """The machine as its file describes it: equal phases, wrong values."""

    def equal(values: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
        return (sum(values) / 3 * factor,) * 3

    return motor.model_copy(
        update={
            "resistance_ohm": equal(motor.resistance_ohm, error.resistance),
            "inductance_h": equal(motor.inductance_h, error.inductance),
            "inductance_q_h": motor.inductance_q_h and motor.inductance_q_h * error.inductance,
            "psi_vs": equal(motor.psi_vs, error.flux),
            "inertia_kgm2": motor.inertia_kgm2 * error.inertia,
        }
    )


def told_scenario(s: Scenario) -> Scenario:
    """The scenario as a user has it, who knows the motor file alone."""
    motor, drive = told_motor(s.motor, s.drive.motor_error), s.drive.model_copy(update={"motor_error": MotorError()})
    return s.model_copy(update={"motor": motor, "drive": drive})


def lowest_rpm(p: Parts, error: MotorError, method: Method) -> float:
    """Lowest speed that a life holds."""
    motor = told_motor(p.motor, error)
    least = least_vector_rpm(motor, p.inverter) if method == "vector" else least_six_step_rpm(motor)
    return max(LOWEST_SHARE * p.base_rpm, LEAST_MARGIN * least)


@dataclass
class _Clock:
    """Events, holds and changes as time goes on. turn_s: electrical, at the lowest speed."""

    accel: float
    settle_s: float
    turn_s: float
    rpm: float
    now_s: float
    events: list[Event] = field(default_factory=list)
    holds: list[Hold] = field(default_factory=list)
    changes: list[Change] = field(default_factory=list)

    def settle(self) -> None:
        """Give the loops their time."""
        self.now_s = _ms(self.now_s + self.settle_s)

    def load(self, factor: float) -> None:
        """Change the load on a ramp and let it settle."""
        self.events.append(Event(at_s=_ms(self.now_s), load_factor=factor, ramp_s=LOAD_RAMP_S))
        self.now_s += LOAD_RAMP_S
        self.settle()

    def speed(self, rpm: float, length_s: float) -> None:
        """Change the target; after this time the rotor must be there, and settles."""
        begin_s, before_rpm = _ms(self.now_s), self.rpm
        self.events.append(Event(at_s=begin_s, speed_rpm=rpm))
        self.rpm, self.now_s = rpm, self.now_s + length_s
        self.settle()
        if rpm != before_rpm:
            self.changes.append(Change(before_rpm, rpm, begin_s, self.now_s))

    def ramp(self, rpm: float) -> None:
        """Change the target on the drive's ramp."""
        self.speed(rpm, abs(rpm - self.rpm) / self.accel)

    def hold(self, name: str) -> None:
        """Watch."""
        end_s = _ms(self.now_s + max(HOLD_S, HOLD_TURNS * self.turn_s))
        self.holds.append(Hold(name, self.rpm, self.now_s, end_s))
        self.now_s = end_s


def _ms(time_s: float) -> float:
    """To a whole millisecond."""
    return round(time_s, 3)


def _mrpm(rpm: float) -> float:
    """To a thousandth."""
    return round(rpm, 3)


def slope_rpm_per_s(motor: Motor) -> float:
    """Slope of the target, r/min/s."""
    return float(f"{RAMP_SHARE * motor.rated_torque_nm / motor.inertia_kgm2 * RPM_PER_RAD_S:.4g}")


def _loop_rad_s(s: Scenario) -> float:
    """Bandwidth of the speed loop that the drive is to have."""
    return 2 * math.pi * loops_of(s).speed_hz if s.drive.method == "vector" else Design(s).bandwidth


def _timeline(p: Parts, lowest: float, caught_s: float, loop_rad_s: float) -> _Clock:
    motor = p.motor
    per_s = motor.rated_torque_nm / motor.inertia_kgm2 * RPM_PER_RAD_S
    low, middle, high = (math.floor(rpm) for rpm in (lowest, max(lowest, MIDDLE_SHARE * p.base_rpm), p.base_rpm))
    turn_s = 60.0 / (low * motor.pole_pairs)
    settle_s = max(SETTLE_S, SETTLE_TURNS * turn_s, SETTLE_CONSTANTS / loop_rad_s)
    clock = _Clock(slope_rpm_per_s(motor), settle_s, turn_s, middle, caught_s)
    clock.events += [
        Event(at_s=0.0, load_factor=0.0),
        Event(at_s=0.002, speed_rpm=middle),
        Event(at_s=0.003, command="start"),
    ]
    clock.ramp(low)
    for name, factor in (("low-light", 1.0), ("low-loaded", p.full_factor), ("low-unloaded", 1.0)):
        clock.load(factor)
        clock.hold(name)
    clock.ramp(middle)
    clock.load(p.full_factor)
    clock.hold("middle")
    clock.ramp(high)
    clock.hold("high")
    clock.ramp(middle)
    clock.hold("down")
    clock.load(1.0)
    clock.ramp(high)
    clock.hold("high-light")
    clock.events.append(Event(at_s=_ms(clock.now_s), accel_rpm_per_s=min(1e8, HARD * clock.accel)))
    clock.now_s += 0.001
    clock.speed(low, (high - low) / (BRAKE_SHARE * per_s))
    clock.hold("braked")
    return clock


def _drive(d: Draw, p: Parts, method: Method) -> Drive:
    keys: dict[str, Any] = {
        "method": method,
        "carrier_hz": p.carrier_hz,
        "current_limit_a": p.current_limit_a,
        "accel_rpm_per_s": slope_rpm_per_s(p.motor),
        "motor_error": d.error,
    }
    if method == "six-step":
        keys |= {"sync_rect": True, "linearity": True}
        keys["zcd"] = Zcd.model_validate({"balance": "both"})  # phases are unequal
    return Drive(**keys)


def life_of(draw: Draw, method: Method) -> Life:
    """The life of a machine with a method."""
    p = parts(draw, method)
    lowest = min(lowest_rpm(p, draw.error, method), p.base_rpm)
    caught_s = _ms(CATCH_S + CATCH_TURNS * 60.0 / (max(lowest, MIDDLE_SHARE * p.base_rpm) * p.motor.pole_pairs))
    bare = Scenario(
        name=f"population-{method}-{draw.name}",
        description=f"Machine {draw.index} of the population with seed {draw.seed}",
        motor=p.motor,
        inverter=p.inverter,
        duration_s=1.0,
        seed=draw.index,
        drive=_drive(draw, p, method),
        load=p.load,
    )
    clock = _timeline(p, lowest, caught_s, _loop_rad_s(bare))
    windows = [Window(name=hold.name, from_s=hold.from_s, to_s=hold.to_s) for hold in clock.holds]
    expect = [
        Expect(
            window=hold.name,
            metric="speed_rpm.mean",
            min=_mrpm((1 - SPEED_TOLERANCE) * hold.rpm),
            max=_mrpm((1 + SPEED_TOLERANCE) * hold.rpm),
        )
        for hold in clock.holds
    ]
    scenario = Scenario(
        name=bare.name,
        description=bare.description,
        motor=bare.motor,
        inverter=bare.inverter,
        duration_s=_ms(clock.now_s + 0.005),
        seed=bare.seed,
        drive=bare.drive,
        load=bare.load,
        initial=Initial(theta_deg=draw.theta_deg, speed_rpm=clock.events[1].speed_rpm or 0.0),
        event=clock.events,
        window=windows,
        expect=expect,
    )
    return Life(draw, method, scenario, tuple(clock.holds), tuple(clock.changes), caught_s, lowest)


def _too_fast(life: Life) -> str:
    """What the rule of the least speed says of a machine that would have to turn faster than half its base speed."""
    motor = told_scenario(life.scenario).motor
    most_rpm = REFUSED_SHARE * motor.max_speed_rpm / LEAST_MARGIN
    least_rpm = life.lowest_rpm / LEAST_MARGIN
    factor = least_rpm / most_rpm
    cure = (
        f"an encoder, resistance_ohm up to {sum(motor.resistance_ohm) / 3 / factor:.3g} Ohm or rated_current_a up to "
        f"{motor.rated_current_a / factor:.3g} A"
        if life.method == "vector"
        else f'drive.hall.mode = "sensored" or inertia_kgm2 from {motor.inertia_kgm2 * factor:.3g} kg*m^2'
    )
    share = 100 * least_rpm / motor.max_speed_rpm
    return f"least speed: {least_rpm:.0f} r/min, {share:.0f} % of max_speed_rpm; it runs with {cure}"


def refusals(life: Life) -> list[str]:
    """Why the life is refused before the start, as the file checks name it; empty if it is not."""
    if life.lowest_rpm > REFUSED_SHARE * life.scenario.motor.max_speed_rpm:
        return [_too_fast(life)]
    return parameters.refusals(told_scenario(life.scenario))
