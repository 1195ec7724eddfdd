# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A lost angle in six-step: faults made on purpose, each found in time by name, and the rotor not turned back."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from fluxlock.native import averaged_motor as am
from tests.firmware.firmware_bench import Bench, commutation_errors_deg

BASE_RPM = 60_000
FOUND_S = 0.02  # above a tenth of that speed, below it half an electrical turn if that is longer
AFTERWARDS_S = 0.1
AGAINST_DEG = 90.0  # electrical, in the wrong direction
ALIGNED_BACK_DEG = 210.0  # the same as a new start aligns the rotor, which may turn slowly yet
HELD_DEG = 15.0  # a quarter of a sector, of each commutation of a turn
SECTORS = 6
NAMED_S = 0.003  # from the trip to its cause


def logged(bench: Bench) -> list[str]:
    """Names in the fault log, the newest first."""
    return [line.split()[1] for line in bench.fw.command("faults") if line.startswith("fault ")]


def jump(bench: Bench, degrees: float) -> None:
    """The rotor is elsewhere than the commutations believe."""
    bench.model.s[am.THETA] += math.radians(degrees)


def lock(bench: Bench) -> None:
    """The rotor stands."""
    bench.model.m[am.M_LOCKED] = 1.0


def halt(bench: Bench) -> None:
    """The rotor stands for a moment, and may go where the current pulls it."""
    bench.model.s[am.OMEGA] = 0.0


def halve(bench: Bench) -> None:
    """The commutations come at another frequency than the rotor's."""
    bench.model.s[am.OMEGA] *= 0.5


FAULTS: dict[str, Callable[[Bench], None]] = {
    "jump-60": lambda bench: jump(bench, 60.0),
    "jump-120": lambda bench: jump(bench, 120.0),
    "jump-180": lambda bench: jump(bench, 180.0),
    "locked": lock,
    "standing": halt,
    "wrong-frequency": halve,
}


@pytest.mark.parametrize("share", [0.05, 0.5, 1.0])
@pytest.mark.parametrize("fault", FAULTS)
def test_lost_angle_is_found_in_time_by_name(fault: str, share: float) -> None:
    """The rotor jumps, stands or turns at another speed: named in time, or commutated rightly by then.

    Whether crossings take a rotor that has jumped again hangs on the place in the sector where it did: either is right.
    Where the voltage of the speed meets a slower rotor, its current trips the hardware at once, by that name. The log
    says besides that the rotor stands.

    Verifies: FW-20, FW-63
    """
    bench = Bench()
    bench.start(round(share * BASE_RPM), 1.0)
    bench.run(1.2)  # a lock that holds
    turn_s = 60.0 / (bench.model.rpm * bench.scenario.motor.pole_pairs)
    limit_s = max(FOUND_S, turn_s / 2)
    FAULTS[fault](bench)
    furthest_rad, back_rad = bench.model.s[am.THETA], {False: 0.0, True: 0.0}
    aligns = False

    def ended() -> bool:
        nonlocal furthest_rad, aligns
        aligns = aligns or bench.model.c[am.C_SEQ] == am.SEQ_MANUAL
        furthest_rad = max(furthest_rad, bench.model.s[am.THETA])
        back_rad[aligns] = max(back_rad[aligns], furthest_rad - bench.model.s[am.THETA])
        return bench.fw.state != "running"

    found = bench.run(limit_s, ended)
    if found:
        bench.run(NAMED_S)
        slower = fault in {"locked", "standing", "wrong-frequency"} and share > 0.1
        stands = slower and fault != "wrong-frequency"
        # The newest first: what a trip was the consequence of.
        assert logged(bench)[:2] == ["stalled", "phase_over_current"] if stands else "stalled" not in logged(bench)
        # With the field against the EMF a current may trip before crossings are missed.
        names = {"lost_lock", "phase_over_current"}
        assert "phase_over_current" in logged(bench) if slower else logged(bench)[0] in names
    else:
        # The crossings have taken the rotor again by themselves: they commutate rightly from the limit on.
        assert fault not in {"locked", "standing"}
        errors_deg = commutation_errors_deg(bench, round(turn_s / bench.tick_s) + 1)
        assert abs(errors_deg).max() < HELD_DEG and len(errors_deg) >= SECTORS
        assert logged(bench) == []
    bench.run(AFTERWARDS_S, lambda: ended() and False)
    assert found or (bench.fw.state == "running" and bench.model.rpm > 0.9 * share * BASE_RPM)
    assert math.degrees(back_rad[False]) < AGAINST_DEG
    assert math.degrees(back_rad[True]) < ALIGNED_BACK_DEG
