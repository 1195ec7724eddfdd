# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Start, hand-over and catching of the firmware against models in floating point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from random import Random

import pytest

from fluxlock.firmware.binding import new
from fluxlock.headers import CData


def test_start_sector_pulls_by_90_degrees(lib: CData) -> None:
    """The field of the start sector leads the aligned rotor by 90 degrees in the direction of rotation.

    Verifies: FW-09
    """
    high, low = (0, 0, 1, 1, 2, 2), (1, 2, 2, 0, 0, 1)
    for leg in range(3):
        for reverse in (False, True):
            sector = lib.start_sector(leg, reverse)
            field = sum(s * complex(math.cos(a), math.sin(a)) for s, a in (
                (1, 2 * math.pi / 3 * high[sector]), (-1, 2 * math.pi / 3 * low[sector])))  # fmt: skip
            ahead = math.degrees(math.atan2(field.imag, field.real)) - 120 * leg
            assert (ahead - (-90 if reverse else 90) + 180) % 360 - 180 == pytest.approx(0, abs=1e-9)


def test_forced_intervals_accelerate_evenly(lib: CData) -> None:
    """The sum of the intervals is the time that a constant acceleration needs: to 5e-4 of it.

    Verifies: FW-09
    """
    first = 500_000
    total = first
    for n in range(400):
        total += lib.forced_interval_cycles(first, n)
        wanted = first * math.sqrt(2 * n + 3)
        assert total == pytest.approx(wanted, rel=5e-4), n


def test_handover_takes_two_crossings_that_follow_each_other(lib: CData) -> None:
    """One commutation between them, or both of one tick, and a speed within the bounds; nothing else; counters wrap.

    Verifies: FW-11
    """
    h = new("handover_t")

    def after(*steps: tuple[int, int, int]) -> list[bool]:
        """Whether each step hands over. steps: new crossings, new commutations, interval in clocks."""
        crossings, commutations, found = 65_535, 7, []
        lib.handover_reset(h, crossings)
        for fresh, more, interval in steps:
            crossings, commutations = (crossings + fresh) & 0xFFFF, commutations + more
            found.append(lib.handover_step(h, crossings, commutations, interval, 25_000, 400_000))
        return found

    assert after((1, 0, 100_000), (0, 1, 100_000), (1, 0, 100_000)) == [False, False, True]
    assert after((1, 0, 100_000), (1, 1, 25_000)) == [False, True]
    assert after((1, 0, 100_000), (1, 1, 400_000)) == [False, True]
    assert after((1, 0, 100_000), (1, 1, 24_999)) == [False, False]
    assert after((1, 0, 100_000), (1, 1, 400_001), (1, 1, 100_000)) == [False, False, True]
    assert after((1, 0, 100_000), (1, 2, 100_000), (1, 1, 100_000)) == [False, False, True]
    assert after((1, 1, 100_000), (1, 0, 100_000)) == [False, False]
    assert after((2, 1, 100_000)) == [True]


@pytest.mark.parametrize("channels", [(), (0,), (2,), (0, 1), (0, 1, 2)])
def test_stuck_channels(lib: CData, channels: tuple[int, ...]) -> None:
    """One or two channels that never change are found after exactly the limit; none, or all of a dead rotor, are not.

    Verifies: FW-34
    """
    stuck, limit = new("stuck_t"), 100
    lib.stuck_reset(stuck)
    found = []
    for tick in range(2 * limit):
        v = [5000 if x in channels else round(8000 * math.sin(0.3 * tick + 2.1 * x)) for x in range(3)]
        if tick < 5:
            v = [tick + x for x in range(3)]
        # The EMF may vanish for some ticks of a turn.
        found.append(lib.stuck_step(stuck, v, tick % 21 != 0, limit))
    assert any(found) == (len(channels) in (1, 2))
    if any(found):
        assert found.index(True) == 5 + limit, "the first of equal values begins the count"
    rest = [5000, 0, 0]
    lib.stuck_reset(stuck)
    assert not any(lib.stuck_step(stuck, rest, False, limit) for _ in range(4 * limit)), "no EMF"


def spinning(
    step_deg: float, shares: tuple[float, ...], noise: Random, amplitude: float = 20_000.0
) -> Iterator[list[int]]:
    """Terminals of a coasting machine whose phases have these shares of the EMF, as a converter shows them."""
    theta_deg = noise.uniform(0.0, 360.0)
    while True:
        theta_deg += step_deg
        e = [-amplitude * f * math.sin(math.radians(theta_deg - 120 * x)) for x, f in enumerate(shares)]
        lift = -min(e) - 100.0
        yield [max(0, round(x + lift + noise.gauss(0, 60))) for x in e]


def verdict_of(lib: CData, voltages: Iterator[list[int]], least: int = 2000) -> tuple[int, int]:
    """The first verdict and the ticks to it."""
    winding = new("winding_t")
    lib.winding_reset(winding)
    for tick, v in enumerate(voltages, 1):
        verdict = lib.winding_step(winding, v, least)
        if verdict != lib.WINDING_UNKNOWN:
            return verdict, tick
    raise AssertionError("no verdict")


@pytest.mark.parametrize(
    ("shares", "shorted"),
    [
        ((1.0, 1.0, 1.0), False),
        ((1.03, 0.97, 1.0), False),
        ((0.2, 1.0, 1.0), True),
        ((1.0, 0.4, 1.0), True),
        ((0.1, 0.1, 1.0), True),
        ((1.0, 0.0, 0.0), True),
    ],
)
def test_winding(lib: CData, shares: tuple[float, ...], shorted: bool) -> None:
    """Bridged turns are seen at every speed up to a third of a turn a tick, within 13 ms or five turns.

    Verifies: FW-64
    """
    for seed, step_deg in enumerate((1.0, -3.3, 17.0, 60.0, 72.0, 90.0, -110.0, 119.0)):
        rng = Random(seed)
        verdict, ticks = verdict_of(lib, spinning(step_deg, shares, rng))
        assert verdict == (lib.WINDING_SHORTED if shorted else lib.WINDING_WHOLE), (seed, step_deg)
        assert ticks <= (1 + shorted) * max(64, 900.0 / abs(step_deg)), (seed, step_deg)


def test_winding_beside_a_channel_that_stays(lib: CData) -> None:
    """A terminal that does not move says nothing of the winding.

    Verifies: FW-64
    """
    for back in (30, 10_000):
        turning = enumerate(spinning(17.0, (1.0, 1.0, 1.0), Random(1)))
        voltages = ([90_000 if tick < back else v[0], v[1], v[2]] for tick, v in turning)
        assert verdict_of(lib, voltages)[0] == lib.WINDING_WHOLE, back


def shown_voltages(theta: float, amplitude: float, diode: float, rng: Random) -> list[int]:
    """Terminal voltages of a coasting rotor as a converter that knows no negative ones shows them."""
    e = [-amplitude * math.sin(math.radians(theta - 120 * x)) for x in range(3)]
    lift = max(0.0, -min(e) - diode)
    return [max(0, round(v + lift + rng.gauss(0, 20))) for v in e]


@pytest.mark.parametrize("degrees_a_tick", [3.0, -3.0, 17.3, -36.0, 56.4, 60.0, -60.0, 100.0, -118.0])
def test_catch_measures_and_chooses_the_sector(lib: CData, degrees_a_tick: float) -> None:
    """Noisy terminal voltages: step within 1.6 degrees; the entered sector's crossing is 5 to 85 degrees ahead.

    Verifies: FW-30
    """
    rng = Random(10)
    for _ in range(60):
        rotor, mean = new("catch_t"), new("int32_t")
        theta, done = rng.uniform(0, 360), False
        amplitude, diode = rng.uniform(3_000, 40_000), rng.choice([0.0, 0.2, 0.38])
        sign = 1 if degrees_a_tick > 0 else -1
        for _ in range(40):
            theta += degrees_a_tick
            v, line = new("int32_t[3]"), amplitude * math.sqrt(3)
            shown = shown_voltages(theta, sign * amplitude, diode * amplitude, rng)
            spread = lib.catch_restore(shown, round(diode * amplitude), v)
            assert 0.7 * line < spread < 1.1 * line
            done = lib.catch_step(rotor, v, mean)
            if done:
                break
        assert done
        assert mean[0] / 2**32 * 360 == pytest.approx(degrees_a_tick, abs=1.6)
        update = theta + degrees_a_tick
        sector = lib.catch_sector((rotor.angle + mean[0]) % 2**32, degrees_a_tick < 0)
        # theta' = theta + 180; the crossing of sector index s at 60 + 60 s forward, 240 + 60 s backward.
        crossing = 60 + 60 * sector if sign > 0 else 240 + 60 * sector
        ahead = sign * (crossing - (update + 180)) % 360
        assert 5.0 < ahead < 85.0, (sector, update)
        if lib.catch_begins((rotor.angle + mean[0]) % 2**32, degrees_a_tick < 0):
            assert 4.0 < ahead < 51.0, (sector, update)
        cycles = lib.catch_sector_cycles(mean[0], 5000)
        assert cycles == pytest.approx(5000 * 60 / abs(degrees_a_tick), rel=0.6 if abs(degrees_a_tick) < 5 else 0.08)


def test_catch_refuses_what_does_not_turn_evenly(lib: CData) -> None:
    """Noise, a stuck channel at speed, or more than a third of a turn a tick are not caught.

    Verifies: FW-30
    """
    rng = Random(11)
    for case in ("noise", "stuck", "fast"):
        rotor, mean, caught = new("catch_t"), new("int32_t"), 0
        for k in range(200):
            angle = math.radians(k * (30.0 if case == "stuck" else 130.0))
            v = [20_000 * math.sin(angle - 2 * math.pi / 3 * x) for x in range(3)]
            if case == "noise":
                v = [rng.gauss(0, 50) for _ in range(3)]
            elif case == "stuck":
                v[1] = 9_000.0
            caught += lib.catch_step(rotor, list(map(round, v)), mean)
        assert caught == 0, case
