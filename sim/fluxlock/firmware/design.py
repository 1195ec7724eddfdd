# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A scenario in the firmware's units, and the quantities of six-step operation that several parameters follow from.

Symbols: psi phase flux (peak), p pole pairs, R_l line resistance 2 (R + R_on), k_e mean line EMF of the conducting
pair per mechanical speed (= torque per ampere), w mechanical and w_e electrical speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.drive import CURRENT_BANDWIDTH_MAX_HZ, CURRENT_LOOP_LAG_RAD, CURRENT_LOOP_LAG_TICKS, TICK_HZ
from fluxlock.config.machine import Machine
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import Scenario
from fluxlock.config.settling import Settling, crossing_settling
from fluxlock.config.vector_design import told_machine
from fluxlock.config.vector_timing import VectorTiming, vector_timing

Q5, Q8, Q16, Q17, Q18, Q20, Q21, Q22, Q24, Q25 = (2**bits for bits in (5, 8, 16, 17, 18, 20, 21, 22, 24, 25))
Q29, Q30, Q32, Q36, Q44, Q60 = 2**29, 2**30, 2**32, 2**36, 2**44, 2**60
RPM_Q8 = RPM_PER_RAD_S * Q8  # speed of 1 rad/s

# Share of the start current's torque that the open-loop ramp asks for: the rest is the margin against load.
RAMP_TORQUE_SHARE = 0.3
# Fewest sectors in which it reaches the hand-over speed.
RAMP_SECTORS_MIN = 2
RAMP_STEP_MAX_RPM = 2**31 / Q20 - 1  # what a control tick can add
INTERVAL_MAX_CYCLES = 0xFFFFFF
# Amplitude of the floating EMF at the end of a sector, in converter steps, from which crossings are trusted.
HANDOVER_LSB = 30.0
HANDOVER_SPEED_SHARE = 0.05
START_CARRIER_HZ = 8e3
# Highest speed at which a coasting rotor is shorted, over that of the hand-over: a drive lets go below it.
COAST_RATIO = 1.25
# Over-voltage margin used up by braking: the current falls to zero between these shares of supply to trip.
BRAKE_MARGIN = (0.3, 0.75)
BANDWIDTH_HZ = 30.0
# Phase that the delay of the speed may cost at the bandwidth, and that delay in electrical turns.
SPEED_DELAY_RAD = 0.35
SPEED_DELAY_TURNS = 3.5 / 6.0
CURRENT_BANDWIDTH_HZ = 100.0
# Carrier over the time constant of the rotor on its EMF line, from which on a cut carrier shows in the speed.
CARRIER_SHARE = 1 / 150
# Carriers of a sector beyond which they run on: a light rotor that swings, or one that its EMF alone holds; any other.
RESTART_CARRIERS, RESTART_ALWAYS = 8, 30_000
# Of the rotor on its EMF, from which on the beat of carriers that run on is no resonance.
SWING_DAMPING = 0.25


@dataclass(frozen=True)
class Design:
    """A scenario and what follows from it. volt, ampere: of 1 V, 1 A in parts of 2^-25 of the full scale."""

    s: Scenario

    @cached_property
    def machine(self) -> Machine:
        """The machine as the firmware is told it."""
        return told_machine(self.s)

    @cached_property
    def timing(self) -> VectorTiming | None:
        """Clocks of vector control."""
        return vector_timing(self.s.drive, self.s.inverter) if self.s.drive.method == "vector" else None

    @cached_property
    def tick_s(self) -> float:
        """Control tick."""
        return self.timing.tick_cycles / CLOCK_HZ if self.timing else 1.0 / TICK_HZ

    @cached_property
    def volt(self) -> float:
        """Of 1 V."""
        return Q25 / self.s.inverter.sensing.voltage_full_scale_v

    @cached_property
    def ampere(self) -> float:
        """Of 1 A."""
        return Q25 / self.s.inverter.sensing.current_full_scale_a

    @property
    def step_v(self) -> float:
        """Step of the voltage channels."""
        return self.s.inverter.sensing.step_v

    @property
    def half_codes(self) -> int:
        """Codes of the current channels for one sign."""
        return int(2 ** (self.s.inverter.sensing.bits - 1))

    def ticks(self, seconds: float) -> int:
        """Control ticks, at least one."""
        return max(1, round(seconds / self.tick_s))

    def code(self, volts: float) -> int:
        """Code of a voltage channel."""
        return int(min(2**self.s.inverter.sensing.bits - 1, round(volts / self.step_v)))

    def v_q17(self, volts: float) -> int:
        """Voltage that a channel can show."""
        return max(1, min(Q17, round(volts * self.volt / Q8)))

    # Currents.
    @cached_property
    def trip_a(self) -> float:
        """Trip of the phase currents, which the converter can see."""
        return self.visible_a(self.s.inverter.protection.phase_current_a)

    def visible_a(self, trip_a: float) -> float:
        """A trip that the converter can see."""
        return min(trip_a, 0.97 * self.s.inverter.sensing.current_full_scale_a)

    @cached_property
    def start_a(self) -> float:
        """Current of alignment and open-loop ramp."""
        if self.s.drive.start.current_a is not None:
            return self.s.drive.start.current_a
        return min(0.35 * self.s.rated_current_a, 0.6 * self.s.current_limit_a, 0.4 * self.trip_a)

    # Samples of the crossing detection.
    @cached_property
    def settling(self) -> Settling:
        """What the crossing detection waits after an edge."""
        return crossing_settling(self.s.drive, self.s.inverter)

    @property
    def settle_s(self) -> float:
        """From an edge until a sample counts.

        Such a sample follows one that is settled itself: a clamp shorter than the sample spacing would else go unseen
        between an unsettled sample on its rise and one on its fall.
        """
        return self.settling.settle_s

    @property
    def offset_s(self) -> float:
        """The sample that comes once a carrier: settled, and inside of the shortest pulse."""
        return self.settling.least_s - self.s.inverter.sensing.sample_period_s

    # Open-loop start.
    @cached_property
    def start_v(self) -> float:
        """Voltage of the start current at standstill."""
        return self.machine.line_ohm * self.start_a

    @cached_property
    def _handover(self) -> tuple[float, float]:
        """Mechanical speed of the hand-over (rad/s), longest carrier (s)."""
        m, p, drive = self.machine, self.s.motor.pole_pairs, self.s.drive
        crossing_slope = 0.75 if m.sinusoidal else 1.0  # floating voltage at the sector's end over psi * w_e
        w_signal = HANDOVER_LSB * self.step_v / (crossing_slope * m.psi_vs * p)
        w = max(w_signal, HANDOVER_SPEED_SHARE * m.speed_max)
        longest_s = min(1.0 / (drive.start.carrier_hz or START_CARRIER_HZ), math.pi / (3.0 * p * w) / 6.0)
        # A pulse must hold settled samples even in the longest carrier.
        least_v = 1.1 * self.settling.least_s / longest_s * self.s.inverter.supply_v
        w = min(max(w, (least_v - self.start_v) / m.k_e), 0.3 * m.speed_max)
        return w, max(longest_s, 1.0 / drive.carrier_hz)

    @property
    def w_handover(self) -> float:
        """Mechanical speed of the hand-over (rad/s)."""
        return self._handover[0]

    @property
    def longest_s(self) -> float:
        """Longest carrier."""
        return self._handover[1]

    @cached_property
    def handover_interval_s(self) -> float:
        """A sector at the hand-over."""
        return math.pi / (3.0 * self.s.motor.pole_pairs * self.w_handover)

    @cached_property
    def ramp_rad_s2(self) -> float:
        """Mechanical acceleration of the open-loop ramp."""
        p = self.s.motor.pole_pairs
        accel = RAMP_TORQUE_SHARE * self.machine.k_e * self.start_a / self.s.motor.inertia_kgm2
        accel = min(accel, p * self.w_handover**2 / (2.0 * RAMP_SECTORS_MIN * math.pi / 3.0))
        accel = max(accel, math.pi / 3.0 / p * (CLOCK_HZ / INTERVAL_MAX_CYCLES) ** 2)
        return min(accel, RAMP_STEP_MAX_RPM / RPM_PER_RAD_S / self.tick_s)

    @cached_property
    def align_s(self) -> float:
        """Time in which the rotor settles on a vector: 4.5 time constants of its slowest mode, 20 ms to 0.6 s.

        Stiffness 3/2 p^2 psi I; the legs shorted by the lower switches damp with 3/2 p^2 psi^2 / R.
        """
        m, inertia = self.machine, self.s.motor.inertia_kgm2
        p2 = 1.5 * self.s.motor.pole_pairs**2 * m.psi_vs
        stiffness = p2 * self.start_a / inertia
        sigma = p2 * m.psi_vs / m.resistance_ohm / (2.0 * inertia)
        slowest = sigma if sigma**2 < stiffness else stiffness / (sigma + math.sqrt(sigma**2 - stiffness))
        return min(0.6, max(0.02, 4.5 / slowest))

    @cached_property
    def w_coast(self) -> float:
        """Mechanical speed below which the lower switches may short the machine, at most 1.25 of the hand-over.

        Its current stays under 0.6 of the trip and 0.8 of the limit then; it has the bound psi / L: below those, any
        speed will do.
        """
        m, current_a = self.machine, min(0.6 * self.trip_a, 0.8 * self.s.current_limit_a)
        most = self.w_handover if self.timing else COAST_RATIO * self.w_handover
        reach = m.psi_vs**2 - (current_a * m.inductance_h) ** 2
        if reach <= 0.0:
            return most
        return min(most, current_a * m.resistance_ohm / math.sqrt(reach) / self.s.motor.pole_pairs)

    # Loops.
    @cached_property
    def bandwidth(self) -> float:
        """Of the speed loop, rad/s."""
        if self.s.drive.speed_bandwidth_hz is not None:
            return 2.0 * math.pi * self.s.drive.speed_bandwidth_hz
        return min(2.0 * math.pi * BANDWIDTH_HZ, SPEED_DELAY_RAD / self.lag_s)

    @property
    def damping_ohm(self) -> float:
        """Resistance R_t that damps the rotor on the spring of its EMF; at least the line's own.

        EMF and inductance make the rotor swing at k_e/sqrt(J L_l). R_t = k_e sqrt(2 L_l/J) damps that by 0.7; the delay
        of the measured current bounds it.
        """
        m = self.machine
        wanted = m.k_e * math.sqrt(2.0 * m.line_h / self.s.motor.inertia_kgm2)
        return max(m.line_ohm, min(wanted, CURRENT_LOOP_LAG_RAD / CURRENT_LOOP_LAG_TICKS * m.line_h / self.tick_s))

    @property
    def restart_carriers(self) -> int:
        """Carriers of a sector up to which a commutation starts them anew, if asked for.

        The EMF line moves the rotor with the time constant J R_l / k_e^2. Where a carrier is no small part of it, cut
        pulses show in the speed: from some carriers a sector on they run on. A rotor whose swing on the spring of its
        EMF is damped as well, 1/2 sqrt(J R_l^2 / (k_e^2 L_l)), bears the beat of few carriers that run on; cut ones
        take the line away that holds it.
        """
        m = self.machine
        moves_s = self.s.motor.inertia_kgm2 * m.line_ohm / m.k_e**2
        if 1.0 / self.s.drive.carrier_hz <= CARRIER_SHARE * moves_s:
            return RESTART_ALWAYS
        damped = 0.5 * math.sqrt(moves_s * m.line_ohm / m.line_h) >= SWING_DAMPING
        return 0 if damped else RESTART_CARRIERS

    @property
    def firm_restart_carriers(self) -> int:
        """The same of a firm drive (drive/six_step/regulate.h): its EMF line alone holds any rotor."""
        return min(self.restart_carriers, RESTART_CARRIERS)

    @property
    def lag_s(self) -> float:
        """From the current reference to the torque: the control's delay and the rise of the current."""
        return 1.5 * self.tick_s + self.machine.line_h / self.damping_ohm

    @cached_property
    def current_bandwidth(self) -> float:
        """Of the current loop, rad/s."""
        asked_hz = self.s.drive.current_bandwidth_hz or CURRENT_BANDWIDTH_HZ
        return min(2.0 * math.pi * asked_hz, 2.0 * math.pi * CURRENT_BANDWIDTH_MAX_HZ)


def cycles(seconds: float) -> int:
    """Clocks."""
    return round(seconds * CLOCK_HZ)
