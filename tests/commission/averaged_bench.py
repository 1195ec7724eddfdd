# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A bench without switching: plays the commissioning program and a machine, in steps well below a carrier."""

from __future__ import annotations

import cmath
import math
from collections.abc import Generator
from dataclasses import dataclass, field
from random import Random
from typing import Any

from fluxlock.commission.protocol import Q17, Q25, Q30, Q44, Scales

STEPS = 5  # a carrier
CARRIERS_A_TICK = 2


@dataclass
class Machine:
    """Salient or not; friction as of the plant. dead_v: what a leg loses, softened below `zone_a`."""

    pole_pairs: int = 1
    resistance_ohm: float = 0.022
    ld_h: float = 22e-6
    lq_h: float = 22e-6
    psi_vs: float = 1e-3
    inertia_kgm2: float = 5e-7
    coulomb_nm: float = 0.0
    viscous_nm_s_per_rad: float = 0.0
    fan_nm_s2_per_rad2: float = 0.02 / (60_000 / 60 * 2 * math.pi) ** 2
    dead_v: float = 0.1
    zone_a: float = 0.05
    theta: float = 3.0
    omega: float = 0.0
    flux: complex = field(default=0j)  # of the current, rotor's frame

    def current(self) -> complex:
        """Stationary."""
        rotor = complex(self.flux.real / self.ld_h, self.flux.imag / self.lq_h)
        return rotor * cmath.exp(1j * self.theta)

    def step(self, u: complex, h: float) -> None:
        """Advance by h seconds with a stationary voltage."""
        i = self.current()
        lost = 0j
        for k in range(3):
            axis = cmath.exp(2j * math.pi * k / 3)
            part = (i * axis.conjugate()).real
            lost += 2 / 3 * self.dead_v * max(-1.0, min(1.0, part / self.zone_a)) * axis
        turn = cmath.exp(-1j * self.theta)
        rotor = i * turn
        linkage = self.flux + self.psi_vs
        self.flux += h * ((u - lost) * turn - self.resistance_ohm * rotor - 1j * self.omega * linkage)
        torque = 1.5 * self.pole_pairs * (linkage.real * rotor.imag - linkage.imag * rotor.real)
        omega_m = self.omega / self.pole_pairs
        drag = self.viscous_nm_s_per_rad * omega_m + self.fan_nm_s2_per_rad2 * omega_m * abs(omega_m)
        change = (torque - drag) * h / self.inertia_kgm2
        friction = self.coulomb_nm * h / self.inertia_kgm2
        omega_m += change
        omega_m = math.copysign(max(0.0, abs(omega_m) - friction), omega_m)
        self.omega = omega_m * self.pole_pairs
        self.theta += self.omega * h


class AveragedBench:
    """Answers lines as the program on the chip does. noise_lsb: of the 12-bit currents."""

    def __init__(self, scales: Scales, machine: Machine, noise_lsb: float = 1.0, seed: int = 1) -> None:
        self.scales, self.machine = scales, machine
        self.noise_lsb, self.random = noise_lsb, Random(seed)
        self.values: dict[str, list[int]] = {"v": [0, 0], "w": [0, 0], "i": [0, 0], "g": [0, 0, 0, 0], "f": [0, 1]}
        self.mode = "o"
        self.angle = 0.0
        self.omega_q44 = 0
        self.sampled_angle = 0.0
        self.tick = 0
        self.state = 0j
        self.error = 0j
        self.pending = [0j, 0j]  # voltages set that have not acted yet, by tick
        self.time_s = 0.0
        self.lines: list[str] = []
        self.largest_a = 0.0

    def measured(self) -> complex:
        """Current in the frame, in units."""
        lsb = Q17 / 2048
        noise = [self.random.gauss(0.0, self.noise_lsb * lsb) for _ in range(3)]
        error = sum(2 / 3 * n * cmath.exp(2j * math.pi * k / 3) for k, n in enumerate(noise))
        exact = self.machine.current() * Q17 / self.scales.current_full_scale_a
        return (exact + error) * cmath.exp(-1j * self.angle)

    def carrier(self, v: complex) -> None:
        """A carrier with a voltage of the frame, units of v_q17, turned with the frame's angle in its middle."""
        s = self.scales
        h = s.carrier_cycles / s.clock_hz / STEPS
        omega = self.omega_q44 / Q44 * s.clock_hz * 2 * math.pi
        u = v * s.clocks_a_unit * s.supply_v / s.carrier_cycles
        middle = self.angle + omega * h * STEPS / 2
        for _ in range(STEPS):
            self.machine.step(u * cmath.exp(1j * middle), h)
        self.angle += omega * h * STEPS
        self.time_s += h * STEPS
        self.largest_a = max(self.largest_a, abs(self.machine.current()))

    def control_tick(self) -> tuple[complex, complex]:
        """One tick; returns its current sample and the sum of its voltages."""
        self.tick += 1
        target, step = self.values["f"]
        if self.mode != "o":
            self.omega_q44 += max(-step, min(step, target - self.omega_q44))
        self.sampled_angle = self.angle
        sample = self.measured()
        total = 0j
        if self.mode == "i":
            g, h, cross, shift = self.values["g"]
            gain = complex(g, self.omega_q44 / 256 * cross / Q30) * 2.0**-shift * Q17 / Q25
            hold = h * 2.0**-shift * Q17 / Q25
            for k in range(CARRIERS_A_TICK):
                error = complex(*self.values["i"]) - (sample if k == 0 else self.measured())
                applied = self.state
                self.state += gain * error - hold * self.error
                self.error = error
                self.carrier(applied)
                total += applied
        else:
            sign = -1 if self.tick % 4 >= 2 else 1
            wanted = complex(*self.values["v"]) + sign * complex(*self.values["w"]) if self.mode == "v" else 0j
            self.pending.append(wanted)
            acting = self.pending.pop(0)
            for _ in range(CARRIERS_A_TICK):
                self.carrier(acting)
            total = CARRIERS_A_TICK * acting
            self.state = acting
        return sample, total

    def reply(self, line: str) -> list[str]:
        """Run one line."""
        self.lines.append(line)
        words = line.split()
        ticks, block = 0, 1
        while words:
            letter = words.pop(0)
            count = {"o": 0, "a": 1, "t": 1, "g": 4, "s": 3}.get(letter, 2)
            numbers = [int(words.pop(0)) for _ in range(count)]
            if letter in "ovi":
                self.mode = letter
            if letter == "a":
                self.angle += numbers[0] / 2**32 * 2 * math.pi
            elif letter == "r":
                ticks, block = numbers
            elif letter not in "st":
                self.values[letter] = numbers
        return [*(self.block(block) for _ in range(ticks // block)), "ok"]

    def block(self, ticks: int) -> str:
        """A line of sums."""
        current = corner = middle = voltage = last = 0j
        for _ in range(ticks):
            sample, total = self.control_tick()
            current += sample
            place = self.tick % 4
            if place % 2 == 0:
                corner += -sample if place == 2 else sample
            else:
                middle += -sample if place == 3 else sample
            voltage += total
            last = sample
        vdc = round(ticks * 16 * self.scales.supply_v / self.scales.voltage_full_scale_v * Q17)
        omega = round(self.omega_q44 / 256)
        numbers: list[Any] = [ticks, current.real, current.imag, voltage.real, voltage.imag, CARRIERS_A_TICK * ticks]
        numbers += [vdc, last.real, last.imag, omega, round(self.sampled_angle / (2 * math.pi) * 2**32) % 2**32]
        if any(self.values["w"]):
            numbers += [corner.real, corner.imag, middle.real, middle.imag]
        return "b " + " ".join(str(round(x)) for x in numbers)


def converse(bench: AveragedBench, talk: Generator[str, list[str], Any]) -> Any:
    """Lead a conversation to its end."""
    line = next(talk)
    while True:
        try:
            line = talk.send(bench.reply(line))
        except StopIteration as end:
            return end.value
