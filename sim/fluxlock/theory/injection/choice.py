# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Settings of the injection by rule for a motor and an inverter, period by period."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fluxlock.config import Motor, Scenario
from fluxlock.config.checks import check_scenario
from fluxlock.config.drive import Drive
from fluxlock.config.injection_rules import (
    angle_noise_rad,
    injection_loops,
    loop_through_demodulator,
    search_current,
    wave_of,
)
from fluxlock.config.inverter import Inverter

PERIODS = (4, 6, 8, 10, 12, 16, 20, 24, 32)  # updates, as `period` permits them
PEAK_SHARE = 1 / 3  # of the rated current
VOLTAGE_SHARE = 0.5  # of the largest phase voltage
QUIET_DEG = 1.5  # noise that costs nothing: among quieter choices the faster loop is better


@dataclass(frozen=True)
class Choice:
    """A period with the amplitude for it (V), peak of the HF current (A), rms noise of the angle, loops, S, search.

    refused: what the file check says, empty if nothing.
    """

    period: int
    amplitude_v: float
    peak_a: float
    noise_deg: float
    pll_hz: float
    speed_hz: float
    loop: float
    search_a: float
    refused: str


def choices(m: Motor, converter: Inverter, carrier_hz: float, largest: int) -> Iterator[Choice]:
    """Of the periods up to the largest."""
    for period in (p for p in PERIODS if p <= max(largest, PERIODS[0])):
        wanted_v = PEAK_SHARE * m.rated_current_a * 4 * m.inductance_h[0] * carrier_hz / period
        amplitude_v = min(wanted_v, VOLTAGE_SHARE * converter.supply_v / math.sqrt(3))
        injection = {"method": "iq", "amplitude_v": amplitude_v, "period": period}
        drive = {
            "method": "vector",
            "carrier_hz": carrier_hz,
            "vector": {"update": "single", "injection": injection},
        }
        s = Scenario(
            name="choice",
            motor=m,
            inverter=converter,
            duration_s=1.0,
            drive=Drive.model_validate(drive),
        )
        wave, loops = wave_of(s), injection_loops(s)
        problems = check_scenario(s)
        yield Choice(
            period,
            amplitude_v,
            wave.peak_a,
            math.degrees(angle_noise_rad(s, wave)),
            loops.pll_hz,
            loops.speed_hz,
            loop_through_demodulator(s, wave, loops.pll_hz, loops.speed_hz, loops.filter_hz),
            search_current(s),
            f"{problems[0].key}: {problems[0].message}" if problems else "",
        )


def best(found: Sequence[Choice]) -> Choice | None:
    """The one to take: of those that run the fastest loop with little noise, else the least noise; None: none runs."""
    running = [c for c in found if not c.refused]
    quiet = [c for c in running if c.noise_deg <= QUIET_DEG]
    if quiet:
        return max(quiet, key=lambda c: c.pll_hz)
    return min(running, key=lambda c: c.noise_deg, default=None)
