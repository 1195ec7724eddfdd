# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""An inverter that fits a motor and a supply, by the rules of the population of random machines."""

from __future__ import annotations

from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import Motor
from fluxlock.population.draw import LIMIT_SHARE, SWITCH_SHARE, TRIP_SHARE, stage, usual_dead_time_s


def fitting_inverter(motor: Motor, supply_v: float, carrier_hz: float) -> Inverter:
    """Switches of a twentieth of the resistance; full scales and trips above limit and ripple."""
    ripple_a = supply_v / (8 * min(motor.inductance_h) * carrier_hz)
    trip_a = TRIP_SHARE * LIMIT_SHARE * motor.rated_current_a + ripple_a / 2
    switch_ohm = SWITCH_SHARE * sum(motor.resistance_ohm) / 3
    return stage(f"fitting {supply_v:g} V", supply_v, switch_ohm, usual_dead_time_s(carrier_hz), trip_a)
