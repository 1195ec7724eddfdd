# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""References of the current, one a sample, on the whole chip: imposed rotor, regulators of the hardware, real inverter.

`sw/images/bench/current_reference.c` plays them in place of the drive and sends what the regulators saw. The carrier's
ripple repeats with rotor and carrier, so that the difference of two runs with different references is free of it.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario, load_scenario
from fluxlock.config.vector_design import circle, told_machine
from fluxlock.config.vector_timing import VectorTiming, output_shift_cycles, vector_timing
from fluxlock.firmware.vector_compiler import ripple_a_per_v
from fluxlock.results.rundata import FloatArray, LogKind, RunData
from fluxlock.theory.vector.controllers import BANDWIDTH_HZ, GAMMA, Gains, Kind, follow, gains
from fluxlock.theory.vector.controllers import Regulator as FloatRegulator
from fluxlock.theory.vector.frequency import Loop, current_loop
from fluxlock.theory.vector.model import (
    Coefficients,
    ComplexArray,
    Park,
    Sampling,
    SmoothMachine,
    coefficients,
    emf,
    steady_voltage,
)
from fluxverify.regression.runner import RunFailed, Runner
from fluxverify.regression.vector.specified import FS_HZ

SCENARIO = "vector/id-step.toml"
PROGRAM = "current_reference"
RESET_CYCLES = 10  # of the simulator: the chip's time stamp is 0 there
SETTLE = 30  # samples before the table
AFTER = 1  # samples from a row of the table to the first one at which the regulators use its reference
BOOT_CYCLES, TICKS = 60_000, 12  # before the regulators are switched on
ROW_CHARACTERS, BIT_CYCLES, BITS = 17, 50, 10  # of the console's output
DIGITS = (3, 3, 5, 5)
FULL_BITS, STATE_BITS = 17, 25
CURRENT_SHARE, VOLTAGE_SHARE = 0.75, 0.95  # of the tripping current, of the voltage's circle: room for ripple and noise
LEAST_BANDS = 1.5  # rms current over the dead time's band; at 1.3 the bandwidth came out 15 to 25 % too small


@dataclass(frozen=True)
class Setting:
    """What is set: speed over 15 kHz, delay over T_s, carrier (Hz); the rest as in `[drive.vector]`."""

    kind: Kind
    speed: float
    delay: float
    park: Park = "held"
    window: Literal["sample", "carrier"] = "sample"
    update: Literal["single", "double"] = "single"
    carrier_hz: float = 15e3
    gamma: float = GAMMA

    @property
    def fundamental_hz(self) -> float:
        """f_e."""
        return self.speed * FS_HZ

    @property
    def name(self) -> str:
        """Of its runs."""
        parts = [self.kind, f"{self.fundamental_hz:g}hz", f"td-{self.delay:g}", self.park, self.window, self.update]
        return "-".join([*parts, f"{self.carrier_hz:g}", f"g-{self.gamma:g}"])

    def overrides(self) -> list[str]:
        """Keys of the scenario, without its duration."""
        rpm = 60.0 * self.fundamental_hz
        keys = [
            f"drive.carrier_hz={self.carrier_hz!r}",
            f'drive.vector.update="{self.update}"',
            f'drive.vector.window="{self.window}"',
            f'drive.vector.regulator="{self.kind}"',
            f'drive.vector.park="{self.park}"',
            f"drive.vector.delay={self.delay!r}",
            f"initial.speed_rpm={rpm!r}",
            f"mechanics.profile=[[0.0, {rpm!r}]]",
            "window=[]",
        ]
        return keys if self.kind == "A" else [*keys, f"drive.vector.gamma={self.gamma!r}"]


@dataclass(frozen=True)
class Theory:
    """The exact discrete model of what the chip does: its own T_s and T_d in clocks, winding with switch."""

    machine: SmoothMachine
    sampling: Sampling
    omega: float
    kind: Kind
    gamma: float

    @property
    def fs_hz(self) -> float:
        """1 / T_s."""
        return 1.0 / self.sampling.ts_s

    @cached_property
    def model(self) -> Coefficients:
        """At the speed."""
        return coefficients(self.machine, self.omega, self.sampling)

    @cached_property
    def loop(self) -> Loop:
        """Open loop in z."""
        return current_loop(self.model, self.gains)

    @property
    def gains(self) -> Gains:
        """Of the regulator."""
        return gains(self.kind, self.machine, self.omega, self.sampling, gamma=self.gamma, bandwidth_hz=BANDWIDTH_HZ)

    def response(self, reference: ComplexArray) -> ComplexArray:
        """Current (A) at the samples at which the regulators use the references (A), from rest."""
        return follow(self.model, FloatRegulator(self.gains), reference)


@dataclass(frozen=True)
class Ground:
    """Scenario of a setting and what follows from it."""

    setting: Setting
    scenario: Scenario
    timing: VectorTiming
    machine: SmoothMachine

    @staticmethod
    def of(setting: Setting) -> Ground:
        """Load the scenario with the setting's keys."""
        scenario = load_scenario(ROOT / "scenarios" / SCENARIO, setting.overrides())
        timing, m = vector_timing(scenario.drive, scenario.inverter), told_machine(scenario)
        return Ground(setting, scenario, timing, SmoothMachine(m.resistance_ohm, m.inductance_h, m.fundamental_vs))

    @property
    def theory(self) -> Theory:
        """The exact model."""
        ts = self.timing.sample_cycles / CLOCK_HZ
        sampling = Sampling(ts, min(self.timing.delay, 1.0) * ts, self.setting.park)
        omega = 2.0 * math.pi * self.setting.fundamental_hz
        return Theory(self.machine, sampling, omega, self.setting.kind, self.setting.gamma)

    @property
    def full_scale_a(self) -> float:
        """Of the currents."""
        return self.scenario.inverter.sensing.current_full_scale_a

    @property
    def full_scale_v(self) -> float:
        """Of the voltages."""
        return self.scenario.inverter.sensing.voltage_full_scale_v

    @property
    def held_v(self) -> complex:
        """Voltage without current."""
        theory = self.theory
        return complex(steady_voltage(theory.model, 0.0, emf(self.machine, theory.omega)))

    @property
    def limit_v(self) -> float:
        """Circle that binds the voltage."""
        inverter = self.scenario.inverter
        return circle(inverter, self.timing) * inverter.supply_v / math.sqrt(3.0)

    @property
    def band_a(self) -> float:
        """Phase current below which the dead time costs nothing (docs/theory/vector.md, Dead time)."""
        return ripple_a_per_v(told_machine(self.scenario), self.timing) * abs(self.held_v)

    def amplitude_a(self, unit: ComplexArray) -> float:
        """Amplitude (A) of a reference that is given for 1 A: the largest that current and voltage leave room for.

        On the exact model, CURRENT_SHARE of what trips and VOLTAGE_SHARE of the voltage's circle are reached. What the
        dead time takes is nearly a fixed voltage, and so counts the less the more current flows: RunFailed if the
        current's rms value stays below LEAST_BANDS of the band in which the dead time costs nothing.
        """
        current = self.theory.response(unit)
        regulator = FloatRegulator(self.theory.gains)
        voltage = np.array([regulator.step(complex(error)) for error in unit - current])
        most_a = CURRENT_SHARE * min(self.scenario.inverter.protection.phase_current_a, self.full_scale_a)
        by_current = most_a / float(max(np.abs(current).max(), np.abs(unit).max()))
        # |held + x u| = share * limit, for each sample's u
        along, size = (np.conj(self.held_v) * voltage).real, np.abs(voltage) ** 2
        room = (VOLTAGE_SHARE * self.limit_v) ** 2 - abs(self.held_v) ** 2
        moves = size > 1e-12 * size.max()
        by_voltage = ((-along + np.sqrt(along**2 + size * room)) / np.where(moves, size, 1.0))[moves].min()
        amplitude = min(by_current, float(by_voltage))
        rms = amplitude * float(np.sqrt(np.mean(np.abs(current) ** 2)))
        if rms < LEAST_BANDS * self.band_a:
            raise RunFailed(
                f"{self.setting.name}: {rms:.2f} A rms are all that current and voltage allow, less than "
                f"{LEAST_BANDS:g} times the dead time's band of {self.band_a:.2f} A: the dead time would be measured"
            )
        return amplitude

    def table(self, reference: ComplexArray) -> bytes:
        """The program's table for references (A)."""
        held, limit_v, band_a = self.held_v, self.limit_v, self.band_a
        supply_v = self.scenario.inverter.supply_v
        turn_a_clock = self.setting.fundamental_hz / CLOCK_HZ
        scale = self.timing.carrier_cycles * self.full_scale_v / supply_v / 2**FULL_BITS
        shift = min(31, math.floor(math.log2((2**FULL_BITS - 1) / scale)))
        words = [
            round(turn_a_clock * RESET_CYCLES * 2**32),
            round(turn_a_clock * 2**36),
            *_pair(held / self.full_scale_v),
            round(limit_v / self.full_scale_v * 2**FULL_BITS),
            round(band_a / self.full_scale_a * 2**FULL_BITS),
            math.floor(scale * 2**shift),
            shift,
            SETTLE,
            len(reference),
        ]
        for value in reference / self.full_scale_a:
            words += _pair(complex(value))
        return struct.pack(f"<{len(words)}i", *words)

    def duration_s(self, count: int) -> float:
        """Until everything is sent."""
        samples = (TICKS + SETTLE + count) * self.timing.sample_cycles + TICKS * self.timing.tick_cycles
        return (BOOT_CYCLES + samples + (count + 1) * ROW_CHARACTERS * BITS * BIT_CYCLES) / CLOCK_HZ


def _pair(value: complex) -> tuple[int, int]:
    return round(value.real * 2**FULL_BITS), round(value.imag * 2**FULL_BITS)


@dataclass(frozen=True)
class Played:
    """What the regulators saw: currents (A) and voltages (V) at the samples that used the references, d + jq.

    The first sample belongs to the second row of the table and used the first reference. ripple: what of the current
    is the carrier's (A), none for a mean over it.
    """

    current: ComplexArray
    voltage: ComplexArray
    ripple: ComplexArray
    angle_error_deg: FloatArray  # of the chip against the rotor, at the samples
    instant_error_cycles: float  # largest, of the samples against the middle of the pulses, from where T_d puts them
    trips: int


def play(runner: Runner, setting: Setting, reference: ComplexArray, name: str, every_event: bool = False) -> Played:
    """Play references (A) on the chip; name: of the reference; every_event: record the plant so, for the ripple."""
    ground = Ground.of(setting)
    count, duration_s = len(reference), ground.duration_s(len(reference))
    run = runner.program(
        PROGRAM,
        ground.table(reference),
        SCENARIO,
        f"{setting.name}-{name}",
        *setting.overrides(),
        f"duration_s={duration_s!r}",
        *(("record.zoom_from_s=0", f"record.zoom_to_s={duration_s!r}") if every_event else ()),
    )
    values = _decode(run, count)
    current = (values[:, 0] + 1j * values[:, 1]) * (ground.full_scale_a / 2**FULL_BITS)
    voltage = (values[:, 2] + 1j * values[:, 3]) * (ground.full_scale_v / 2**STATE_BITS)
    ripple = _ripple(run, ground, count) if every_event and not ground.timing.length_cycles else np.zeros_like(current)
    return Played(
        current[AFTER:],
        voltage[AFTER:],
        ripple[AFTER:],
        _angle_errors(run, ground),
        _instant_error(run, ground),
        len(run.rows(LogKind.TRIP)),
    )


def _ripple(run: RunData, ground: Ground, count: int) -> ComplexArray:
    """Current of the plant at the last samples, less that which the carrier's mean voltage would have left there (A).

    In the stationary frame the mean voltage is constant from an update to the next: between the two the current runs
    straight, but for what the EMF adds by turning on. The winding's resistance is left out: 1 % of the ripple.
    """
    time, records = run.zoom["t_cycle"], run.zoom
    stationary = (records["ia"] + records["ib"] * np.exp(2j * np.pi / 3) + records["ic"] * np.exp(-2j * np.pi / 3)) * (
        2 / 3
    )
    instants = run.rows(LogKind.ANGLE)[:, 0].astype(np.float64)
    # The gates go off after the table's last sample.
    at = instants[instants < run.rows(LogKind.GATES)[-1, 0]][-count:]
    theta = np.interp(at, time, records["theta_e"])
    omega = 2 * np.pi * ground.setting.fundamental_hz / CLOCK_HZ
    begin = at - ground.timing.from_cycles + output_shift_cycles(ground.scenario.inverter)
    end = begin + ground.timing.carrier_cycles

    def without_emf(cycle: FloatArray) -> ComplexArray:
        current = np.interp(cycle, time, stationary.real) + 1j * np.interp(cycle, time, stationary.imag)
        flux = ground.machine.psi_vs * np.exp(1j * (theta + omega * (cycle - at)))
        return np.asarray(current + flux / ground.machine.l_h)

    share = (at - begin) / (end - begin)
    straight = (1 - share) * without_emf(begin) + share * without_emf(end)
    return np.asarray((without_emf(at) - straight) * np.exp(-1j * theta))


def _decode(run: RunData, count: int) -> FloatArray:
    """Lines of the program as signed integers [count, 4]."""
    lines = [line for line in run.uart if len(line) == sum(DIGITS)]
    if len(lines) != count:
        raise ValueError(f"{len(lines)} rows came from the chip instead of {count}: {run.uart[:3]}")
    values = np.empty((count, len(DIGITS)))
    for k, line in enumerate(lines):
        begin = 0
        for column, digits in enumerate(DIGITS):
            word = 0
            for character in line[begin : begin + digits]:
                word = word << 6 | ord(character) - ord("0")
            values[k, column] = word - (1 << 6 * digits) if word >> (6 * digits - 1) else word
            begin += digits
    return values


def _angle_errors(run: RunData, ground: Ground) -> FloatArray:
    """Angle of the chip less that of the rotor at the last samples (deg)."""
    rows = run.rows(LogKind.ANGLE)[-50:]
    turns = rows[:, 2] / 2**32 - rows[:, 0] * (ground.setting.fundamental_hz / CLOCK_HZ)
    return np.asarray(360.0 * (turns - np.round(turns)), dtype=np.float64)


ALL_UPPER = 0b010101


def _instant_error(run: RunData, ground: Ground) -> float:
    """Instant of a window, less that which belongs to T_d, against the middle of all legs' pulses: largest (clocks)."""
    t, gates = ground.timing, run.rows(LogKind.GATES)
    begin = np.flatnonzero(gates[:-1, 2] == ALL_UPPER)[:-1]  # the last one may be cut when the gates go off
    middle = (gates[begin, 0] + gates[begin + 1, 0]) / 2.0
    instants = run.rows(LogKind.ANGLE)[:, 0].astype(np.float64)
    before = instants[np.searchsorted(instants, middle, side="right") - 1]
    shift = output_shift_cycles(ground.scenario.inverter)
    expected = shift + t.carrier_cycles / 2 - t.from_cycles - max(t.length_cycles - 1, 0) / 2
    late = expected - (middle - before)
    return float(max((late + t.sample_cycles / 2) % t.sample_cycles - t.sample_cycles / 2, key=abs))


BEFORE, FOLLOWED = 6, 40  # samples of a step
STEP_A = -20.0  # away from the voltage's limit at 1500 Hz


def step_reference(step_a: complex = STEP_A) -> ComplexArray:
    """No current, then the step."""
    reference = np.zeros(BEFORE + FOLLOWED + AFTER, dtype=np.complex128)
    reference[BEFORE:] = step_a
    return reference


@dataclass(frozen=True)
class Step:
    """Response to a step of i_d: current and voltage over the step from the sample at which it begins.

    current: at the samples, less what flows without the step, and so with what the step changes of the ripple.
    ripple_a: current that flows without the step (A), at the samples.
    """

    current: ComplexArray
    voltage: ComplexArray
    ripple_a: ComplexArray
    angle_error_deg: float
    instant_error_cycles: float
    trips: int


def id_step(runner: Runner, setting: Setting, step_a: float = STEP_A) -> Step:
    """The run with the step less the same run without; RunFailed if `Ground.amplitude_a` has no room for the step."""
    reference = step_reference(step_a)
    room_a = Ground.of(setting).amplitude_a(reference / abs(step_a))
    if abs(step_a) > room_a:
        raise RunFailed(
            f"{setting.name}: a step of {step_a:g} A, while current and voltage leave room for {room_a:.1f} A"
        )
    stepped = play(runner, setting, reference, f"step-{step_a:g}a")
    rest = play(runner, setting, np.zeros_like(reference), "rest")
    return Step(
        ((stepped.current - rest.current) / step_a)[BEFORE:],
        ((stepped.voltage - rest.voltage) / step_a)[BEFORE:],
        rest.current,
        float(np.abs(np.concatenate([stepped.angle_error_deg, rest.angle_error_deg])).max()),
        max(stepped.instant_error_cycles, rest.instant_error_cycles, key=abs),
        stepped.trips + rest.trips,
    )
