# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Cost of a kernel call: `python -m fluxlock.plant.bench`.

A compiled loop calls the kernel through its address, as the simulator's main does, with the events of a
six-step drive at 60 000 r/min: 12-bit samples of all channels each microsecond and gate edges of a 40 kHz
carrier; and with those of five legs under vector control at 4 kHz with 2 us of dead time, for a linear and for a
saturated machine.
"""

from __future__ import annotations

import importlib
import math
import time
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import (
    InverterParams,
    MachineParams,
    MechanicsParams,
    Plant,
    PlantParams,
    RecordingParams,
    SaturationParams,
    SensingParams,
    ThirdParams,
)
from .build import CALLBACK

CLOCK_S = 20e-9
SECTOR_PAIRS = ((0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1))


def demo_params(
    dc_link_c_f: float = 0.0,
    emf: Literal["sinusoidal", "trapezoidal"] = "sinusoidal",
    l_q_h: float | None = None,
) -> PlantParams:
    """Motor-I of the specification on its 25 V inverter; l_q_h: with another inductance on the q axis."""
    return PlantParams(
        MachineParams(1, (0.02,) * 3, (22e-6,) * 3, (1e-3,) * 3, emf=emf, l_q_h=l_q_h),
        InverterParams(25.0, r_on_ohm=5e-3, supply_r_ohm=0.02, dc_link_c_f=dc_link_c_f),
        SensingParams(30.0, 50.0, divider_pole_s=100e-9),
        MechanicsParams(5e-7, omega_m_rad_s=6283.0, fan_nm_s2_per_rad2=5.07e-10),
        RecordingParams(every_strobes=10, wave_rows=1 << 16, event_rows=1 << 16),
    )


def demo_events(duration_s: float, duty: float = 0.6, strobe_cycles: int = 50) -> npt.NDArray[np.int64]:
    """Rows [t_cycle, gates, flags]: commutation by the nominal angle, ON-PWM chopping, strobes."""
    period = round(25e-6 / CLOCK_S)
    cycles = round(duration_s / CLOCK_S)
    times = np.arange(strobe_cycles, cycles, strobe_cycles)
    edges = np.concatenate([np.arange(0, cycles, period), np.arange(round(duty * period), cycles, period)])
    sectors = np.arange(0.0, duration_s, math.pi / 3 / 6283.0) / CLOCK_S
    moments = np.unique(np.concatenate([times, edges, sectors.astype(np.int64)]))
    rows = np.zeros((len(moments), 3), np.int64)
    rows[:, 0] = moments
    for row, t in zip(rows, moments, strict=True):
        theta = math.degrees(6283.0 * t * CLOCK_S) % 360.0
        high, low = SECTOR_PAIRS[int(((theta + 150.0) % 360.0) // 60.0)]
        on = t % period < duty * period
        row[1] = (1 << (2 * high) if on else 0) | 2 << (2 * low)
        row[2] = int(t % strobe_cycles == 0)
    return rows


def five_phase_params(saturated: bool) -> PlantParams:
    """Machine of nine pole pairs and 2 kW on 350 V."""
    saturation = SaturationParams(5.0, -0.10, 0.05, (0.018, -0.025, 0.0, -0.0015), 5.0) if saturated else None
    third = ThirdParams(2e-3, 2e-3)
    return PlantParams(
        MachineParams(
            *(9, (0.5,) * 5, (11.8e-3,) * 5, (0.098,) * 5), l_q_h=13.7e-3, phases=5, third=third, saturation=saturation
        ),
        InverterParams(350.0, r_on_ohm=0.02),
        SensingParams(450.0, 10.0, divider_pole_s=1e-6),
        MechanicsParams(5e-3, omega_m_rad_s=30.0, viscous_nm_s_per_rad=2e-3),
        RecordingParams(every_strobes=10, wave_rows=1 << 16, event_rows=1 << 16),
    )


def five_leg_events(duration_s: float, strobe_cycles: int = 50, dead_cycles: int = 100) -> npt.NDArray[np.int64]:
    """Rows [t_cycle, gates, flags]: five legs about a carrier with dead time, a rotating voltage, strobes."""
    period, cycles = round(250e-6 / CLOCK_S), round(duration_s / CLOCK_S)
    edges: list[tuple[int, int, int]] = []  # cycle, leg, gates
    for begin in range(0, cycles, period):
        angle = 9 * 30.0 * begin * CLOCK_S
        for x in range(5):
            duty = 0.5 - 0.12 * math.sin(angle - 0.4 * math.pi * x)
            up, down = (round(begin + 0.5 * period * (1 - side * duty)) for side in (1, -1))
            edges += [(up, x, 0), (up + dead_cycles, x, 1), (down, x, 0), (down + dead_cycles, x, 2)]
    now = [2] * 5
    rows: dict[int, list[int]] = {t: [t, 0, 1] for t in range(strobe_cycles, cycles, strobe_cycles)}
    for t, _, _ in edges:
        rows.setdefault(t, [t, 0, 0])
    by_time = sorted(edges)
    k = 0
    for t in sorted(rows):
        while k < len(by_time) and by_time[k][0] <= t:
            now[by_time[k][1]] = by_time[k][2]
            k += 1
        rows[t][1] = sum(g << (2 * x) for x, g in enumerate(now))
    return np.array([rows[t] for t in sorted(rows)], np.int64)


def native_seconds(params: PlantParams, rows: npt.NDArray[np.int64], repeats: int = 5) -> float:
    """CPU time of the kernel calls alone, best of some repeats."""
    numba: Any = importlib.import_module("numba")
    plants = [Plant(params, seed=1, mode="jit") for _ in range(repeats + 1)]
    step: Any = CALLBACK(plants[0].address)

    def run(rows: Any, s: Any, io: Any) -> Any:  # noqa: ANN401
        for k in range(len(rows)):
            code = step(rows[k, 0], rows[k, 1], rows[k, 2], s.ctypes, io.ctypes)
            if code != 0:
                return code
        return 0

    loop = numba.njit(run)
    loop(rows[:0], plants[0].state, plants[0].io)
    best = math.inf
    for plant in plants[1:]:
        begin = time.process_time()
        code = loop(rows, plant.state, plant.io)
        best = min(best, time.process_time() - begin)
        if code:
            raise RuntimeError(plant.fault_text(code))
    return best


def main() -> None:
    """Print microseconds per event."""
    rows = demo_events(0.3)
    print(f"{len(rows)} events, 0.3 s of simulated time")
    for name, params in {
        "ideal link, sinusoidal": demo_params(),
        "capacitor, sinusoidal": demo_params(dc_link_c_f=470e-6),
        "ideal link, trapezoidal": demo_params(emf="trapezoidal"),
        "ideal link, salient": demo_params(l_q_h=44e-6),
    }.items():
        print(f"{name:25s} {native_seconds(params, rows) / len(rows) * 1e6:6.3f} us per event")
    five_legs = five_leg_events(0.1)
    for name, params in {
        "five phases": five_phase_params(saturated=False),
        "five phases, saturated": five_phase_params(saturated=True),
    }.items():
        print(f"{name:25s} {native_seconds(params, five_legs) / len(five_legs) * 1e6:6.3f} us per event")
    plant = Plant(demo_params(), seed=1, mode="py")
    begin = time.perf_counter()
    for t, gates, flags in rows[:5000].tolist():
        plant.step(t, gates, flags)
    print(f"{'plain Python':25s} {(time.perf_counter() - begin) / 5000 * 1e6:6.1f} us per event")


if __name__ == "__main__":
    main()
