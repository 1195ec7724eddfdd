"""The whole drive on the host, closed over the averaged model: start, hand-over, speed, limits, faults, restart."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from fluxlock.firmware import DriveSpec, InverterSpec, MotorSpec
from tests.firmware import averaged_motor as am
from tests.firmware.averaged_motor import Load
from tests.firmware.firmware_bench import FAN_1, MOTOR_1, Bench


def fault_of(bench: Bench) -> str:
    """Name of the present fault."""
    return bench.fw.command("get fault")[0].split()[1]


def longest_period(bench: Bench) -> int:
    """Carrier period that leaves six pulses in the sectors of the last turn."""
    sixth = bench.get("comm.snap_period") // 36
    return max(1250, min(bench.block.number("carrier_longest_cycles"), sixth))


def test_boot_measures_offsets_with_gates_off() -> None:
    """From reset to ready in less than 2 ms, offsets measured, gates disabled all the time.

    Verifies: FW-14
    """
    bench = Bench()
    bench.fw.auto_zero_offsets[3:6] = (2048 * 16 + 40, 2048 * 16 - 64, 2048 * 16 + 7)
    assert bench.fw.state == "init"
    for _ in range(20):
        bench.step()
        assert bench.get("safety.guard") & 1 == 0
    assert bench.fw.state == "ready"
    assert [bench.get("sense.offset", 3 + x) for x in range(3)] == [
        2048 * 16 + 40,
        2048 * 16 - 64,
        2048 * 16 + 7,
    ]


def test_wrong_offset_is_a_named_fault() -> None:
    """A current sensor far off its mid-scale does not come to ready; clear measures again.

    Verifies: FW-14, FW-18
    """
    bench = Bench()
    bench.fw.auto_zero_offsets[4] = 1700 * 16
    bench.run(0.005)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "current_offset")
    bench.fw.auto_zero_offsets[4] = 2050 * 16
    assert bench.fw.command("clear") == ["ok"]
    assert bench.until_state("ready", 0.005)
    assert fault_of(bench) == "none"


@pytest.mark.parametrize("theta_rad", [0.0, 1.1, 2.2, 3.141592653589793, 4.4, 5.5])
def test_starts_from_any_angle_and_holds_60000(theta_rad: float) -> None:
    """Standstill to 60 000 r/min within 0.3 s + ramp; held within 0.5 %; the measured speed is the true one.

    Verifies: FW-15, FW-16
    """
    bench = Bench(theta_rad=theta_rad)
    bench.start(60_000, 0.3)
    bench.run(0.8)
    speeds = []
    for _ in range(1000):
        bench.step()
        speeds.append(bench.model.rpm)
        assert bench.fw.telemetry()["speed_rpm_q8"] / 256 == pytest.approx(bench.model.rpm, rel=2e-3)
    assert np.max(np.abs(np.array(speeds) / 60_000 - 1)) < 0.005
    assert bench.trips == 0


def test_start_sequence_uses_the_right_vectors() -> None:
    """All low, leg A high, leg B high, then six-step forced from sector index 4, then crossings.

    Verifies: FW-15
    """
    bench = Bench()
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    seen: list[tuple[int, tuple[int, ...], int]] = []
    while bench.fw.state != "running" and bench.now < 1.0:
        bench.step()
        manual, control = bench.get("pwm.manual"), bench.get("pwm.control")
        legs = tuple(manual >> (4 * x) & 7 for x in range(3)) if control & 3 == 1 else ()
        entry = (control & 3, legs, bench.get("comm.control") & 3)
        if not seen or seen[-1] != entry:
            seen.append(entry)
            if entry == (2, (), 1):
                assert control >> 16 & 7 == 4
    assert seen == [
        (0, (), 0),
        (1, (2, 2, 2), 0),
        (1, (3, 2, 2), 0),
        (1, (2, 3, 2), 0),
        (2, (), 1),
        (2, (), 2),
    ]


@pytest.mark.parametrize(
    "change",
    [
        {"inertia_kgm2": 1e-6},
        {"inertia_kgm2": 2.5e-7},
        {"psi_vs": 0.85e-3},
        {"psi_vs": 1.15e-3},
        {"resistance_ohm": 14e-3},
        {"resistance_ohm": 28e-3},
        {"inductance_h": 15e-6},
        {"inductance_h": 31e-6},
    ],
)
def test_start_tolerates_wrong_parameters(change: dict[str, float]) -> None:
    """The machine differs from its file by half in inertia, 15 % in flux, 40 % in R or L: it starts at once.

    Verifies: FW-15
    """
    bench = Bench(model_motor=replace(MOTOR_1, **change))  # type: ignore[arg-type]
    bench.start(40_000, 0.35)
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(40_000, rel=0.005)
    assert bench.trips == 0


@pytest.mark.parametrize("coulomb_nm", [1e-3, 3e-3])
def test_start_against_friction(coulomb_nm: float) -> None:
    """Coulomb friction up to 30 % of the start torque.

    Verifies: FW-15
    """
    bench = Bench(load=replace(FAN_1, coulomb_nm=coulomb_nm))
    bench.start(30_000, 1.0)
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)


OTHERS = [
    (
        MotorSpec(2, 0.15, 120e-6, 5e-3, 8e-6, 10.0, 22_000.0),
        InverterSpec(48.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 60.0, 25.0, 200e-9),
        Load(0.02, 15_000, 2e-3),
        15_000,
    ),
    (
        MotorSpec(4, 0.08, 80e-6, 2.4e-3, 2e-5, 12.0, 9_000.0, "trapezoidal"),
        InverterSpec(24.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 30.0, 30.0, 200e-9),
        Load(0.12, 8_000, 3e-3),
        6_000,
    ),
    (
        MotorSpec(7, 0.06, 30e-6, 7.8e-4, 1.5e-5, 20.0, 12_000.0),
        InverterSpec(14.8, 3e-3, 0.7, 200e-9, 400e-9, 12, 1e-6, 20.0, 60.0, 200e-9),
        Load(0.10, 9_000),
        8_000,
    ),
    (
        MotorSpec(4, 0.5, 1.2e-3, 14e-3, 6e-5, 6.0, 4_000.0),
        InverterSpec(48.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 60.0, 15.0, 200e-9),
        Load(0.2, 3_000, 0.02),
        3_000,
    ),
]


@pytest.mark.parametrize(("motor", "inverter", "load", "rpm"), OTHERS)
@pytest.mark.parametrize("direction", [1, -1])
def test_other_machines_run_from_their_files(
    motor: MotorSpec, inverter: InverterSpec, load: Load, rpm: int, direction: int
) -> None:
    """2, 4 and 7 pole pairs, 15 to 48 V, to mH, trapezoidal, both directions: start, hold within 0.5 %.

    Verifies: FW-13, FW-15, FW-16
    """
    bench = Bench(motor, inverter, DriveSpec(carrier_hz=30e3), load)
    bench.start(direction * rpm, 2.0)
    bench.run(2.0)
    assert bench.model.rpm == pytest.approx(direction * rpm, rel=0.005)


def test_load_step_and_ramp_follow_the_settings() -> None:
    """+25 % load: less than 4 % dip, back within 0.5 % after 60 ms; ramps have the set acceleration.

    Verifies: FW-16
    """
    bench = Bench(drive=DriveSpec(accel_rpm_per_s=150_000.0))
    bench.start(60_000)
    bench.run(0.7)
    bench.model.set_load(Load(25e-3, 60_000))
    dip = 60_000.0
    for _ in range(600):
        bench.step()
        dip = min(dip, bench.model.rpm)
    assert dip > 57_600
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)
    bench.fw.command("set accel_rpm_s 100000")
    bench.fw.command("set speed_rpm 40000")
    before = bench.model.rpm
    bench.run(0.1)
    assert before - bench.model.rpm == pytest.approx(10_000, rel=0.1)
    bench.run(0.4)
    assert bench.model.rpm == pytest.approx(40_000, rel=0.005)


def test_current_limit_binds_without_windup() -> None:
    """Far too steep a ramp: the current settles at its limit within 15 %, then no overshoot above 2 %.

    Verifies: FW-17
    """
    bench = Bench(drive=DriveSpec(accel_rpm_per_s=2e6, current_limit_a=15.0))
    bench.start(60_000)
    peak_rpm, currents = 0.0, []
    for _ in range(6000):
        bench.step()
        peak_rpm = max(peak_rpm, bench.model.rpm)
        if 15_000 < bench.model.rpm < 45_000:
            currents.append(float(bench.model.s[am.I_LINE]))
    assert np.mean(currents[len(currents) // 4 :]) == pytest.approx(15.0, rel=0.15)
    assert max(currents) < 20.0
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)
    assert peak_rpm < 61_200


def test_dc_limit_binds() -> None:
    """A DC-link current limit below what the load wants holds the mean DC current there, at a lower speed.

    Verifies: FW-17
    """
    bench = Bench(drive=DriveSpec(dc_current_limit_a=4.0))
    bench.start(60_000)
    bench.run(1.2)
    mean = [bench.model.s[am.IDC_MEAN] for _ in range(500) if bench.step() is None]
    assert np.mean(mean) == pytest.approx(4.0, rel=0.05)
    assert 40_000 < bench.model.rpm < 58_000
    assert bench.fw.command("get limit") == ["limit current", "ok"]


def test_duty_limit_binds_and_releases() -> None:
    """At 12 V supply 60 000 r/min are out of reach: full duty, no windup when the target falls.

    Verifies: FW-17
    """
    inverter = InverterSpec(supply_v=12.0, phase_current_trip_a=45.0)
    bench = Bench(inverter=inverter, drive=DriveSpec(duty_max=0.9, accel_rpm_per_s=200_000.0))
    bench.start(60_000)
    bench.run(1.0)
    assert bench.fw.command("get duty") == ["duty 0.9000", "ok"]
    assert bench.fw.command("get limit") == ["limit duty_max", "ok"]
    bench.fw.command("set speed_rpm 30000")
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)


def test_stop_and_stop_now() -> None:
    """`stop` ramps down before the gates open, `stop now` opens them at once; both end ready and can start again.

    Verifies: FW-19
    """
    bench = Bench()
    bench.start(30_000)
    bench.run(0.4)
    assert bench.fw.command("stop") == ["ok"]
    assert bench.until_state("stopping", 0.01)
    assert bench.until_state("ready", 2.0)
    assert bench.model.rpm < 7_000
    assert bench.get("safety.guard") & 1 == 0
    bench.start(30_000, 4.0)
    bench.run(0.4)
    assert bench.fw.command("stop now") == ["ok"]
    bench.run(0.0002)
    assert bench.fw.state == "ready"
    assert bench.get("safety.guard") & 1 == 0


@pytest.mark.parametrize(
    ("cause", "name"),
    [
        (1, "phase_over_current"),
        (2, "dc_over_current"),
        (4, "fault_pin"),
        (16, "over_voltage"),
        (32, "under_voltage"),
        (64, "software_trip"),
        (1 | 4, "phase_over_current"),
    ],
)
def test_trips_have_names_and_can_be_cleared(cause: int, name: str) -> None:
    """Every trip opens the gates and names its first cause; clear, then a new start runs again.

    Verifies: FW-18
    """
    bench = Bench()
    bench.start(30_000)
    bench.run(0.2)
    bench.trip(cause)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", name)
    assert bench.get("safety.guard") & 1 == 0
    assert bench.fw.command("start") == ["error: not ready"]
    assert any(line.startswith(f"fault {name} ") for line in bench.fw.command("faults"))
    assert bench.fw.command("clear") == ["ok"]
    assert bench.until_state("ready", 0.01)
    bench.start(30_000, 5.0)


def test_cause_still_present_is_a_fault_again() -> None:
    """Clearing does not help while the cause persists.

    Verifies: FW-18
    """
    bench = Bench()
    bench.until_state("ready", 0.1)
    bench.trip(4, now=4)
    bench.run(0.001)
    assert fault_of(bench) == "fault_pin"
    bench.fw.command("clear")
    bench.run(0.01)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "fault_pin")


def test_real_over_current_in_the_model_trips() -> None:
    """A rotor that stops dead drives the current into the trip; the fault is named.

    Verifies: FW-18
    """
    bench = Bench(drive=DriveSpec(restart_retries=0))
    bench.start(60_000)
    bench.run(0.6)
    bench.model.m[am.M_LOCKED] = 1.0
    assert bench.until_state("fault", 0.5)
    assert fault_of(bench) in ("phase_over_current", "lost_lock")
    assert bench.get("safety.guard") & 1 == 0


def test_lost_lock_restarts_by_itself() -> None:
    """Crossings vanish for a while: gates open, the rotor coasts, the drive starts anew and comes back to speed.

    Verifies: FW-20
    """
    bench = Bench(load=replace(FAN_1, coulomb_nm=1e-3))
    bench.start(20_000)
    bench.run(0.3)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("starting", 0.1)
    assert bench.get("safety.guard") & 1 == 0
    bench.model.m[am.M_BLIND] = 0.0
    assert bench.until_state("running", 5.0)
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(20_000, rel=0.005)
    assert bench.fw.command("get lost_locks") == ["lost_locks 1", "ok"]


def test_restarts_are_limited() -> None:
    """Without crossings every attempt fails: after the retries a named fault, gates off.

    Verifies: FW-20
    """
    bench = Bench(load=replace(FAN_1, coulomb_nm=1e-3), drive=DriveSpec(start_retries=2))
    bench.start(20_000)
    bench.run(0.2)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("fault", 10.0)
    assert fault_of(bench) == "start_failed"
    bench = Bench(drive=DriveSpec(restart_retries=0))
    bench.start(20_000)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("fault", 1.0)
    assert fault_of(bench) == "lost_lock"


def test_unseen_rotor_shorted_by_the_precharge_of_a_restart() -> None:
    """Voltage channels that hide the EMF let the precharge short a turning rotor: open, wait longer, start again.

    Verifies: FW-20
    """
    bench = Bench(load=replace(FAN_1, coulomb_nm=1e-3), drive=DriveSpec(catch_rotor=False))
    bench.start(20_000)
    bench.run(0.3)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("starting", 0.1)
    bench.model.m[am.M_BLIND] = 0.0
    assert bench.run(5.0, lambda: bench.fw.telemetry()["phase"] == 1)
    bench.trip(1)
    bench.run(0.0003)
    assert (bench.fw.state, bench.fw.telemetry()["phase"]) == ("starting", 0)
    assert bench.get("safety.guard") & 1 == 0
    assert bench.until_state("running", 5.0)


def test_ramp_down_does_not_undershoot() -> None:
    """Without braking (fan alone slows the rotor) the speed falls at most 3 % below its target.

    Verifies: FW-16
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    bench.fw.command("set speed_rpm 20000")
    assert bench.run(1.0, lambda: bench.model.rpm < 20_400)
    speeds = []
    for _ in range(2000):
        bench.step()
        speeds.append(bench.model.rpm)
    assert min(speeds) > 19_400
    assert speeds[-1] == pytest.approx(20_000, rel=0.005)


def test_locked_rotor_fails_to_start_by_name() -> None:
    """A rotor that cannot turn: start_failed after the retries, current bounded by the start current.

    Verifies: FW-20
    """
    bench = Bench(drive=DriveSpec(start_retries=1, start_current_a=6.0))
    bench.model.m[am.M_LOCKED] = 1.0
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    assert bench.until_state("fault", 3.0)
    assert fault_of(bench) == "start_failed"
    assert bench.model.s[am.I_PEAK] < 45.0


def test_start_waits_for_a_spinning_rotor() -> None:
    """A rotor at 40 000 r/min coasts with open gates until its EMF is small; then it is aligned and started.

    Verifies: FW-15
    """
    bench = Bench(speed_rpm=40_000.0, load=Load(20e-3, 20_000, 3e-3), drive=DriveSpec(catch_rotor=False))
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    while bench.fw.telemetry()["phase"] == 0 and bench.now < 5.0:
        assert bench.get("safety.guard") & 1 == 0
        bench.step()
    assert bench.model.rpm < 6_500
    assert bench.until_state("running", 1.0)
    assert bench.trips == 0


def test_voltage_outside_of_its_range_refuses_to_start() -> None:
    """Start at a wrong supply is a named fault.

    Verifies: FW-18
    """
    for supply, name in ((12.0, "under_voltage"), (29.9, "over_voltage")):
        bench = Bench()
        bench.model.m[am.M_VDC] = supply
        bench.until_state("ready", 0.1)
        bench.fw.command("set speed_rpm 20000")
        bench.fw.command("start")
        bench.run(0.05)
        assert (bench.fw.state, fault_of(bench)) == ("fault", name)


def test_silent_converter_is_a_fault() -> None:
    """No new samples for three ticks while running.

    Verifies: FW-18
    """
    bench = Bench()
    bench.start(20_000)
    bench.sampling = False
    bench.run(0.001)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "no_samples")


def test_freeze_holds_every_setting() -> None:
    """Frozen, every committed register stays as it is whatever the machine does; released, control goes on.

    Verifies: FW-21
    """
    bench = Bench()
    bench.start(40_000)
    bench.run(0.6)
    assert bench.fw.command("set freeze 1") == ["ok"]
    bench.step()
    names = (
        "pwm.control",
        "pwm.period",
        "pwm.duty",
        "comm.control",
        "comm.delay",
        "comm.timeout",
        "zcd.control",
    )
    held = [bench.get(name) for name in names]
    bench.model.set_load(Load(24e-3, 60_000))
    bench.fw.command("set advance_q16 1000")
    bench.fw.command("set speed_rpm 50000")
    for _ in range(500):
        bench.step()
        assert [bench.get(name) for name in names] == held
    assert abs(bench.model.rpm - 40_000) > 200
    bench.fw.command("set freeze 0")
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(50_000, rel=0.005)


def test_long_carrier_at_low_duty_only() -> None:
    """Pulses keep the on-time floor at low speed by a longer carrier; at speed the carrier is the wanted one.

    Verifies: FW-08
    """
    bench = Bench()
    bench.start(60_000)
    floor = bench.block.number("on_time_floor_cycles")
    while bench.model.rpm < 55_000:
        bench.step()
        pulse, period = bench.get("pwm.duty") / 256, bench.get("pwm.period")
        longest = longest_period(bench)
        assert 1250 <= period <= longest
        assert pulse > floor - 2 or period == longest
        assert period == 1250 or pulse < floor + 2
    assert bench.get("pwm.period") == 1250


def test_coasting_keeps_enough_pulses_in_a_sector() -> None:
    """Far too steep a ramp down: the least duty binds, pulses stay long enough and six or more in a sector.

    Verifies: FW-08
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    bench.fw.command("set accel_rpm_s 2000000")
    bench.fw.command("set speed_rpm 10000")
    bound = 0
    for _ in range(3000):
        bench.step()
        assert bench.get("pwm.period") <= longest_period(bench)
        assert bench.get("pwm.duty") / 256 >= bench.block.number("least_on_cycles") - 12
        bound += bench.fw.telemetry()["limit"] == 2
    assert bound > 100
    assert bench.model.rpm < 45_000
    assert bench.fw.state == "running"


def test_host_runs_faster_than_real_time() -> None:
    """The drive on the host over the averaged model: more than a second a second, even on a busy machine.

    Verifies: FW-22
    """
    bench = Bench()
    bench.start(30_000)
    begin = time.process_time()
    bench.run(1.0)
    assert time.process_time() - begin < 1.0


def line_current_a(bench: Bench) -> float:
    """Current of the conducting pair as the drive sees it."""
    return float(bench.fw.command("get line_a")[0].split()[1])


def mean_torque_nm(bench: Bench, steps: int = 300) -> float:
    """Mean of the machine's torque."""
    total = 0.0
    for _ in range(steps):
        bench.step()
        total += float(am.torque_of(bench.model.s, bench.model.c, bench.model.m))
    return total / steps


CURRENT_LOOP = DriveSpec(current_loop=True, accel_rpm_per_s=150_000.0)


@pytest.mark.parametrize("direction", [1, -1])
def test_current_loop_holds_the_speed(direction: int) -> None:
    """With the current loop: speed within 0.5 %, load step below 4 %, the measured current is the machine's.

    Verifies: FW-25
    """
    bench = Bench(drive=CURRENT_LOOP)
    bench.start(60_000 * direction)
    bench.run(0.8)
    assert bench.model.rpm == pytest.approx(direction * 60_000, rel=0.005)
    assert line_current_a(bench) == pytest.approx(float(bench.model.s[am.I_LINE]), rel=0.05)
    bench.model.set_load(Load(25e-3, 60_000))
    dip = 60_000.0
    for _ in range(800):
        bench.step()
        dip = min(dip, abs(bench.model.rpm))
    assert dip > 57_600
    assert bench.model.rpm == pytest.approx(direction * 60_000, rel=0.005)


@pytest.mark.parametrize(("motor", "inverter", "load", "rpm"), OTHERS)
def test_current_loop_follows_from_the_motor_file(
    motor: MotorSpec, inverter: InverterSpec, load: Load, rpm: int
) -> None:
    """The machines of the files hold their speed with the current loop too.

    Verifies: FW-25
    """
    bench = Bench(motor, inverter, DriveSpec(carrier_hz=30e3, current_loop=True), load)
    bench.start(rpm, 2.0)
    bench.run(2.0)
    assert bench.model.rpm == pytest.approx(rpm, rel=0.005)


@pytest.mark.parametrize("change", [{}, {"psi_vs": 0.9e-3}, {"resistance_ohm": 30e-3}, {"inductance_h": 30e-6}])
def test_current_loop_bounds_the_current(change: dict[str, float]) -> None:
    """Far too steep a ramp, also with wrong parameters: the current stays at its limit, no windup after it.

    Verifies: FW-25, FW-17
    """
    drive = DriveSpec(current_loop=True, accel_rpm_per_s=2e6, current_limit_a=15.0)
    bench = Bench(drive=drive, model_motor=replace(MOTOR_1, **change))  # type: ignore[arg-type]
    bench.start(60_000)
    peak_rpm, currents = 0.0, []
    for _ in range(6000):
        bench.step()
        peak_rpm = max(peak_rpm, bench.model.rpm)
        if 15_000 < bench.model.rpm < 45_000:
            currents.append(float(bench.model.s[am.I_LINE]))
    assert np.mean(currents[len(currents) // 4 :]) == pytest.approx(15.0, rel=0.12)
    assert max(currents) < 19.0
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)
    assert peak_rpm < 61_200


def test_current_loop_obeys_dc_and_duty_limits() -> None:
    """The DC-link limit holds the mean DC current; at the duty limit nothing winds up.

    Verifies: FW-25, FW-17
    """
    bench = Bench(drive=replace(CURRENT_LOOP, dc_current_limit_a=4.0))
    bench.start(60_000)
    bench.run(1.2)
    mean = [bench.model.s[am.IDC_MEAN] for _ in range(500) if bench.step() is None]
    assert np.mean(mean) == pytest.approx(4.0, rel=0.05)
    assert bench.fw.command("get limit") == ["limit current", "ok"]
    inverter = InverterSpec(supply_v=12.0, phase_current_trip_a=45.0)
    bench = Bench(inverter=inverter, drive=replace(CURRENT_LOOP, duty_max=0.9))
    bench.start(60_000)
    bench.run(1.0)
    assert bench.fw.command("get duty") == ["duty 0.9000", "ok"]
    assert bench.fw.command("get limit") == ["limit duty_max", "ok"]
    bench.fw.command("set speed_rpm 30000")
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)


def test_current_loop_ramps_down_without_braking() -> None:
    """Only the fan slows the rotor, the current stops conducting: at most 3 % undershoot, then held.

    Verifies: FW-25
    """
    bench = Bench(drive=CURRENT_LOOP)
    bench.start(60_000)
    bench.run(0.6)
    bench.fw.command("set speed_rpm 20000")
    assert bench.run(1.5, lambda: bench.model.rpm < 20_400)
    speeds = []
    for _ in range(2000):
        bench.step()
        speeds.append(bench.model.rpm)
    assert min(speeds) > 19_400
    assert speeds[-1] == pytest.approx(20_000, rel=0.005)


def test_torque_mode_gives_the_torque() -> None:
    """Set torque is made within 5 % at any speed between the limits, with a flux 10 % off within 12 %.

    Verifies: FW-26
    """
    for flux, tolerance in ((1.0e-3, 0.05), (0.9e-3, 0.12)):
        bench = Bench(drive=CURRENT_LOOP, model_motor=replace(MOTOR_1, psi_vs=flux))
        bench.start(80_000)
        assert bench.fw.command("set torque_mnm 12.5") == ["ok"]
        assert bench.fw.command("get torque_mnm") == ["torque_mnm 12.500", "ok"]
        assert bench.fw.command("set mode torque") == ["ok"]
        bench.run(1.0)
        assert mean_torque_nm(bench) == pytest.approx(12.5e-3, rel=tolerance)
        # The fan takes 20 mN*m at 60 000 r/min.
        assert bench.model.rpm == pytest.approx(60_000 * (12.5 / 20.0) ** 0.5, rel=0.07)
        assert bench.fw.command("set torque_mnm 6") == ["ok"]
        bench.run(0.05)
        assert mean_torque_nm(bench, 50) == pytest.approx(6e-3, rel=1.5 * tolerance)


def test_torque_mode_keeps_the_speed_limits() -> None:
    """More torque than the load takes ends at the target speed, less at the stop speed; back to speed without a jump.

    Verifies: FW-26
    """
    bench = Bench(drive=CURRENT_LOOP)
    bench.start(30_000)
    assert bench.fw.command("set current_ma 15000") == ["ok"]
    assert bench.fw.command("get current_ma") == ["current_ma 15000", "ok"]
    assert bench.fw.command("set mode torque") == ["ok"]
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.06)
    assert bench.fw.command("set current_ma 0") == ["ok"]
    bench.run(3.0)
    assert bench.fw.state == "running"
    assert bench.model.rpm == pytest.approx(bench.block.number("stop_rpm"), rel=0.25)
    bench.fw.command("set current_ma 8000")
    bench.run(0.05)
    before = bench.model.rpm
    bench.fw.command("set mode speed")
    bench.run(0.002)
    assert bench.model.rpm == pytest.approx(before, rel=0.05)
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)
    assert bench.fw.command("set current_ma 60000") == ["error: value out of range"]


def test_torque_mode_needs_the_current_loop() -> None:
    """Neither can be had without the other.

    Verifies: FW-26
    """
    bench = Bench()
    bench.until_state("ready", 0.1)
    assert bench.fw.command("set mode torque") == ["error: value out of range"]
    assert bench.fw.command("set current_loop 1") == ["ok"]
    assert bench.fw.command("set mode torque") == ["ok"]
    assert bench.fw.command("set current_loop 0") == ["error: value out of range"]


def test_current_loop_switches_while_running() -> None:
    """From one regulator to the other and back: the speed moves by less than 1 %.

    Verifies: FW-25
    """
    bench = Bench()
    bench.start(50_000)
    bench.run(1.0)
    for value in (1, 0, 1):
        assert bench.fw.command(f"set current_loop {value}") == ["ok"]
        for _ in range(1000):
            bench.step()
            assert bench.model.rpm == pytest.approx(50_000, rel=0.01)


@pytest.mark.parametrize("linearity", [True, False])
def test_linearity_makes_the_voltage_the_wanted_one(linearity: bool) -> None:
    """At 3.4 carriers a sector the machine gets the voltage that the drive asks for; without, 5 % more at least.

    Verifies: FW-27
    """
    bench = Bench(drive=DriveSpec(carrier_hz=20e3, linearity=linearity), cut_pulses=True)
    bench.start(59_000)
    bench.run(1.0)
    asked, got = [], []
    for _ in range(200):
        bench.step()
        asked.append(bench.fw.telemetry()["u_v_q25"] / 2**25 * 30.0)
        duty = float(bench.model.c[am.C_DUTY])
        got.append(duty * 25.0 - (1.0 - duty) * 0.7)
    ratio = float(np.mean(got) / np.mean(asked))
    assert (ratio == pytest.approx(1.0, abs=0.01)) if linearity else (ratio > 1.05)
    assert bench.model.rpm == pytest.approx(59_000, rel=0.005)


MOTOR_2 = MotorSpec(1, 0.0397, 27.8e-6, 1.27e-3, 5e-7, 10.0, 60_000.0)
INVERTER_2 = InverterSpec(15.0, 2e-3, 0.7, 200e-9, 400e-9, 12, 1e-6, 18.0, 20.0)
FAN_2 = Load(8e-3, 54_000)


def thresholds_of(bench: Bench) -> list[float]:
    """Thresholds as the console shows them."""
    return [float(word) for word in bench.fw.command("get threshold_pu")[0].split()[1:]]


def interval_spread_deg(bench: Bench) -> float:
    """Largest deviation of a sector's interval from 60 degrees."""
    ring = bench.model.s[am.RING_FIRST : am.RING_FIRST + 6]
    return float(np.max(np.abs(ring / ring.mean() - 1.0)) * 60.0)


@pytest.mark.parametrize("direction", [1, -1])
def test_balance_learns_dividers_and_inductances(direction: int) -> None:
    """Motor-II with divider gains 1.10, 1.00, 0.90 at 20 000 r/min: vertical takes most, both nearly all of it.

    Verifies: FW-28
    """
    bench = Bench(MOTOR_2, INVERTER_2, DriveSpec(accel_rpm_per_s=20_000.0), FAN_2)
    bench.start(direction * 20_000, 3.0)
    bench.run(0.8)
    mean = (27.5 + 27.2 + 28.6) / 3
    bench.model.m[am.M_UNEQUAL : am.M_UNEQUAL + 3] = (27.5 / mean, 27.2 / mean, 28.6 / mean)
    bench.model.m[am.M_DIVIDER : am.M_DIVIDER + 3] = (1.10, 1.00, 0.90)
    bench.run(0.3)
    spread = interval_spread_deg(bench)
    assert spread > 10.0
    assert bench.fw.command("set balance vertical") == ["ok"]
    bench.run(0.3)
    vertical = interval_spread_deg(bench)
    assert vertical < 0.5 * spread
    assert bench.fw.command("set balance both") == ["ok"]
    bench.run(0.3)
    assert interval_spread_deg(bench) < 0.5
    got = thresholds_of(bench)
    # Sectors I..VI float C, B, A, C, B, A.
    assert (got[2] + got[5]) / 2 == pytest.approx(0.55, abs=0.004)
    assert (got[1] + got[4]) / 2 == pytest.approx(0.50, abs=0.004)
    assert (got[0] + got[3]) / 2 == pytest.approx(0.45, abs=0.004)
    assert bench.model.rpm == pytest.approx(direction * 20_000, rel=0.005)
    # Through a ramp to 54 000 r/min in 3 s the intervals stay within 59 to 61 degrees.
    bench.fw.command("set accel_rpm_s 12000")
    bench.fw.command(f"set speed_rpm {direction * 54_000}")
    worst = 0.0
    for _ in range(30_000):
        bench.step()
        worst = max(worst, interval_spread_deg(bench))
    assert abs(bench.model.rpm) > 52_000
    assert worst < 1.0
    assert bench.fw.command("set balance none") == ["ok"]
    bench.run(0.01)
    assert thresholds_of(bench) == [0.5] * 6


def test_balance_rests_in_transients() -> None:
    """On a healthy machine a steep ramp moves no threshold by more than 0.2 %.

    Verifies: FW-28
    """
    bench = Bench(drive=DriveSpec(accel_rpm_per_s=400_000.0, balance="both"))
    bench.start(80_000)
    worst = 0.0
    for _ in range(6000):
        bench.step()
        if bench.ticks % 10 == 0:
            worst = max(worst, max(abs(t - 0.5) for t in thresholds_of(bench)))
    assert worst < 0.002


def test_advance_follows_speed_and_current() -> None:
    """Base, speed and current add up in the register, limited to 30 degrees; the model's timer obeys.

    Verifies: FW-29
    """
    drive = DriveSpec(advance_deg=1.0, advance_deg_at_max_speed=6.0, advance_deg_at_rated_current=4.0)
    bench = Bench(drive=drive)
    bench.start(50_000)
    bench.run(1.0)
    current = float(bench.model.s[am.I_LINE])

    def advance_deg() -> float:
        raw = bench.get("comm.delay") >> 16
        return ((raw ^ 0x8000) - 0x8000) / 65536 * 60.0

    wanted = 1.0 + 6.0 * 50_000 / MOTOR_1.max_speed_rpm + 4.0 * current / MOTOR_1.rated_current_a
    assert advance_deg() == pytest.approx(wanted, abs=0.1)
    bench.fw.command("set advance_speed_q16 32767")
    bench.fw.command("set advance_q16 30000")
    bench.run(0.002)
    assert advance_deg() == pytest.approx(30.0, abs=0.01)
    bench.fw.command("set advance_q16 -32768")
    bench.fw.command("set advance_speed_q16 -32768")
    bench.run(0.002)
    assert advance_deg() == pytest.approx(-30.0, abs=0.01)


@pytest.mark.parametrize("rpm", [18_000, 20_000, 40_000, 60_000, 77_777, 94_000, 100_000])
@pytest.mark.parametrize("direction", [1, -1])
def test_spinning_rotor_is_caught(rpm: int, direction: int) -> None:
    """At any speed, both directions: locked within 40 ms without a trip, speed dips by less than a fifth, then held.

    Verifies: FW-30
    """
    bench = Bench(speed_rpm=direction * rpm, theta_rad=0.3 * direction + rpm, load=Load(20e-3, 100_000))
    bench.until_state("ready", 0.1)
    bench.fw.command(f"set speed_rpm {direction * rpm}")
    before = abs(bench.model.rpm)
    bench.fw.command("start")
    assert bench.until_state("running", 0.04)
    assert bench.fw.command("get catches") == ["catches 1", "ok"]
    assert bench.fw.command("get lost_locks") == ["lost_locks 0", "ok"]
    assert bench.model.rpm * direction > 0.8 * before
    assert bench.model.s[am.I_PEAK] < 15.0
    bench.run(0.6)
    assert bench.model.rpm == pytest.approx(direction * rpm, rel=0.005)
    assert bench.trips == 0


def test_lost_lock_is_caught_again() -> None:
    """Crossings vanish for 3 ms at 60 000 r/min: back at speed within 50 ms, without standstill.

    Verifies: FW-30, FW-20
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.until_state("starting", 0.1)
    bench.model.m[am.M_BLIND] = 0.0
    assert bench.until_state("running", 0.05)
    assert bench.model.rpm > 30_000
    bench.run(0.6)
    assert bench.model.rpm == pytest.approx(60_000, rel=0.005)


def test_over_current_after_scattered_misses_is_a_lost_lock() -> None:
    """Crossings missed now and then, never two in a row: an over-current then restarts; one without misses is a fault.

    Verifies: FW-20
    """
    bench = Bench()
    bench.start(60_000)
    bench.run(0.6)
    for _ in range(2):
        bench.model.s[am.TIMEOUTS] += 1
        bench.run(0.002)
    bench.trip(1)
    bench.run(0.0003)
    assert bench.fw.state == "starting"
    assert bench.until_state("running", 0.05)
    bench.run(0.1)
    bench.trip(1)
    bench.run(0.0003)
    assert (bench.fw.state, fault_of(bench)) == ("fault", "phase_over_current")


@pytest.mark.parametrize("value_q17", [131071, 30_000, 0])
def test_stuck_voltage_channel_is_named(value_q17: int) -> None:
    """A channel that keeps its value while the rotor turns is named after 50 ms; gone, the drive starts.

    Verifies: FW-34
    """
    bench = Bench(speed_rpm=50_000.0)
    bench.stuck = {0: value_q17}
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 50000")
    bench.fw.command("start")
    assert bench.until_state("fault", 0.06)
    assert fault_of(bench) == "voltage_channel"
    assert bench.get("safety.guard") & 1 == 0
    bench.stuck = {}
    bench.fw.command("clear")
    bench.until_state("ready", 0.1)
    bench.fw.command("start")
    assert bench.until_state("running", 0.05)


@pytest.mark.parametrize("sync_rect", [True, False])
@pytest.mark.parametrize("current_loop", [True, False])
def test_rotor_that_spins_backward_is_turned(sync_rect: bool, current_loop: bool) -> None:
    """Caught backward, slowed down (with braking current or by its load), started forward; no trip.

    Verifies: FW-30, FW-31
    """
    drive = DriveSpec(sync_rect=sync_rect, current_loop=current_loop, accel_rpm_per_s=200_000.0)
    bench = Bench(speed_rpm=-50_000.0, load=replace(FAN_1, coulomb_nm=2e-3), drive=drive)
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 40000")
    bench.fw.command("start")
    assert bench.run(3.0, lambda: bench.model.rpm > 39_000)
    bench.run(0.5)
    assert bench.model.rpm == pytest.approx(40_000, rel=0.005)
    assert bench.trips == 0
    assert fault_of(bench) == "none"


@pytest.mark.parametrize("current_loop", [True, False])
def test_reversal_brakes_within_its_limit(current_loop: bool) -> None:
    """60 000 r/min to -60 000 and back with 8 A of braking current: kept within 20 %, faster than coasting, no trip.

    Verifies: FW-31
    """
    drive = DriveSpec(sync_rect=True, current_loop=current_loop, accel_rpm_per_s=1e6, brake_current_limit_a=8.0)
    bench = Bench(drive=drive)
    bench.start(60_000)
    bench.run(0.6)
    for sign in (-1, 1):
        lowest, begin = 0.0, bench.now
        bench.fw.command(f"set speed_rpm {sign * 60_000}")
        while abs(bench.model.rpm) > 10_000 and bench.now - begin < 1.0:
            bench.step()
            lowest = min(lowest, float(bench.model.s[am.I_LINE]))
        # Fan and 8 A: 13 mN*m and at least as much of the fan at first.
        assert bench.now - begin < 0.2
        assert -9.6 < lowest < -6.0
        assert bench.run(2.0, lambda s=sign: s * bench.model.rpm > 59_000)
        bench.run(0.3)
        assert bench.model.rpm == pytest.approx(sign * 60_000, rel=0.005)
    assert bench.trips == 0


def test_braking_spares_the_dc_link() -> None:
    """A DC link at its limit takes no braking current: the rotor slows by its load alone.

    Verifies: FW-31
    """
    bench = Bench(drive=DriveSpec(sync_rect=True, accel_rpm_per_s=1e6, brake_current_limit_a=10.0))
    bench.start(60_000)
    bench.run(0.6)
    bench.model.m[am.M_VDC] = 29.8
    bench.run(0.1)
    bench.fw.command("set speed_rpm 30000")
    lowest = 0.0
    for _ in range(500):
        bench.step()
        lowest = min(lowest, float(bench.model.s[am.I_LINE]))
    assert lowest > -1.5
    bench.model.m[am.M_VDC] = 25.0
    bench.run(1.0)
    assert bench.model.rpm == pytest.approx(30_000, rel=0.005)


@pytest.mark.parametrize(("emf", "factor"), [("sinusoidal", 1.5), ("trapezoidal", 1.0)])
def test_crossing_settings_reach_the_registers(emf: str, factor: float) -> None:
    """Options come from parameters and console, the amplitude follows speed and signal, the wait half of the delay.

    Verifies: FW-32
    """
    drive = DriveSpec(zcd_method="averaged", zcd_source="star_point", compute_back=True, correction_a=True)
    bench = Bench(motor=replace(MOTOR_1, emf=emf), drive=drive)
    assert bench.until_state("ready", 0.1)
    bench.step()
    assert bench.get("zcd.amplitude") == 0

    def options() -> tuple[int, int, int, int, int]:
        zcd = bench.get("zcd.control")
        return (zcd >> 1) & 3, (zcd >> 3) & 1, (zcd >> 6) & 1, (zcd >> 8) & 3, (bench.get("comm.control") >> 5) & 1

    def peak() -> float:
        return factor * 1e-3 * bench.model.rpm * np.pi / 30.0 / 30.0 * 2**17

    linear = int(emf == "trapezoidal")
    assert bench.fw.command("set speed_rpm 50000") == ["ok"]
    assert bench.fw.command("start") == ["ok"]
    # The rotor may lead the forced field by more than can be computed back.
    assert bench.run(2.0, lambda: bench.fw.telemetry()["phase"] == 4)
    assert options() == (2, 0, linear, 1, 1)
    assert bench.until_state("running", 2.0)
    assert options() == (2, 1, linear, 1, 1)
    bench.run(0.5)
    assert bench.get("zcd.amplitude") == pytest.approx(peak() / 3.0, rel=0.005)
    assert bench.get("zcd.wait_limit") == 0x40
    for line in ("zcd_method first", "zcd_source terminal", "compute_back 0", "correction_a 0", "advance_q16 16384"):
        assert bench.fw.command(f"set {line}") == ["ok"]
    bench.step()
    assert options() == (0, 0, linear, 0, 0)
    assert bench.get("zcd.amplitude") == pytest.approx(peak(), rel=0.005)
    assert bench.get("zcd.wait_limit") == 0x20
    assert bench.fw.command("set zcd_source mean") == ["ok"]
    assert bench.fw.command("stop now") == ["ok"]
    bench.run(0.001)
    assert bench.get("zcd.amplitude") == 0


@pytest.mark.parametrize("source", ["terminal", "mean"])
def test_balance_learns_from_computed_back_crossings(source: str) -> None:
    """Overridden crossings stop the learning unless they are computed back; another signal starts anew.

    Verifies: FW-32, FW-28
    """
    bench = Bench(drive=DriveSpec(zcd_source=source, compute_back=True, balance="both"))  # type: ignore[arg-type]
    bench.start(40_000)
    bench.run(0.5)
    bench.model.m[am.M_DIVIDER : am.M_DIVIDER + 3] = (1.03, 1.0, 0.98)

    def run(back: bool) -> float:
        for _ in range(2000):
            bench.overridden += 1
            bench.computed_back += int(back)
            bench.step()
        return max(abs(t - 0.5) for t in thresholds_of(bench))

    assert run(back=False) < 0.002
    assert run(back=True) > 0.01
    assert bench.fw.command(f"set zcd_source {'mean' if source == 'terminal' else 'terminal'}") == ["ok"]
    bench.step()
    assert thresholds_of(bench) == [0.5] * 6


def test_sampling_once_a_carrier_while_running_only() -> None:
    """Start, standstill and coasting need continuous samples; a lone sample of a pulse has none before it.

    Verifies: FW-35
    """
    bench = Bench(drive=DriveSpec(zcd_sampling="carrier"))

    def sampling() -> tuple[int, int]:
        return bench.get("sense.scheduler") & 3, (bench.get("zcd.control") >> 4) & 3

    assert bench.until_state("ready", 0.1)
    assert sampling() == (1, 1)
    assert bench.fw.command("set speed_rpm 40000") == ["ok"]
    assert bench.fw.command("start") == ["ok"]
    while bench.fw.state != "running":
        assert sampling() == (1, 1)
        bench.step()
    bench.step()
    assert sampling() == (3, 0)
    assert bench.fw.command("stop now") == ["ok"]
    bench.run(0.001)
    assert sampling() == (1, 1)
