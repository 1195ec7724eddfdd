# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Hall sensors: the learning against exact numbers, and the whole drive on the host over the averaged model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from random import Random

import numpy as np
import pytest

from fluxlock.firmware.binding import new
from fluxlock.headers import CData
from fluxlock.native import averaged_motor as am
from tests.firmware import machines
from tests.firmware.firmware_bench import Bench, commutation_errors_deg

MISPLACED_DEG = (6.0, -4.0, 3.0)
SENSED = machines.motor(hall={"offset_deg": MISPLACED_DEG})
# Sensor whose edge leads into a sector, for positive and for negative speed.
SENSOR = {1: (2, 1, 0, 2, 1, 0), -1: (1, 0, 2, 1, 0, 2)}


def expected_deg(direction: int) -> list[float]:
    """How late the edge into each sector comes."""
    return [direction * MISPLACED_DEG[x] for x in SENSOR[direction]]


def value(bench: Bench, name: str) -> str:
    """Value of the console."""
    return bench.fw.command(f"get {name}")[0].split(" ", 1)[1]


def learnt_deg(bench: Bench) -> list[float]:
    """What the drive takes the edges' lateness for."""
    return [float(word) for word in value(bench, "hall_offset_deg").split()]


def sensored(hall: dict[str, object] | None = None, theta_rad: float = 0.4, rpm: float = 0.0, **drive: object) -> Bench:
    """A drive with misplaced sensors."""
    return Bench(
        SENSED,
        drive=machines.drive(**drive, hall={"mode": "sensored"} | (hall or {})),
        theta_rad=theta_rad,
        speed_rpm=rpm,
    )


def fallback(**drive: object) -> Bench:
    """The same, commutated by its crossings at 60 000 r/min."""
    bench = Bench(SENSED, drive=machines.drive(**drive, hall={"mode": "fallback"}), speed_rpm=60_000)
    bench.start(60_000, 1.0)
    bench.run(0.2)
    assert value(bench, "commutated_by") == "crossings"
    return bench


@pytest.mark.parametrize("backward", [False, True])
def test_lateness_from_intervals_and_phases(lib: CData, backward: bool) -> None:
    """Edges at random places: both rules give them back, the intervals without the part common to all.

    Verifies: FW-40
    """
    rng = Random(40)
    print("seed 40")
    for _ in range(200):
        turn = rng.randint(3000, 60_000_000)
        late = [rng.uniform(-14.0, 14.0) for _ in range(6)]
        order = [5 - k for k in range(6)] if backward else list(range(6))
        interval = new("uint32_t[6]")
        for k, s in enumerate(order):
            interval[s] = round(turn * (60.0 + late[s] - late[order[k - 1]]) / 360.0)
        period = sum(interval)
        x6 = new("int32_t[6]")
        lib.interval_lateness(interval, backward, x6)
        mean = sum(late) / 6
        grain_deg = 4 * 360.0 / turn + 60.0 / 65536
        for s in range(6):
            got = 60.0 * lib.hall_late_from_intervals_q16(x6[s], period) / 65536
            assert got == pytest.approx(late[s] - mean, abs=max(grain_deg, 0.002)), (turn, late)
            phase = round(turn * (30.0 + late[s]) / 360.0)
            got = 60.0 * lib.hall_late_from_phase_q16(phase, period) / 65536
            assert got == pytest.approx(late[s], abs=max(grain_deg, 0.002) + 0.02 * grain_deg * 30)
    # What cannot be an edge's own crossing is none.
    for phase in (0, 10_000, 0xFFFFFF):
        assert lib.hall_late_from_phase_q16(phase, 60_000) == 32768


def test_mirrored_places(lib: CData) -> None:
    """The sensors seen in the other direction: late becomes early at the same place; twice is the same again.

    Verifies: FW-40
    """
    forward = [round(100 * x) for x in expected_deg(1)]
    backward, again = new("int32_t[6]"), new("int32_t[6]")
    lib.hall_mirror(forward, True, backward)
    lib.hall_mirror(backward, False, again)
    assert list(backward) == [round(100 * x) for x in expected_deg(-1)]
    assert list(again) == forward


@pytest.mark.parametrize("theta_rad", [0.2, 2.5, 4.9])
def test_sensored_start_needs_no_alignment(theta_rad: float) -> None:
    """From standstill the sensors' sector pulls at once; neither alignment nor forced commutation.

    Once fast enough the rotor coasts for some milliseconds, which proves the sensors.

    Verifies: FW-41
    """
    bench = sensored(theta_rad=theta_rad)
    assert bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 60000")
    bench.fw.command("start")
    timers, phases = set(), set()
    while bench.now < 0.45:
        bench.step()
        timers.add(bench.get("comm.control") & 3)
        phases.add(value(bench, "phase"))
        assert bench.model.rpm > -200.0
    assert bench.fw.state == "running" and bench.trips == 0
    assert timers <= {0, 3} and phases == {"none", "coast", "precharge", "hall", "lock"}
    assert (value(bench, "catches"), value(bench, "lost_locks")) == ("1", "0")
    assert bench.model.rpm == pytest.approx(60_000, rel=0.01)


@pytest.mark.parametrize("direction", [1, -1])
def test_sensored_learns_where_the_sensors_sit(direction: int) -> None:
    """Sensors 6, -4, 3 degrees late: commutations off by degrees before, within 0.5 degrees after learning.

    Verifies: FW-40, FW-41
    """
    bench = sensored({"learn": False})
    bench.start(direction * 60_000, 1.0)
    bench.run(0.4)
    assert learnt_deg(bench) == [0.0] * 6
    before = commutation_errors_deg(bench)
    assert np.sqrt(np.mean(before**2)) > 2.5
    assert bench.fw.command("set hall_learn 1") == ["ok"]
    bench.run(0.15)
    assert learnt_deg(bench) == pytest.approx(expected_deg(direction), abs=0.1)
    after = commutation_errors_deg(bench)
    assert abs(np.mean(after)) < 0.2 and np.sqrt(np.mean(after**2)) < 0.3, (np.mean(after), np.std(after))
    assert bench.trips == 0


def test_known_places_are_used_from_the_start() -> None:
    """Offsets of the file that are right need no learning; the other direction is their mirror image.

    Verifies: FW-40
    """
    bench = sensored({"learn": False, "offset_deg": MISPLACED_DEG})
    bench.start(40_000, 1.0)
    bench.run(0.3)
    errors = commutation_errors_deg(bench)
    assert np.sqrt(np.mean(errors**2)) < 0.3
    assert bench.fw.command("stop now") == ["ok"]
    bench.run(0.01)
    bench.model.s[am.OMEGA] = 0.0
    bench.start(-40_000, 1.0)
    bench.run(0.3)
    assert learnt_deg(bench) == pytest.approx(expected_deg(-1), abs=0.01)
    errors = commutation_errors_deg(bench)
    assert np.sqrt(np.mean(errors**2)) < 0.3


def test_sensored_reversal() -> None:
    """Through standstill by the edges alone, without a trip.

    Verifies: FW-41
    """
    bench = sensored(sync_rect=True)
    bench.start(20_000, 1.0)
    bench.run(0.2)
    bench.fw.command("set speed_rpm -20000")
    assert bench.run(1.0, lambda: bench.model.rpm < -19_800)
    assert bench.fw.state == "running" and bench.trips == 0


@pytest.mark.parametrize("rpm", [-30_000, 7000])
def test_sensored_catches_a_spinning_rotor(rpm: int) -> None:
    """A rotor that spins is taken over by its edges, also one too slow for its EMF to be seen; backward it is turned.

    Verifies: FW-41
    """
    bench = sensored(rpm=rpm)
    bench.start(20_000, 0.1)
    assert value(bench, "catches") == "1"
    assert bench.run(3.0, lambda: bench.model.rpm > 19_000)
    assert bench.trips == 0


@pytest.mark.parametrize("stuck", [0.0, 1.0])
@pytest.mark.parametrize("sensor", [0, 1, 2])
def test_stuck_sensor_is_a_named_fault(sensor: int, stuck: float) -> None:
    """A sensor that stops switching while it drives: gates off within three turns, by name.

    Verifies: FW-42
    """
    bench = sensored()
    bench.start(40_000, 1.0)
    bench.run(0.1)
    bench.model.m[am.M_HALL + 4 + sensor] = stuck
    assert bench.run(3 * 60 / 40_000 + 1e-3, lambda: bench.fw.state == "fault")
    assert value(bench, "fault") == "hall_sensor"
    assert bench.get("safety.guard") & 1 == 0


def test_invalid_code_refuses_to_start() -> None:
    """All sensors high, as with an open plug: no gate is enabled.

    Verifies: FW-42
    """
    bench = sensored()
    bench.model.m[am.M_HALL + 4 : am.M_HALL + 7] = 1.0
    assert bench.until_state("ready", 0.1)
    assert value(bench, "hall_state") == "faulty"
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    for _ in range(100):
        bench.step()
        assert bench.get("safety.guard") & 1 == 0
    assert (bench.fw.state, value(bench, "fault")) == ("fault", "hall_sensor")


def test_blocked_rotor_fails_to_start_by_name() -> None:
    """No edges: the attempts end as those of a sensorless start.

    Verifies: FW-41
    """
    bench = sensored(start={"retries": 1})
    bench.model.m[am.M_LOCKED] = 1.0
    bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 20000")
    bench.fw.command("start")
    assert bench.until_state("fault", 3.0)
    assert value(bench, "fault") == "start_failed"


@pytest.mark.parametrize("dead", [0, 1, 2])
def test_fallback_hands_over_and_back(dead: int) -> None:
    """One phase's crossings vanish: the edges take over without a trip; the crossings get the drive back.

    Verifies: FW-43
    """
    bench = fallback()
    assert learnt_deg(bench) == pytest.approx(expected_deg(1), abs=0.1)
    bench.model.m[am.M_ONE_BLIND] = dead
    bench.run(0.01)
    assert value(bench, "commutated_by") == "hall"
    errors = commutation_errors_deg(bench)
    assert np.sqrt(np.mean(errors**2)) < 0.5
    bench.run(0.1)
    assert value(bench, "commutated_by") == "hall" and bench.fw.state == "running"
    bench.model.m[am.M_ONE_BLIND] = -1
    bench.run(0.1)
    assert value(bench, "commutated_by") == "crossings"
    assert value(bench, "hall_handovers") == "1" and bench.trips == 0
    errors = commutation_errors_deg(bench)
    assert np.sqrt(np.mean(errors**2)) < 0.3


def test_all_crossings_lost() -> None:
    """No crossings at all: the edges take over; without them the drive loses its lock by name.

    Verifies: FW-43
    """
    bench = fallback()
    bench.model.m[am.M_BLIND] = 1.0
    bench.run(0.1)
    assert (bench.fw.state, value(bench, "commutated_by"), bench.trips) == ("running", "hall", 0)
    bench.model.m[am.M_HALL + 4] = 0.0
    bench.run(0.01)
    assert (bench.fw.state, value(bench, "fault")) == ("fault", "hall_sensor")


def test_faulty_sensors_are_no_fallback() -> None:
    """Sensors that fail while crossings commutate change nothing, but they take nothing over.

    Verifies: FW-42, FW-43
    """
    bench = fallback(start={"restart_retries": 0})
    assert bench.get("comm.control") >> 8 & 0xFF == 0
    bench.model.m[am.M_HALL + 5] = 1.0
    bench.run(0.05)
    assert (bench.fw.state, value(bench, "hall_state")) == ("running", "faulty")
    assert bench.get("comm.control") >> 8 & 0xFF == 6
    errors = commutation_errors_deg(bench)
    assert np.sqrt(np.mean(errors**2)) < 0.3
    bench.model.m[am.M_BLIND] = 1.0
    bench.run(0.05)
    assert (bench.fw.state, value(bench, "fault")) == ("fault", "lost_lock")


def test_restart_by_edges() -> None:
    """An over-current while crossings are lost is a lost lock: the restart is by the edges, at speed.

    Verifies: FW-43
    """
    bench = fallback()
    bench.model.m[am.M_BLIND] = 1.0
    bench.run(0.0004)
    bench.trip(am.TRIP_PHASE)
    bench.run(0.001)
    bench.put("safety.trip", 0)
    assert bench.run(0.1, lambda: bench.fw.state == "running")
    assert value(bench, "commutated_by") == "hall"
    assert bench.model.rpm > 50_000


def test_over_current_while_ready_starts_nothing() -> None:
    """Stopped just after the edges took over: an over-current with gates off is a fault, no reason to start again.

    Verifies: FW-18, FW-43
    """
    bench = fallback()
    bench.model.m[am.M_BLIND] = 1.0
    assert bench.run(0.01, lambda: value(bench, "commutated_by") == "hall")
    assert bench.fw.command("stop now") == ["ok"]
    assert bench.until_state("ready", 0.001)
    bench.trip(am.TRIP_PHASE)
    bench.run(0.0003)
    assert (bench.fw.state, value(bench, "fault")) == ("fault", "phase_over_current")


def test_drive_without_sensors_reads_none() -> None:
    """Off: the sensors are off in every respect.

    Verifies: FW-41
    """
    bench = Bench(SENSED)
    bench.start(20_000, 1.0)
    assert value(bench, "hall_state") == "off" and value(bench, "hall_handovers") == "0"


# ---- wires and places

ORDERS = ("ABC", "BCA", "CAB", "ACB", "BAC", "CBA")
INVERTED = ("", "A", "B", "C", "AB", "BC", "AC", "ABC")
OFFSETS_DEG = (-60.0, -30.0, 0.0, 30.0, 60.0)
FAST_RPM, SLOW_RPM = 30_000, 24_000
NAMED_S = 0.2
BRAKED_S = 0.010
# Mean torque of a stop, which nothing may drive. Exact: the gates are open, or the model sums currents without noise.
STOP_TORQUE_NM = 0.0


@dataclass(frozen=True)
class Life:
    """What came of a start, a speed, a slower one and a stop: a fault and when, or mean speeds and currents."""

    fault: str = "none"
    at_s: float = 0.0
    speeds_rpm: tuple[float, ...] = ()
    currents_a: tuple[float, ...] = ()
    stop_torque_nm: float = 0.0  # from 10 ms after the stop on, positive where it drives the rotor
    distrusted: bool = False  # the fallback is none
    logged: bool = False  # and the log says so


def life(order: str, inverted: str, offset_deg: float, mode: str, direction: int, *, sync_rect: bool = False) -> Life:
    """Start to 30 000 r/min, 24 000 r/min, stop. Angle at the start: another one for each wiring."""
    wires = {"order": order, "inverted": list(inverted), "offset_deg": [offset_deg] * 3}
    drive = machines.drive(accel_rpm_per_s=400_000.0, sync_rect=sync_rect, hall={"mode": mode})
    theta_rad = 0.4 + ORDERS.index(order) + 7.0 * INVERTED.index(inverted) + offset_deg
    bench = Bench(machines.motor(hall=wires), drive=drive, theta_rad=theta_rad)
    assert bench.until_state("ready", 0.1)
    begin_s = bench.now
    speeds, currents, torques = [], [], []
    spans = [(f"set speed_rpm {direction * FAST_RPM}", 0.2 if mode == "sensored" else 0.4)]
    spans += [(f"set speed_rpm {direction * SLOW_RPM}", 0.12), ("stop", 0.1)]
    for command, span_s in spans:
        assert bench.fw.command(command) == ["ok"]
        if not speeds:
            assert bench.fw.command("start") == ["ok"]
        rpm, current, torque = [], [], []
        for _ in range(round(span_s / bench.tick_s)):
            bench.step()
            rpm.append(bench.model.rpm)
            current.append(abs(bench.model.s[am.I_LINE]))
            torque.append(am.torque_of(bench.model.s, bench.model.c, bench.model.m))
            if bench.fw.state == "fault":
                return Life(value(bench, "fault"), bench.now - begin_s)
        settled = len(rpm) * 3 // 4
        speeds.append(float(np.mean(rpm[settled:])))
        currents.append(float(np.mean(current[settled:])))
        torques = torque
    stop_torque_nm = direction * float(np.mean(torques[round(BRAKED_S / bench.tick_s) :]))
    logged = any("hall_sensor" in line for line in bench.fw.command("faults"))
    distrusted = value(bench, "hall_state") == "faulty"
    return Life("none", 0.0, tuple(speeds), tuple(currents), stop_torque_nm, distrusted, logged)


def is_right(life: Life, best: Life, direction: int) -> bool:
    """Both speeds within 2 % at no more than 1.5 times the current of right sensors; the stop drives nothing."""
    held = zip(life.speeds_rpm, life.currents_a, best.currents_a, (FAST_RPM, SLOW_RPM), strict=False)
    return (
        all(abs(direction * rpm - wanted) <= 0.02 * wanted and a <= 1.5 * best_a for rpm, a, best_a, wanted in held)
        and life.stop_torque_nm <= STOP_TORQUE_NM
    )


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("mode", "sync_rect"), [("sensored", False), ("sensored", True), ("fallback", False)])
def test_each_wiring_is_right_or_named(mode: str, sync_rect: bool, direction: int) -> None:
    """All orders of three wires, each inverted or not, sensors up to 60 degrees off.

    Sensored: right, or the fault `hall_sensor` within 0.2 s of the start. Fallback: the crossings commutate, wrong
    sensors are none, and the log says so.

    Verifies: FW-62
    """
    best = life("ABC", "", 0.0, mode, direction, sync_rect=sync_rect)
    assert best.fault == "none" and not best.distrusted
    right = []
    for order in ORDERS:
        for inverted in INVERTED:
            # Two wires that are exchanged give invalid codes with one or two inverted ones, whatever the places.
            for offset_deg in OFFSETS_DEG if inverted in ("", "ABC") else (0.0, -45.0):
                found = life(order, inverted, offset_deg, mode, direction, sync_rect=sync_rect)
                what = f"{order} inverted {inverted or 'none'} {offset_deg:+.0f} deg: {found}"
                if found.fault != "none":
                    assert mode == "sensored" and found.fault == "hall_sensor" and found.at_s <= NAMED_S, what
                    continue
                assert is_right(found, best, direction), what
                assert found.distrusted == found.logged, what
                if not found.distrusted:
                    right.append((order, inverted, offset_deg))
    # What is the right wiring, or the same as a sensor that is 30 degrees off.
    assert {("ABC", "", -30.0), ("ABC", "", 0.0), ("ABC", "", 30.0)} <= set(right)
    # An inverted cyclic exchange turns by 60 degrees, which an offset takes back.
    assert all(inverted in ("", "ABC") and order in ("ABC", "BCA", "CAB") for order, inverted, _ in right), right
    assert len(right) < 10, right


def test_wrong_sensors_can_be_mended_and_started() -> None:
    """After the fault, with the wires as they belong, `clear` and `start` run.

    Verifies: FW-62
    """
    bench = Bench(machines.motor(hall={"offset_deg": 60.0}), drive=machines.drive(hall={"mode": "sensored"}))
    assert bench.until_state("ready", 0.1)
    bench.fw.command("set speed_rpm 30000")
    bench.fw.command("start")
    assert bench.until_state("fault", 0.3)
    assert value(bench, "fault") == "hall_sensor"
    bench.model.m[am.M_HALL + 1 : am.M_HALL + 4] -= math.radians(60.0)
    bench.fw.command("clear")
    assert bench.until_state("ready", 0.1)
    bench.fw.command("start")
    bench.run(0.4)
    assert (bench.fw.state, value(bench, "hall_state"), value(bench, "fault")) == ("running", "ok", "none")
    assert bench.model.rpm == pytest.approx(30_000, rel=0.01)


def test_proof_by_looks(lib: CData) -> None:
    """Looks at a rotor: their mean tells 29 from 60 degrees; one that turns without edges is found too.

    Verifies: FW-62
    """
    rng = Random(62)
    print("seed 62")
    for _ in range(300):
        late_deg, backward = rng.choice([*range(-29, 30, 2), -60, 60, 120, 180]), rng.random() < 0.5
        proof, verdict = new("hall_proof_t"), 0
        rotor_deg, step_deg, edges, before = rng.uniform(0, 360), rng.uniform(2.0, 45.0), 0, None
        while verdict == 0:
            rotor_deg = (rotor_deg + (-step_deg if backward else step_deg)) % 360.0
            # Sector of position 0 from 210 degrees on; the sensors see a rotor that is late.
            position = int((rotor_deg - 210.0 - late_deg) % 360.0 // 60.0)
            edges = 0 if before is None or before == position else 1
            before = position
            emf = round((rotor_deg + (-90.0 if backward else 90.0)) % 360.0 / 360.0 * 2**32) % 2**32
            ahead = lib.hall_ahead_q16(emf, backward, position)
            verdict = lib.hall_proof_step(proof, ahead, edges, round(step_deg / 360.0 * 65536), 3)
        assert (verdict == 1) == (abs(late_deg) < 30), (late_deg, step_deg, backward)
    proof = new("hall_proof_t")
    verdicts = [lib.hall_proof_step(proof, 0, 0, 16384, 3) for _ in range(17)]
    assert verdicts == [0] * 16 + [2], "a rotor that turns without an edge"
