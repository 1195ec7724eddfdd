# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Six-step control on the whole chip with its motor, led by `fluxlock.drive` alone."""

from __future__ import annotations

import math

import numpy as np
from cocotb.simtime import get_sim_time
from cocotb.triggers import FallingEdge, RisingEdge, ValueChange

from fluxlock.base.paths import ROOT
from fluxlock.drive import Drive, DriveError, drive_test, run_tests
from fluxlock.results.rundata import SimulationFault

SCENARIO = ROOT / "scenarios" / "campaign" / "six-step.toml"
RPM = 56_000
CARRIER_CLOCKS = 1250  # 40 kHz at 50 MHz
CLOCK_NS = 20


async def at_speed(drive: Drive) -> None:
    """The common start: a rotor that spins is caught."""
    await drive.start(RPM)
    await drive.run(0.01)


@drive_test(after=at_speed)
async def catches_a_rotor_that_spins(drive: Drive) -> None:
    """The true speed is the target, the firmware's within a percent of it, commutations are where they should be.

    Verifies: DRV-01
    """
    found = drive.window(drive.time_s - 0.01)
    print(drive, found, drive.angle_error_deg)
    assert abs(found["speed_rpm"]["mean"] - RPM) < 0.01 * RPM
    assert abs(float(await drive.get("speed_rpm")) - drive.speed_rpm) < 0.01 * RPM
    assert await drive.get("state") == drive.state == "running"
    assert drive.fault_name == "none"
    assert abs(drive.angle_error_deg) < 1.0
    turned = drive.angle_deg
    await drive.run(1e-3)
    expected = drive.speed_rpm / 60 * 360 * drive.pole_pairs * 1e-3
    assert abs((drive.angle_deg - turned - expected + 180) % 360 - 180) < 5


@drive_test(after=at_speed)
async def carries_a_load_step(drive: Drive) -> None:
    """The motor's torque rises by the load's step, and the speed comes back.

    Verifies: DRV-01
    """
    begin = drive.time_s
    drive.load(constant_nm=0.01)
    await drive.run(0.06)
    before, after = drive.window(begin - 0.01, begin), drive.window(drive.time_s - 0.01)
    print(before, after)
    assert abs(after["torque_nm"]["mean"] - before["torque_nm"]["mean"] - 0.01) < 0.0005
    assert abs(after["speed_rpm"]["mean"] - RPM) < 0.01 * RPM
    assert abs(drive.angle_error_deg) < 1.0


@drive_test(after=at_speed)
async def finds_an_open_phase(drive: Drive) -> None:
    """The phase carries no current from then on; the drive ends in a fault, with every gate pin low.

    Verifies: DRV-01
    """
    drive.fault("open_phase", phases="B")
    await drive.run(1e-4)
    assert drive.currents_a[1] == 0.0
    await drive.until(lambda: drive.fault_name != "none", 0.2)
    print(drive)
    assert drive.gates_off
    assert drive.dut.gate_h_o.value == 0 and drive.dut.gate_l_o.value == 0
    assert drive.fault_name in ("phase_over_current", "lost_lock"), "what two phases do"


@drive_test(after=at_speed)
async def coasts_with_open_gates(drive: Drive) -> None:
    """After `stop now` no gate moves, and load and friction alone slow the rotor down.

    Verifies: DRV-01
    """
    await drive.stop(now=True)
    await drive.until(lambda: drive.gates_off, 0.01)
    await drive.run(1e-3)  # currents are over
    speed, time_s, gates = drive.speed_rpm * math.pi / 30, drive.time_s, drive.gate_changes
    await drive.run(0.02)
    fan = drive.scenario.shaft_load.fan_nm_s2_per_rad2 / drive.scenario.motor.inertia_kgm2
    expected = speed / (1 + fan * speed * (drive.time_s - time_s))
    print(drive, "expected", expected * 30 / math.pi)
    assert abs(drive.speed_rpm * math.pi / 30 - expected) < 0.002 * expected
    assert drive.gate_changes == gates > 100
    assert drive.state == "ready"


@drive_test(after=at_speed)
async def carries_a_load_written_in_python(drive: Drive) -> None:
    """A function of the shaft brakes as the same load of the plant does, until it is taken away or breaks.

    Verifies: DRV-09
    """

    def load_nm(speed_rad_s: float, angle_rad: float, time_s: float) -> float:
        assert angle_rad > speed_rad_s * 1e-3 and time_s > begin_s, "unwrapped, since power-up"
        return 1e-6 * speed_rad_s + 0.002

    begin_s, begin_rpm = drive.time_s, drive.speed_rpm
    ends = drive.branch(["plant", "python", "taken away", "breaks"])
    for end in ends:
        await drive.stop(now=True)
        if end.value == "plant":
            drive.load(constant_nm=0.002, viscous_nm_s_per_rad=1e-6)
        else:
            drive.load_nm(load_nm if end.value != "breaks" else lambda w, _angle, _time: 1 / (w - w))
        if end.value == "taken away":
            drive.load_nm(None)
        try:
            await drive.run(0.003)
            end.keep(drive.speed_rpm)
        except SimulationFault as error:
            end.keep(str(error))
    plant, python, coasts, said = ends.kept
    print(begin_rpm, ends.kept)
    assert plant < coasts - 50 and abs(python - plant) < 1e-4 * (begin_rpm - plant) + 0.01
    assert said.startswith("load_nm raised ZeroDivisionError")


@drive_test(after=at_speed)
async def shows_the_pins_of_its_converters(drive: Drive) -> None:
    """The codes at the pins are those of the true supply and currents; an error of the sensing appears in them.

    Verifies: DRV-01
    """
    phases, sensing, wrong = drive.plant.phases, drive.scenario.inverter.sensing, 100
    noise = 6 * sensing.noise_lsb + 1

    async def codes() -> list[int]:
        await RisingEdge(drive.dut.adc_valid_i)
        word = int(drive.dut.adc_code_i.value)
        return [word >> sensing.bits * n & (1 << sensing.bits) - 1 for n in range(2 * phases + 3)]

    found = await codes()
    currents = [code - (1 << sensing.bits - 1) for code in found[phases : 2 * phases]]
    print(found, currents, drive.currents_a)
    assert abs(found[2 * phases] * sensing.step_v - drive.link_v) < noise * sensing.step_v
    assert abs(sum(currents)) < phases * noise < max(map(abs, currents))
    drive.disturb("ia", offset_lsb=wrong)
    await codes()
    disturbed = await codes()
    assert abs(sum(disturbed[phases : 2 * phases]) - phases * (1 << sensing.bits - 1) - wrong) < phases * noise


@drive_test(after=at_speed)
async def reads_registers_by_name(drive: Drive) -> None:
    """Carrier period and duty stand in their registers; a name that is none says which there are.

    Verifies: DRV-01, DRV-07
    """
    assert drive.registers["pwm.period.cycles"] == CARRIER_CLOCKS
    assert drive.registers["safety.guard.enable"] == 1
    duty = drive.registers["pwm.duty.cycles_q8"] / 256 / CARRIER_CLOCKS
    emf_ratio = RPM / float(drive.scenario.motor.max_speed_rpm)
    print("duty", duty, "speed over highest", emf_ratio, len(drive.registers))
    assert 0.5 * emf_ratio < duty < 1.0
    try:
        drive.registers["pwm.periods"]
    except KeyError as error:
        assert "pwm.period.cycles" in str(error)
    else:
        raise AssertionError("a register that is none")


@drive_test(after=at_speed)
async def answers_the_console(drive: Drive) -> None:
    """Lines are answered; a refusal of the drive raises with its text.

    Verifies: DRV-01, DRV-07
    """
    assert "state running" in await drive.console("status")
    await drive.set("speed_rpm", 57_000)
    assert await drive.get("speed_rpm") != 0
    for line, said in (("start", "not ready"), ("fly", "unknown command"), ("set wings 2", "")):
        try:
            await drive.console(line)
        except DriveError as error:
            assert said in str(error)
        else:
            raise AssertionError(line)
    await drive.at_speed(57_000)


@drive_test(after=at_speed)
async def trips_by_over_current(drive: Drive) -> None:
    """Windings that are shorted against each other trip the drive: gates off, the name, and no current is left.

    Verifies: DRV-01
    """
    drive.fault("shorted_winding", phases="AB")
    await drive.until(lambda: drive.fault_name != "none", 0.1, every_s=1e-4)
    print(drive, drive.currents_a)
    assert drive.gates_off
    assert "over_current" in drive.fault_name
    drive.fault("clear")
    await drive.run(0.3e-3)
    assert np.abs(drive.currents_a).max() < 0.5, "open gates: the currents have decayed"


@drive_test(after=at_speed)
async def fault_pin_turns_the_gates_off(drive: Drive) -> None:
    """The gates are off within three clocks of the fault pin, and the rotor is caught again after a clear.

    Verifies: DRV-01
    """
    drive.force_pin("fault_pin_i", level=1, cycles=50)
    await RisingEdge(drive.dut.fault_pin_i)
    begin = get_sim_time("ns")
    while not drive.gates_off:
        await ValueChange(drive.dut.gate_o)
    print("gates off after", get_sim_time("ns") - begin, "ns")
    assert get_sim_time("ns") - begin <= 3 * CLOCK_NS
    await FallingEdge(drive.dut.fault_pin_i)
    await drive.until(lambda: drive.state == "fault", 0.01)
    assert drive.fault_name == "fault_pin"
    await drive.console("clear")
    await drive.until(lambda: drive.state == "ready", 0.05)
    await drive.console("start")
    await drive.at_speed(RPM, 0.2)


@drive_test(after=at_speed)
async def names_a_sagging_supply(drive: Drive) -> None:
    """The link falls with the supply, and the drive says so.

    Verifies: DRV-01
    """
    drive.supply(8.0, ramp_s=0.005)
    await drive.until(lambda: drive.fault_name != "none", 0.1)
    print(drive, drive.registers["safety.voltage_limit.under_lsb"])
    assert drive.fault_name == "under_voltage"
    assert drive.gates_off


@drive_test(after=at_speed)
async def names_a_rotor_that_stands(drive: Drive) -> None:
    """A shaft that is held all of a sudden: the current trips, and nothing turns.

    Verifies: DRV-01
    """
    drive.shaft("locked")
    await drive.until(lambda: drive.fault_name != "none", 0.2)
    print(drive)
    assert drive.speed_rpm == 0.0 and drive.gates_off
    assert drive.fault_name == "phase_over_current"


@drive_test(after=at_speed)
async def slows_down(drive: Drive) -> None:
    """A lower target is reached down the ramp, the commutation in step.

    Verifies: DRV-01
    """
    await drive.set("speed_rpm", 54_000)
    await drive.at_speed(54_000, 0.2)
    assert abs(drive.angle_error_deg) < 2.0


def test_six_step() -> None:
    """The chip with the six-step path."""
    run_tests(SCENARIO, __name__)
