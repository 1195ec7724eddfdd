# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Vector control in scenario files: what is refused, and what the firmware is told."""

from __future__ import annotations

import math
import re
from pathlib import Path
from random import Random

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, Inverter, Motor, Scenario, load_scenario
from fluxlock.config.vector_timing import default_delay, shortest_delay, update_hz, update_hz_max, vector_timing
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware import ParameterBlock, compile_parameters
from fluxlock.generate.memory import BLOCK_MAX_BYTES
from fluxlock.theory.vector.pll import pll_gains
from tests.firmware import machines
from tests.firmware.test_fw_parameters import INVERTERS, MOTORS, told
from tests.firmware.vector_float import Subspace

START = ROOT / "tests" / "config" / "scenarios" / "vector.toml"
DEMO = ROOT / "scenarios" / "demo.toml"
SEED = 31


def errors(*overrides: str, path: Path = START) -> list[str]:
    """Problems of a scenario with overrides, without the file."""
    with pytest.raises(ConfigError) as caught:
        load_scenario(path, overrides)
    return [f"{p.key}: {p.message}" for p in caught.value.problems]


# ---- keys of the other method


def test_keys_of_six_step_with_vector() -> None:
    """Each key of six-step operation is refused by name, also those that state the default; shared ones pass.

    Verifies: VCONF-01
    """
    belongs = 'belongs to drive.method = "six-step", the scenario has "vector"; leave it out'
    given = {
        "commutation": "CSC",
        "sync_rect": "false",
        "duty_max": "0.9",
        "speed_bandwidth_hz": "10",
        "zcd.method": "first",
        "hall.mode": "sensored",
        "start.carrier_hz": "8000",
        "start.current_a": "5",
    }
    named = ["commutation", "sync_rect", "duty_max", "speed_bandwidth_hz", "zcd", "hall", "start.current_a"]
    found = errors(*(f"drive.{key}={value}" for key, value in given.items()))
    assert sorted(found) == sorted(f"drive.{key}: {belongs}" for key in [*named, "start.carrier_hz"])
    load_scenario(
        START,
        ["drive.start.retries=1", "drive.start.catch=false", "drive.motor_error.flux=0.9", "drive.current_limit_a=35"],
    )


def test_keys_of_vector_with_six_step() -> None:
    """[drive.vector] without its method, and metrics of either method with the other one.

    Verifies: VCONF-01
    """
    text = 'belongs to drive.method = "vector", the scenario has "six-step"; set drive.method or leave it out'
    assert errors("drive.vector.gamma=0.3", path=DEMO) == [f"drive.vector: {text}"]
    wrong = 'expect[0].metric: "{}" belongs to drive.method = "{}", the scenario has "{}"'
    assert errors("expect[0].metric=angle_error_deg.rms", path=DEMO) == [
        wrong.format("angle_error_deg.rms", "vector", "six-step")
    ]
    for metric in ("late_crossings", "zcp_error_deg.rms"):
        assert errors(f"expect[0].metric={metric}") == [wrong.format(metric, "six-step", "vector")]


# ---- what cannot work


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["drive.method=foc"], "drive.method: 'foc' is not permitted, permitted: six-step, vector"),
        (["drive.vector.delay=1.1"], "drive.vector.delay: 1.1 is out of range, permitted 0 to 1"),
        (["drive.vector.pll_order=4"], "drive.vector.pll_order: 4 is out of range, permitted 2 to 3"),
        (["drive.vector.observer_pol=0.7"], 'drive.vector.observer_pol: unknown key, did you mean "observer_pole"?'),
        (
            ["drive.vector.regulator=A", "drive.vector.gamma=0.3"],
            'drive.vector.gamma: does not belong to regulator = "A"',
        ),
        (["drive.vector.bandwidth_hz=500"], 'drive.vector.bandwidth_hz: does not belong to regulator = "C"'),
        (
            ["drive.carrier_hz=60e3"],
            'drive.carrier_hz: 60000 Hz with drive.vector.update = "double" needs 120000 regulator steps a second, '
            "permitted 100000: carrier up to 50000 Hz",
        ),
        (
            ["drive.vector.current_regulator=c"],
            'drive.carrier_hz: 20000 Hz with drive.vector.update = "double" needs 40000 regulator steps a second on '
            'the core (drive.vector.current_regulator = "c"), permitted 20000: carrier up to 10000 Hz',
        ),
        (
            ["drive.carrier_hz=10e3", "drive.vector.current_regulator=c", "drive.vector.delay=0.2"],
            "drive.vector.delay: 0.2 is shorter than what the chip needs: window, conversion, 600 clocks and the way "
            "to the gates take 0.250 of T_s = 50 us, permitted 0.25 to 1",
        ),
        (
            ["drive.vector.delay=0.05"],
            "drive.vector.delay: 0.05 is shorter than what the chip needs: window, conversion, 83 clocks and the way "
            "to the gates take 0.086 of T_s = 25 us, permitted 0.087 to 1",
        ),
        (
            ["drive.vector.window=carrier", "drive.vector.delay=0.55"],
            "drive.vector.delay: 0.55 is shorter than what the chip needs: window, conversion, 83 clocks and the way "
            "to the gates take 0.566 of T_s = 25 us, permitted 0.567 to 1",
        ),
        (
            ["drive.carrier_hz=1500", "drive.vector.window=carrier", "event=[]"],
            'drive.vector.window: "carrier" takes 333 samples in T_s = 333.3 us at inverter.sensing.sample_period_s = '
            "1e-06 s, permitted 2 to 255",
        ),
        (
            ["drive.carrier_hz=50e3", "inverter.sensing.conversion_s=10e-6", "inverter.sensing.sample_period_s=10e-6"],
            'drive.carrier_hz: 50000 Hz with drive.vector.update = "double" leaves no room for a delay of at most T_s: '
            "window, conversion, 83 clocks and the way to the gates take 11.8 us, T_s is 10 us; lower the carrier or "
            "take single update",
        ),
        (
            ["drive.vector.observer_every=1"],
            "drive.vector.observer_every: 1 gives a control tick of 40000 Hz, permitted 25000 Hz: at least 2",
        ),
        (
            ["motor.inductance_h=0.5e-6"],
            "drive.carrier_hz: 20000 Hz gives a control tick of 50 us, longer than 1.9 times L/R of the motor "
            "(22.7 us); it runs with inductance_h from 5.79e-07 H",
        ),
        (
            ["drive.vector.regulator=A", "drive.vector.bandwidth_hz=7000"],
            "drive.vector.bandwidth_hz: 7000 Hz is too fast for 40000 samples a second, permitted up to 6000 Hz",
        ),
        (
            ["drive.vector.pll_hz=2000"],
            "drive.vector.pll_hz: 2000 Hz is too fast for a control tick of 20000 Hz with drive.vector.observer_pole "
            "= 0.7, permitted up to 1800 Hz",
        ),
        (
            ["drive.vector.speed_hz=60", "drive.vector.pll_hz=200"],
            "drive.vector.speed_hz: 60 Hz with drive.vector.pll_hz = 200 Hz leaves a phase margin of 0 degrees, "
            "permitted from 30 on; left out, both come by rule: 25.2 Hz and 335 Hz with 62 degrees",
        ),
        (
            ["drive.vector.start_current_a=40"],
            "drive.vector.start_current_a: 40 A is above drive.current_limit_a (36 A)",
        ),
        (
            ["drive.vector.handover_rpm=95000"],
            "drive.vector.handover_rpm: 95000 r/min is above max_speed_rpm of the motor (94000 r/min)",
        ),
        (
            ["drive.vector.handover_rpm=300"],
            "drive.vector.handover_rpm: 300 r/min has an EMF of 31.4 mV, less than 10 steps of the converter, "
            "permitted from 700 r/min",
        ),
        (
            ["drive.vector.start_accel_rpm_per_s=600000"],
            "drive.vector.start_accel_rpm_per_s: the start needs 0.491 mN*m for the load at 9400 r/min and 31.4 mN*m "
            "to accelerate by 600000 r/min/s, 11.578 A pull with at most 15.6 mN*m",
        ),
        (
            ["load.coulomb_nm=0.02", "event=[]"],
            "drive.vector.start_current_a: the start needs 20.5 mN*m for the load at 9400 r/min and 5.21 mN*m to "
            "accelerate by 99506 r/min/s, 11.578 A pull with at most 15.6 mN*m",
        ),
        (
            ["drive.vector.observer_every=9", "event.2.command=stop"],
            "event[0].speed_rpm: 90000 r/min turns the rotor by 0.34 of an electrical turn in a control tick, "
            "permitted 0.25; raise drive.carrier_hz or lower drive.vector.observer_every",
        ),
        (
            ["drive.current_limit_a=29", "event.2.command=stop"],
            "event[0].speed_rpm: 90000 r/min with 0.045 N*m needs 30.0 A, permitted by drive.current_limit_a 29.0 A; "
            'on purpose: [[accept]] what = "current", or --allow-overload',
        ),
    ],
)
def test_what_cannot_work(overrides: list[str], expected: str) -> None:
    """One line a cause: key, value, what is permitted.

    Verifies: VCONF-02
    """
    assert errors(*overrides) == [expected]


def test_value_of_the_option_is_charged_to_it() -> None:
    """What `--set` gave is named as `--set`, with the key as it was given; what a file holds is named by the file.

    Verifies: FRONT-05
    """
    encoder = ROOT / "scenarios" / "vector" / "encoder.toml"
    for path, override, key in (
        (encoder, "motor.encoder.lines=2", "motor.encoder.lines"),
        (START, "drive.carrier_hz=900", "drive.carrier_hz"),
        (START, "drive.vector.pll_hz=5000", "drive.vector.pll_hz"),
    ):
        with pytest.raises(ConfigError) as caught:
            load_scenario(path, [override])
        assert ("--set", key) in {(p.file, p.key) for p in caught.value.problems}, caught.value.problems
    with pytest.raises(ConfigError) as caught:
        load_scenario(START, ["motor.max_speed_rpm=500"])
    assert {p.file for p in caught.value.problems} != {"--set"}


def test_console_settings_of_six_step() -> None:
    """Lines that set what vector control does not have are refused before the run.

    Verifies: VCONF-01
    """
    events = (
        '[{at_s=0.01,command="set balance 1"},{at_s=0.02,command="set accel_rpm_s 9000"},{at_s=0.03,command="start"}]'
    )
    assert errors(f"event={events}") == [
        'event[0].command: "balance" is no setting of vector control, permitted: speed_rpm, accel_rpm_s, '
        "current_limit_a, brake_limit_a, catch, command_timeout_ms, irq_load, check_wiring"
    ]


def test_permitted_values_are_permitted() -> None:
    """What the messages name as the limit passes.

    Verifies: VCONF-02
    """
    for limits in (
        ["drive.carrier_hz=50e3"],
        ["drive.vector.delay=0.1"],
        ["drive.vector.window=carrier", "drive.vector.delay=0.58"],
        ["drive.vector.observer_every=2"],
        ["drive.vector.pll_hz=1800"],
        ["drive.vector.speed_hz=50"],
        ["drive.vector.regulator=A", "drive.vector.bandwidth_hz=6000"],
        ["drive.vector.handover_rpm=700"],
    ):
        parameter_block(load_scenario(START, limits))


def phase_voltage(s: Scenario, rpm: float, torque_nm: float) -> float:
    """Phase voltage (peak) of Motor-I with i_d = 0, from the phasor diagram."""
    omega = rpm * math.pi / 30
    i = torque_nm / 1.5e-3
    along = omega * 1e-3 + (0.020 + s.inverter.on_resistance_ohm) * i
    return math.hypot(along, omega * 22e-6 * i)


def test_voltage_is_that_of_the_phasor_diagram() -> None:
    """The message's two voltages; field weakening reaches the same speed with less.

    Verifies: VCONF-02
    """
    s = load_scenario(START)
    needed = phase_voltage(s, 90_000, 0.045)
    found = errors("inverter.supply_v=20", "event.2.command=stop")
    assert len(found) == 1
    match = re.search(r"needs a phase voltage of ([\d.]+) V .*available ([\d.]+) V \(vdc / sqrt\(3\)", found[0])
    assert match is not None
    assert float(match[1]) == pytest.approx(needed, abs=0.06)
    # The shortest pulse and the dead time at either end of the carrier, and the drop of the supply.
    power_w = 0.045 * 90_000 * math.pi / 30 + 1.5 * 0.022 * 30**2
    have = (20 - 0.010 * power_w / 20) / math.sqrt(3) * (1 - 2 * 600e-9 * 20e3)
    assert float(match[2]) == pytest.approx(have, abs=0.06)
    weak = ["inverter.supply_v=20", "drive.current_limit_a=40", "drive.vector.weakening=true"]
    load_scenario(START, weak)
    assert errors("inverter.supply_v=12", *weak[1:])


# ---- clocks


# From the converter's codes: currents 7, window 1 or 8, regulators 52, modulator 12, carriers 3, pins 1.
PINS_CYCLES = {"sample": 76, "carrier": 83}


def sampled_delay(t: ParameterBlock, inverter: Inverter, latency: int, before: int) -> tuple[float, float]:
    """Delay over T_s and its slack (clocks) on a time line of updates, samples and pulses, by the parameters alone.

    latency: clocks from codes to the pins; before: from the last sample of another grid to the first update.
    """
    ts, first, length = (t.number(f"vector_{name}") for name in ("sample_cycles", "from_cycles", "length_cycles"))
    offset, period = t.number("sample_offset_cycles"), t.number("sample_period_cycles")
    # The scheduler: a grid that every update starts anew; in mode 2 it goes on until then, and may hold it up.
    starts = [k * ts for k in range(6)]
    strobes = [-before]
    for start in starts:
        restart = start + offset
        while strobes[-1] + period <= restart - period:
            strobes.append(strobes[-1] + period)
        strobes.append(max(restart, strobes[-1] + period))
        while strobes[-1] + period < start + ts:
            strobes.append(strobes[-1] + period)
    begin = 2 * ts + first
    window = [x for x in strobes if begin <= x < begin + max(length, 1)]
    assert window and window[0] == begin
    assert len(window) == (1 if length == 0 else (length - 1) // period + 1)
    ready = window[-1] + math.ceil(inverter.sensing.conversion_s * CLOCK_HZ) + latency
    update = ts * math.ceil(ready / ts)
    pulses = update + (inverter.gate_delay_s + inverter.dead_time_s / 2) * CLOCK_HZ
    return (pulses - sum(window) / len(window)) / ts, update - ready


def test_window_has_the_delay_that_the_model_has() -> None:
    """Random carriers, windows, converters and delays: samples, grid and pulses on a time line.

    Verifies: VCONF-04
    """
    rng = Random(SEED)
    seen = 0
    while seen < 300:
        inverter = machines.inverter(
            sample_period_s=rng.choice([0.5e-6, 1e-6, 1.7e-6]),
            gate_delay_s=rng.choice([0.0, 300e-9]),
            dead_time_s=rng.choice([0.0, 200e-9, 700e-9]),
            min_pulse_s=700e-9,
        )
        carrier_hz = 10 ** rng.uniform(3.7, 4.7)
        double, window = rng.random() < 0.5, rng.choice(["sample", "carrier"])
        place = rng.choice(["rtl", "c"])
        vector = {"update": "double" if double else "single", "window": window, "current_regulator": place}
        vector |= {"pll_hz": 200.0, "speed_hz": 20.0}  # their rule is not asked
        drive = machines.drive(method="vector", carrier_hz=carrier_hz, vector=vector)
        shortest = shortest_delay(drive, inverter)
        count = 1.0 / update_hz(drive) / inverter.sensing.sample_period_s
        if shortest > 0.99 or count > 255 or update_hz(drive) > update_hz_max(drive):
            continue
        seen += 1
        delay = rng.choice([None, 1.0, rng.uniform(shortest + 0.01, 1.0)])
        drive = machines.drive(method="vector", carrier_hz=carrier_hz, vector=vector | {"delay": delay})
        block = compile_parameters(machines.scenario(MOTORS[0], inverter, drive))
        latency = 600 if place == "c" else PINS_CYCLES[window]
        found, slack = sampled_delay(block, inverter, latency, rng.randrange(1, 26))
        wanted = default_delay(drive, inverter) if delay is None else delay
        ts = block.number("vector_sample_cycles")
        case = (SEED, seen, carrier_hz, double, window, place, delay)
        assert found == pytest.approx(block.number("vector_delay_q30") / 2**30, abs=1.0 / ts), case
        # T_s may be rounded to whole converter periods, and the window begins at a clock.
        assert found == pytest.approx(wanted, abs=0.03), case
        assert slack >= 0, case
        wanted_ts = CLOCK_HZ / update_hz(drive)
        assert abs(ts - wanted_ts) <= inverter.sensing.sample_period_s * CLOCK_HZ / 2 + 0.5, case


def test_believed_delay_reaches_the_model_only() -> None:
    """The firmware's T_d is the one that it is to believe in; samples and updates stay where they are.

    Verifies: VCONF-07
    """
    right = parameter_block(load_scenario(START, ["drive.vector.delay=0.75"])).values
    for believed in (0.0, 0.25, 1.0):
        overrides = ["drive.vector.delay=0.75", f"drive.vector.believed_delay={believed}"]
        wrong = parameter_block(load_scenario(START, overrides)).values
        assert {name for name in right if right[name] != wrong[name]} == {"vector_delay_q30"}
        assert wrong["vector_delay_q30"] == round(believed * 2**30)


def test_regulator_on_the_core_reaches_the_parameters() -> None:
    """One flag; with the delay given nothing else changes.

    Verifies: VCONF-08
    """
    common = ["drive.carrier_hz=10e3", "drive.vector.delay=0.5", "drive.vector.observer_every=1"]
    rtl, core = (
        parameter_block(load_scenario(START, [*common, f"drive.vector.current_regulator={place}"])).values
        for place in ("rtl", "c")
    )
    assert (rtl["vector_direct"], core["vector_direct"]) == (0, 1)
    assert {name for name in rtl if rtl[name] != core[name]} == {"vector_direct"}


def test_single_sample_is_free_of_ripple() -> None:
    """Without a stated delay the sample lies in the middle of a gap or a pulse of the gates.

    Verifies: VCONF-04
    """
    inverter = INVERTERS[0]
    for carrier_hz, double, middle in ((15e3, False, True), (15e3, True, False), (20e3, True, False)):
        drive = machines.drive(carrier_hz=carrier_hz, vector={"update": "double" if double else "single"})
        t = vector_timing(drive, inverter)
        shift = inverter.dead_time_s / 2 * CLOCK_HZ
        wanted = t.sample_cycles / 2 + shift if middle else shift
        assert t.from_cycles == pytest.approx(wanted, abs=1.0)
        assert t.length_cycles == 0
    assert default_delay(machines.drive(carrier_hz=100e3, vector={"update": "single"}), inverter) == 0.5


def test_tick_follows_the_samples() -> None:
    """At most 20 kHz unless asked for; all times in ticks follow it.

    Verifies: VCONF-03
    """
    for carrier_hz, ticks, tick_hz in ((20e3, 2, 20e3), (10e3, 1, 20e3), (50e3, 5, 20e3), (15e3, 2, 15e3)):
        block = parameter_block(load_scenario(START, [f"drive.carrier_hz={carrier_hz}", "event=[]"]))
        assert block.number("vector_tick_samples") == ticks
        assert CLOCK_HZ / block.number("tick_cycles") == pytest.approx(tick_hz, rel=0.015)
        assert block.number("tick_cycles") == ticks * block.number("vector_sample_cycles")
        seconds = block.number("precharge_ticks") * block.number("tick_cycles") / CLOCK_HZ
        assert seconds == pytest.approx(2e-3, rel=0.05)


# ---- parameters


def test_model_of_the_machine() -> None:
    """R T/L, T_d/T, admittance, impedance as the tests of the firmware's model write them, for thesis conditions.

    Verifies: VCONF-03
    """
    for delay in (0.25, 0.5, 0.75):
        overrides = ["drive.carrier_hz=15e3", "drive.vector.update=single", f"drive.vector.delay={delay}"]
        s = load_scenario(START, [*overrides, "inverter.dead_time_s=0", "inverter.on_resistance_ohm=0"])
        block = parameter_block(s)
        exact = Subspace(period_cycles=3333, delay=delay).machine()
        assert block.number("vector_sample_cycles") == exact.period_cycles
        assert block.number("vector_resistance_q30") == pytest.approx(exact.resistance_q30, abs=1)
        # A sample lies on a clock.
        assert block.number("vector_delay_q30") == pytest.approx(exact.delay_q30, abs=2**30 / 3333)
        for name in ("admittance", "impedance"):
            gain = getattr(exact, name)
            assert block.gain(f"vector_{name}") == pytest.approx(gain.mant * 2.0**-gain.shift, rel=1e-8)


@pytest.mark.parametrize("order", [2, 3])
def test_loop_has_its_bandwidth(order: int) -> None:
    """Gains of the phase-locked loop against the design of the analysis.

    Verifies: VCONF-03
    """
    block = parameter_block(load_scenario(START, [f"drive.vector.pll_order={order}", "drive.vector.pll_hz=150"]))
    tick = block.number("tick_cycles")
    wanted = pll_gains(2 if order == 2 else 3, 150.0, tick / CLOCK_HZ)
    radian = 2**30 * 2 * math.pi
    assert block.gain("vector_pll_angle") / 2**32 * radian == pytest.approx(wanted.a, rel=2e-4)
    k_i = block.gain("vector_pll_speed") / 2**60 * radian * tick
    assert k_i == pytest.approx(wanted.b * tick / CLOCK_HZ, rel=2e-4)
    k_a = block.gain("vector_pll_acceleration") / 2**60 * radian * tick
    assert k_a == pytest.approx(wanted.c * (tick / CLOCK_HZ) ** 2, rel=3e-4)


def test_speeds_currents_and_voltages() -> None:
    """Decoded to SI units the parameters are the scenario's and the motor's.

    Verifies: VCONF-03
    """
    overrides = {
        "start_current_a": 9.0,
        "start_accel_rpm_per_s": 60e3,
        "handover_rpm": 12e3,
        "speed_hz": 25.0,
        "gamma": 0.4,
        "observer_pole": 0.75,
        "weakening": "true",
    }
    s = load_scenario(START, [f"drive.vector.{key}={value}" for key, value in overrides.items()])
    block, psi, inertia = parameter_block(s), 1e-3, 5e-7
    tick_s = block.number("tick_cycles") / CLOCK_HZ
    amp, volt = 2**25 / 50.0, 2**25 / 30.0
    speed = 2**36 / CLOCK_HZ / (2 * math.pi)  # rad/s -> 2^-36 turn a clock
    assert block.number("vector_start_i_q25") / amp == pytest.approx(9.0)
    per_s = block.number("vector_start_accel_turn_q44") / 2**44 * CLOCK_HZ / tick_s
    assert per_s * 60 == pytest.approx(60e3, rel=1e-4)
    over = block.number("vector_handover_turn_q36")
    assert over / speed == pytest.approx(12e3 * math.pi / 30, rel=1e-5)
    assert block.number("vector_back_turn_q36") == pytest.approx(0.6 * over, abs=1)
    assert block.gain("vector_rpm_to_turn") * 12e3 * 256 == pytest.approx(over, abs=1)
    emf_v = 1000.0 * psi
    assert block.gain("vector_flux") * 1000.0 * speed / volt == pytest.approx(emf_v, rel=1e-8)
    # The EMF that counts is half of that at which the forced frame takes over again.
    assert block.number("vector_emf_minimum_v_q25") / volt == pytest.approx(0.3 * 12e3 * math.pi / 30 * psi, rel=1e-5)
    assert block.number("vector_gamma_q30") / 2**30 == pytest.approx(0.4)
    assert block.number("vector_pole1_q30") == block.number("vector_pole2_q30") == round(0.75 * 2**30)
    # Speed loop: 3/2 psi / J rad/s^2 an ampere closed at 2 pi 25 Hz, its integral a quarter of that.
    k_p = block.gain("vector_speed_kp") * speed / amp
    assert k_p * 1.5 * psi / inertia == pytest.approx(2 * math.pi * 25)
    k_i = block.gain("vector_speed_ki") * speed / amp / 32 / tick_s
    assert k_i / k_p == pytest.approx(2 * math.pi * 25 / 4)
    # Weakening: 20 Hz where a volt of voltage is a volt over omega L of current.
    reaction = 94e3 * math.pi / 30 * 22e-6
    k_w = block.gain("vector_weakening_ki") / 32 / amp * volt / tick_s
    assert k_w * reaction == pytest.approx(2 * math.pi * 20)
    assert block.number("vector_weakening_lowest_i_q25") / amp == pytest.approx(-0.8 * 36, rel=1e-6)
    off = parameter_block(load_scenario(START))
    assert (off.gain("vector_weakening_ki"), off.number("vector_weakening_lowest_i_q25")) == (0.0, 0)


def ripple_at_own_edge(share: float) -> float:
    """Ripple of phase A's current at its leg's edge, phase voltages share * (0, -sin 60, sin 60), in vdc T / L.

    Legs switched on around the middle of the carrier; the middle of the pause has no ripple.
    """
    legs = [0.5 + share * math.sin(math.radians(angle)) for angle in (0, -120, 120)]
    rise = [(1.0 - leg) / 2.0 for leg in legs]
    on_before = sum(max(rise[0] - edge, 0.0) for edge in rise)
    return on_before / 3.0  # against the star point, which goes along with a third of each leg


def test_modulator() -> None:
    """A voltage becomes its share of the carrier; the lost time is given back beyond the carrier's ripple, not steeply.

    Verifies: VCONF-03
    """
    s = load_scenario(START)
    block = parameter_block(s)
    carrier = 2 * block.number("vector_sample_cycles")
    assert carrier == 2500
    vdc_v_q25, v_q17 = 25.0 / 30 * 2**25, 6.0 / 30 * 2**17
    assert v_q17 * block.gain("vector_scale_v") / vdc_v_q25 == pytest.approx(6.0 / 25 * carrier)
    assert block.number("vector_dead_comp_cycles") == 10
    assert block.number("vector_slope") >= 2**15, "no bits given away"
    for inductance_h in (5e-6, 22e-6):
        changed = parameter_block(load_scenario(START, [f"motor.inductance_h={inductance_h}"]))
        slope = changed.number("vector_slope") * 2.0 ** -changed.number("vector_slope_shift")
        zone_a = 10 / slope / 2**17 * 50
        assert zone_a == pytest.approx(0.25 * 25 / (12 * inductance_h * 20e3), rel=1e-4)
        for voltage_v in (0.5, 5.0, 14.0):
            band_a = changed.gain("vector_band") * voltage_v / 30 * 2**25 / 2**17 * 50
            ripple_a = ripple_at_own_edge(voltage_v / 25.0) * 25 / 20e3 / inductance_h
            assert band_a == pytest.approx(ripple_a, rel=1e-4)
    smooth = s.motor.model_copy(update={"inductance_h": (1e-3,) * 3})
    fine = compile_parameters(s.model_copy(update={"motor": smooth}))
    slope = fine.number("vector_slope") * 2.0 ** -fine.number("vector_slope_shift")
    assert 10 / slope / 2**17 * 50 == pytest.approx(8 * 50 / 2**12, rel=1e-4), "not within the converter's noise"
    margin = block.number("vector_margin_cycles")
    assert margin == 10 + 20  # dead time and shortest pulse
    assert block.number("vector_circle_q16") / 2**16 == pytest.approx(1 - 2 * margin / carrier, abs=2**-16)
    off = parameter_block(load_scenario(START, ["drive.vector.dead_time_compensation=false"]))
    assert (off.number("vector_dead_comp_cycles"), off.number("vector_slope")) == (0, 0)


def test_salient_machine_and_trapezoid() -> None:
    """Mean inductance and the split's ratio of a salient machine; the fundamental of a trapezoid counts as flux.

    Verifies: VCONF-03
    """
    small = ["load.fan_torque_nm=0", "expect=[]", "drive.current_limit_a=8", "drive.carrier_hz=10e3", "drive.vector={}"]
    ipm = ["motor=motors/ipm-4pp.toml", "event=[]", *small]
    s = load_scenario(START, [x.replace("motors/", str(ROOT / "motors") + "/") for x in ipm])
    block = parameter_block(s)
    amp = 2**25 / 50.0
    assert block.number("vector_mtpa_ratio_i_q25") / amp == pytest.approx(s.motor.psi_vs[0] / 0.2e-3, rel=1e-6)
    per_s = block.number("vector_resistance_q30") / 2**30 / block.number("vector_sample_cycles") * CLOCK_HZ
    resistance = s.motor.resistance_ohm[0] + s.inverter.on_resistance_ohm
    assert per_s == pytest.approx(resistance / 0.3e-3, rel=1e-6)
    pump = load_scenario(START, [f"motor={ROOT / 'motors' / 'pump-4pp.toml'}", "event=[]", *small])
    flat = math.radians(pump.motor.flat_top_deg)
    # Fourier integral of a trapezoid by its corners.
    ramp = (math.pi - flat) / 2
    steps = [(k + 0.5) * math.pi / 20_000 for k in range(20_000)]
    shape = [min(1.0, x / ramp, (math.pi - x) / ramp) for x in steps]
    first = 2 / 20_000 * sum(y * math.sin(x) for x, y in zip(steps, shape, strict=True))
    assert pump.motor.emf_fundamental == pytest.approx(first, rel=1e-6)
    speed = 2**36 / CLOCK_HZ / (2 * math.pi)
    flux = parameter_block(pump).gain("vector_flux") * speed / 2**25 * 30
    assert flux == pytest.approx(pump.motor.psi_vs[0] * first, rel=1e-6)


@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize("inverter", INVERTERS)
def test_every_machine_compiles(motor: Motor, inverter: Inverter) -> None:
    """Blocks of very different machines are within the schema with either update.

    Verifies: VCONF-03
    """
    for vector in ({}, {"update": "single", "weakening": True, "window": "carrier"}):
        block = compile_parameters(told(motor, inverter, method="vector", carrier_hz=20e3, vector=vector))
        assert len(block.pack()) <= BLOCK_MAX_BYTES
        assert 0 < block.number("vector_back_turn_q36") < block.number("vector_handover_turn_q36")
        over = block.number("vector_handover_turn_q36")
        assert over < block.number("vector_speed_max_turn_q36")


def test_six_step_blocks_have_no_vector_parameters() -> None:
    """The method alone decides; six-step blocks are what they were.

    Verifies: VCONF-03
    """
    values = parameter_block(load_scenario(DEMO)).values
    assert values["method"] == 0 and not [name for name in values if name.startswith("vector")]
    assert values["tick_cycles"] == 5000
    block = parameter_block(load_scenario(START))
    assert block.number("method") == 1
    assert block.number("sample_mode") == 2


def test_values_that_no_parameter_holds_are_named() -> None:
    """A machine beyond the formats: one message with file and parameter.

    Verifies: VCONF-03
    """
    heavy = ["motor.inertia_kgm2=0.05", "mechanics.mode=locked", "drive.vector.start_accel_rpm_per_s=1"]
    s = load_scenario(START, [*heavy, "drive.vector.pll_hz=1800", "drive.vector.speed_hz=450"])
    expected = (
        r"--set: motor\.inertia_kgm2: 0\.05 kg\*m\^2 does not fit the firmware \(parameter vector_speed_kp: gain "
    )
    with pytest.raises(ConfigError, match=expected) as caught:
        parameter_block(s)
    assert len(caught.value.problems) == 1


# ---- encoder

IPM = ROOT / "scenarios" / "vector" / "encoder.toml"


def test_encoder_that_is_missing_or_too_coarse(tmp_path: Path) -> None:
    """A frame that shall follow an encoder needs one, with edges enough; its mounting belongs to it.

    Verifies: VCONF-01
    """
    assert errors('drive.vector.angle="encoder"') == [
        'drive.vector.angle: "encoder" needs one: the motor file has no [encoder]'
    ]
    assert errors('drive.vector.mounting="learnt"') == [
        'drive.vector.mounting: belongs to drive.vector.angle = "encoder"'
    ]
    text = (ROOT / "motors" / "ipm-4pp.toml").read_text(encoding="utf-8")
    coarse = tmp_path / "coarse.toml"
    coarse.write_text(text.replace("lines = 1024", "lines = 35"), encoding="utf-8")
    assert errors(f'motor="{coarse}"', path=IPM) == [
        'encoder.lines: 35 lines are too few for drive.vector.angle = "encoder", needed at least 36: 36 edges an '
        "electrical turn"
    ]


def test_encoder_in_the_parameters() -> None:
    """Quarters, filter, electrical angle of half a quarter and of the mounting; learnt, the index is left aside.

    Verifies: VCONF-01
    """
    block = parameter_block(load_scenario(IPM))
    assert (block.values["vector_angle"], block.values["encoder_quarters"], block.values["encoder_index"]) == (
        1,
        4096,
        1,
    )
    assert block.gain("encoder_turn") == pytest.approx(4 / 8192 * 2**32)
    assert block.values["encoder_offset_q32"] == round((4 * 37.0 / 360.0) * 2**32)
    edge_cycles = CLOCK_HZ / (4096 * 1.25 * 4_000 / 60)
    assert 1 <= block.number("encoder_filter_cycles") <= edge_cycles / 4
    learnt = parameter_block(load_scenario(IPM, ['drive.vector.mounting="learnt"']))
    assert learnt.values["encoder_index"] == 0
    observed = parameter_block(load_scenario(IPM, ['drive.vector.angle="observer"']))
    assert (observed.values["vector_angle"], observed.values["encoder_quarters"]) == (0, 4096)
