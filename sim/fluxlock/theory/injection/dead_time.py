# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the compensation of the dead time leaves when every edge of the legs has its instant: float model, 2 us.

    python -m fluxlock.theory.injection.dead_time

prints the rows of docs/theory/five-phase.md. Mean voltages, as in `cases`, do not show it: the ripple of the
carrier turns the sign of the currents at the edges.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fluxlock.theory.injection.cases import DEAD_TIME_S, TIAN_BEST, YU_BEST, YU_PRINTED, Row, tian, yu
from fluxlock.theory.injection.loop import Loop, Schedule

WAYS: dict[str, dict[str, bool]] = {
    "currents at the edges": {"model": False, "edges": True},
    "HF current moved": {"model": True},
    "sampled currents": {"model": False},
}
BRAKES_NM = {"no load": 0.0, "rated brake": 11.0}
LIMITS = {"yu": 0.07, "tian": 1.0, "driven": 0.005}  # rad, deg, rad; of the currents at the edges
SPEEDS_RPM = (150.0, 600.0)
REST_ANGLES_RAD = np.arange(6) * math.pi / 30


def switched(loop: Loop, way: dict[str, bool]) -> Loop:
    """The same drive with edges, compensated one way."""
    return replace(loop, inverter=replace(loop.inverter, switched=True, **way))


def yu_start_rad(
    way: dict[str, bool], brake_nm: float, seconds: float = 1.5, dead_time_s: float = DEAD_TIME_S
) -> float:
    """Largest 5 ms mean of a step to 50 r/min at 0.3 s."""
    loop = switched(yu(YU_BEST, dead_time_s), way)
    speed = np.where(loop.times(seconds) > 0.3, loop.motor.omega_e(50.0), 0.0)
    return loop.run(Schedule(seconds, speed_rad_s=speed, coulomb_nm=brake_nm)).largest_mean(0.2)


def tian_standstill_deg(way: dict[str, bool]) -> float:
    """Largest mean error over rest angles, i_q 0 and 0.3 A."""
    loop = switched(tian(TIAN_BEST, DEAD_TIME_S), way)
    means = [
        loop.run(Schedule(0.5, imposed_rad_s=0.0, i_q_a=i_q, theta_rad=float(theta))).statistics(0.25).degrees().mean
        for theta in REST_ANGLES_RAD
        for i_q in (0.0, 0.3)
    ]
    return max(means, key=abs)


def yu_driven_rad(way: dict[str, bool], rpm: float, seconds: float = 1.0) -> float:
    """Mean error of the exact sequence on a driven shaft without current and saturation."""
    loop = switched(yu(replace(YU_PRINTED, sequence="exact"), DEAD_TIME_S, saturated=False), way)
    return loop.run(Schedule(seconds, imposed_rad_s=loop.motor.omega_e(rpm))).statistics(0.2, raw=True).mean


def rows() -> list[Row]:
    """All ways; limits for the one that the chip has."""
    found = []
    for text, way in WAYS.items():
        limited = "edges" in way
        for load, brake_nm in BRAKES_NM.items():
            value = yu_start_rad(way, brake_nm)
            found.append(Row(f"yu 0 to 50 r/min, {load}, {text}", value, "rad", LIMITS["yu"] if limited else None))
        for rpm in SPEEDS_RPM:
            limit = LIMITS["driven"] if limited else None
            found.append(Row(f"yu driven at {rpm:g} r/min, {text}", yu_driven_rad(way, rpm), "rad", limit))
        value = tian_standstill_deg(way)
        found.append(Row(f"tian standstill, {text}", value, "deg", LIMITS["tian"] if limited else None))
    return found


def main() -> None:
    """Print the rows; exit code 1 if a limit is missed."""
    found = rows()
    for row in found:
        print(row.text())
    if not all(row.passed for row in found):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
