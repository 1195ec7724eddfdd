# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Vector control on the whole chip with its motor, led by `fluxlock.drive` alone; cocotb sees the trip block, too."""

from __future__ import annotations

from cocotb.simtime import get_sim_time
from cocotb.triggers import RisingEdge, ValueChange

from fluxlock.base.paths import ROOT
from fluxlock.drive import Drive, drive_test, run_tests

SCENARIO = ROOT / "scenarios" / "campaign" / "vector.toml"
RPM = 54_000
CLOCK_NS = 20


async def at_speed(drive: Drive) -> None:
    """The common start: a rotor that spins is caught."""
    await drive.start(RPM)
    await drive.run(0.005)


@drive_test(after=at_speed)
async def holds_the_angle_through_a_load_step(drive: Drive) -> None:
    """Ends of one start: the more load, the more torque and the less speed at first, with the angle held.

    Verifies: DRV-01, DRV-04
    """
    ends = drive.branch([1.0, 1.5])
    for end in ends:
        drive.load(factor=end.value)
        await drive.run(0.012)
        found = drive.window(drive.time_s - 0.005)
        end.keep((found["torque_nm"]["mean"], drive.speed_rpm, drive.angle_error_deg))
    print(ends.kept)
    torques, speeds, errors_deg = zip(*ends.kept, strict=True)
    assert torques[1] > 1.3 * torques[0]
    assert speeds[0] > speeds[1]
    assert all(abs(error_deg) < 2.0 for error_deg in errors_deg)


@drive_test(after=at_speed)
async def notices_a_rotor_that_stands(drive: Drive) -> None:
    """A shaft that is held all of a sudden: the drive no longer says that it runs, and its currents stay bounded.

    Verifies: DRV-01
    """
    drive.shaft("locked")
    await drive.until(lambda: drive.state != "running", 0.05)
    print(drive, drive.currents_a)
    assert max(abs(drive.currents_a)) < drive.scenario.inverter.protection.phase_current_a


@drive_test(after=at_speed)
async def names_a_current_sensor_that_is_off(drive: Drive) -> None:
    """Three currents that do not sum to zero.

    Verifies: DRV-01
    """
    drive.disturb("ia", gain=0.5)
    await drive.until(lambda: drive.fault_name != "none", 0.1)
    print(drive)
    assert drive.fault_name == "current_sum" and drive.gates_off


@drive_test(after=at_speed)
async def shows_the_trip_before_the_gates(drive: Drive) -> None:
    """A signal of the inside is a handle: the trip of the fault pin rises within three clocks, the gates fall after it.

    Verifies: DRV-01
    """
    trip = drive.dut.u_safety.u_trip
    assert trip.trip_o.value == 0 and int(drive.dut.gate_o.value) != 0
    drive.force_pin("fault_pin_i", level=1, cycles=50)
    await RisingEdge(drive.dut.fault_pin_i)
    begin = get_sim_time("ns")
    await RisingEdge(trip.trip_o)
    tripped = get_sim_time("ns")
    assert trip.fault_pin_i.value == 1
    while not drive.gates_off:
        await ValueChange(drive.dut.gate_o)
    print("trip", tripped - begin, "ns, gates", get_sim_time("ns") - begin, "ns after the pin")
    assert tripped - begin <= get_sim_time("ns") - begin <= 3 * CLOCK_NS
    await drive.until(lambda: drive.state == "fault", 0.01)
    assert drive.fault_name == "fault_pin"


def test_vector() -> None:
    """The chip with the vector path, whose trip block cocotb sees."""
    run_tests(SCENARIO, __name__, signals=["fl_trip.*"])
