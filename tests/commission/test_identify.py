# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commissioning: the conversation against a bench without switching, what it may know, and the file that it writes."""

from __future__ import annotations

import pickle
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.commission.bench import bench_of
from fluxlock.commission.estimate import phase_resistances, triangle_inductance
from fluxlock.commission.plate import NamePlate
from fluxlock.commission.procedure import Commissioning
from fluxlock.commission.protocol import MeasurementError
from fluxlock.commission.report import figure, gains, motor_file, quantities, write_motor
from fluxlock.commission.simulate import known_of
from fluxlock.config import load_inverter
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxverify.regression.vector.identify import generated_motor
from tests.commission.averaged_bench import AveragedBench, Machine, converse

CLOCK_HZ, CARRIER, TICK = 50e6, 2500, 5000
BENCH_25 = load_inverter(ROOT / "inverters" / "bench-25v.toml")
DRIVE_48 = load_inverter(ROOT / "inverters" / "drive-48v.toml")
PLATE_1 = NamePlate("Motor-I", 1, 30.0, 94_000.0)
MACHINE_1 = Machine(fan_nm_s2_per_rad2=5.07e-10)
PLATE_IPM = NamePlate("IPM", 4, 10.0, 4_000.0)
IPM = Machine(4, 0.13, 0.2e-3, 0.4e-3, 14.5e-3, 8e-5, fan_nm_s2_per_rad2=5.07e-6, dead_v=0.3)
SPINDLE = Machine(2, 0.16, 120e-6, 120e-6, 5e-3, 8e-6, 2e-3, 2.5e-5, 0.0, 0.3)
PUMP = Machine(4, 0.085, 80e-6, 80e-6, 2.4e-3, 2e-5, 3e-3, 0.0, 1.7e-7, 0.3)


def measured(plate: NamePlate, machine: Machine, inverter: Any = BENCH_25, **bench: Any) -> dict[str, Any]:
    """Commission a machine on the averaged bench."""
    talk = Commissioning(plate, inverter, CLOCK_HZ, CARRIER, TICK)
    result: dict[str, Any] = converse(AveragedBench(talk.scales, replace(machine), **bench), talk.conversation())
    return result


@pytest.mark.parametrize(
    ("plate", "machine", "inverter"),
    [
        (PLATE_1, MACHINE_1, BENCH_25),
        (PLATE_IPM, IPM, DRIVE_48),
        (NamePlate("spindle", 2, 10.0, 22_000.0), SPINDLE, DRIVE_48),
        (NamePlate("pump", 4, 12.0, 9_000.0), PUMP, DRIVE_48),
    ],
    ids=["Motor-I", "IPM", "spindle", "pump"],
)
def test_machine_is_found(plate: NamePlate, machine: Machine, inverter: Any) -> None:
    """R, L on both axes and flux within 3 %, inertia within 10 %, with 1 LSB of noise and a rotor that stands anywhere.

    Verifies: IDENT-01
    """
    found = measured(plate, machine, inverter)
    assert sum(found["resistance_ohm"]) / 3 == pytest.approx(machine.resistance_ohm, rel=0.03)
    assert found["ld_h"] == pytest.approx(machine.ld_h, rel=0.03)
    assert found["lq_h"] == pytest.approx(machine.lq_h, rel=0.03)
    assert found["psi_vs"] == pytest.approx(machine.psi_vs, rel=0.03)
    assert found["inertia_kgm2"] == pytest.approx(machine.inertia_kgm2, rel=0.10)
    assert found["dead_v"] == pytest.approx(machine.dead_v, rel=0.05)


def test_friction_is_found() -> None:
    """Coulomb and viscous friction of a spindle together, at the highest speed of the run.

    Verifies: IDENT-01
    """
    found = measured(NamePlate("spindle", 2, 10.0, 22_000.0), SPINDLE, DRIVE_48)
    top = max(found["run"]["omega_m"])
    drag = found["coulomb_nm"] + found["viscous_nm_s_per_rad"] * top + found["fan_nm_s2_per_rad2"] * top**2
    assert drag == pytest.approx(SPINDLE.coulomb_nm + SPINDLE.viscous_nm_s_per_rad * top, rel=0.1)


def test_tool_knows_the_name_plate_only(tmp_path: Path) -> None:
    """Two machines of one name plate: the conversation and the parameter block that they get are the same bytes.

    Verifies: IDENT-02
    """
    text = (ROOT / "motors" / "motor-1.toml").read_text(encoding="utf-8")
    other = tmp_path / "other.toml"
    changed = text.replace("0.020\ninduct", "0.035\ninduct").replace("22e-6 ", "31e-6 ").replace("1.0e-3", "1.2e-3")
    other.write_text(changed.replace("5e-7", "9e-7"), encoding="utf-8")
    inverter = ROOT / "inverters" / "bench-25v.toml"
    benches = [bench_of(ROOT / "motors" / "motor-1.toml", inverter), bench_of(other, inverter)]
    motors = [bench.motor for bench in benches]
    for key in ("resistance_ohm", "inductance_h", "psi_vs", "inertia_kgm2"):
        assert getattr(motors[0], key) != getattr(motors[1], key)
    (talk, block), (other_talk, other_block) = map(known_of, benches)
    assert pickle.dumps(talk) == pickle.dumps(other_talk)
    assert block.pack() == other_block.pack()
    assert {f.name for f in fields(NamePlate)} == {"name", "pole_pairs", "rated_current_a", "max_speed_rpm"}


def test_current_stays_below_the_rated_one() -> None:
    """No sample of the measurement passes the rated current by more than a tenth, nor the trip.

    Verifies: IDENT-03
    """
    talk = Commissioning(PLATE_1, BENCH_25, CLOCK_HZ, CARRIER, TICK)
    bench = AveragedBench(talk.scales, replace(MACHINE_1))
    converse(bench, talk.conversation())
    assert bench.largest_a < 1.1 * PLATE_1.rated_current_a


class Unconnected(AveragedBench):
    """No current flows."""

    def measured(self) -> complex:
        """Noise only."""
        return 0j


class Tripped(AveragedBench):
    """Trips at the first voltage."""

    def reply(self, line: str) -> list[str]:
        """An error as soon as there is a voltage."""
        self.lines.append(line)
        return (
            ["error: tripped"]
            if line != "o" and "v 0 0" not in line
            else ["ok"]
            if line == "o"
            else super().reply(line)
        )


def test_what_cannot_be_measured_is_said() -> None:
    """No winding, a trip, a rotor that is held, too small a current: a line says so, and the gates are off.

    Verifies: IDENT-04
    """
    talk = Commissioning(PLATE_1, BENCH_25, CLOCK_HZ, CARRIER, TICK)
    for kind, machine, text in (
        (Unconnected, MACHINE_1, "are all three phases connected"),
        (Tripped, MACHINE_1, "switched the gates off"),
        (AveragedBench, replace(MACHINE_1, coulomb_nm=1.0), "rotor"),
    ):
        bench = kind(talk.scales, replace(machine))
        with pytest.raises(MeasurementError, match=text):
            converse(bench, talk.conversation())
        assert bench.lines[-1] == "o"
    with pytest.raises(MeasurementError, match="50 are wanted"):
        Commissioning(replace(PLATE_1, rated_current_a=1.0), BENCH_25, CLOCK_HZ, CARRIER, TICK)


def test_axes_and_triangles() -> None:
    """Phase resistances from the slopes of the axes, inductance from a corner, both put in and found again.

    Verifies: IDENT-05
    """
    r = (0.0381, 0.0375, 0.0435)
    slopes = [r[k] / 2 + sum(r) / 6 for k in range(3)]
    assert phase_resistances(slopes) == pytest.approx(r)
    # Settled triangle, integrated: L di/dt = u - R i, u = +1 V for 200 us, then -1 V.
    inductance, resistance, current, n = 22e-6, 0.022, 0.0, 20_000
    for half in range(101):
        for _ in range(n if half > 98 else 200):
            step = 200e-6 / (n if half > 98 else 200)
            current += step * ((1.0 if half % 2 == 0 else -1.0) - resistance * current) / inductance
    assert triangle_inductance(1.0, current, resistance, 200e-6) == pytest.approx(inductance, rel=2e-3)
    with pytest.raises(MeasurementError, match="no inductance"):
        triangle_inductance(1.0, 50.0, 0.022, 200e-6)


def test_motor_file(tmp_path: Path) -> None:
    """The written file is a motor file with the numbers; salient and unequal machines have theirs, others one.

    Verifies: IDENT-06
    """
    found = measured(PLATE_1, MACHINE_1)
    path = tmp_path / "found.toml"
    motor = write_motor(path, motor_file(found, PLATE_1, BENCH_25, "Measured."))
    assert motor.pole_pairs == 1 and motor.max_speed_rpm == 94_000 and motor.inductance_q_h is None
    assert len(set(motor.resistance_ohm)) == 1
    assert motor.resistance_ohm[0] == pytest.approx(MACHINE_1.resistance_ohm - BENCH_25.on_resistance_ohm, rel=0.03)
    speed = 10_000 / RPM_PER_RAD_S
    drag = found["coulomb_nm"] + found["viscous_nm_s_per_rad"] * speed + found["fan_nm_s2_per_rad2"] * speed**2
    assert motor.load.torque_nm(10_000) == pytest.approx(drag, rel=1e-3)
    uneven = {**found, "resistance_ohm": [0.04, 0.041, 0.046], "lq_h": 2 * found["ld_h"]}
    motor = write_motor(path, motor_file(uneven, PLATE_1, BENCH_25, "Measured."))
    assert motor.resistance_ohm == pytest.approx((0.038, 0.039, 0.044))
    assert motor.inductance_q_h == pytest.approx(2 * motor.inductance_h[0], rel=1e-3)
    assert len(figure(found, "Motor-I").axes) == 4
    assert all(q.true is None for q in quantities(found, 0.002))
    by_name = {g.name: g.value for g in gains(found, PLATE_1, 800.0, 20.0)}
    assert by_name["current, 800 Hz: k_p d"] == pytest.approx(5026.5 * found["ld_h"], rel=1e-3)


def test_generated_motors_are_machines(tmp_path: Path) -> None:
    """A seed gives one file; all of them are valid, some are salient.

    Verifies: IDENT-07
    """
    assert generated_motor(3, DRIVE_48) == generated_motor(3, DRIVE_48) != generated_motor(4, DRIVE_48)
    motors = []
    for seed in range(20):
        path = tmp_path / f"{seed}.toml"
        path.write_text(generated_motor(seed, DRIVE_48), encoding="utf-8")
        motors.append(bench_of(path, ROOT / "inverters" / "drive-48v.toml").motor)
    assert 0 < sum(m.inductance_q_h is not None for m in motors) < 20
