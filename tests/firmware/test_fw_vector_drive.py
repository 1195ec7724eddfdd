# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The vector algorithms together on the exact plant with inertia and fan: start, hand-over, reversal, way back."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field
from functools import partial

import pytest

from fluxlock.firmware.binding import new
from fluxlock.firmware.block import gain
from fluxlock.firmware.vector_formats import (
    Complex,
    from_complex,
    model_at,
    observer_gains,
    pll_gains,
    regulator_design,
    to_complex,
)
from fluxlock.headers import CData
from tests.firmware.vector_float import CLOCK_HZ, GAMMA, C, Subspace, float_model

Q30, Q32, Q36 = 2**30, 2**32, 2**36
MOTOR_1 = Subspace(delay=0.5)
INERTIA_KGM2 = 5e-7
JUMP_A = 0.1  # 1 % of the forced current; i_d fades by half of that a sample
FAN_NM, FAN_RAD_S = 0.020, 2 * math.pi * 1000.0


@dataclass
class Plant:
    """Motor-I with one pole pair: exact electrical model at the speed of the sample, mechanics by Euler's rule."""

    m: Subspace
    omega: float = 0.0
    theta: float = 0.6
    i: complex = 0j
    u_before: complex = 0j

    def step(self, u_stationary: complex) -> None:
        """One sample period with a voltage in the stationary frame, seen from dq at this instant."""
        u = u_stationary * cmath.exp(-1j * self.theta)
        model, emf = float_model(self.m, self.omega), 1j * self.m.psi_vs * self.omega
        torque = 1.5 * self.m.psi_vs * self.i.imag
        load = FAN_NM * (self.omega / FAN_RAD_S) * abs(self.omega / FAN_RAD_S)
        self.i, self.u_before = model.step(self.i, u, self.u_before, emf), u
        self.theta += self.omega * self.m.period_s
        self.omega += (torque - load) / INERTIA_KGM2 * self.m.period_s

    @property
    def current(self) -> complex:
        """Current vector in the stationary frame, A."""
        return self.i * cmath.exp(1j * self.theta)


@dataclass
class Drive:
    """Calls the firmware's blocks in the order in which the chip and its interrupt will."""

    lib: CData
    plant: Plant
    start: CData = field(default_factory=partial(new, "if_start_t"))
    regulator: CData = field(default_factory=partial(new, "complex_regulator_t"))
    observer: CData = field(default_factory=partial(new, "emf_observer_t"))
    pll: CData = field(default_factory=partial(new, "pll_t"))
    speed: CData = field(default_factory=partial(new, "pi_state_t"))
    forced: bool = True
    i_d_q25: int = 0
    error_deg: float = 0.0

    def __post_init__(self) -> None:
        """Constants of Motor-I at 15 kHz."""
        m = self.plant.m
        self.machine = m.machine()
        self.unit_a, self.unit_v = 2**17 / m.full_scale_a, 2**25 / m.full_scale_v
        self.unit_turn = Q36 / CLOCK_HZ  # Hz -> 2^-36 turn a clock
        slope = 1500.0 * m.period_s * self.unit_turn * 256
        amp = 256 * self.unit_a
        self.settings = new(
            "if_settings_t",
            current_i_q25=round(10 * amp),
            rise_i_q25=round(0.05 * amp),
            align_ticks=400,
            acceleration_turn_q44=round(slope),
            minimum_v_q25=round(0.5 * self.unit_v),
            damping=gain(1.4 * math.sqrt(10.0 * INERTIA_KGM2 / (1.5 * m.psi_vs)) / m.psi_vs * amp / self.unit_v),
            smooth_q16=round(4.0 * math.sqrt(15.0 * m.psi_vs / INERTIA_KGM2) * m.period_s * 65536),
            tolerance_turn_q32=round(Q32 / 60),
            steady_ticks=60,
        )
        self.loop = pll_gains(0.95, m.period_cycles, order=3)
        bandwidth = 2 * math.pi * 15.0
        kp = bandwidth * INERTIA_KGM2 / (1.5 * m.psi_vs) * 2 * math.pi * amp / self.unit_turn
        self.gains = new("pi_gains_t", gain(kp), gain(kp * bandwidth / 4 * m.period_s * 32))
        self.lib.if_begin(self.start)

    def turn_frame(self, turn_q32: int) -> None:
        """Angle of the frame ahead by turn; the vectors stay in the machine."""
        rotation = self.lib.cis_q30(-turn_q32 % Q32)
        self.lib.complex_regulator_turn(self.regulator, rotation)
        self.lib.emf_observer_turn(self.observer, rotation)
        angle = (self.lib.pll_angle_turn_q32(self.pll) + turn_q32) % Q32
        self.lib.pll_preset(self.pll, angle, self.speed_q36)

    @property
    def speed_q36(self) -> int:
        """Speed of the frame."""
        if self.forced:
            return int(self.lib.if_speed_turn_q36(self.start))
        return int(self.lib.pll_speed_turn_q36(self.pll))

    def hand_over(self, target_q36: int) -> None:
        """From the forced frame to the observed angle."""
        turn = self.start.turn_q32
        forced = complex(self.start.current_i_q25, self.start.damping_i_q25)
        i = forced * cmath.exp(-2j * math.pi * turn / Q32)
        self.turn_frame(turn)
        self.i_d_q25 = round(i.real)
        self.lib.vector_speed_preset(self.speed, self.gains, target_q36, self.speed_q36, round(i.imag))
        self.forced = False

    def due_v_q25(self, speed_q36: int) -> int:
        """EMF of a speed."""
        return round(2 * math.pi * self.plant.m.psi_vs * speed_q36 / self.unit_turn * self.unit_v)

    def hand_back(self, i: Complex) -> None:
        """From the observed angle to the forced frame."""
        speed = self.speed_q36
        self.turn_frame(self.lib.if_turn_back_q32(i))
        self.lib.if_resume(self.start, self.settings, speed, self.lib.complex_abs(i), self.due_v_q25(speed))
        self.forced = True

    def step(self, target_hz: float, i_d_a: float = 0.0) -> bool:
        """One sample; true where a hand-over, or with i_d wanted a way back, is possible. Target in Hz."""
        lib, plant, m = self.lib, self.plant, self.plant.m
        target = round(target_hz * self.unit_turn)
        angle = lib.pll_angle_turn_q32(self.pll)
        frame = cmath.exp(2j * math.pi * angle / Q32)
        self.error_deg = math.degrees(cmath.phase(frame * cmath.exp(-1j * plant.theta)))
        measured = from_complex(plant.current / frame, self.unit_a)
        if self.forced:
            lib.if_step(self.start, self.settings, target)
            due = self.due_v_q25(self.speed_q36)
            self.wanted = lib.if_current_i_q25(self.start, self.settings, self.observer.emf_v_q25, due)
        else:
            goal = round(i_d_a * 256 * self.unit_a)
            self.i_d_q25 = lib.fade(self.i_d_q25, goal, self.settings.rise_i_q25)
            limit = lib.current_rest_i_q25(round(25 * 256 * self.unit_a), self.i_d_q25)
            result = lib.vector_speed_step(self.speed, self.gains, target, self.speed_q36, 0, limit)
            self.wanted = Complex(self.i_d_q25, result.output)
        speed = self.speed_q36
        model, regulator_gains = model_at(lib, self.machine, speed), new("regulator_gains_t")
        design = regulator_design(C, gamma=GAMMA)
        assert lib.regulator_design(regulator_gains, design, self.machine, model)
        reference = Complex((self.wanted.re + 128) >> 8, (self.wanted.im + 128) >> 8)
        lib.complex_regulator_step(self.regulator, regulator_gains, reference, measured, round(14.0 / 30 * 2**17))
        u = self.regulator.voltage_v_q25
        gains = observer_gains(lib, self.machine, speed, 0.7, 0.7)
        lib.emf_observer_step(self.observer, gains, measured, 0)
        lib.emf_observer_voltage(self.observer, gains, u)
        emf = self.observer.emf_v_q25
        if self.forced:
            ready = bool(lib.if_ready(self.start, self.settings))
            lib.pll_preset(self.pll, angle, speed)
            lib.pll_step(self.pll, self.loop, m.period_cycles, 0)
        else:
            ready = abs(self.i_d_q25 - i_d_a * 256 * self.unit_a) < 1
            error = lib.pll_error_q30(emf, speed, round(0.2 * self.unit_v))
            lib.pll_step(self.pll, self.loop, m.period_cycles, error)
        plant.step(to_complex(u, self.unit_v) * frame)
        return ready


def followed_step(drive: Drive, hz: float, i_d_a: float = 0.0) -> tuple[bool, float]:
    """One sample: ready, and by how much the current vector leaves its even rotation, A."""
    turned = drive.plant.current * cmath.exp(1j * drive.plant.omega * drive.plant.m.period_s)
    ready = drive.step(hz, i_d_a)
    return ready, abs(drive.plant.current - turned)


def run_until_ready(drive: Drive, hz: float, jumps: list[float], most: int = 20_000, i_d_a: float = 0.0) -> int:
    """Samples until the drive is ready at the target speed; what the current vector jumps goes to `jumps`."""
    for k in range(most):
        ready, jump = followed_step(drive, hz, i_d_a)
        jumps.append(jump)
        there = abs(drive.speed_q36 / drive.unit_turn - hz) < 5.0
        if ready and there:
            return k
    raise AssertionError(f"not ready at {hz} Hz after {most} samples, speed {drive.plant.omega / 2 / math.pi:.1f} Hz")


def test_start_hand_over_reversal_and_way_back(lib: CData) -> None:
    """Standstill, 300 Hz forced, 900 Hz sensorless, back, through zero forced, -900 Hz sensorless, and down again.

    Verifies: VC-14
    """
    drive = Drive(lib, Plant(MOTOR_1))
    for sign in (1, -1):
        jumps: list[float] = []
        run_until_ready(drive, sign * 300.0, jumps)
        drive.hand_over(round(sign * 300.0 * drive.unit_turn))
        errors, target = [], 300.0
        quiet = max(jumps[-200:])
        jumps.clear()
        for k in range(9000):
            target = min(target + 0.1, 900.0) if k < 7000 else max(target - 0.3, 300.0)
            _, jump = followed_step(drive, sign * target)
            if k < 20:
                jumps.append(jump)
            errors.append(drive.error_deg)
            if k == 6999:
                assert drive.plant.omega / 2 / math.pi == pytest.approx(sign * 900.0, abs=5.0)
        rms = math.sqrt(sum(e * e for e in errors) / len(errors))
        print(f"{sign:+d}: rms {rms:.3f} deg, max {max(map(abs, errors)):.3f} deg, at hand-over {errors[0]:+.3f} deg")
        print(f"   current step at hand-over {max(jumps):.3f} A, before {quiet:.3f} A")
        assert rms < 1.0
        assert max(map(abs, errors)) < 5.0
        assert max(jumps) < JUMP_A
        run_until_ready(drive, sign * 300.0, jumps, i_d_a=9.0)
        jumps.clear()
        drive.hand_back(drive.wanted)
        run_until_ready(drive, sign * 150.0, jumps)
        print(f"   after the way back at most {max(jumps):.3f} A")
        assert max(jumps) < JUMP_A
        assert abs(drive.plant.omega / 2 / math.pi - sign * 150.0) < 20.0
