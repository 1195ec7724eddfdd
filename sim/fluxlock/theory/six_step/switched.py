# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Freewheel angles from the switched circuit: the plant at imposed speed with ideal gates.

Independent of `freewheel`: nothing here knows a decay voltage. `commutate` looks at a single commutation from a given
current; `steady_operation` runs to the periodic state of a duty and looks at all its commutations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import RPM_PER_RAD_S, Motor
from fluxlock.plant import (
    InverterParams,
    MachineParams,
    MechanicsParams,
    Plant,
    PlantParams,
    RecordingParams,
    SensingParams,
)
from fluxlock.plant import layout as L
from fluxlock.results.angles import FLOATING_PHASE
from fluxlock.results.rundata import FloatArray, IntArray, RecordArray
from fluxlock.theory.six_step.fourier import space_vector
from fluxlock.theory.six_step.machine import Machine
from fluxlock.theory.six_step.patterns import (
    LOWER_LEG,
    SECTORS,
    UPPER_LEG,
    Chopping,
    Commutation,
    GateSequence,
    gate_sequence,
    gates_of,
)

CLOCK_S = 1e-9  # gate edges are rounded to it
LIMIT_DEG = 90.0
ROUNDING_RAD = 1e-4  # more than half a clock at any speed
NO_SENSING = SensingParams(100.0, 100.0, noise_lsb_rms=0.0)


def ideal_inverter(supply_v: float) -> InverterParams:
    """Switches and diodes without drops on a stiff supply: what the equations of chapter 4 assume."""
    return InverterParams(supply_v, diode_drop_v=0.0)


def real_inverter(inverter: Inverter, *, link: bool = True) -> InverterParams:
    """The power stage of an inverter file. link: with its supply and DC link, else on a stiff supply."""
    return InverterParams(
        supply_v=inverter.supply_v,
        r_on_ohm=inverter.on_resistance_ohm,
        diode_drop_v=inverter.diode_drop_v,
        diode_r_ohm=inverter.diode_resistance_ohm,
        supply_r_ohm=inverter.supply_resistance_ohm if link else 0.0,
        dc_link_c_f=inverter.dc_link_f if link else 0.0,
    )


def plant_at_speed(
    motor: Motor, inverter: InverterParams, speed_rpm: float, prime_deg: float, sensing: SensingParams, seed: int
) -> Plant:
    """A plant that turns at an imposed speed, at the angle theta' (deg) and without current."""
    machine = MachineParams(
        pole_pairs=motor.pole_pairs,
        r_ohm=motor.resistance_ohm,
        l_h=motor.self_inductance_h,
        m_h=motor.mutual_h,
        psi_vs=motor.psi_vs,
        emf=motor.emf,
        flat_top_deg=motor.flat_top_deg,
    )
    mechanics = MechanicsParams(
        motor.inertia_kgm2,
        mode="imposed",
        theta_e_rad=float(np.radians(prime_deg - 180.0)),
        omega_m_rad_s=speed_rpm / RPM_PER_RAD_S,
        step_max_s=1.0,
    )
    recording = RecordingParams(every_strobes=0, energies=True, wave_rows=1, zoom_rows=1, event_rows=1024)
    return Plant(PlantParams(machine, inverter, sensing, mechanics, recording, CLOCK_S), seed)


@dataclass
class SingleCommutation:
    """One commutation, and the sector after it, from a given current.

    speed_rpm: mechanical; current_a: of the outgoing phase at the commutation; sector: 0..5, entered; duty 0..1;
    carrier_phase: 0..1, of the carrier at the commutation; late_deg: commutation after the ideal instant.
    """

    motor: Motor
    inverter: InverterParams
    speed_rpm: float
    current_a: float
    duty: float
    carrier_hz: float
    sector: int = 0
    chopping: Chopping = "ON-PWM"
    carrier_phase: float = 0.0
    late_deg: float = 0.0
    sensing: SensingParams = NO_SENSING
    seed: int = 0
    plant: Plant = field(init=False)
    pulse: bool = field(init=False)

    def __post_init__(self) -> None:
        entry_deg = 30.0 + 60.0 * self.sector + self.late_deg
        self.plant = plant_at_speed(self.motor, self.inverter, self.speed_rpm, entry_deg, self.sensing, self.seed)
        before = (self.sector - 1) % SECTORS
        sign = 1.0 if UPPER_LEG[before] == self.floating else -1.0
        stays = int(LOWER_LEG[before] if sign > 0 else UPPER_LEG[before])
        self.plant.state[L.I + self.floating] = sign * self.current_a
        self.plant.state[L.I + stays] = -sign * self.current_a
        self._entry_rad = self.plant.theta_e_rad
        self._edges = self._pulse_edges()
        self._next = next(self._edges)
        self.pulse = self.carrier_phase % 1.0 < self.duty
        self.plant.step(0, self.gates(self.pulse))

    @property
    def floating(self) -> int:
        """Phase that stops conducting at the commutation."""
        return int(FLOATING_PHASE[self.sector])

    def _pulse_edges(self) -> Iterator[tuple[int, bool]]:
        """Cycle and new state of every later edge of the pulse."""
        period = 1.0 / (self.carrier_hz * CLOCK_S)
        carrier = 0
        while True:
            for offset, pulse in ((0.0, True), (self.duty, False)):
                cycle = round((carrier + offset - self.carrier_phase) * period)
                if cycle > 0 and 0.0 < self.duty < 1.0:
                    yield cycle, pulse
            carrier += 1
            if not 0.0 < self.duty < 1.0:
                yield 1 << 62, self.duty >= 1.0

    def gates(self, pulse: bool) -> int:
        """Gates of the sector with the pulse on or off."""
        return int(gates_of(self.chopping, np.array([self.sector]), np.array([pulse]))[0])

    @property
    def next_edge(self) -> tuple[int, bool]:
        """Cycle of the next edge of the pulse and its state after it."""
        return self._next

    def take_edge(self) -> None:
        """Advance to the next edge of the pulse and over it."""
        cycle, self.pulse = self._next
        self.plant.step(cycle, self.gates(self.pulse))
        self._next = next(self._edges)

    def angle_deg(self) -> float:
        """Angle since the commutation."""
        return float(np.degrees(self.plant.theta_e_rad - self._entry_rad))

    def cycle_of(self, angle_deg: float) -> int:
        """Cycle at which the rotor is an angle past the commutation."""
        return round(float(np.radians(angle_deg)) / abs(self.plant.omega_e_rad_s) / CLOCK_S)

    def freewheel_deg(self) -> float:
        """Run until the outgoing current is zero and return the angle; infinite beyond 90 degrees."""
        end = self.cycle_of(LIMIT_DEG)
        if self.current_a == 0.0:
            return 0.0
        while True:
            done = self._next[0] >= end
            if done:
                self.plant.advance(end)
            else:
                self.take_edge()
            for event in self.plant.events():
                if event["kind"] == L.EXTINCTION and event["phase"] == self.floating:
                    return float(np.degrees(event["theta_e"] - self._entry_rad))
            if done:
                return float("inf")


def commutate(
    motor: Motor,
    inverter: InverterParams,
    speed_rpm: float,
    current_a: float,
    *,
    duty: float,
    carrier_hz: float,
    sector: int = 0,
    chopping: Chopping = "ON-PWM",
    carrier_phase: float = 0.0,
    late_deg: float = 0.0,
) -> float:
    """Freewheel angle (deg) of one commutation; arguments as of `SingleCommutation`."""
    return SingleCommutation(
        motor, inverter, speed_rpm, current_a, duty, carrier_hz, sector, chopping, carrier_phase, late_deg
    ).freewheel_deg()


def worst_commutation_deg(
    motor: Motor,
    inverter: InverterParams,
    speed_rpm: float,
    current_a: float,
    *,
    duty: float,
    carrier_hz: float,
    chopping: Chopping,
    late_deg: float = 0.0,
    phases: int = 8,
) -> float:
    """Largest freewheel angle (deg) over equally spaced carrier phases and both freewheeling diodes."""
    return max(
        commutate(
            motor,
            inverter,
            speed_rpm,
            current_a,
            duty=duty,
            carrier_hz=carrier_hz,
            sector=sector,
            chopping=chopping,
            carrier_phase=k / phases,
            late_deg=late_deg,
        )
        for k in range(phases)
        # ON-PWM and PWM-ON treat both diodes alike.
        for sector in ((0,) if chopping in ("ON-PWM", "PWM-ON") else (0, 1))
    )


@dataclass(frozen=True)
class SteadyState:
    """Periodic operation at one speed and duty. Arrays: one entry a commutation.

    torque_nm: mean at the shaft; sector: entered; current_a: of the outgoing phase at the commutation; freewheel_deg:
    infinite if it lasts until the next commutation; visible_deg: angle since the commutation of the first instant at
    which a sample counts (pulse on and outgoing current gone, both for the settling time), infinite if there is none
    in the sector.
    """

    speed_rpm: float
    duty: float
    torque_nm: float
    sector: IntArray
    current_a: FloatArray
    freewheel_deg: FloatArray
    visible_deg: FloatArray


DRAIN_EVERY = 256  # steps; the event buffer holds more than they can cause
# Columns of a commutation: electrical angle (rad), sector entered, outgoing current (A), shaft energy (J).
_THETA, _SECTOR, _CURRENT, _ENERGY = range(4)


def _run(plant: Plant, sequence: GateSequence, turn_cycles: float) -> FloatArray:
    """Drive the plant with a gate sequence; returns a row [4] a commutation."""
    entered = dict(zip(sequence.commutations.tolist(), sequence.sectors.tolist(), strict=True))
    rows: list[tuple[float, int, float, float]] = []
    for k, (at, gates) in enumerate(zip(sequence.at.tolist(), sequence.gates.tolist(), strict=True)):
        plant.step(round(at * turn_cycles), gates)
        if k % DRAIN_EVERY == 0:
            plant.drain()
        if at in entered:
            sector = entered[at]
            outgoing = abs(float(plant.currents_a[FLOATING_PHASE[sector]]))
            rows.append((plant.theta_e_rad, sector, outgoing, plant.energies_j()["shaft"]))
    return np.array(rows)


def steady_operation(
    motor: Motor,
    inverter: InverterParams,
    speed_rpm: float,
    duty: float,
    *,
    carrier_hz: float,
    commutation: Commutation = "NSC",
    chopping: Chopping = "ON-PWM",
    settle_s: float = 2e-6,
    settle_turns: int = 8,
    turns: int = 8,
    all_phases: bool = False,
) -> SteadyState:
    """Run to the periodic state and measure; ideal commutation instants, delayed by RSC only.

    settle_s: age of pulse and of the extinction at which a sample counts; settle_turns: turns before the measurement
    (some L/R); turns: turns measured; all_phases: add one carrier to those of the measured turns, so that commutations
    meet every phase of a carrier that runs on (else N = 20/3 meets three).
    """
    machine = Machine.from_motor(motor)
    omega = float(machine.omega_e(speed_rpm))
    n = float(machine.carriers_per_sector(speed_rpm, carrier_hz)) + (1.0 / (SECTORS * turns) if all_phases else 0.0)
    sequence = gate_sequence(commutation, n, duty, turns=settle_turns + turns, chopping=chopping)
    # y = 0 is the entry into sector II.
    plant = plant_at_speed(motor, inverter, speed_rpm, 90.0, NO_SENSING, 0)
    start = plant.theta_e_rad
    rows = _run(plant, sequence, 2.0 * np.pi / (omega * CLOCK_S))
    rows = rows[rows[:, _THETA] >= start + 2.0 * np.pi * settle_turns - ROUNDING_RAD]
    energy_j, turned = rows[-1, _ENERGY] - rows[0, _ENERGY], rows[-1, _THETA] - rows[0, _THETA]

    events = plant.events()
    extinctions = events[events["kind"] == L.EXTINCTION]
    pulse = np.abs(space_vector(sequence.gates)) > 0.5
    on = start + 2.0 * np.pi * sequence.at[pulse]
    off = start + 2.0 * np.pi * np.append(sequence.at[1:], sequence.length)[pulse]
    freewheel, visible = [], []
    for row, following in pairwise(rows):
        own = extinctions["phase"] == FLOATING_PHASE[int(row[_SECTOR])]
        end = extinctions["theta_e"][own & (extinctions["theta_e"] > row[_THETA])]
        gone = row[_THETA] if row[_CURRENT] == 0.0 else float(end[0]) if end.size else np.inf
        gone = gone if gone <= following[_THETA] else np.inf
        sample = np.maximum(on, gone) + settle_s * omega
        counts = (
            (sample > row[_THETA]) & (on > row[_THETA] - ROUNDING_RAD) & (sample < np.minimum(off, following[_THETA]))
        )
        freewheel.append(gone - row[_THETA])
        visible.append(sample[counts][0] - row[_THETA] if counts.any() else np.inf)
    return SteadyState(
        speed_rpm=speed_rpm,
        duty=duty,
        torque_nm=float(energy_j / turned) * motor.pole_pairs,
        sector=rows[:-1, _SECTOR].astype(np.int64),
        current_a=rows[:-1, _CURRENT],
        freewheel_deg=np.degrees(freewheel),
        visible_deg=np.degrees(visible),
    )


def duty_for_torque(
    motor: Motor,
    inverter: InverterParams,
    speed_rpm: float,
    torque_nm: float,
    *,
    carrier_hz: float,
    commutation: Commutation = "NSC",
    chopping: Chopping = "ON-PWM",
    all_phases: bool = False,
    tolerance_nm: float = 2e-5,
) -> SteadyState | None:
    """Periodic state with a given mean torque (regula falsi over the duty); None if duty 1 gives less."""

    def run(duty: float) -> SteadyState:
        return steady_operation(
            motor,
            inverter,
            speed_rpm,
            duty,
            carrier_hz=carrier_hz,
            commutation=commutation,
            chopping=chopping,
            all_phases=all_phases,
        )

    low, high = run(0.0), run(1.0)
    if high.torque_nm < torque_nm:
        return None
    low_error, high_error = low.torque_nm - torque_nm, high.torque_nm - torque_nm
    while True:
        duty = low.duty + (high.duty - low.duty) * low_error / (low_error - high_error)
        state = run(duty)
        error = state.torque_nm - torque_nm
        if abs(error) <= tolerance_nm or high.duty - low.duty < 1e-6:
            return state
        # Illinois: an end that stays twice counts half.
        if error < 0.0:
            low, low_error = state, error
            high_error *= 0.5
        else:
            high, high_error = state, error
            low_error *= 0.5


def waveforms(
    motor: Motor, inverter: InverterParams, speed_rpm: float, sequence: GateSequence, *, settle_turns: int, samples: int
) -> RecordArray:
    """Drive the circuit with a gate sequence; records at `samples` instants a turn, the settling turns left out.

    sequence: of `gate_sequence`, from start_deg 0. t_cycle in nanoseconds, the first record at 0.
    """
    turn_cycles = 2.0 * np.pi / (float(Machine.from_motor(motor).omega_e(speed_rpm)) * CLOCK_S)
    # y = 0 is the entry into sector II.
    plant = plant_at_speed(motor, inverter, speed_rpm, 90.0, NO_SENSING, 0)
    plant.configure_recording(1)
    first = round(settle_turns * turn_cycles)
    turns = settle_turns + np.arange(round((sequence.length - settle_turns) * samples)) / samples
    wanted = np.round(turns * turn_cycles)
    edges = np.round(sequence.at * turn_cycles)
    following = np.searchsorted(edges, wanted, side="right")
    done = 0
    for cycle, until in zip(wanted.astype(np.int64).tolist(), following.tolist(), strict=True):
        for edge in range(done, until):
            plant.step(int(edges[edge]), int(sequence.gates[edge]))
            if edge % DRAIN_EVERY == 0:
                plant.drain()
        done = until
        plant.sample(cycle)
        plant.drain()
    found = plant.records()
    found["t_cycle"] -= first
    return found
