# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""When the vector drive samples, and when the voltage of a sample acts.

An update every T_s: the whole carrier, or half of it with double update. T_d is the time from the mean instant of the
current window to the update at which its voltage acts; at the machine it acts by the gates' delay and half a dead time
later, which T_d contains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.drive import Drive
from fluxlock.config.inverter import Inverter

# Last codes of a window to the pins of the update at which their voltage acts, clocks: regulators in hardware (of a
# mean; 76 of one sample), on the core.
LATENCY_CYCLES = 83
INJECTION_LATENCY_CYCLES = 165  # with an injection, of five phases too
CORE_LATENCY_CYCLES = 600
WINDOW_SAMPLES_MAX = 255
SAMPLE_CYCLES_MAX = 65535
TICK_SAMPLES_MAX = 255
TICK_HZ = 20e3
INJECTION_TICK_HZ = 10.5e3  # a control step with injection takes up to 5500 clocks
TICK_HZ_MAX = 25e3
UPDATE_HZ_MAX = 100e3
CORE_UPDATE_HZ_MAX = 20e3  # the rest of the core's time belongs to the control step


@dataclass(frozen=True)
class VectorTiming:
    """All in clocks; delay is T_d over T_s, as these clocks make it.

    sample_cycles: T_s; from_cycles, length_cycles: window after the update, length 0: one sample; offset_cycles: first
    sample of the converter after the update.
    """

    sample_cycles: int
    carrier_cycles: int
    tick_samples: int
    from_cycles: int
    length_cycles: int
    offset_cycles: int
    delay: float

    @property
    def tick_cycles(self) -> int:
        """Clocks from one control tick to the next."""
        return self.sample_cycles * self.tick_samples


@dataclass(frozen=True)
class _Window:
    """Window in clocks: T_s that it belongs to, span from its first to its last sample, number of samples."""

    sample_cycles: int
    span: int
    count: int

    @staticmethod
    def of(drive: Drive, inverter: Inverter) -> _Window:
        """The mean over a T_s takes whole converter periods, so that the sample grid runs on through an update."""
        ts = round(CLOCK_HZ / update_hz(drive))
        converter = round(inverter.sensing.sample_period_s * CLOCK_HZ)
        if drive.vector.window == "sample":
            count = drive.vector.injection.samples if drive.vector.injection else 1
            return _Window(ts, (count - 1) * converter, count)
        count = max(1, round(ts / converter))
        return _Window(count * converter, (count - 1) * converter, count)


def update_hz(drive: Drive) -> float:
    """1 / T_s."""
    return 2 * drive.carrier_hz if drive.vector.update == "double" else drive.carrier_hz


def update_hz_max(drive: Drive) -> float:
    """Largest 1 / T_s that the regulators keep up with."""
    return CORE_UPDATE_HZ_MAX if drive.vector.current_regulator == "c" else UPDATE_HZ_MAX


def latency_cycles(drive: Drive) -> int:
    """Clocks from the last codes of a window to the pins for which the delay leaves room."""
    if drive.vector.injection is not None:
        return INJECTION_LATENCY_CYCLES
    return CORE_LATENCY_CYCLES if drive.vector.current_regulator == "c" else LATENCY_CYCLES


def tick_samples(drive: Drive) -> int:
    """Samples a control tick: what is asked for, else as few as leave the core its time."""
    most_hz = TICK_HZ if drive.vector.injection is None else INJECTION_TICK_HZ
    return drive.vector.observer_every or max(1, math.ceil(update_hz(drive) / most_hz - 1e-9))


def window_samples(drive: Drive, inverter: Inverter) -> int:
    """Samples in the window."""
    return _Window.of(drive, inverter).count


def output_shift_cycles(inverter: Inverter) -> float:
    """From the update to the middle of the edges: the gates' delay and half a dead time.

    A dead time moves the pulse of a leg that sources current and of one that sinks it by half of itself.
    """
    return (inverter.gate_delay_s + inverter.dead_time_s / 2) * CLOCK_HZ


def shortest_delay(drive: Drive, inverter: Inverter) -> float:
    """Least T_d / T_s: rest of the window after its mean instant, conversion, latency, way to the gates."""
    window = _Window.of(drive, inverter)
    conversion = math.ceil(inverter.sensing.conversion_s * CLOCK_HZ)
    after = conversion + latency_cycles(drive) + output_shift_cycles(inverter)
    return (window.span / 2 + after) / window.sample_cycles


def default_delay(drive: Drive, inverter: Inverter) -> float:
    """The shortest T_d / T_s that fits; of a single sample the shortest at which it is free of the carrier's ripple.

    That is in the middle of a gap or of a pulse: at an update, with a single one a carrier also halfway between two.
    Elsewhere the ripple counts as current: t before the middle of a gap it is u t / L, which turns the observed EMF by
    omega t |u| / |e|. With injection at an update: there the search is quiet.
    """
    shortest = shortest_delay(drive, inverter)
    if drive.vector.window == "carrier":
        return shortest
    halfway = drive.vector.update == "single" and drive.vector.injection is None
    return 0.5 if halfway and shortest <= 0.5 else 1.0


def vector_timing(drive: Drive, inverter: Inverter) -> VectorTiming:
    """Clocks for a carrier and a delay that fit (`shortest_delay`).

    The grid of the samples restarts a whole converter period later than it could: the one before cannot hold it up, and
    in step it has a sample at the earlier instant too. T_s is a whole number of converter periods where a single sample
    lies within one after the update: so the grids are in step.
    """
    vector, converter = drive.vector, round(inverter.sensing.sample_period_s * CLOCK_HZ)
    wanted = default_delay(drive, inverter) if vector.delay is None else vector.delay
    shift = output_shift_cycles(inverter)
    window = _Window.of(drive, inverter)
    ts, middle = window.sample_cycles, window.span / 2

    def begin(ts: int) -> int:
        """First clock of the window after an update; a long one began a T_s before the last one."""
        return math.floor(ts + shift - wanted * ts - middle) % ts

    if begin(ts) < converter and ts % converter:
        ts = max(1, round(ts / converter)) * converter
    first = begin(ts)
    delay = (ts + shift - middle - first) / ts
    return VectorTiming(
        sample_cycles=ts,
        carrier_cycles=2 * ts if vector.update == "double" else ts,
        tick_samples=tick_samples(drive),
        from_cycles=first,
        length_cycles=window.span + 1 if window.count > 1 or vector.window == "carrier" else 0,
        offset_cycles=first % converter + converter,
        delay=delay + round(wanted - delay),
    )
