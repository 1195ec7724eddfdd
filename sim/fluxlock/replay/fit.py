# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The machine that explains a log: the twin runs the log's demand at the log's link voltage, and its machine is varied.

The firmware stays as the scenario has it; R, L, psi and J of the machine are found by least squares. Compared are means
of bins: speed, amplitude of the current, and active and reactive power of the terminals. None of them depends on the
angle at which log and twin happen to be. Reactive power is what tells the inductance; a log without the terminals'
voltages has the link's power only, and L stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fluxlock.config import ConfigError, Motor, Problem, Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import BOOT_S
from fluxlock.native.play import LEAST_LINK_V
from fluxlock.native.vector_chip import set_machine
from fluxlock.native.vector_run import Play
from fluxlock.replay.table import Table

Floats = NDArray[np.float64]

BINS = 200
PARAMETERS = ("R", "L", "psi", "J")
UNITS = {"R": "ohm", "L": "H", "psi": "V*s", "J": "kg*m2"}
LEAST, MOST = 0.3, 3.0  # factors of the scenario's values between which the machine is looked for
STEP = 0.01  # of a factor, for the slopes: wide, since the twin has noise and a start that is counted in ticks
MOST_STEPS = 15
SUPPLY_S = 5e-4  # between two values of the link
STILL_RPM = 100.0
AXES = np.exp(2j * np.pi * np.arange(3) / 3)


@dataclass(frozen=True)
class Fit:
    """Factors of the scenario's machine by name, values, and what is left.

    residual: rms over the log of each compared quantity, relative to its own rms. before: that of the scenario's.
    """

    factors: dict[str, float]
    values: dict[str, float]
    residual: dict[str, float]
    before: dict[str, float]
    runs: int


def scaled(motor: Motor, factors: dict[str, float]) -> Motor:
    """A motor with other R, L, psi and J."""
    henry = factors["L"]
    return motor.model_copy(
        update={
            "resistance_ohm": tuple(factors["R"] * x for x in motor.resistance_ohm),
            "inductance_h": tuple(henry * x for x in motor.inductance_h),
            "mutual_h": tuple(henry * x for x in motor.mutual_h),
            "inductance_q_h": None if motor.inductance_q_h is None else henry * motor.inductance_q_h,
            "psi_vs": tuple(factors["psi"] * x for x in motor.psi_vs),
            "inertia_kgm2": factors["J"] * motor.inertia_kgm2,
        }
    )


def binned(edges: Floats, time: Floats, values: Floats) -> Floats:
    """Means of the bins between edges; an empty one takes what is interpolated at its middle."""
    place = np.digitize(time, edges) - 1
    inside = (place >= 0) & (place < edges.size - 1)
    counts = np.bincount(place[inside], minlength=edges.size - 1)
    sums = np.bincount(place[inside], values[inside], minlength=edges.size - 1)
    middle = np.interp((edges[1:] + edges[:-1]) / 2, time, values)
    return np.where(counts > 0, sums / np.maximum(counts, 1), middle)


def compared(
    edges: Floats, time: Floats, speed_rpm: Floats, current: NDArray[np.complex128], power: NDArray[np.complex128]
) -> dict[str, Floats]:
    """What is compared, by bin."""
    return {
        "speed": binned(edges, time, speed_rpm),
        "current": binned(edges, time, np.abs(current)),
        "power": binned(edges, time, power.real),
        "reactive": binned(edges, time, power.imag),
    }


class Replay:
    """A log, and the twin that repeats it. ConfigError if they do not fit."""

    def __init__(self, scenario: Scenario, table: Table, seed: int) -> None:
        if scenario.drive.method != "vector":
            raise ConfigError([scenario.sources.problem("drive.method", "a log is replayed with vector control only")])
        turning = np.flatnonzero(table["target"] != 0.0)
        if turning.size == 0:
            raise ConfigError([Problem("log", "column target", "is 0 all the time: there is nothing to replay")])
        first = table["speed"][0]
        if abs(first) > STILL_RPM:
            text = f"begins at {first:.0f} r/min: cut the log where the rotor stands, before the start"
            raise ConfigError([Problem("log", "column speed", text)])
        self.scenario, self.table, self.seed = scenario, table, seed
        self.end_s = float(table["time"][-1])
        self.edges = np.linspace(0.0, self.end_s, BINS + 1)
        self.runs = 0
        current = 2 / 3 * sum(table[f"i{phase}"] * axis for phase, axis in zip("abc", AXES, strict=True))
        if table.has_voltages:
            voltage = 2 / 3 * sum(table[f"v{phase}"] * axis for phase, axis in zip("abc", AXES, strict=True))
            power = 1.5 * voltage * np.conj(current)
        elif "idc" in table.columns:
            power = (table["vdc"] * table["idc"]).astype(np.complex128)
        else:
            text = "needs va, vb and vc, or at least idc: nothing tells the resistance from the flux"
            raise ConfigError([Problem("log", "columns", text)])
        self.wanted = compared(self.edges, table["time"], table["speed"], np.asarray(current), power)
        self.names = [name for name in self.wanted if table.has_voltages or name != "reactive"]
        self.fitted = [name for name in PARAMETERS if table.has_voltages or name != "L"]
        self.scales = {name: float(np.sqrt(np.mean(self.wanted[name] ** 2))) or 1.0 for name in self.names}
        self.scales["reactive"] = max(self.scales.get("reactive", 1.0), 1e-3 * self.scales["power"])

    def run(self, factors: dict[str, float]) -> dict[str, Floats]:
        """What the twin makes of the log with a machine."""
        self.runs += 1
        play = Play(self.scenario.model_copy(update={"duration_s": self.end_s}), self.seed)
        chip, table = play.chip, self.table
        set_machine(chip.plant, scaled(self.scenario.motor, factors), self.scenario.inverter.on_resistance_ohm)
        chip.plant.supply_ohm = 0.0  # the log has the link
        steps = np.flatnonzero(np.diff(table["target"], prepend=0.0) != 0.0)
        agenda = [(max(BOOT_S, float(table["time"][k])), float(table["target"][k])) for k in steps]
        started = False
        while play.now < self.end_s - SUPPLY_S:
            while agenda and agenda[0][0] <= play.now:
                rpm = agenda.pop(0)[1]
                if rpm == 0.0:
                    play.command("stop")
                    started = False
                    continue
                play.command(f"set speed_rpm {round(rpm)}")
                if not started:
                    play.command("start")
                    started = True
            chip.plant.supply_v = max(LEAST_LINK_V, float(np.interp(play.now, table["time"], table["vdc"])))
            due = agenda[0][0] if agenda else self.end_s
            play.advance(min(play.now + SUPPLY_S, max(due, play.now + chip.timing.period_s)))
        rows = chip.rows()
        time = rows["t_cycle"] * (chip.timing.period_s / chip.timing.cycles)
        speed = rows["omega"] / self.scenario.motor.pole_pairs * RPM_PER_RAD_S
        power = 1.5 * rows["v"] * np.conj(rows["i"])
        if not table.has_voltages:
            power = (rows["vdc"] * rows["idc"]).astype(np.complex128)
        return compared(self.edges, time, speed, rows["i"], power)

    def errors(self, factors: dict[str, float]) -> Floats:
        """Twin less log, each quantity relative to its rms."""
        found = self.run(factors)
        return np.concatenate([(found[name] - self.wanted[name]) / self.scales[name] for name in self.names])

    def residual(self, errors: Floats) -> dict[str, float]:
        """Rms by quantity."""
        parts = np.split(errors, len(self.names))
        return {name: float(np.sqrt(np.mean(part**2))) for name, part in zip(self.names, parts, strict=True)}

    def fit(self) -> Fit:
        """Vary the machine until the twin does what the log did."""
        one = dict.fromkeys(PARAMETERS, 1.0)

        def errors(point: Floats) -> Floats:
            return self.errors(one | dict(zip(self.fitted, point.tolist(), strict=True)))

        count = len(self.fitted)
        start = np.ones(count)
        before = errors(start)
        found = least_squares(
            errors, start, bounds=(LEAST, MOST), diff_step=STEP, xtol=3e-3, ftol=1e-3, max_nfev=MOST_STEPS
        )
        factors = one | dict(zip(self.fitted, found.x.tolist(), strict=True))
        motor = self.scenario.motor
        nominal = {
            "R": sum(motor.resistance_ohm) / 3,
            "L": motor.mean_inductance_h,
            "psi": sum(motor.psi_vs) / 3,
            "J": motor.inertia_kgm2,
        }
        values = {name: nominal[name] * factors[name] for name in PARAMETERS}
        return Fit(factors, values, self.residual(found.fun), self.residual(before), self.runs)
