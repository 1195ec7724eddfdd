# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A vector scenario on the native twin: events, profile and ramps of the scenario, and the run data of its end.

What the twin leaves out: ripple of the carrier, pulses that the modulator drops, delays of the console. `refusals`
names whatever else it is not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from fluxlock.analysis.rundata import PLANT_EVENT_DTYPE, RECORD_DTYPE, RecordArray, Rejection, RunData
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import Event
from fluxlock.config.vector_timing import vector_timing
from fluxlock.cosim.console import NO_REPLY
from fluxlock.cosim.parameters import parameter_block
from fluxlock.native.chip import without_noise
from fluxlock.native.vector_chip import Sampling, VectorChip

FINAL_COMMANDS = ("status", "faults", "stats")
CHUNK_S = 0.01
QUANTUM_LSB = 1 / math.sqrt(12)  # rms of a converter's rounding


def refusals(scenario: Scenario) -> list[Problem]:
    """What of a vector scenario the twin is not, by name."""
    motor, inverter, vector = scenario.motor, scenario.inverter, scenario.drive.vector
    if scenario.drive.method != "vector":
        return [scenario.sources.problem("drive.method", "only a vector scenario can be played")]
    found = {
        "motor.phases": motor.phases != 3 and "the native program has three phases",
        "motor.saturation": motor.saturation is not None and "the native program's machine does not saturate",
        "drive.vector.injection": vector.injection is not None and "the native program has no injection",
        "drive.vector.dead_time_compensation": not vector.dead_time_compensation
        and "the native program's dead time is that of a compensated drive",
        "inverter.supply_diode": inverter.supply_diode and "the native program's supply takes energy back",
        "inverter.brake_chopper": inverter.brake_chopper is not None and "the native program has no brake chopper",
        "inverter.protection.safe_state": inverter.protection.safe_state != "off"
        and "the native program's trip opens all gates",
        "inverter.sensing.divider_gain": len(set(inverter.sensing.divider_gain)) > 1
        and "the native program's dividers are equal",
        "can": scenario.can is not None and "a scenario that is played has no bus; leave [can] out",
        **{
            f"event[{k}].fault": "the native program has no faults of the plant"
            for k, event in enumerate(scenario.event)
            if event.fault is not None
        },
    }
    return [scenario.sources.problem(key, text) for key, text in found.items() if text]


def vector_chip_of(scenario: Scenario, seed: int) -> VectorChip:
    """Drive and machine of a vector scenario at time 0; ConfigError for what the twin is not."""
    problems = refusals(scenario)
    if problems:
        raise ConfigError(problems)
    timing = vector_timing(scenario.drive, scenario.inverter)
    sampling = Sampling(timing.sample_cycles, timing.tick_samples, min(max(timing.delay, 0.0), 1.0))
    chip = VectorChip(parameter_block(without_noise(scenario)), scenario.motor, scenario.inverter, sampling, seed=seed)
    chip.state.theta = math.radians(scenario.initial.theta_deg)
    chip.state.omega = scenario.initial.speed_rpm / RPM_PER_RAD_S * scenario.motor.pole_pairs
    chip.plant.dead_time = 1
    chip.plant.guided = scenario.mechanics.mode != "free"
    chip.set_load(scenario.shaft_load)
    chip.set_noise(math.hypot(scenario.inverter.sensing.noise_lsb, QUANTUM_LSB))
    encoder = scenario.motor.encoder
    if encoder is not None:
        turn = math.radians(encoder.offset_deg) * scenario.motor.pole_pairs / (2 * math.pi)
        chip.set_encoder(encoder.lines, encoder.index, turn, encoder.inverted)
    return chip


@dataclass
class _Ramp:
    """A value on its way, linear in time."""

    begin_s: float
    length_s: float
    begin: float
    end: float
    put: Callable[[float], None]

    def follow(self, now_s: float) -> bool:
        """Set the value of now; whether the ramp goes on."""
        share = min(1.0, (now_s - self.begin_s) / self.length_s) if self.length_s > 0.0 else 1.0
        self.put(self.begin + share * (self.end - self.begin))
        return share < 1.0


class Play:
    """One run of a scenario on the twin."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario, self.seed = scenario, seed
        self.chip = vector_chip_of(scenario, seed)
        self.samples = round(scenario.duration_s / self.chip.timing.period_s)
        self.chip.keep_rows(self.samples)
        self.uart: list[str] = []
        self.rejected: list[Rejection] = []
        self._ramps: list[_Ramp] = []
        self._load_factor = 1.0

    def _command(self, line: str) -> None:
        replies = self.chip.fw.command(line)
        self.uart += replies
        answer = replies[-1] if replies else NO_REPLY
        if answer != "ok":
            self.rejected.append(Rejection(self.chip.now, line, answer.removeprefix("error: ")))

    def _set_load(self, factor: float) -> None:
        self._load_factor = factor
        self.chip.set_load(self.scenario.shaft_load, factor)

    def _set_supply(self, volt: float) -> None:
        self.chip.plant.supply_v = volt

    def act(self, event: Event) -> None:
        """Carry out an event."""
        now = self.chip.now
        if event.load_factor is not None:
            self._ramps.append(_Ramp(now, event.ramp_s, self._load_factor, event.load_factor, self._set_load))
        elif event.supply_v is not None:
            volt = float(self.chip.plant.supply_v[0])
            self._ramps.append(_Ramp(now, event.ramp_s, volt, event.supply_v, self._set_supply))
        elif event.speed_rpm is not None:
            self._command(f"set speed_rpm {round(event.speed_rpm)}")
        elif event.accel_rpm_per_s is not None:
            self._command(f"set accel_rpm_s {round(event.accel_rpm_per_s)}")
        else:
            assert event.command is not None
            self._command(event.command)

    def guide(self, at_s: float) -> None:
        """Speed and slope of an imposed profile from a time on."""
        times, speeds = zip(*self.scenario.mechanics.profile, strict=True)
        rad_s = np.array(speeds) / RPM_PER_RAD_S * self.scenario.motor.pole_pairs
        self.chip.state.omega = np.interp(at_s, times, rad_s)
        k = int(np.searchsorted(times, at_s, side="right"))
        inside = 0 < k < len(times)
        self.chip.plant.guided_rad_s2 = (rad_s[k] - rad_s[k - 1]) / (times[k] - times[k - 1]) if inside else 0.0

    def _agenda(self) -> Iterator[tuple[float, Callable[[], None]]]:
        for event in self.scenario.event:
            yield event.at_s, partial(self.act, event)
        for at_s, _ in self.scenario.mechanics.profile:
            yield at_s, partial(self.guide, at_s)

    def _advance(self, sample: int) -> None:
        period_s = self.chip.timing.period_s
        while (rest := sample - int(self.chip.state.samples[0])) > 0:
            self._ramps = [ramp for ramp in self._ramps if ramp.follow(self.chip.now)]
            chunk = self.chip.timing.tick_samples if self._ramps else max(1, round(CHUNK_S / period_s))
            self.chip.advance(min(rest, chunk))

    def run(self) -> RunData:
        """The scenario from its begin to its end."""
        begin = time.perf_counter()
        if self.scenario.mechanics.profile:
            self.guide(0.0)
        period_s = self.chip.timing.period_s
        for at_s, act in sorted(self._agenda(), key=lambda entry: entry[0]):
            self._advance(min(self.samples, math.ceil(at_s / period_s - 1e-9)))
            act()
        self._advance(self.samples)
        for line in FINAL_COMMANDS:
            self.uart += self.chip.fw.command(line)
        return self._data(time.perf_counter() - begin)

    def _records(self) -> RecordArray:
        rows = self.chip.rows()
        records = np.zeros(rows.size, RECORD_DTYPE)
        for name, source in (("t_cycle", "t_cycle"), ("theta_e", "theta"), ("omega_e", "omega")):
            records[name] = rows[source]
        for name in ("vdc", "idc", "torque_nm"):
            records[name] = rows[name]
        for k, phase in enumerate("abc"):
            turn = np.exp(-2j * np.pi * k / 3)
            records[f"i{phase}"] = (rows["i"] * turn).real
            records[f"v{phase}"] = (rows["v"] * turn).real + rows["vdc"] / 2
        return records

    def _data(self, wall_s: float) -> RunData:
        records, cycle = self._records(), self.chip.timing.cycles
        low, high = (at_s * CLOCK_HZ for at_s in self.scenario.zoom_window_s())
        return RunData(
            log=self.chip.log(),
            records=records,
            plant_events=np.zeros(0, PLANT_EVENT_DTYPE),
            zoom=records[(records["t_cycle"] >= low) & (records["t_cycle"] < high)],
            clock_hz=CLOCK_HZ,
            pole_pairs=self.scenario.motor.pole_pairs,
            cycles=self.samples * cycle,
            wall_s=wall_s,
            seed=self.seed,
            uart=self.uart,
            rejected=self.rejected,
        )


def play(scenario: Scenario, seed: int) -> RunData:
    """Run a vector scenario on the twin."""
    return Play(scenario, seed).run()
