# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A vector scenario on the native twin: events, profile and ramps of the scenario, and the run data of its end.

What the twin leaves out: ripple of the carrier, pulses that the modulator drops, delays of the console. `refusals`
names whatever else it is not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.vector_timing import vector_timing
from fluxlock.cosim.parameters import parameter_block
from fluxlock.native.chip import without_noise
from fluxlock.native.play import LEAST_LINK_V, ScenarioPlay, Taken, common_refusals, problems_of
from fluxlock.native.vector_chip import Sampling, VectorChip
from fluxlock.results.rundata import PLANT_EVENT_DTYPE, RECORD_DTYPE, LogKind, RecordArray, RunData

CHUNK_S = 0.01
ENDLESS = 2**62  # samples
QUANTUM_LSB = 1 / math.sqrt(12)  # rms of a converter's rounding


def refusals(scenario: Scenario) -> list[Problem]:
    """What of a vector scenario the twin is not, by name."""
    inverter, vector = scenario.inverter, scenario.drive.vector
    if scenario.drive.method != "vector":
        return [scenario.sources.problem("drive.method", "only a vector scenario can be played")]
    found = common_refusals(scenario) | {
        "inverter.sensing": False,
        "drive.vector.dead_time_compensation": not vector.dead_time_compensation
        and "the native program's dead time is that of a compensated drive",
        "inverter.sensing.divider_gain": len(set(inverter.sensing.divider_gain)) > 1
        and "the native program's dividers are equal",
    }
    return problems_of(scenario, found)


def vector_chip_of(scenario: Scenario, seed: int, library: Path | None = None) -> VectorChip:
    """Drive and machine of a vector scenario at time 0; ConfigError for what the twin is not.

    library: of the firmware, default the host library.
    """
    problems = refusals(scenario)
    if problems:
        raise ConfigError(problems)
    timing = vector_timing(scenario.drive, scenario.inverter)
    sampling = Sampling(timing.sample_cycles, timing.tick_samples, min(max(timing.delay, 0.0), 1.0))
    block = parameter_block(without_noise(scenario))
    chip = VectorChip(block, scenario.motor, scenario.inverter, sampling, library, seed)
    chip.state.theta = math.radians(scenario.initial.theta_deg)
    chip.state.omega = scenario.initial.speed_rpm / RPM_PER_RAD_S * scenario.motor.pole_pairs
    chip.plant.dead_time = 1
    chip.plant.guided = scenario.mechanics.mode != "free"
    chip.set_load(scenario.shaft_load)
    chip.set_noise(math.hypot(scenario.inverter.sensing.noise_lsb, QUANTUM_LSB))
    encoder = scenario.motor.encoder
    if encoder is not None:
        turn = math.radians(encoder.offset_deg) * scenario.motor.pole_pairs / (2 * math.pi)
        chip.set_encoder(encoder.lines, encoder.index, turn, encoder.inverted, encoder.missing_lines)
    return chip


class Play(ScenarioPlay):
    """One run of a scenario on the twin."""

    chip: VectorChip

    def __init__(self, scenario: Scenario, seed: int, kept_s: float | None = None) -> None:
        super().__init__(scenario, seed)
        self.chip = vector_chip_of(scenario, seed)
        period_s = self.chip.timing.period_s
        self.samples = round(scenario.duration_s / period_s) if kept_s is None else ENDLESS
        self._kept = self.samples if kept_s is None else math.ceil(kept_s / period_s) + 1
        self.chip.keep_rows(self._kept)
        if scenario.mechanics.profile:
            self.guide(0.0)

    @property
    def shaft(self) -> tuple[float, float]:
        """Mechanical speed, rad/s, and angle, rad, unwrapped."""
        state, poles = self.chip.state, self.scenario.motor.pole_pairs
        return float(state.omega[0]) / poles, float(state.theta[0]) / poles

    def set_load(self, factor: float) -> None:
        """Scale the scenario's load; `held_nm` comes on top."""
        self.chip.set_load(self.scenario.shaft_load, factor)
        self.chip.plant.constant_nm += self.held_nm

    def set_supply(self, volt: float) -> None:
        """Change the supply."""
        self.chip.plant.supply_v = max(volt, LEAST_LINK_V)

    def open_phase(self, phase: int | None) -> None:
        """A leg, 0 to 2, loses the machine; None: no one has."""
        self.chip.plant.open_phase = 0 if phase is None else phase + 1

    def set_locked(self, on: bool) -> None:
        """The rotor, a free one, stands at once and stays, or turns again."""
        self.chip.plant.guided = on
        if on:
            self.chip.state.omega = self.chip.plant.guided_rad_s2 = 0.0

    def set_noise(self, lsb: float | None) -> None:
        """Noise of the converter's codes, rms; None: as it was at the begin."""
        own = self.scenario.inverter.sensing.noise_lsb
        self.chip.set_noise(math.hypot(own if lsb is None else lsb, QUANTUM_LSB))

    def take(self) -> Taken:
        """What was recorded since the last call, which is then forgotten."""
        log, error_deg = self.chip.log().copy(), self.chip.rows()["error_deg"].copy()
        trips = int(np.bitwise_or.reduce(log[log[:, 1] == int(LogKind.TRIP), 2]))
        taken = Taken(self._records(), log, {"angle_error_deg": error_deg}, trips)
        self.chip.keep_rows(self._kept)
        return taken

    def guide(self, at_s: float) -> None:
        """Speed and slope of an imposed profile from a time on."""
        times, speeds = zip(*self.scenario.mechanics.profile, strict=True)
        rad_s = np.array(speeds) / RPM_PER_RAD_S * self.scenario.motor.pole_pairs
        self.chip.state.omega = np.interp(at_s, times, rad_s)
        k = int(np.searchsorted(times, at_s, side="right"))
        inside = 0 < k < len(times)
        self.chip.plant.guided_rad_s2 = (rad_s[k] - rad_s[k - 1]) / (times[k] - times[k - 1]) if inside else 0.0

    def agenda(self) -> Iterator[tuple[float, Callable[[], None]]]:
        """Actions and their times, in any order."""
        yield from super().agenda()
        for at_s, _ in self.scenario.mechanics.profile:
            yield at_s, partial(self.guide, at_s)

    def advance(self, until_s: float) -> None:
        """Run, and let ramps follow, a control tick at a time."""
        period_s, tick = self.chip.timing.period_s, self.chip.timing.tick_samples
        end = min(self.samples, math.ceil(until_s / period_s - 1e-9))
        while (rest := end - int(self.chip.state.samples[0])) > 0:
            self.follow(tick * period_s)
            chunk = tick if self.ramps or self.load is not None else max(1, round(CHUNK_S / period_s))
            self.chip.advance(min(rest, chunk))

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

    def data(self, wall_s: float) -> RunData:
        """What was recorded."""
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
