# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A scenario with injection on the native twin: its events and ramps, and the run data of its end.

A row per current sample; of three or five phases, with saturation. The link's current is that of the
sampled currents. What the twin leaves out: ripple of the carrier, pulses that the modulator drops, the trip of the
link's current, delays of the console. `refusals` names whatever else it is not.
"""

from __future__ import annotations

import math

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.native.injection_chip import InjectionChip
from fluxlock.native.play import LEAST_LINK_V, ScenarioPlay, Taken, common_refusals, problems_of
from fluxlock.plant.trajectory import wave_dtype
from fluxlock.results.rundata import PLANT_EVENT_DTYPE, LogKind, RecordArray, RunData

CHUNK_S = 0.01
ENDLESS = 2**62  # samples


def refusals(scenario: Scenario) -> list[Problem]:
    """What of a scenario with injection the twin is not, by name."""
    found = common_refusals(scenario) | {
        "motor.phases": False,
        "motor.saturation": False,
        "drive.vector.angle": scenario.drive.vector.angle == "encoder"
        and "the native program with injection has no encoder",
        "inverter.sensing.divider_gain": len(set(scenario.inverter.sensing.divider_gain)) > 1
        and "the native program's dividers are equal",
    }
    return problems_of(scenario, found)


class Play(ScenarioPlay):
    """One run of a scenario with injection on the twin."""

    chip: InjectionChip

    def __init__(self, scenario: Scenario, seed: int, kept_s: float | None = None) -> None:
        super().__init__(scenario, seed)
        problems = refusals(scenario)
        if problems:
            raise ConfigError(problems)
        self.chip = InjectionChip(scenario, seed)
        period_s = self.chip.setup.period_s
        self.samples = round(scenario.duration_s / period_s) if kept_s is None else ENDLESS
        self._kept = self.samples if kept_s is None else math.ceil(kept_s / period_s) + 1
        self._dtype = wave_dtype(scenario.motor.phases)
        self.chip.keep_rows(self._kept)
        self.set_locked(scenario.mechanics.mode == "locked")

    @property
    def shaft(self) -> tuple[float, float]:
        """Mechanical speed, rad/s, and angle, rad, unwrapped."""
        return self.chip.shaft

    def set_load(self, factor: float) -> None:
        """Scale the scenario's load; `held_nm` comes on top."""
        self.chip.set_load(self.scenario.shaft_load, factor)
        self.chip.held_nm = self.held_nm

    def set_supply(self, volt: float) -> None:
        """Change the supply; `advance` takes off what its resistance drops."""

    def open_phase(self, phase: int | None) -> None:
        """A leg loses the machine; None: no one has."""
        self.chip.open_phase(phase)

    def set_locked(self, on: bool) -> None:
        """The rotor stands at once and stays, or is free."""
        self.chip.imposed_rpm = 0.0 if on else math.nan
        if on:
            self.chip.stop()

    def set_noise(self, lsb: float | None) -> None:
        """Noise of the converter's codes, rms; None: as it was at the begin."""
        self.chip.set_noise(self.scenario.inverter.sensing.noise_lsb if lsb is None else lsb)

    def take(self) -> Taken:
        """What was recorded since the last call, which is then forgotten."""
        log, error_deg = self.chip.log().copy(), self.chip.rows()["error_deg"].copy()
        trips = int(np.bitwise_or.reduce(log[log[:, 1] == int(LogKind.TRIP), 2]))
        taken = Taken(self._records(), log, {"angle_error_deg": error_deg}, trips)
        self.chip.keep_rows(self._kept)
        return taken

    def advance(self, until_s: float) -> None:
        """Run, and let ramps, profile and link follow, a control tick at a time."""
        setup, chip, mechanics = self.chip.setup, self.chip, self.scenario.mechanics
        resistance_ohm, profile = self.scenario.inverter.supply_resistance_ohm, mechanics.mode == "imposed"
        end = min(self.samples, math.ceil(until_s / setup.period_s - 1e-9))
        while (rest := end - chip.samples) > 0:
            tick_s = setup.tick_samples * setup.period_s
            self.follow(tick_s)
            if profile:
                times, speeds = zip(*mechanics.profile, strict=True)
                chip.imposed_rpm = float(np.interp(self.now + tick_s, times, speeds))
            chip.set_supply(max(self.supply_v - resistance_ohm * chip.link_a, LEAST_LINK_V))
            fine = self.ramps or self.load is not None or profile or resistance_ohm > 0.0
            chunk = setup.tick_samples if fine else max(1, round(CHUNK_S / setup.period_s))
            chip.advance(min(rest, chunk))

    def _records(self) -> RecordArray:
        rows, count = self.chip.rows(), self.scenario.motor.phases
        records = np.zeros(rows.size, self._dtype)
        for name, source in (("t_cycle", "t_cycle"), ("theta_e", "theta"), ("omega_e", "omega")):
            records[name] = rows[source]
        for name in ("vdc", "idc", "torque_nm"):
            records[name] = rows[name]
        first = (rows["i_d"] + 1j * rows["i_q"]) * np.exp(1j * rows["theta"])
        third = (rows["i_d3"] + 1j * rows["i_q3"]) * np.exp(3j * rows["theta"]) * (count == 5)
        for k, phase in enumerate("abcde"[:count]):
            turn = np.exp(-2j * np.pi * k / count)
            records[f"i{phase}"] = (first * turn + third * turn**3).real
            records[f"v{phase}"] = rows["v"][:, k]
        return records

    def data(self, wall_s: float) -> RunData:
        """What was recorded."""
        records = self._records()
        low, high = (at_s * CLOCK_HZ for at_s in self.scenario.zoom_window_s())
        return RunData(
            log=self.chip.log(),
            records=records,
            plant_events=np.zeros(0, PLANT_EVENT_DTYPE),
            zoom=records[(records["t_cycle"] >= low) & (records["t_cycle"] < high)],
            clock_hz=CLOCK_HZ,
            pole_pairs=self.scenario.motor.pole_pairs,
            cycles=self.samples * self.chip.setup.period_cycles,
            wall_s=wall_s,
            seed=self.seed,
            uart=self.uart,
            rejected=self.rejected,
        )
