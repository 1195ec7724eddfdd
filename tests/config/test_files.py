# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Reading and checking of motor, inverter and scenario files."""

from __future__ import annotations

import math
import re
import shutil
from pathlib import Path
from typing import get_args

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, load_inverter, load_motor, load_scenario, reach
from fluxlock.config.console import COMMAND_LENGTH, COMMANDS
from fluxlock.config.info import derived_values, warnings
from fluxlock.config.reach import overloads, required_voltage
from fluxlock.config.scenario import Channel, DriveFault, TripCause
from fluxlock.config.schema import PAGE, page
from fluxlock.interface.names import fault_names
from fluxlock.plant.params import CHANNEL_NAMES
from fluxlock.results.rundata import TRIP_CAUSES

DEMO = ROOT / "scenarios" / "demo.toml"
BRAKE = "{off_v = %g, on_v = %g, resistance_ohm = 1, longest_on_s = 0.1}"


def names(folder: str) -> list[str]:
    return sorted(str(p.relative_to(ROOT / folder)) for p in (ROOT / folder).rglob("*.toml"))


def errors(*overrides: str, path: Path = DEMO) -> list[str]:
    """Problems of a scenario with overrides, as lines with the file reduced to its name."""
    with pytest.raises(ConfigError) as caught:
        load_scenario(path, overrides)
    return [str(p).replace(f"{p.file}:", f"{Path(p.file).name}:", 1) for p in caught.value.problems]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The shipped files in a folder of the test's own."""
    for folder in ("motors", "inverters", "scenarios"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    return tmp_path


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")


# ---- shipped files


@pytest.mark.parametrize("name", names("motors"))
def test_shipped_motors(name: str) -> None:
    """Each shipped motor file is valid and without warnings.

    Verifies: FRONT-01
    """
    assert warnings(load_motor(ROOT / "motors" / name)) == []


@pytest.mark.parametrize("name", names("inverters"))
def test_shipped_inverters(name: str) -> None:
    """Each shipped inverter file is valid.

    Verifies: FRONT-01
    """
    assert load_inverter(ROOT / "inverters" / name).supply_v > 0


@pytest.mark.parametrize("name", [*names("scenarios"), *(f"six-step/{name}" for name in names("scenarios/six-step"))])
def test_shipped_scenarios(name: str) -> None:
    """Each shipped scenario is valid and ends after its windows.

    Verifies: FRONT-01
    """
    scenario = load_scenario(ROOT / "scenarios" / name)
    begin, end = scenario.zoom_window_s()
    assert 0 <= begin < end <= scenario.duration_s


def test_motor_1_agrees_with_the_thesis() -> None:
    """Load of 20 mN*m at 60 000 r/min takes about 12 A and 10.4 V mean line EMF (psi omega 3 sqrt 3 / pi).

    Verifies: FRONT-01
    """
    motor = load_motor(ROOT / "motors" / "motor-1.toml")
    inverter = load_inverter(ROOT / "inverters" / "bench-25v.toml")
    omega = 2 * math.pi * 1000
    emf_v = 3 * math.sqrt(3) / math.pi * 1e-3 * omega
    current = 0.020 * omega / emf_v
    assert motor.load.torque_nm(60_000) == pytest.approx(0.020)
    assert motor.load.torque_nm(30_000) == pytest.approx(0.005)
    drop_v = current * (2 * 0.020 + 2 * inverter.on_resistance_ohm + inverter.supply_resistance_ohm)
    drop_v += 3 / math.pi * omega * 22e-6 * current  # six commutations a turn, each takes L I
    assert required_voltage(motor, inverter, 60_000, 0.020) == pytest.approx(emf_v + drop_v)
    values = {v.key: v.value for v in derived_values(motor)}
    assert values["max_electrical_hz"] == pytest.approx(94_000 / 60)
    assert values["torque_constant_nm_per_a"] == pytest.approx(1.654e-3, rel=1e-3)


def trapezoid(angle_deg: float, flat_top_deg: float) -> float:
    """Trapezoid of height 1 with the sine's sign and zero crossings."""
    ramp, half = (180 - flat_top_deg) / 2, angle_deg % 180
    return (1.0 if angle_deg % 360 < 180 else -1.0) * min(1.0, half / ramp, (180 - half) / ramp)


@pytest.mark.parametrize("flat_top_deg", [170.0, 120.0, 90.0, 60.0])
def test_harmonics_of_the_emf(flat_top_deg: float) -> None:
    """Harmonics over the fundamental equal the numeric Fourier sums of the trapezoid; a sine has none.

    Verifies: FRONT-01
    """
    pump = load_motor(ROOT / "motors" / "pump-4pp.toml").model_copy(update={"flat_top_deg": flat_top_deg})
    angles = [360 * (k + 0.5) / 7200 for k in range(7200)]
    sums = {n: sum(trapezoid(a, flat_top_deg) * math.sin(math.radians(n * a)) for a in angles) for n in (1, 3, 5, 7)}
    values = {v.key: v.value for v in derived_values(pump)}
    sine = {v.key: v.value for v in derived_values(pump.model_copy(update={"emf": "sinusoidal"}))}
    for n in (3, 5, 7):
        assert values[f"emf_harmonic_{n}_percent"] == pytest.approx(100 * sums[n] / sums[1], abs=1e-3)
        assert sine[f"emf_harmonic_{n}_percent"] == 0.0


@pytest.mark.parametrize("flat_top_deg", [170.0, 120.0, 90.0, 60.0])
def test_mean_line_flux_of_a_trapezoid(flat_top_deg: float) -> None:
    """The mean line EMF over a sector equals the numeric mean of the trapezoids of two phases.

    Verifies: FRONT-01
    """
    motor = load_motor(ROOT / "motors" / "pump-4pp.toml").model_copy(update={"flat_top_deg": flat_top_deg})
    n = 6000
    angles = [30 + 60 * (k + 0.5) / n for k in range(n)]
    mean = sum(trapezoid(a, flat_top_deg) - trapezoid(a - 120, flat_top_deg) for a in angles) / n
    assert motor.line_flux_vs == pytest.approx(motor.psi_vs[0] * mean, rel=1e-6)


def test_salient_machine() -> None:
    """L_d and L_q of the file; what knows one inductance only gets their mean.

    Verifies: FRONT-42
    """
    motor = load_motor(ROOT / "motors" / "ipm-4pp.toml")
    assert motor.inductance_q_h == pytest.approx(2 * motor.inductance_h[0])
    assert motor.mean_inductance_h == pytest.approx(0.3e-3)
    assert motor.self_inductance_h == pytest.approx((0.3e-3,) * 3)
    values = {v.key: v.value for v in derived_values(motor)}
    assert (values["inductance_d_h"], values["inductance_q_h"]) == pytest.approx((0.2e-3, 0.4e-3))
    assert values["electrical_time_constant_s"] == pytest.approx(0.3e-3 / 0.12)
    plain = {v.key: v.value for v in derived_values(load_motor(ROOT / "motors" / "motor-1.toml"))}
    assert plain["inductance_d_h"] == plain["inductance_q_h"] == pytest.approx(22e-6)


def test_mutual_inductance_gives_self_inductance() -> None:
    """Self minus mutual stays what the file states.

    Verifies: FRONT-01
    """
    motor = load_motor(ROOT / "motors" / "motor-1.toml").model_copy(update={"mutual_h": (-3e-6, -3e-6, -3e-6)})
    assert motor.self_inductance_h == pytest.approx((19e-6, 19e-6, 19e-6))


def test_speed_target_by_console_line() -> None:
    """`set speed_rpm` on the console is a target as the key is: for the plot and for the length of the zoom window.

    Verifies: FRONT-09
    """
    events = (
        '[{at_s=0.01,speed_rpm=60000},{at_s=0.02,command="start"},{at_s=0.3,command="set speed_rpm -20000"},'
        '{at_s=0.4,command="get speed_rpm"},{at_s=0.5,speed_rpm=30000}]'
    )
    reversal = load_scenario(DEMO, [f"event={events}", 'window=[{name="x",from_s=0.35,to_s=0.4}]', "expect=[]"])
    at = {t_s: reversal.speed_target_at(t_s) for t_s in (0.0, 0.1, 0.3, 0.45, 0.5)}
    assert at == {0.0: 0.0, 0.1: 60_000.0, 0.3: -20_000.0, 0.45: -20_000.0, 0.5: 30_000.0}
    begin_s, end_s = reversal.zoom_window_s()
    assert (end_s, end_s - begin_s) == (0.4, pytest.approx(2.5 * 60 / 20_000))


# ---- bad input


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("drive.carier_hz=1e4", '--set: drive.carier_hz: unknown key, did you mean "carrier_hz"?'),
        ("commutation=RSC", '--set: commutation: unknown key, did you mean "drive.commutation"?'),
        ("drive.commutation=CCS", "'CCS' is not permitted, permitted: RSC, NSC, CSC, did you mean \"CSC\"?"),
        ("drive.pattern=on-pwm", 'did you mean "ON-PWM"?'),
        ("drive.duty_max=1.2", "--set: drive.duty_max: 1.2 is out of range, permitted 0.05 to 1"),
        ("drive.carrier_hz=fast", "--set: drive.carrier_hz: must be a number, not 'fast'"),
        ("drive.sync_rect=1", "--set: drive.sync_rect: must be true or false, not 1"),
        ("drive=3", "--set: drive: must be a table, not 3"),
        ("seed=1.5", "--set: seed: must be a whole number, not 1.5"),
        (
            "motor.inductance_h=-1e-6",
            "--set: motor.inductance_h: -1e-06 H is out of range, permitted 1e-08 to 10 H",
        ),
        ("motor.resistance_ohm=[0.1,0.1,-1]", "--set: motor.resistance_ohm[2]: -1 Ohm is out of range"),
        ("motor.resistance_ohm=[0.1,0.1]", "must be a number or an array of 3 numbers"),
        ("motor.psi_vs=nan", "--set: motor.psi_vs: nan V*s/rad is out of range"),
        (
            "motor.mutual_h=-30e-6",
            "--set: motor.mutual_h: with inductance_h gives a self inductance of -8e-06 H",
        ),
        ("motor.mutual_h=[60e-6, -10e-6, -10e-6]", "not positive definite"),
        (
            "motor.inductance_q_h=20",
            "--set: motor.inductance_q_h: 20 H is out of range, permitted 1e-08 to 10 H",
        ),
        ("motor.pole_pairs=true", "--set: motor.pole_pairs: must be a whole number, not true"),
        ("motor.load.fan_speed_rpm=0", "--set: motor.load.fan_speed_rpm: 0 r/min is out of range"),
        (
            "inverter.min_pulse_s=1e-7",
            "--set: inverter.min_pulse_s: 1e-07 s is shorter than dead_time_s (2e-07 s)",
        ),
        (
            "inverter.sensing.voltage_full_scale_v=20",
            "does not cover supply_v times the largest divider gain (25 V)",
        ),
        ("inverter.sensing.conversion_s=2e-6", "is longer than sample_period_s"),
        ("inverter.protection.phase_current_a=60", "is not below sensing.current_full_scale_a (50 A)"),
        ("inverter.dc_link_f=0", "OK"),
        ("motor=motors/motor-3.toml", "--set: motor: file not found (motors/motor-3.toml)"),
        ("event=3", "--set: event: must be an array, not 3"),
        ("event.9.at_s=0.1", '--set: event: has no entry "9", permitted: 0 to 3'),
        ("window.nope.to_s=1", '--set: window: has no entry "nope", permitted: 0 to '),
        ("window.nope.to_s=1", ", steady, loaded"),
        ("expect[0].window=nope", 'no window is named "nope", permitted: steady, loaded'),
        ("name=1979-05-27", "--set: name: must be a string, not 1979-05-27"),
        ("drive.carrier_hz=1979-05-27T07:32:00Z", "must be a number, not 1979-05-27T07:32:00+00:00"),
        ('name=""', "--set: name: must not be empty"),
        ('window.steady.name="a b"', "window[0].name: may hold only letters, digits, _ and -, not 'a b'"),
        ("expect[0].min=nan", "--set: expect[0].min: must be a finite number, not nan"),
        (
            'mechanics={mode="imposed",profile=[[1]]}',
            "mechanics.profile[0]: must be a pair of numbers [time in s, speed in r/min] ([1])",
        ),
        (
            'mechanics={mode="imposed",profile=[[0,"a"]]}',
            "mechanics.profile[0][1]: must be a number, not 'a'",
        ),
        ('mechanics={mode="imposed",profile=[[0,nan]]}', "mechanics.profile: is out of range"),
        ('name="abc', '--set: name: "abc is not valid TOML'),
        ('name=abc"', '--set: name: abc" is not valid TOML'),
        ("window=[3", "--set: window: [3 is not valid TOML"),
        ("name=1\nseed=2", "--set: name: holds several lines"),
        ("expect_fault=start_faild", "'start_faild' is not permitted, permitted: parameter_magic, parameter_version,"),
        ("expect_fault=start_faild", ', did you mean "start_failed"?'),
        ("event[1].command=strat", '"strat" is no command of the drive, permitted: help, status, get, set, start,'),
        ("event[1].command=statu", ', did you mean "status"?'),
        (
            "event[1].command=set sped_rpm 1",
            'command: "sped_rpm" is no setting of the drive, did you mean "speed_rpm"?',
        ),
        ("event[1].command=set accel_rpm_per_s 1", 'did you mean "accel_rpm_s"?'),
        ("event[1].command=set xyz 1", '"xyz" is no setting of the drive, permitted: speed_rpm, accel_rpm_s, '),
        ("event[1].command=set duty 1", '"duty" is a value of the drive that cannot be set'),
        ("event[1].command=set speed_rpm", 'must have the form "set NAME VALUE"'),
        ("event[1].command=set speed_rpm 1 2", 'must have the form "set NAME VALUE"'),
        ("event[1].command=set speed_rpm -20000", "OK"),
        (
            "event[1].command=set speed_rpm abc",
            "--set: event[1].command: 'abc' is not permitted for speed_rpm, permitted: a whole number",
        ),
        ("event[1].command=set speed_rpm 2e4", "'2e4' is not permitted for speed_rpm, permitted: a whole number"),
        (
            "event[1].command=set commutation XSC",
            "'XSC' is not permitted for commutation, permitted: RSC, NSC, CSC, or 0 to 2",
        ),
        ("event[1].command=set commutation 3", "'3' is not permitted for commutation"),
        ("event[1].command=set commutation 2", "OK"),
        ("event[1].command=set pattern PWM-ON", "OK"),
        ("event[1].command=set freeze 2", "'2' is not permitted for freeze, permitted: 0 to 1"),
        ("event[1].command=set freeze 1", "OK"),
        ("event[1].command=set accel_rpm_s 0", "'0' is not permitted for accel_rpm_s, permitted: 1 to 100000000"),
        ("event[1].command=set accel_rpm_s 100000000", "OK"),
        (
            "event[1].command=set advance_q16 32768",
            "'32768' is not permitted for advance_q16, permitted: -32768 to 32767",
        ),
        ("event[1].command=set advance_q16 -32768", "OK"),
        (
            "event[1].command=set irq_load 499",
            "'499' is not permitted for irq_load, permitted: 0 or from 500 to 2147483647",
        ),
        ("event[1].command=set irq_load 500", "OK"),
        ("event[1].command=set irq_load 2147483647", "OK"),
        (
            "event[1].command=set irq_load 2147483648",
            "'2147483648' is not permitted for irq_load, permitted: 0 or from 500 to 2147483647",
        ),
        ("event[1].command=set irq_load 99999999999999", "'99999999999999' is not permitted for irq_load"),
        ("event[1].command=set carrier_hz 0", "'0' is not permitted for carrier_hz, permitted: 1 to 2147483647"),
        ("event[1].command=set carrier_hz -5", "'-5' is not permitted for carrier_hz"),
        ("event[1].command=set carrier_hz 2147483648", "'2147483648' is not permitted for carrier_hz"),
        (
            "event[1].command=set speed_rpm -2147483648",
            "'-2147483648' is not permitted for speed_rpm, permitted: a whole number of at most 2147483647 in size",
        ),
        (
            "event[1].command=set torque_mnm 2147483.648",
            "permitted: a number with at most three decimals, of at most 2147483.647 in size",
        ),
        (
            "event[1].command=set torque_mnm 1.2345",
            "'1.2345' is not permitted for torque_mnm, permitted: a number with at most three decimals",
        ),
        ("event[1].command=set torque_mnm 49.125", "OK"),
        ("event[1].command=set carrier_hz 40_000", "'40_000' is not permitted for carrier_hz"),
        ("event[1].command=get mesured_rpm", '"mesured_rpm" is no value of the drive, did you mean "measured_rpm"?'),
        ("event[1].command=get measured_rpm", "OK"),
        ("event[1].command=get", "OK"),
        ("event[1].command=stop later", 'must have the form "stop" or "stop now"'),
        ("event[1].command=stop now", "OK"),
        ("event[1].command=stärt", "--set: event[1].command: must be one line of at most 79 printable ASCII"),
        ('event[1].command=" "', '"" is no command of the drive'),
        ("event[0].at_s=0.0", "event[0].at_s: 0 s is too early for speed_rpm: the drive boots until 0.001 s"),
        ("inverter.supply_v=29.5", "sensing.voltage_full_scale_v: 30 V leaves no room for an over-voltage trip"),
        *(
            (f"inverter.protection.over_voltage_v={volts}", f"over_voltage_v: {volts} V is above 29.9854 V, two steps")
            for volts in (30, 29.997, 29.99)
        ),
        ("inverter.protection.over_voltage_v=29.985", "OK"),
        ("inverter.protection.under_voltage_v=0.005", "under_voltage_v: 0.005 V is below one step of the converter"),
        ("inverter.protection.under_voltage_v=0", "OK"),
        ("inverter.protection.over_voltage_v=25", "over_voltage_v: 25 V is not above supply_v (25 V)"),
        (f"inverter.brake_chopper={BRAKE % (25, 27)}", "brake_chopper.off_v: 25 V is not above supply_v (25 V)"),
        (f"inverter.brake_chopper={BRAKE % (26, 29.4)}", "on_v: 29.4 V is not below the over-voltage trip (29.4 V)"),
        (f"inverter.brake_chopper={BRAKE % (26, 26.02)}", "off_v: 26 V is less than 4 converter steps"),
        (f"inverter.brake_chopper={BRAKE % (26, 27)}", "OK"),
        (
            "inverter.protection.safe_state=short",
            "the short-circuit current of the motor (45.5 A) trips phase_current_a",
        ),
        ("inverter.protection.safe_state=on", "protection.safe_state: "),
        ("inverter.protection.under_voltage_v=25", "under_voltage_v: 25 V is not below supply_v (25 V)"),
        ("event[0].command=status", "--set: event[0]: needs exactly one action"),
        ("event[0].ramp_s=0.1", "event[0].ramp_s: has no meaning beside speed_rpm"),
        ("event[3].at_s=9", "--set: event[3].at_s: 9 s is after the end of the run (duration_s = "),
        ("window.steady.to_s=9", "--set: window[0].to_s: 9 s is after the end of the run"),
        ("window.steady.to_s=0.1", "is not after from_s"),
        ("window.loaded.name=steady", '"steady" names two windows'),
        ("expect[0].window=stedy", '"stedy"'),
        ("expect[0].metric=speed_rpm.avg", '"speed_rpm.avg" is no metric'),
        ("event[0].speed_rpm=200000", "200000 r/min is above max_speed_rpm of the motor (94000 r/min)"),
        ("drive.carrier_hz=4000", "is less than one carrier a sector at 60000 r/min, permitted from 6000 Hz"),
        ("inverter.min_pulse_s=10e-6", "leaves less than four minimum pulses"),
        ("drive.current_limit_a=46", "is not below protection.phase_current_a"),
        ("drive.current_limit_a=14", "permitted by drive.current_limit_a 14.0 A"),
        ("drive.start.current_a=31", "is above drive.current_limit_a (30 A)"),
        (
            "drive.start.carrier_hz=40001",
            "--set: drive.start.carrier_hz: 40001 Hz is above drive.carrier_hz (40000 Hz)",
        ),
        ("drive.start.carrier_hz=40000", "OK"),
        ("drive.hall.filter_s=1e-3", 'drive.hall.filter_s: has no effect with hall.mode = "off": set hall.mode, or'),
        ("drive.zcd.miss_limit=0", "drive.zcd.miss_limit: 0 is out of range, permitted 1 to 255"),
        (
            "drive.current_bandwidth_hz=186",
            "drive.current_bandwidth_hz: 186 Hz is out of range, permitted 1 to 185 Hz",
        ),
        ("drive.current_bandwidth_hz=185", "OK"),
        ("drive.hall.learn=true", 'drive.hall.learn: has no effect with hall.mode = "off": set hall.mode, or'),
        ("drive.hall.learn=false", 'drive.hall.learn: has no effect with hall.mode = "off": set hall.mode, or'),
        (
            "drive.brake_current_limit_a=5",
            "drive.brake_current_limit_a: has no effect without sync_rect = true: set it, or leave this out",
        ),
        (
            'event[0]={at_s=0.1,fault={kind="shorted_winding",phases=["A","A"]}}',
            "event[0].fault.phases: names A twice",
        ),
        ("drive.hall.offset_deg=5", 'drive.hall.offset_deg: has no effect with hall.mode = "off"'),
        (
            "inverter.sensing.sample_period_s=20e-6",
            "sample_period_s = 2e-05 s take 8.06e-05 s, permitted up to 12407 Hz",
        ),
        ("drive.motor_error.encoder_lines=1.1", "has no effect without an encoder that gives the frame its angle"),
        ("motor.encoder={lines=64, missing_lines=64}", "encoder.missing_lines: 64 leaves none of the encoder's lines"),
        ("drive.motor_error.encoder_offset_deg=9", "has no effect without an index that gives the frame its angle"),
        ("motor.hall.order=ABA", "motor.hall.order: 'ABA' is not permitted, permitted: ABC, ACB, BAC, BCA, CAB, CBA"),
        ("motor.hall={order='CAB', inverted=['A', 'C']}", "OK"),
        ("motor.hall.inverted=['B', 'B']", "motor.hall.inverted: names B twice"),
        ("motor.hall.inverted=['D']", "motor.hall.inverted[0]: 'D' is not permitted, permitted: A, B, C"),
        (
            "inverter.sensing.current_order=AAB",
            "inverter.sensing.current_order: 'AAB' is not permitted, permitted: ABC, ACB, BAC, BCA, CAB, CBA",
        ),
        ("inverter.sensing.current_inverted=['A', 'C']", "OK"),
        ("inverter.sensing.current_inverted=['B', 'B']", "sensing.current_inverted: names B twice"),
        ("inverter.sensing.unconnected=['va', 'va']", "sensing.unconnected: names va twice"),
        ("inverter.sensing.unconnected=['vdc']", "unconnected[0]: 'vdc' is not permitted, permitted: va, vb, vc, ia"),
        ("motor.hall.offset_deg=61", "motor.hall.offset_deg: 61 deg is out of range, permitted -60 to 60 deg"),
        ("inverter.sensing.sample_period_s=6e-6", "OK"),
        ("drive.advance_deg_at_max_speed=30", "OK"),
        ("drive.motor_error.flux=3", "drive.motor_error.flux: 3 is out of range, permitted 0.5 to 2"),
        ("drive.motor_error.psi=1.2", "drive.motor_error.psi: unknown key"),
        ("drive.zcd.sampling=once", "drive.zcd.sampling: 'once' is not permitted, permitted: continuous, carrier"),
        (
            "event[0].speed_rpm=-5000",
            "--set: event[0].speed_rpm: -5000 r/min is out of range, permitted 1 to 2000000 r/min; "
            'backward: command = "set speed_rpm -20000", to stop: command = "stop"',
        ),
        (
            "event[0].speed_rpm=3e6",
            "--set: event[0].speed_rpm: 3000000 r/min is out of range, permitted 1 to 2000000 r/min$",
        ),
        (
            "window={foo={to_s=1}}",
            "--set: window: must be an array of tables, [[window]] in a file, not {'foo': {'to_s'",
        ),
        ("mechanics.profile={a=1}", "--set: mechanics.profile: must be an array, not {'a': 1}"),
        ("nonsense", "--set: nonsense: must have the form key=value"),
        ("seed.x=1", "--set: seed.x: seed is not a table"),
        ("mechanics.mode=imposed", "mechanics.profile"),
        ("record.zoom_from_s=0.1", "zoom_from_s and zoom_to_s go together"),
        (
            'event[0]={at_s=0.1,fault={kind="fault_pin",phases=["A"]}}',
            'does not belong to kind = "fault_pin"',
        ),
        (
            'event[0]={at_s=0.1,fault={kind="shorted_winding"}}',
            "event[0].fault.phases: required key is missing",
        ),
    ],
)
def test_bad_values(override: str, expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One wrong key: a message with its place, its value and what is permitted.

    Verifies: FRONT-02, FRONT-03, FRONT-04, FRONT-05
    """
    monkeypatch.chdir(ROOT)
    if expected == "OK":
        load_scenario(DEMO, [override])
        return
    found = errors(override)
    ends = expected.endswith("$")
    assert any(line.endswith(expected[:-1]) if ends else expected in line for line in found), found


def test_torque_target_is_within_reach() -> None:
    """Motor-I gives 1.654 mN*m an ampere: 50 mN*m need 30.2 A, permitted are 30; braking needs the lower switches.

    Verifies: FRONT-04
    """
    torque = ("drive.mode=torque", "drive.current_loop=true")
    load_scenario(DEMO, [*torque, "drive.torque_mnm=49"])
    load_scenario(DEMO, [*torque, "drive.torque_mnm=-49", "drive.sync_rect=true"])
    text = "needs 30.2 A, permitted by drive.current_limit_a 30.0 A"
    assert errors(*torque, "drive.torque_mnm=50") == [f"--set: drive.torque_mnm: 50 mN*m {text}"]
    assert errors(*torque, "drive.torque_mnm=-10") == [
        "--set: drive.torque_mnm: -10 mN*m brakes: needs sync_rect = true"
    ]


def test_console_lines_within_reach() -> None:
    """Speeds, torques and currents of console lines keep the limits of the keys; a line may change the current's.

    Verifies: FRONT-03, FRONT-04
    """

    def found(*lines: str) -> list[str]:
        events = ",".join(f'{{at_s={0.1 + 0.01 * i:.2f},command="{line}"}}' for i, line in enumerate(lines))
        try:
            load_scenario(DEMO, [f"event=[{events}]"])
        except ConfigError as error:
            return [str(problem) for problem in error.problems]
        return []

    where = "--set: event[0].command:"
    top = "is above max_speed_rpm of the motor (94000 r/min)"
    assert found("set speed_rpm 94001") == [f"{where} 94001 r/min {top}"]
    assert found("set speed_rpm -94001") == [f"{where} -94001 r/min {top}"]
    assert found("set speed_rpm 60000", "set speed_rpm 0") == []
    limit = "permitted by the limit of the current, 30 A"
    assert found("set torque_mnm 49", "set sync_rect 1", "set torque_mnm -49", "set current_ma 30000") == []
    assert found("set torque_mnm 50") == [f"{where} 50 mN*m needs 30.2 A, {limit}"]
    assert found("set current_ma 30001") == [f"{where} 30001 mA is beyond the limit of the current, 30 A"]
    assert found("set current_limit_a 40", "set torque_mnm 50") == []
    lowered = found("set current_limit_a 10", "set torque_mnm 49")
    assert lowered == ["--set: event[1].command: 49 mN*m needs 29.6 A, permitted by the limit of the current, 10 A"]
    full = "permitted: above 0 up to sensing.current_full_scale_a of the inverter (50 A)"
    trip = "is not below protection.phase_current_a of the inverter (45 A)"
    assert found("set current_limit_a 44.999") == []
    assert found("set current_limit_a 45") == [f"{where} 45 A {trip}"]
    for name in ("current_limit_a", "dc_limit_a", "brake_limit_a"):
        assert found(f"set {name} 50") == ([f"{where} 50 A {trip}"] if name == "current_limit_a" else [])
        assert found(f"set {name} 50.001") == [f"{where} 50.001 A is not permitted, {full}"]
        assert found(f"set {name} 0") == [f"{where} 0 A is not permitted, {full}"]


def test_console_lines_that_need_another_setting() -> None:
    """Braking torque and torque mode need what the keys need; the lines before may have set it, or taken it away.

    Verifies: FRONT-03, FRONT-04
    """

    def found(overrides: tuple[str, ...], *lines: str) -> list[str]:
        events = ",".join(f'{{at_s={0.1 + 0.01 * i:.2f},command="{line}"}}' for i, line in enumerate(lines))
        try:
            load_scenario(DEMO, [f"event=[{events}]", *overrides])
        except ConfigError as error:
            return [str(problem).removeprefix("--set: ") for problem in error.problems]
        return []

    brakes = "brakes: needs drive.sync_rect = true, or set sync_rect 1 before"
    assert found((), "set torque_mnm -5") == [f"event[0].command: -5 mN*m {brakes}"]
    assert found((), "set current_ma -5") == [f"event[0].command: -5 mA {brakes}"]
    assert found(("drive.sync_rect=true",), "set torque_mnm -5", "set current_ma -5") == []
    lost = found(("drive.sync_rect=true",), "set sync_rect 0", "set torque_mnm -5")
    assert lost == [f"event[1].command: -5 mN*m {brakes}"]
    needs = "torque mode needs drive.current_loop = true, or set current_loop 1 before"
    assert found((), "set mode torque") == [f"event[0].command: {needs}"]
    assert found((), "set mode 1") == [f"event[0].command: {needs}"]
    assert found((), "set mode speed", "set current_loop 1", "set mode torque") == []
    loop = ("drive.current_loop=true",)
    assert found(loop, "set mode torque", "set mode speed", "set current_loop 0") == []
    needed = "event[1].command: the torque mode needs the current loop: set mode speed before"
    assert found(loop, "set mode torque", "set current_loop 0") == [needed]
    # Whatever drive.mode asks for is the mode until a line changes it.
    assert found((*loop, "drive.mode=torque"), "set mode speed", "set current_loop 0") == []
    brake = ("drive.brake_current_limit_a=5",)
    assert found(brake, "set sync_rect 1") == []
    assert len(found(brake, "set sync_rect 0")) == 1


def test_imposed_speed_begins_at_the_initial_speed() -> None:
    """A stated initial speed and an imposed profile must agree at time 0; without one the profile counts.

    Verifies: FRONT-03
    """
    imposed = 'mechanics={mode="imposed",profile=[[0,20000],[1,60000]]}'
    late = 'mechanics={mode="imposed",profile=[[0.5,20000],[1,60000]]}'
    for profile in (imposed, late):
        load_scenario(DEMO, [profile])
        load_scenario(DEMO, [profile, "initial.speed_rpm=20000"])
        assert errors(profile, "initial.speed_rpm=10000") == [
            "--set: initial.speed_rpm: 10000 r/min is not where mechanics.profile begins (20000 r/min); set it to "
            "that, or leave it out"
        ]


def test_advances_within_their_limit() -> None:
    """The three parts may not come to more than 30 degrees anywhere: the drive would cut them off.

    Verifies: FRONT-04
    """
    load_scenario(DEMO, ["drive.advance_deg=-10", "drive.advance_deg_at_max_speed=30"])
    found = errors("drive.advance_deg=20", "drive.advance_deg_at_max_speed=8", "drive.advance_deg_at_rated_current=4")
    assert len(found) == 1 and "comes to 32 deg, permitted -30 to 30 deg" in found[0]
    found = errors(
        "drive.advance_deg=-20", "drive.advance_deg_at_max_speed=30", "drive.advance_deg_at_rated_current=-11"
    )
    assert len(found) == 1 and "comes to -31 deg" in found[0]


def test_unreachable_speed_states_both_voltages() -> None:
    """A supply that is too low for the speed: required and available voltage are in the message.

    Verifies: FRONT-04
    """
    found = errors("inverter.supply_v=10")
    assert len(found) == 1
    assert "event[0].speed_rpm: 60000 r/min with 0.02 N*m needs at least 12.6 V" in found[0]
    assert "available 10.0 V" in found[0]
    # The load step alone may ask too much.
    found = errors("inverter.supply_v=12.8")
    assert len(found) == 1 and "event[2].load_factor: 60000 r/min with 0.025 N*m needs at least 13.2 V" in found[0]


def test_current_that_hides_the_crossing() -> None:
    """A load under which freewheeling lasts until the crossing: the drive would keep to less current and less speed.

    The limit beside it is worked out here from the theory page: 60 000 r/min of a pole pair are sectors of 166.7 us,
    11 us of their half stay free. EMF 10.5 V and a need of 16 V are within a tenth.

    Verifies: FRONT-04, FW-72
    """
    coil = "motor.inductance_h=[70e-6,70e-6,70e-6]"
    found = errors(coil)
    assert len(found) == 1
    said = re.search(
        r"event\[2\]\.load_factor: .* needs 15\.1 A, but freewheeling hides the crossing above ([\d.]+) A", found[0]
    )
    assert said and "(a higher supply_v helps)" in found[0]
    limit_a = (166.7e-6 / 2 - 11e-6) / 70e-6 * ((2 * 25 - 16) / 3 + 0.15 * 10.5)
    assert float(said[1]) == pytest.approx(limit_a, rel=0.1)
    load_scenario(DEMO, [coil, "drive.freewheel_limit=false"])
    load_scenario(DEMO, [coil, "drive.zcd.compute_back=true"])
    # The other patterns have less against the current, whatever the supply: their own pulse.
    (other,) = errors(coil, 'drive.pattern="H_PWM-L_ON"')
    assert "event[0].speed_rpm" in other and '(drive.pattern = "ON-PWM" helps)' in other
    # In sectors of 200 us crossings can also be computed back.
    coil = "motor.inductance_h=[150e-6,150e-6,150e-6]"
    (slow,) = errors(coil, "event[0].speed_rpm=50000")
    assert "(a higher supply_v or drive.zcd.compute_back = true helps)" in slow
    # A supply that is too low for the speed drives no current backwards.
    (low,) = errors(coil, "inverter.supply_v=5", 'accept=[{what="voltage",why="shown"}]')
    assert "above -" not in low


def test_limit_that_hides_the_crossing_is_the_firmwares() -> None:
    """The check before the run and the drive keep to the same numbers.

    Verifies: FW-72
    """
    source = (ROOT / "sw" / "drive" / "six_step" / "regulate.c").read_text()
    stated = dict(re.findall(r"^#define FREEWHEEL_(\w+) (\d+)u?$", source, re.MULTILINE))
    checked = {
        "ROOM_CYCLES": round(reach.FREEWHEEL_ROOM_S * CLOCK_HZ),
        "BACK_X16": reach.FREEWHEEL_BACK * 16,
        "EMF_Q16": round(reach.FREEWHEEL_EMF * 2**16),
    }
    assert {name: int(value) for name, value in stated.items()} == checked
    assert reach.FREEWHEEL_SECTOR == 1 / 16 and "sector_cycles / 16u, sector_cycles / 4u" in source


def test_speed_out_of_reach_on_purpose() -> None:
    """Stated by `[[accept]]` or by the option a target may need more than a limit gives; the others still hold.

    Verifies: FRONT-04, FRONT-67
    """

    def accept(limit: str) -> str:
        return f'accept=[{{what="{limit}",why="shown"}}]'

    low, little = "inverter.supply_v=12", "drive.current_limit_a=11"
    load_scenario(DEMO, [low, accept("voltage")])
    load_scenario(DEMO, [little, accept("current")])
    assert '[[accept]] what = "current", or --allow-overload' in errors(little, accept("voltage"))[0]
    assert 'on purpose: [[accept]] what = "voltage"' in errors(low, accept("current"))[0]
    allowed = load_scenario(DEMO, [little], allow_overload=True)
    assert [(a.what, a.why) for a in allowed.accept if a.why == "--allow-overload"] == [("current", "--allow-overload")]
    assert overloads(allowed) == [
        "event[0].speed_rpm: 60000 r/min with 0.02 N*m needs 12.1 A, permitted by drive.current_limit_a 11.0 A",
        "event[2].load_factor: 60000 r/min with 0.025 N*m needs 15.1 A, permitted by drive.current_limit_a 11.0 A",
    ]
    assert overloads(load_scenario(DEMO, [], allow_overload=True)) == []
    with pytest.raises(ConfigError, match="above max_speed_rpm"):
        load_scenario(DEMO, [little, "event[0].speed_rpm=200000"], allow_overload=True)


def test_hall_filter_is_shorter_than_a_sector() -> None:
    """A filter that swallows whole sectors at the over-speed limit, 1.25 x 94 000 r/min: 1/6 of 60 s / 117 500.

    Verifies: FRONT-04
    """
    hall = ROOT / "scenarios" / "six-step" / "hall.toml"
    load_scenario(hall, ["drive.hall.filter_s=84e-6"])
    assert errors("drive.hall.filter_s=86e-6", path=hall) == [
        "--set: drive.hall.filter_s: 8.6e-05 s is not below a sector at the over-speed limit of 117500 r/min "
        "(8.51064e-05 s)"
    ]


def test_one_line_for_one_unreachable_speed() -> None:
    """Above the machine's limit, or short of voltage and current: one line each time.

    Verifies: FRONT-04
    """
    assert errors("event[0].speed_rpm=200000") == [
        "--set: event[0].speed_rpm: 200000 r/min is above max_speed_rpm of the motor (94000 r/min)"
    ]
    found = errors("inverter.supply_v=10", "drive.current_limit_a=11")
    assert len(found) == 1 and "needs at least 12.6 V" in found[0] and "and needs 12.1 A" in found[0]


def test_shortened_run_names_what_is_beyond_its_end() -> None:
    """One message with all entries after the end, and what to do; one entry alone keeps its key.

    Verifies: FRONT-04
    """
    arrays = [
        "event=[{at_s=0.01,speed_rpm=60000},{at_s=0.4,command='status'},{at_s=1,load_factor=1.1,ramp_s=0.1}]",
        "window=[{name='steady',from_s=0.4,to_s=0.6}]",
        "expect=[{window='steady',metric='late_crossings',max=0}]",
    ]
    assert errors("duration_s=0.5", *arrays) == [
        "--set: duration_s: 0.5 s ends before event[2].ramp_s (1.1 s), window[0].to_s (0.6 s); set duration_s to at "
        "least 1.1 s, or change these, all at once with --set 'event=[...]' --set 'window=[...]' --set 'expect=[...]'"
    ]
    assert errors("window.loaded.to_s=9") == [
        "--set: window[1].to_s: 9 s is after the end of the run (duration_s = "
        f"{load_scenario(DEMO).duration_s:g} s); set duration_s to at least 9 s or this earlier"
    ]
    load_scenario(DEMO, ["duration_s=0.5", "event=[{at_s=0.01,speed_rpm=60000}]", "window=[]", "expect=[]"])


def test_duty_limit_takes_voltage_away() -> None:
    """The voltage that is available is the supply times the largest duty; CSC makes 7 of 6.67 carriers a sector.

    Verifies: FRONT-04
    """
    assert any("available 10.5 V" in line for line in errors("drive.duty_max=0.4"))
    assert any("available 10.0 V" in line for line in errors("drive.duty_max=0.4", "drive.commutation=RSC"))


def test_all_problems_at_once() -> None:
    """Problems of all three files come in one go.

    Verifies: FRONT-02
    """
    found = errors("motor.inductance_h=-1", "inverter.supply_v=-1", "drive.duty_max=2", "name=3", "nonsense")
    assert {line.split(": ")[1] for line in found} == {
        "motor.inductance_h",
        "inverter.supply_v",
        "drive.duty_max",
        "name",
        "nonsense",
    }


def test_problems_in_files_name_the_file(copy: Path) -> None:
    """A key in a file is reported under that file's name, without the prefix of the scenario.

    Verifies: FRONT-02
    """
    edit(copy / "motors" / "motor-1.toml", "inductance_h = 22e-6", "inductance_h = -22e-6\ninductence = 1")
    edit(copy / "inverters" / "bench-25v.toml", "dead_time_s = 200e-9\n", "")
    edit(copy / "scenarios" / "demo.toml", "carrier_hz = 40_000", 'carrier_hz = "40k"')
    found = errors(path=copy / "scenarios" / "demo.toml")
    assert sorted(found) == [
        "bench-25v.toml: dead_time_s: required key is missing",
        "demo.toml: drive.carrier_hz: must be a number, not '40k'",
        "motor-1.toml: inductance_h: -2.2e-05 H is out of range, permitted 1e-08 to 10 H",
        'motor-1.toml: inductence: unknown key, did you mean "inductance_h"?',
    ]


def test_missing_and_broken_files(copy: Path) -> None:
    """Files that are not there, are folders, or are not TOML.

    Verifies: FRONT-02, FRONT-03
    """
    scenarios = copy / "scenarios"
    assert errors(path=scenarios / "dmo.toml") == ['dmo.toml: file not found, did you mean "demo.toml"?']
    assert errors(path=scenarios) == ["scenarios: is a folder, not a file"]
    # Of other kinds or names: no hint.
    shutil.copy(ROOT / "pyproject.toml", scenarios)
    assert errors(path=scenarios / "project.toml") == ["project.toml: file not found"]
    assert errors(path=scenarios / "motor.toml") == ["motor.toml: file not found"]
    edit(scenarios / "demo.toml", 'motor = "../motors/motor-1.toml"', 'motor = "../motors/motor1.toml"')
    found = errors(path=scenarios / "demo.toml")
    assert len(found) == 1
    assert found[0].startswith("demo.toml: motor: file not found") and 'did you mean "motor-1.toml"?' in found[0]
    (copy / "motors" / "motor1.toml").write_text("name = ", encoding="utf-8")
    assert errors(path=scenarios / "demo.toml")[0].startswith("motor1.toml: is not valid TOML: ")
    (copy / "motors" / "motor1.toml").write_bytes(b"name = '\xff'")
    assert errors(path=scenarios / "demo.toml")[0].startswith("motor1.toml: cannot be read")
    edit(scenarios / "demo.toml", 'motor = "../motors/motor1.toml"\n', "")
    assert errors(path=scenarios / "demo.toml") == ["demo.toml: motor: required key is missing: path of the motor file"]


def test_file_of_another_kind(copy: Path) -> None:
    """A motor file where a scenario is wanted, and so on: one line that says so.

    Verifies: FRONT-01
    """
    motor, scenario = copy / "motors" / "motor-1.toml", copy / "scenarios" / "demo.toml"
    assert errors(path=motor) == ["motor-1.toml: is a motor file, not a scenario"]
    with pytest.raises(ConfigError, match=r"demo\.toml: is a scenario, not a motor file$"):
        load_motor(scenario)
    edit(scenario, "../inverters/bench-25v.toml", "../motors/motor-1.toml")
    assert errors(path=scenario) == ["motor-1.toml: is a motor file, not an inverter file"]


@pytest.mark.parametrize(
    ("change", "begin"),
    [
        ({"inductance_h": (22e-3,) * 3}, "inductance_h, resistance_ohm: L/R is 1.1 s"),
        ({"inductance_h": (22e-9,) * 3}, "inductance_h, resistance_ohm: L/R is 1.1e-06 s"),
        ({"psi_vs": (1.0,) * 3}, "psi_vs: the line EMF at max_speed_rpm is"),
        ({"psi_vs": (1e-6,) * 3}, "psi_vs: the line EMF at max_speed_rpm is"),
    ],
)
def test_implausible_units_are_warned_of(change: dict[str, object], begin: str) -> None:
    """Values a thousand times off are named by their own key.

    Verifies: FRONT-01
    """
    motor = load_motor(ROOT / "motors" / "motor-1.toml")
    found = warnings(motor.model_copy(update=change))
    assert any(line.startswith(begin) for line in found), found
    assert not any(line.startswith("inertia") for line in found)


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_implausible_inertia_is_warned_of(factor: float) -> None:
    """An inertia that gives a run-up time no machine has: value, time and a likely value are in the line.

    Verifies: FRONT-01
    """
    motor = load_motor(ROOT / "motors" / "motor-1.toml")
    found = warnings(motor.model_copy(update={"inertia_kgm2": factor * motor.inertia_kgm2}))
    assert len(found) == 1
    # J * omega / T = 5e-7 * 9844 / 0.0496 s = 0.099 s for the shipped file.
    seconds = f"{0.0992 * factor:.2g}"
    assert f"reaches max_speed_rpm in {seconds} s, usual 0.003 to 10 s" in found[0]
    assert "0.1 s would be 5e-07 kg*m^2" in found[0]


def test_implausible_saliency_is_warned_of() -> None:
    """L_q given in another unit than L_d.

    Verifies: FRONT-01, FRONT-42
    """
    motor = load_motor(ROOT / "motors" / "ipm-4pp.toml")
    found = warnings(motor.model_copy(update={"inductance_q_h": 0.4}))
    assert found[0] == "inductance_q_h: L_q/L_d is 2e+03, usual 0.5 to 10; check the units"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            "inductance_h = [0.2e-3, 0.2e-3, 0.3e-3]",
            "inductance_h: [0.0002, 0.0002, 0.0003] H must be one number, that of the d axis, with inductance_q_h",
        ),
        (
            "inductance_h = 0.2e-3\nmutual_h = -1e-5",
            "mutual_h: -1e-05 H does not go with inductance_q_h; leave one of them out",
        ),
        (
            "inductance_h = 0.2e-3\nmutual_h = [-1e-5, 0.0, 0.0]",
            "mutual_h: [-1e-05, 0, 0] H does not go with inductance_q_h; leave one of them out",
        ),
    ],
)
def test_salient_machine_has_two_inductances(copy: Path, change: str, expected: str) -> None:
    """Values a phase and mutual inductances beside L_q are refused by key and value.

    Verifies: FRONT-03, FRONT-42
    """
    path = copy / "motors" / "ipm-4pp.toml"
    edit(path, "inductance_h = 0.2e-3  # L_d", change)
    with pytest.raises(ConfigError) as caught:
        load_motor(path)
    assert [f"{p.key}: {p.message}" for p in caught.value.problems] == [expected]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("lines = 0", "encoder.lines: 0 is out of range, permitted 1 to 65536"),
        ("lines = 1024.5", "encoder.lines: must be a whole number, not 1024.5"),
        (
            "lines = 40_000",
            "encoder.lines: 40000 gives 1.07e+07 edges/s at max_speed_rpm, above 8e+06 edges/s; "
            "permitted up to 30000 lines",
        ),
        ("lines = 1024\nindex = 1", "encoder.index: must be true or false, not 1"),
        (
            "pulses = 1024\nlines = 1024",
            "encoder.pulses: unknown key, permitted: lines, inverted, index, missing_lines, offset_deg",
        ),
        ("index = true", "encoder.lines: required key is missing"),
    ],
)
def test_encoder_is_checked(copy: Path, line: str, expected: str) -> None:
    """Wrong encoder tables are refused by key, limits and value.

    Verifies: FRONT-03, FRONT-43
    """
    path = copy / "motors" / "ipm-4pp.toml"
    edit(path, "lines = 1024\n", f"{line}\n")
    with pytest.raises(ConfigError) as caught:
        load_motor(path)
    assert [f"{p.key}: {p.message}" for p in caught.value.problems] == [expected]


def test_encoder_at_its_limit(copy: Path) -> None:
    """The number of lines that the message permits is permitted.

    Verifies: FRONT-43
    """
    path = copy / "motors" / "ipm-4pp.toml"
    edit(path, "lines = 1024\n", "lines = 30_000\nindex = false\n")
    encoder = load_motor(path).encoder
    assert encoder is not None and (encoder.lines, encoder.index, encoder.offset_deg) == (30_000, False, 37.0)


# ---- overrides


def test_overrides_reach_everything(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenario, motor and inverter keys, array entries, windows by name, whole files, new tables.

    Verifies: FRONT-05
    """
    monkeypatch.chdir(ROOT)
    s = load_scenario(
        DEMO,
        [
            "drive.commutation=RSC",
            "drive.zcd.method=first",
            "motor=motors/motor-2.toml",
            "motor.psi_vs=1e-3",
            "inverter.sensing.divider_gain=[1.1, 1.0, 0.9]",
            "window.loaded.to_s=0.865",
            "event[2].load_factor=1.1",
            "load.fan_torque_nm=0.002",
            "drive.current_limit_a=9",
            "record.period_s=20e-6",
        ],
    )
    assert s.drive.commutation == "RSC" and s.drive.zcd.method == "first"
    assert s.motor.name == "Motor-II" and s.motor.psi_vs == (1e-3,) * 3
    assert s.inverter.sensing.divider_gain == (1.1, 1.0, 0.9)
    assert s.window[1].to_s == 0.865 and s.event[2].load_factor == 1.1
    assert s.record.period_s == 20e-6
    assert Path(s.sources.motor).name == "motor-2.toml"


def test_defaults_that_follow_from_other_files() -> None:
    """Load, current limit and slope come from the motor where the scenario states none.

    Verifies: FRONT-05
    """
    s = load_scenario(ROOT / "scenarios" / "own-pump.toml")
    assert s.shaft_load == s.motor.load
    assert s.current_limit_a == s.motor.rated_dc_current_a == pytest.approx(12, rel=1e-3)
    expected = 0.25 * s.motor.rated_torque_nm / s.motor.inertia_kgm2 * 30 / math.pi
    assert s.accel_rpm_per_s == pytest.approx(expected)


def test_override_of_an_entry_that_no_file_has(copy: Path) -> None:
    """`--set window.foo.to_s` where the scenario has no windows: it says so, and how to give one.

    Verifies: FRONT-03, FRONT-05
    """
    scenario = copy / "scenarios" / "demo.toml"
    text = scenario.read_text(encoding="utf-8")
    scenario.write_text(text.partition("[[window]]")[0], encoding="utf-8")
    assert errors("window.foo.to_s=1", path=scenario) == [
        '--set: window: has no entry "foo", the scenario has no [[window]]; give whole entries with '
        "--set 'window=[{...}]'"
    ]


def test_words_are_those_of_the_other_parts() -> None:
    """Trip causes, channels, commutations, patterns and commands are the words of analysis, plant and firmware.

    Verifies: FRONT-05
    """
    assert get_args(TripCause) == TRIP_CAUSES
    assert get_args(Channel) == CHANNEL_NAMES
    assert get_args(DriveFault) == fault_names()
    console = (ROOT / "sw" / "console" / "console.c").read_text(encoding="utf-8")
    assert set(re.findall(r'text_equal\(name, "(\w+)"\)', console)) == set(COMMANDS)
    assert f"#define LINE_LENGTH {COMMAND_LENGTH + 1}u" in console


# ---- reference page


def test_reference_page_is_up_to_date() -> None:
    """The committed page is what the models give now, and names every key.

    Verifies: FRONT-08
    """
    assert PAGE.read_text(encoding="utf-8") == page()
    for key in ("inductance_h", "voltage_full_scale_v", "carrier_hz", "turns_fraction", "zoom_from_s"):
        assert f"| `{key}` |" in page()
