# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Trips at speed on the whole chip, and running again afterwards."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.cosim.outcome import Run
from fluxlock.results.rundata import LogKind
from fluxlock.results.verdict import judge_run
from tests.closed_loop.support import drive

SCENARIOS = Path(__file__).parent / "scenarios"
VECTOR = ROOT / "scenarios" / "vector" / "start.toml"
UPPER, LOWER = 0b010101, 0b101010
LOW_LINK = ("inverter.supply_v=12", "inverter.supply_diode=true", "inverter.protection.over_voltage_v=20")


def test_over_current() -> None:
    """Shorted winding: all gates off within 3 clocks of the raw sample's valid; cause named; restart after clear.

    Verifies: SYS-08
    """
    # Above the limit of the phases: the same current flows in phase and link, and noise would tell which trips first.
    run = drive(SCENARIOS / "short.toml", "short", "inverter.protection.dc_current_a=49", log_strobes=True)
    assert not run.verdict.failures
    trip = run.data.rows(LogKind.TRIP)
    assert len(trip) == 1
    gates = run.gates()
    off = gates[(gates[:, 1] == 0) & (gates[:, 0] >= trip[0, 0] - 3)][0, 0]
    conversion = round(run.scenario.inverter.sensing.conversion_s * run.data.clock_hz)
    valid = run.data.rows(LogKind.STROBE)[:, 0] + conversion
    last_valid = valid[valid < off][-1]
    assert 0 < off - last_valid <= 3
    later = gates[(gates[:, 0] > off) & (gates[:, 0] < 0.14 * run.data.clock_hz)]
    assert not later[:, 1].any(), "gates stay off until the next start"
    assert "fault phase_over_current" in run.console()
    assert run.metrics["again"]["speed_rpm"]["mean"] == pytest.approx(24_000, rel=0.01)


SHORT_STAYS = (
    'event=[{at_s=0.003, speed_rpm=24000}, {at_s=0.004, command="start"}, '
    '{at_s=0.06, fault={kind="shorted_winding", phases=["A", "B"], turns_fraction=0.1}}, '
    '{at_s=0.07, command="clear"}, {at_s=0.08, command="start"}]',
    "window=[]",
    "duration_s=0.12",
)


def test_shorted_winding_is_not_energised_again() -> None:
    """A start after the trip finds the short by the EMF of the coasting rotor: a named fault, gates off all the time.

    Verifies: FW-64
    """
    run = drive(SCENARIOS / "short.toml", "short-stays", *SHORT_STAYS)
    trip = run.data.rows(LogKind.TRIP)
    assert len(trip) == 1
    later = run.gates()[run.gates()[:, 0] > trip[0, 0] + 3]
    assert not later[:, 1].any()
    assert "fault shorted_winding" in run.console()


FIVE = ROOT / "scenarios" / "five-phase" / "yu.toml"
FIVE_TURN = (
    'event=[{at_s=0.002, speed_rpm=300}, {at_s=0.005, fault={kind="stuck_channel", channel="ia", code=4095}}, '
    '{at_s=0.0052, fault={kind="clear"}}, {at_s=0.006, command="clear"}, {at_s=0.008, command="start"}]',
    *("mechanics.mode=imposed", "mechanics.profile=[[0.0, 400.0], [1.0, 400.0]]", "initial.speed_rpm=400"),
    *("window=[]", "expect=[]", "duration_s=0.04"),
)


def test_five_phases_that_turn_have_no_short() -> None:
    """Three of five line EMFs are never alike: after an over-current a turning rotor is waited for, as without one.

    Verifies: FW-64
    """
    run = drive(FIVE, "five-turn", *FIVE_TURN)
    assert len(run.data.rows(LogKind.TRIP)) == 1
    assert "fault phase_over_current" in run.console() and "shorted_winding" not in run.console()
    assert "state starting" in run.console()


AT_REST = (
    'event=[{at_s=0.001, fault={kind="shorted_winding", phases=["A", "B"], turns_fraction=0.1}}, '
    '{at_s=0.003, speed_rpm=24000}, {at_s=0.004, command="start"}, '
    '{at_s=0.05, command="clear"}, {at_s=0.06, command="start"}]',
    "initial.speed_rpm=0",
    "window=[]",
    "duration_s=0.08",
)


def test_shorted_winding_at_rest() -> None:
    """The start after the trip finds the short by its shortest pulses; healthy, they stay far below the trip.

    Verifies: FW-64
    """
    run = drive(SCENARIOS / "short.toml", "short-at-rest", *AT_REST)
    assert "fault shorted_winding" in run.console()
    trip = run.data.rows(LogKind.TRIP)
    assert len(trip) == 2
    whole = drive(SCENARIOS / "short.toml", "short-gone", *AT_REST[1:], AT_REST[0].replace(
        '{at_s=0.05, command="clear"}', '{at_s=0.045, fault={kind="clear"}}, {at_s=0.05, command="clear"}'
    ))  # fmt: skip
    assert "state starting" in whole.console()
    records = whole.data.records
    pulsed = (records["t_cycle"] > 0.060 * whole.data.clock_hz) & (records["t_cycle"] < 0.065 * whole.data.clock_hz)
    largest_a = max(abs(records[name][pulsed]).max() for name in ("ia", "ib", "ic"))
    assert 0 < largest_a < 0.2 * whole.scenario.inverter.protection.phase_current_a


VECTOR_BEGIN = '{at_s=0.003, speed_rpm=24000}, {at_s=0.004, command="start"}, '
VECTOR_BREAK = '{at_s=0.008, fault={kind="shorted_winding", phases=["A", "B"], turns_fraction=0.1}}, '
VECTOR_MEND = '{at_s=0.009, fault={kind="clear"}}, '
VECTOR_AGAIN = '{at_s=0.010, command="clear"}, {at_s=0.012, command="start"}'
VECTOR_AT_REST = ("initial.speed_rpm=0", "window=[]", "expect=[]", "duration_s=0.022", 'expect_trip=["phase_current"]')


def test_shorted_winding_at_rest_under_vector_control() -> None:
    """As in six steps: the start after the trip names the short by pulses, before a current is regulated.

    Verifies: FW-64
    """
    events = VECTOR_BEGIN + VECTOR_BREAK
    run = drive(VECTOR, "vector-short-at-rest", f"event=[{events}{VECTOR_AGAIN}]", *VECTOR_AT_REST)
    clock_hz = run.data.clock_hz
    assert run.data.fault == "shorted_winding"
    trip = run.data.rows(LogKind.TRIP)
    assert len(trip) == 2
    gates = run.gates()
    driven = gates[(gates[:, 0] > 0.012 * clock_hz) & (gates[:, 1] != 0)]
    assert 0 < trip[1, 0] - driven[0, 0] < 0.002 * clock_hz, "within the pulses"
    whole = drive(VECTOR, "vector-short-gone", f"event=[{events}{VECTOR_MEND}{VECTOR_AGAIN}]", *VECTOR_AT_REST)
    assert whole.data.fault is None
    assert len(whole.data.rows(LogKind.TRIP)) == 1
    gates = whole.gates()
    driven = gates[(gates[:, 0] > 0.012 * clock_hz) & (gates[:, 1] != 0)]
    records = whole.data.records
    pulsed = (records["t_cycle"] > driven[0, 0]) & (records["t_cycle"] < driven[0, 0] + 0.0012 * clock_hz)
    largest_a = max(abs(records[name][pulsed]).max() for name in ("ia", "ib", "ic"))
    assert 0.05 < largest_a < 0.2 * whole.scenario.inverter.protection.phase_current_a


def test_fault_pin() -> None:
    """Gates are off at the third clock edge after the pin changes.

    Verifies: SYS-09
    """
    run = drive(SCENARIOS / "fault-pin.toml", "fault-pin")
    assert not run.verdict.failures
    pin = run.data.rows(LogKind.PINS)
    assert len(pin) == 1
    gates = run.gates()
    off = gates[gates[:, 0] > pin[0, 0]]
    assert off[0, 1] == 0 and off[0, 0] == pin[0, 0] + 3
    assert len(off) == 1, "gates stay off"
    assert "fault_pin" in run.console()


def spun_up(name: str, ohm: float, *overrides: str) -> Run:
    """A machine that feeds the link through the diodes of open gates, beside a brake resistor."""
    brake = f"{{off_v = 13, on_v = 14, resistance_ohm = {ohm:g}, longest_on_s = 2e-3}}"
    return drive(SCENARIOS / "brake.toml", name, *LOW_LINK, f"inverter.brake_chopper={brake}", *overrides)


def test_brake_chopper() -> None:
    """The chip's brake pin holds the link between its thresholds, before a trip and after it.

    Verifies: SYS-17
    """
    run = spun_up("brake", 0.5)
    assert not run.verdict.failures
    records = run.data.records
    held = records["vdc"][records["t_cycle"] > 0.0065 * run.data.clock_hz]
    # The divider's pole, one sample and its conversion at 25 V/ms, noise and rounding.
    assert held.min() > 12.9
    assert held.max() < 14.1
    rises = ((held[:-1] < 13.5) & (held[1:] >= 13.5)).sum()
    assert rises > 20, "it goes to and fro between the thresholds"


def test_brake_chopper_beyond_its_time() -> None:
    """A resistor that the machine overpowers is off after its longest time: fault by name, the link rises.

    Verifies: SYS-17
    """
    run = spun_up("brake-overload", 5.0, 'expect_trip=["fault_pin", "deadline"]', "expect_fault=brake_overload")
    assert not run.verdict.failures
    assert run.data.fault == "brake_overload"
    assert run.data.records["vdc"][-1] > 14.5


@pytest.mark.parametrize("safe_state", ["short", "off"])
def test_safe_state_above_the_speed_of_the_link(safe_state: str) -> None:
    """Tripped by over-voltage: shorted, the link stays and the currents settle at flux over inductance; open, it rises.

    Verifies: SYS-18
    """
    overrides = ("inverter.supply_v=14", "inverter.supply_diode=true", "inverter.protection.over_voltage_v=17")
    choice = f"inverter.protection.safe_state={safe_state}"
    run = drive(SCENARIOS / "active-short.toml", f"safe-state-{safe_state}", *overrides, choice)
    assert not run.verdict.failures
    assert run.data.fault == "over_voltage"
    clock_hz, records, gates = run.data.clock_hz, run.data.records, run.gates()
    trip = run.data.rows(LogKind.TRIP)[0, 0]
    after = gates[gates[:, 0] >= trip - 3]
    assert not (after[:, 1] & UPPER).any()
    motor, inverter = run.scenario.motor, run.scenario.inverter
    omega_e = motor.omega_e(110_000)
    emf_v = motor.psi_vs[0] * omega_e
    if safe_state == "off":
        assert not after[:, 1].any()
        assert records["vdc"].max() == pytest.approx(math.sqrt(3) * emf_v - 2 * inverter.diode_drop_v, abs=0.2)
        return
    assert after[-1, 1] == LOWER
    assert after[-1, 0] <= trip + 1 + round(inverter.dead_time_s * clock_hz)
    assert records["vdc"].max() < 17.1
    held = records["t_cycle"] > 0.040 * clock_hz
    currents = [records[name] for name in ("ia", "ib", "ic")]
    impedance = abs(motor.resistance_ohm[0] + inverter.on_resistance_ohm + 1j * omega_e * motor.inductance_h[0])
    assert max(abs(i[held]).max() for i in currents) == pytest.approx(emf_v / impedance, rel=0.01)
    assert max(abs(i).max() for i in currents) < 2 * emf_v / impedance


def test_lost_lock() -> None:
    """The voltage channels fail for 1.3 ms: lost lock by name, then the drive starts again by itself.

    Verifies: SYS-10
    """
    run = drive(SCENARIOS / "lost-lock.toml", "lost-lock")
    assert not run.verdict.failures
    assert "lost_lock" in run.console()
    assert run.metrics["again"]["speed_rpm"]["mean"] == pytest.approx(24_000, rel=0.01)


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("pump", ()),
        (
            "motor-1",
            (
                "motor=motors/motor-1.toml",
                "inverter=inverters/bench-25v.toml",
                "drive.carrier_hz=40000",
                "drive.start.retries=1",
                "duration_s=0.48",
                "initial.theta_deg=70",
            ),
        ),
    ],
)
def test_blocked_rotor(name: str, overrides: tuple[str, ...]) -> None:
    """A rotor that cannot turn: what looks like crossings is no lock; start_failed by name, gates off.

    No trip, but a run that does not expect the fault in which the drive ended fails.

    Verifies: FW-20, FRONT-31
    """
    run = drive(SCENARIOS / "blocked.toml", f"blocked-{name}", *overrides)
    assert not run.verdict.failures
    assert run.result["trips"] == []
    assert run.data.fault == "start_failed" and "state fault" in run.data.uart
    assert "fault start_failed" in run.console()
    assert run.gates()[-1, 1] == 0
    unexpected = run.scenario.model_copy(update={"expect_fault": None})
    verdict = judge_run(run.data, unexpected, run.analysis, run.metrics)
    named = r"the drive ended in fault start_failed: its last attempt failed in (ramp|lock)"
    assert len(verdict.failures) == 1 and re.fullmatch(named, verdict.failures[0])
