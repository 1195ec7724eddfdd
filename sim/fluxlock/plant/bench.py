"""Cost of a kernel call: `python -m fluxlock.plant.bench`.

A compiled loop calls the kernel through its address, as the simulator's main does, with the events of a
six-step drive at 60 000 r/min: 12-bit samples of all channels each microsecond and gate edges of a 40 kHz
carrier.
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
    SensingParams,
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
    plant = Plant(demo_params(), seed=1, mode="py")
    begin = time.perf_counter()
    for t, gates, flags in rows[:5000].tolist():
        plant.step(t, gates, flags)
    print(f"{'plain Python':25s} {(time.perf_counter() - begin) / 5000 * 1e6:6.1f} us per event")


if __name__ == "__main__":
    main()
