# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The rated current has one meaning: the nominal point of a catalogue holds with both methods of driving."""

from __future__ import annotations

import math
from typing import Literal

import pytest

from fluxlock.config import Inverter, Load, Motor, Scenario
from fluxlock.config.checks import check_scenario
from fluxlock.config.drive import Drive
from fluxlock.config.scenario import Event, Initial
from fluxlock.cosim.parameters import parameter_block
from fluxlock.native.vector_run import play
from tests.firmware import machines
from tests.firmware.firmware_bench import INVERTER_1, Bench, fault_of

Method = Literal["six-step", "vector"]


def of_rms(rms_a: float, torque_nm: float, pole_pairs: int, **keys: object) -> Motor:
    """A servo motor: rated current as an rms value, torque constant per ampere rms."""
    psi_vs = torque_nm / (1.5 * pole_pairs * math.sqrt(2) * rms_a)
    rated_a = math.sqrt(2) * rms_a
    return machines.motor(name="servo", pole_pairs=pole_pairs, psi_vs=psi_vs, rated_current_a=rated_a, **keys)


def of_dc(dc_a: float, torque_nm: float, pole_pairs: int, **keys: object) -> Motor:
    """A motor for block commutation: rated DC current, torque constant per ampere of that."""
    psi_vs = torque_nm / (2 * pole_pairs * dc_a)
    keys |= {"emf": "trapezoidal", "pole_pairs": pole_pairs, "psi_vs": psi_vs}
    # 1.097 by the table of docs/reference/conventions.md: 2 / (3/2 · 1.2159), the fundamental of the trapezoid.
    fundamental = 4 * math.sin(math.pi / 6) / (math.pi * math.pi / 6)
    return machines.motor(name="fan", rated_current_a=2 / (1.5 * fundamental) * dc_a, **keys)


SERVO = of_rms(2.6, 1.27, 5, resistance_ohm=0.775, inductance_h=3.35e-3, inertia_kgm2=2.8e-5, max_speed_rpm=3600)
FAN = of_dc(4.0, 0.2, 4, resistance_ohm=0.15, inductance_h=0.2e-3, inertia_kgm2=2e-5, max_speed_rpm=6000)
MAINS: dict[str, object] = {
    "supply_v": 310,
    "voltage_full_scale_v": 450,
    "current_full_scale_a": 20,
    "on_resistance_ohm": 0,
}
MAINS |= {"phase_current_a": 15, "dc_current_a": 15}
LOW: dict[str, object] = {"supply_v": 48, "voltage_full_scale_v": 65}


def nominal(motor: Motor, inverter: Inverter, method: Method, rpm: float, torque_nm: float) -> Scenario:
    """A load at a speed, with the current limit that follows from the motor file."""
    drive = Drive(method=method, carrier_hz=20e3)
    load = Load(fan_torque_nm=torque_nm, fan_speed_rpm=rpm)
    events = [Event(at_s=0.01, speed_rpm=rpm), Event(at_s=0.02, command="start")]
    return Scenario(
        name="nominal", motor=motor, inverter=inverter, drive=drive, load=load, event=events, duration_s=1.0
    )


@pytest.mark.parametrize("method", ["six-step", "vector"])
@pytest.mark.parametrize(
    ("motor", "stage", "rpm", "torque_nm"), [(SERVO, MAINS, 3000.0, 1.27), (FAN, LOW, 4000.0, 0.2)], ids=["rms", "dc"]
)
def test_nominal_point_is_permitted(
    motor: Motor, stage: dict[str, object], rpm: float, torque_nm: float, method: Method
) -> None:
    """A catalogue's torque at its speed passes the check, 2 % more is beyond the limit; I²t has that torque's current.

    Verifies: FRONT-66
    """
    assert motor.rated_torque_nm == pytest.approx(torque_nm)
    inverter = machines.inverter(**stage)
    fits = nominal(motor, inverter, method, rpm, 0.999 * torque_nm)
    assert check_scenario(fits) == []
    more = check_scenario(nominal(motor, inverter, method, rpm, 1.02 * torque_nm))
    assert [p.key for p in more] == ["event[0].speed_rpm"] and "current_limit_a" in more[0].message
    phase_nm = 1.5 * motor.pole_pairs * motor.psi_vs[0] * motor.emf_fundamental
    needed_a = torque_nm / (motor.torque_per_amp_nm if method == "six-step" else phase_nm)
    rated_a = parameter_block(fits).number("rated_i_q17") / 2**17 * inverter.sensing.current_full_scale_a
    assert rated_a == pytest.approx(needed_a, rel=1e-3)


def test_nominal_torque_in_six_step_operation() -> None:
    """At rated torque for twenty times its time the I²t protection says nothing; a fifth more torque is an overload.

    Verifies: FRONT-66, FW-45
    """
    motor = machines.motor(overload_s=0.03)
    for share, state in ((0.98, "running"), (1.2, "fault")):
        load = Load(fan_torque_nm=share * motor.rated_torque_nm, fan_speed_rpm=30_000)
        bench = Bench(motor=motor, load=load, drive=machines.drive(current_limit_a=30.0))
        bench.start(30_000)
        bench.run(0.6)
        assert bench.fw.state == state
        assert fault_of(bench) == ("none" if state == "running" else "overload")


def test_nominal_torque_with_vector_control() -> None:
    """The same machine with vector control: the same torque for ever, a fifth more is an overload.

    Verifies: FRONT-66, FW-45
    """
    motor = machines.motor(overload_s=0.03)
    for share, fault in ((0.98, "none"), (1.2, "overload")):
        load = Load(fan_torque_nm=share * motor.rated_torque_nm, fan_speed_rpm=30_000)
        scenario = nominal(motor, INVERTER_1, "vector", 30_000, share * motor.rated_torque_nm).model_copy(
            update={
                "load": load,
                "initial": Initial(speed_rpm=30_000.0, theta_deg=100.0),
                "drive": Drive(method="vector", carrier_hz=40e3, current_limit_a=32.0),
                "duration_s": 0.5,
            }
        )
        data = play(scenario, 1)
        assert f"fault {fault}" in data.uart
