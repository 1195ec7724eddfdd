# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Overridden crossings computed back from the first valid sample, and how far that reaches.

If the outgoing phase still freewheels at its crossing, the first valid sample lies an angle a past it, with the value
v = 3/2 psi w sin a relative to the threshold (sinusoidal EMF; psi w a / ramp for a trapezoid). Then the crossing was a
ago, exactly, and the commutation can still be on time if the sample comes before it. With the crossing 30 degrees after
the entry:

    freewheel angle + lateness of the entry + wait for the first valid sample + latency <= 60 degrees

against 30 degrees if the crossing itself must be seen. The wait is settling and a sample period; at worst the pulse
ends just before such a sample, and the chop-off gap, settling and a sample period follow. Not from the thesis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import Motor
from fluxlock.plant import CHANNEL_NAMES, SensingParams
from fluxlock.results.rundata import FloatArray
from fluxlock.theory.six_step.machine import Machine
from fluxlock.theory.six_step.switched import SingleCommutation, real_inverter

CROSSING_DEG, NEXT_DEG = 30.0, 60.0  # after the ideal entry into the sector
CLAMP_MARGIN = 0.02  # of the link voltage: closer to a rail a terminal is clamped


@dataclass(frozen=True)
class SampleTiming:
    """When samples count: settling after pulse start and extinction, sample period; latency from sample to gates."""

    settle_s: float = 2e-6
    period_s: float = 1e-6
    latency_s: float = 1e-6

    @property
    def wait_s(self) -> float:
        """Longest time to a sample that counts while the pulse lasts."""
        return self.settle_s + self.period_s


def usable_freewheel_deg(
    omega: npt.ArrayLike,
    n: npt.ArrayLike,
    duty: npt.ArrayLike,
    timing: SampleTiming,
    *,
    back_computed: bool,
    late_deg: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Largest freewheel angle (deg) at which the commutation still comes on time, whatever the carrier phase.

    omega: electrical speed (rad/s); n: carriers a sector; duty: 0..1; late_deg: lateness of the entry. back_computed:
    the first valid sample may come after the crossing, else it must come before it.
    """
    w, per_sector, m = (np.asarray(x, dtype=np.float64) for x in (omega, n, duty))
    gap_deg = (1.0 - np.minimum(m, 1.0)) * 60.0 / per_sector
    wait_deg = np.degrees(w * timing.wait_s) * np.where(gap_deg > 0.0, 2.0, 1.0)
    end = np.where(back_computed, NEXT_DEG - np.degrees(w * timing.latency_s), CROSSING_DEG)
    return np.asarray(end - np.asarray(late_deg, dtype=np.float64) - gap_deg - wait_deg)


def angle_past_crossing_deg(machine: Machine, voltage_v: npt.ArrayLike, emf_v: npt.ArrayLike) -> FloatArray:
    """Angle since the crossing from the open phase's voltage past the threshold; emf_v = psi * omega.

    Voltages above the peak give the angle of the peak.
    """
    ratio = np.asarray(voltage_v, dtype=np.float64) / np.asarray(emf_v, dtype=np.float64)
    if machine.emf == "sinusoidal":
        return np.asarray(np.degrees(np.arcsin(np.clip(ratio / 1.5, -1.0, 1.0))))
    return np.asarray(np.clip(ratio, -1.0, 1.0) * (180.0 - machine.flat_top_deg) / 2)


def emf_error_sensitivity_deg(angle_deg: npt.ArrayLike, relative_error: npt.ArrayLike) -> FloatArray:
    """Error of the crossing (deg, positive = late) if psi * omega is taken too large by a relative error.

    First order, sinusoidal EMF: error * tan(a) at the angle a past the crossing.
    """
    a = np.radians(np.asarray(angle_deg, dtype=np.float64))
    return np.asarray(np.degrees(np.asarray(relative_error) * np.tan(a)))


@dataclass(frozen=True)
class Recovered:
    """One crossing computed back: angles in degrees, since the commutation.

    freewheel_deg; sample_deg: instant of the first valid sample; error_deg: of the crossing, positive = late.
    """

    freewheel_deg: float
    sample_deg: float
    error_deg: float


def sensing_of(inverter: Inverter) -> SensingParams:
    """Converter and dividers of an inverter file."""
    s = inverter.sensing
    return SensingParams(
        v_full_scale_v=s.voltage_full_scale_v,
        i_full_scale_a=s.current_full_scale_a,
        bits=s.bits,
        divider_gain=s.divider_gain,
        divider_pole_s=s.divider_pole_s,
        noise_lsb_rms=s.noise_lsb,
    )


def _first_valid(
    run: SingleCommutation, freewheel_deg: float, settle_s: float, period_s: float, phase: float, late_deg: float
) -> tuple[float, float] | None:
    """Sample up to the first one that counts: open phase's voltage and half the link's (V).

    None if the next commutation comes before. Clamped samples do not count: a circulating current can hold the open
    phase at a rail for microseconds after turn-on.
    """
    if not np.isfinite(freewheel_deg):
        return None
    clock_s = run.plant.params.clock_period_s
    settle = settle_s / clock_s
    usable_from = run.cycle_of(freewheel_deg) + settle
    end = run.cycle_of(NEXT_DEG - late_deg)
    on_since = 0.0 if run.pulse else np.inf
    volts_per_code = run.sensing.v_full_scale_v / (1 << run.sensing.bits)
    k = 0
    while (strobe := round((k + phase) * period_s / clock_s)) < end:
        k += 1
        while run.next_edge[0] <= strobe:
            cycle, pulse = run.next_edge
            on_since = cycle if pulse else np.inf
            run.take_edge()
        if strobe < max(usable_from, on_since + settle):
            continue
        volts = run.plant.sample(strobe) * volts_per_code
        open_v, link_v = float(volts[run.floating]), float(volts[CHANNEL_NAMES.index("vdc")])
        if CLAMP_MARGIN * link_v < open_v < (1.0 - CLAMP_MARGIN) * link_v:
            return open_v, link_v / 2
    return None


def recover_crossing(
    motor: Motor,
    inverter: Inverter,
    speed_rpm: float,
    current_a: float,
    *,
    duty: float,
    carrier_hz: float,
    carrier_phase: float = 0.0,
    sector: int = 0,
    late_deg: float = 0.0,
    settle_s: float = 2e-6,
    sample_phase: float = 0.0,
    relative_emf_error: float = 0.0,
    seed: int = 0,
) -> Recovered | None:
    """Compute a crossing back from the codes of the switched plant, ON-PWM; None if no sample counts in time.

    The converter, its noise and the divider pole are those of the inverter file; samples count settle_s after pulse
    start and extinction. sample_phase: 0..1, of the sample grid at the commutation; relative_emf_error: of the
    assumed psi * omega.
    """

    def begin() -> SingleCommutation:
        return SingleCommutation(
            motor=motor,
            inverter=real_inverter(inverter, link=False),
            speed_rpm=speed_rpm,
            current_a=current_a,
            duty=duty,
            carrier_hz=carrier_hz,
            sector=sector,
            carrier_phase=carrier_phase,
            late_deg=late_deg,
            sensing=sensing_of(inverter),
            seed=seed,
        )

    freewheel = begin().freewheel_deg()
    # Again from the start, this time with samples.
    run = begin()
    found = _first_valid(run, freewheel, settle_s, inverter.sensing.sample_period_s, sample_phase, late_deg)
    if found is None:
        return None
    machine = Machine.from_motor(motor)
    past = found[0] - found[1]
    # The EMF of the open phase falls in I, III, V.
    past = -past if sector % 2 == 0 else past
    omega = abs(run.plant.omega_e_rad_s)
    emf_v = machine.psi_vs * omega * (1.0 + relative_emf_error)
    since = float(angle_past_crossing_deg(machine, past, emf_v))
    # The divider shows the voltage of one time constant ago.
    seen = run.angle_deg() - float(np.degrees(omega * run.sensing.divider_pole_s))
    crossing = seen - since + late_deg
    return Recovered(freewheel, run.angle_deg(), crossing - CROSSING_DEG)
