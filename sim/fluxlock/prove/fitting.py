# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""An inverter that fits a motor and a supply, by the rules of the population of random machines."""

from __future__ import annotations

import math

from fluxlock.config.inverter import Inverter, Protection, Sensing
from fluxlock.config.motor import Motor
from fluxlock.population.draw import DEAD_TIME_S, DEAD_TIME_SHARE, LIMIT_SHARE, SWITCH_SHARE, TRIP_SHARE, six_digits


def fitting_inverter(motor: Motor, supply_v: float, carrier_hz: float) -> Inverter:
    """Switches of a twentieth of the resistance; full scales and trips above limit and ripple."""
    dead_s = math.ceil(min(max(DEAD_TIME_SHARE / carrier_hz, DEAD_TIME_S[0]), DEAD_TIME_S[1]) * 50e6) / 50e6
    ripple_a = supply_v / (8 * min(motor.inductance_h) * carrier_hz)
    trip_a = TRIP_SHARE * LIMIT_SHARE * motor.rated_current_a + ripple_a / 2
    return Inverter(
        name=f"fitting {supply_v:g} V",
        supply_v=supply_v,
        on_resistance_ohm=six_digits(SWITCH_SHARE * sum(motor.resistance_ohm) / 3),
        dead_time_s=dead_s,
        min_pulse_s=2 * dead_s,
        sensing=Sensing(
            sample_period_s=1e-6,
            voltage_full_scale_v=six_digits(1.3 * supply_v),
            current_full_scale_a=six_digits(1.1 * trip_a),
            divider_pole_s=100e-9,
        ),
        protection=Protection(phase_current_a=six_digits(trip_a), dc_current_a=six_digits(trip_a)),
    )
