# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A six-step scenario on the averaged chip: its events and ramps, and the run data of its end.

A row per control tick; commutations and crossings at their own times. What the model leaves out: gates, samples of the
terminals, of a salient machine all but its mean inductance. The outgoing phase's current ends at once, so there is no
freewheeling. `refusals` names whatever else it is not.
"""

from __future__ import annotations

import math
from functools import reduce
from operator import or_

import numpy as np
from numpy.typing import NDArray

from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.native import averaged_motor as am
from fluxlock.native.chip import AveragedChip
from fluxlock.native.play import LEAST_LINK_V, NOW, PIN, ScenarioPlay, Taken, common_refusals, problems_of
from fluxlock.results.angles import FLOATING_PHASE
from fluxlock.results.metrics import GUARD_CYCLES
from fluxlock.results.rundata import (
    PLANT_EVENT_DTYPE,
    RECORD_DTYPE,
    LogKind,
    PlantEventKind,
    RecordArray,
    RunData,
)

PHASE_ANGLES = 2 * np.pi / 3 * np.arange(3)


def refusals(scenario: Scenario) -> list[Problem]:
    """What of a six-step scenario the model is not, by name."""
    drive = scenario.drive
    if drive.method != "six-step":
        return [scenario.sources.problem("drive.method", "this model is driven in six steps only")]
    found = common_refusals(scenario) | {
        "mechanics.mode": scenario.mechanics.mode == "imposed" and "the native program's rotor is free or locked",
        "drive.hall.mode": drive.hall.mode != "off" and "the native program has no Hall sensors",
        **{
            f"expect[{k}].metric": "the native program's outgoing phase does not freewheel"
            for k, expect in enumerate(scenario.expect)
            if expect.metric.startswith(("freewheel_deg", "demagnetisation_margin_deg"))
        },
        **{
            f"expect[{k}].metric": "the native program has no carrier"
            for k, expect in enumerate(scenario.expect)
            if expect.metric == "pwm_phase_error_pp_deg"
        },
        "drive.zcd.sampling": drive.zcd.sampling != "continuous" and "the native program sees crossings at any time",
    }
    return problems_of(scenario, found)


class Play(ScenarioPlay):
    """One run of a scenario on the averaged chip."""

    chip: AveragedChip

    def __init__(self, scenario: Scenario, seed: int, kept_s: float | None = None) -> None:
        super().__init__(scenario, seed)
        problems = refusals(scenario)
        if problems:
            raise ConfigError(problems)
        self.chip = AveragedChip(scenario, cut_pulses=True)
        model = self.chip.model
        model.s[am.SEED] = 1.0 + seed  # of a generator that stays at 0
        model.m[am.M_LOCKED] = float(scenario.mechanics.mode == "locked")
        model.m[am.M_DIVIDER : am.M_DIVIDER + 3] = scenario.inverter.sensing.divider_gain
        count = math.ceil((scenario.duration_s if kept_s is None else kept_s) / self.chip.tick_s) + 2
        self._records = np.zeros(count, RECORD_DTYPE)
        self._states = np.zeros((count, 4), np.int64)
        self._fields = np.zeros(count)  # angle of the field that drives, rad, nan without one
        self._events: list[NDArray[np.float64]] = []
        self._trips: list[tuple[float, int]] = []
        self._rows = 0

    @property
    def shaft(self) -> tuple[float, float]:
        """Mechanical speed, rad/s, and angle, rad, unwrapped."""
        s = self.chip.model.s
        return float(s[am.OMEGA]), float(s[am.THETA]) / self.scenario.motor.pole_pairs

    def set_load(self, factor: float) -> None:
        """Scale the scenario's load; `held_nm` comes on top."""
        m, load = self.chip.model.m, self.scenario.shaft_load
        m[am.M_FAN] = factor * load.fan_nm_s2_per_rad2
        m[am.M_VISCOUS] = factor * load.viscous_nm_s_per_rad
        m[[am.M_COULOMB, am.M_CONSTANT]] = factor * load.coulomb_nm, factor * load.constant_nm + self.held_nm

    def set_supply(self, volt: float) -> None:
        """Change the supply; `_step` takes off what its resistance drops."""

    def open_phase(self, phase: int | None) -> None:
        """A leg, 0 to 2, loses the machine; None: no one has."""
        self.chip.model.m[am.M_OPEN] = -1.0 if phase is None else phase

    def set_pin(self, on: bool) -> None:
        """Level of the gate driver's fault output."""
        if on:
            self.chip.trip(PIN, PIN)
        else:
            self.chip.put("safety.trip", self.chip.get("safety.trip") & ~(PIN << NOW))

    def set_locked(self, on: bool) -> None:
        """The rotor, a free one, stands at once and stays, or turns again."""
        self.chip.model.m[am.M_LOCKED] = float(on)

    def set_noise(self, lsb: float | None) -> None:
        """Noise of the converter's codes, rms, which moves crossings; None: as at the begin, that of a code."""
        self.chip.model.m[am.M_NOISE] = (1.0 if lsb is None else lsb) * self.scenario.inverter.sensing.step_v

    def take(self) -> Taken:
        """What was recorded since the last call, which is then forgotten.

        angle_error_deg: the field from its best place, 90 degrees before the rotor; within 30 degrees it is right.
        """
        log, trips = self._log(), reduce(or_, (causes for _, causes in self._trips), 0)
        count, self._rows = self._rows, 0
        self._events.clear()
        self._trips.clear()
        records = self._records[:count].copy()
        best = records["theta_e"] + np.where(records["omega_e"] < 0.0, -np.pi / 2, np.pi / 2)
        error = np.angle(np.exp(1j * (self._fields[:count] - best)))
        return Taken(records, log, {"angle_error_deg": np.degrees(error)}, trips)

    def advance(self, until_s: float) -> None:
        """Run, and let ramps follow, a control tick at a time."""
        while self.chip.now < until_s - 1e-9:
            self.follow(self.chip.tick_s)
            self._step()

    def _step(self) -> None:
        chip, model = self.chip, self.chip.model
        drop_v = self.scenario.inverter.supply_resistance_ohm * model.s[am.IDC_MEAN]
        model.m[am.M_VDC] = max(self.supply_v - drop_v, LEAST_LINK_V)
        self._note_records()
        trips = chip.trips
        chip.step()
        if chip.trips != trips:
            self._trips.append((chip.now - chip.tick_s, chip.tripped))
        notes = model.notes()
        if notes.size:
            self._events.append(notes)

    def _note_records(self) -> None:
        """Angle, speed and currents of now, and the drive by its own account."""
        chip, s = self.chip, self.chip.model.s
        row, cycle = self._records[self._rows], round(chip.now * chip.clock)
        row["t_cycle"], row["theta_e"] = cycle, s[am.THETA]
        row["omega_e"] = s[am.OMEGA] * self.scenario.motor.pole_pairs
        row["vdc"], row["idc"] = chip.model.m[am.M_VDC], s[am.IDC_MEAN]
        currents = s[am.I_ALPHA] * np.cos(PHASE_ANGLES) + s[am.I_BETA] * np.sin(PHASE_ANGLES)
        if chip.model.c[am.C_SEQ] == am.SEQ_SIX:
            currents = np.zeros(3)
            currents[am.HIGH[int(s[am.SECTOR])]] = s[am.I_LINE]
            currents[am.LOW[int(s[am.SECTOR])]] = -s[am.I_LINE]
        row["ia"], row["ib"], row["ic"] = currents
        driven = chip.model.c[am.C_SEQ] == am.SEQ_SIX and chip.model.c[am.C_GATES] > 0.0
        self._fields[self._rows] = math.radians(330.0 + 60.0 * s[am.SECTOR]) if driven else math.nan
        row["torque_nm"] = am.torque_of(s, chip.model.c, chip.model.m)
        t = chip.fw.telemetry()
        drive = t.state & 0xFF | (t.fault & 0xFF) << 8 | (t.limit & 0xF) << 16 | (t.lost_locks & 0xFFF) << 20
        told = t.target_rpm << 32 | t.reference_rpm_q8 & 0xFFFFFFFF
        self._states[self._rows] = cycle, int(LogKind.UPDATE), t.speed_rpm_q8 << 32 | drive, told
        self._rows += 1

    def _log(self) -> NDArray[np.int64]:
        clock = self.chip.clock
        events = np.concatenate(self._events) if self._events else np.zeros((0, am.NOTE_FIELDS))
        cycle = np.round(events[:, 0] * clock).astype(np.int64)
        kind, sector = events[:, 1], events[:, 2].astype(np.int64)
        commutation = kind == am.NOTE_COMMUTATION
        rows = np.zeros((len(events), 4), np.int64)
        # The log of the chip has the clock before the one in which the gates change.
        rows[:, 0] = cycle - GUARD_CYCLES * commutation
        rows[:, 1] = np.where(commutation, int(LogKind.COMMUTATION), int(LogKind.CROSSING))
        rows[:, 2] = sector | (kind == am.NOTE_LATE).astype(np.int64) << 4
        rows[:, 3] = cycle
        tripped = [(round(at_s * clock), int(LogKind.TRIP), causes, 0) for at_s, causes in self._trips]
        parts = [self._states[: self._rows], rows, np.array(tripped, np.int64).reshape(-1, 4)]
        whole = np.concatenate(parts)
        return whole[np.argsort(whole[:, 0], kind="stable")]

    def _extinctions(self, log: NDArray[np.int64]) -> RecordArray:
        """The outgoing phase's current ends with the commutation."""
        rows = log[log[:, 1] == int(LogKind.COMMUTATION)]
        found = np.zeros(len(rows), PLANT_EVENT_DTYPE)
        found["t_cycle"], found["kind"] = rows[:, 3], int(PlantEventKind.EXTINCTION)
        found["phase"] = FLOATING_PHASE[rows[:, 2]]
        return found

    def data(self, wall_s: float) -> RunData:
        """What was recorded."""
        self._note_records()
        log = self._log()
        clock = self.chip.clock
        records: RecordArray = self._records[: self._rows]
        low, high = (at_s * clock for at_s in self.scenario.zoom_window_s())
        return RunData(
            log=log,
            records=records,
            plant_events=self._extinctions(log),
            zoom=records[(records["t_cycle"] >= low) & (records["t_cycle"] < high)],
            clock_hz=clock,
            pole_pairs=self.scenario.motor.pole_pairs,
            cycles=round(self.chip.now * clock),
            wall_s=wall_s,
            seed=self.seed,
            uart=self.uart,
            rejected=self.rejected,
        )
