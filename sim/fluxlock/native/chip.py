# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip as the firmware on the host sees it, played by the averaged model: registers at every control tick."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Motor, Scenario
from fluxlock.config.drive import TICK_HZ
from fluxlock.firmware import ParameterBlock, compile_parameters
from fluxlock.firmware.host import HostFirmware
from fluxlock.native import averaged_motor as am
from fluxlock.native.averaged_motor import AveragedMotor
from fluxlock.native.registers import (
    FREE,
    K_CLOCK_HZ,
    K_CUT_PULSES,
    K_HALL,
    K_I_UNIT,
    K_NUMBERS,
    K_SAMPLES,
    K_V_UNIT,
    places,
    show_crossings,
    show_samples,
    take_settings,
)


def without_noise(scenario: Scenario) -> Scenario:
    """A scenario whose firmware does not take a voltage that stays for that of a stuck channel."""
    inverter = scenario.inverter
    quiet = inverter.model_copy(update={"sensing": inverter.sensing.model_copy(update={"noise_lsb": 0.0})})
    return scenario.model_copy(update={"inverter": quiet})


@dataclass
class AveragedChip:
    """One drive on one machine; the firmware has booted."""

    scenario: Scenario
    model_motor: Motor | None = None  # what the machine really is, if not that of the scenario
    library: Path | None = None  # of the firmware, if it holds more
    cut_pulses: bool = False  # with CSC the mean of a sector is that of its cut pulse train

    def __post_init__(self) -> None:
        s = self.scenario
        self.block: ParameterBlock = compile_parameters(self.told())
        self.model = AveragedMotor(
            self.model_motor or s.motor,
            s.inverter,
            s.shaft_load,
            math.radians(s.initial.theta_deg),
            s.initial.speed_rpm,
        )
        self.fw = HostFirmware(self.library)
        self.fw.load(self.block)
        self.fw.boot()
        self.ticks = 0
        self.samples = 0
        self.trips = 0
        self.tripped = 0  # causes of the last one, which the firmware may have cleared since
        self.sampling = True
        self.idc_offset_a = 0.0
        self.stuck: dict[int, int] = {}  # voltage channels that keep a value, q17
        self.overridden = 0  # late crossings besides those of the model
        self.computed_back = 0
        self.clock = CLOCK_HZ
        self.tick_s = 1.0 / TICK_HZ
        self._places = places(self.fw.offsets)
        self.tick_samples = round(self.tick_s / s.inverter.sensing.sample_period_s)
        self._scales = np.zeros(K_NUMBERS)
        self._scales[[K_CLOCK_HZ, K_SAMPLES]] = self.clock, self.tick_samples
        self._scales[K_V_UNIT] = 2**17 / s.inverter.sensing.voltage_full_scale_v
        self._scales[K_I_UNIT] = 2**17 / s.inverter.sensing.current_full_scale_a
        self._scales[[K_CUT_PULSES, K_HALL]] = self.cut_pulses, self.model.motor.hall is not None
        self._free = np.full(3, FREE)
        self._reg = {name: self.fw.offsets[name] // 4 for name in self.fw.offsets}

    def told(self) -> Scenario:
        """What the firmware is told: the samples have no noise, a value that stays is none of a stuck channel."""
        return without_noise(self.scenario)

    # Registers as integers.
    def get(self, name: str, element: int = 0) -> int:
        """Value of a register."""
        return int(self.fw.registers[self._reg[name] + element])

    def put(self, name: str, value: int, element: int = 0) -> None:
        """Set a register, signed values in two's complement."""
        self.fw.registers[self._reg[name] + element] = value & 0xFFFFFFFF

    def _snapshot(self) -> None:
        """Measurements of the period that ends at this tick."""
        model, registers = self.model, self.fw.registers
        if self.sampling:
            self.samples += self.tick_samples
        stuck = self._free
        if self.stuck:
            stuck = np.array([self.stuck.get(channel, FREE) for channel in range(3)])
        show_samples(registers, self._places, self._scales, model.s, model.c, model.m, stuck, self.idc_offset_a)
        show_crossings(registers, self._places, self._scales, model.s, model.c)
        self.put("sense.snap_number", self.samples)
        self.put("sense.snap_count", self.tick_samples if self.sampling else 0)
        self.put("zcd.counters", ((int(model.s[am.LATE]) + self.overridden) & 0xFFFF) << 16)
        self.put("zcd.method_counters", self.computed_back & 0xFFFF)
        if model.s[am.TRIPS] > 0.0:
            self.trip(int(model.s[am.TRIPS]))
            model.s[am.TRIPS] = 0.0

    def _update(self) -> None:
        """The update event: committed settings become active."""
        if self.get("timer.update") & 2:
            self.put("timer.update", 0)
            take_settings(self.fw.registers, self._places, self._scales, self.model.s, self.model.c)

    def trip(self, causes: int, now: int = 0) -> None:
        """Latch trip causes and open the gates, as the hardware does."""
        old = self.get("safety.trip")
        first = (old >> 16) & 0xFF or causes
        self.put("safety.trip", (old & 0xFF) | causes | (now << 8) | (first << 16))
        self.put("safety.guard", self.get("safety.guard") & ~1)
        self.trips += 1
        self.tripped = causes

    def step(self) -> None:
        """One control tick, then the machine up to the next."""
        self._snapshot()
        self._update()
        self.put("timer.tick_time", round(self.ticks * self.tick_s * self.clock))
        self.put("sys.time_now", round(self.ticks * self.tick_s * self.clock) + 20)
        self.fw.tick()
        latched = self.get("safety.trip") & 0xFF
        self.model.c[am.C_GATES] = float((self.get("safety.guard") & 1) and not latched)
        self.ticks += 1
        self.model.advance(self.ticks * self.tick_s)

    @property
    def now(self) -> float:
        """Simulated time in seconds."""
        return self.ticks * self.tick_s
