# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The encoder's levels: each edge at the first clock at which the rotor has passed it."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest

from fluxlock.plant import EncoderParams, MechanicsParams, Plant, PlantParams
from fluxlock.plant import layout as L
from tests.plant.drives import CLOCK_S, drive, motor_1

# (A, B) of the quarters of a line, in the order of positive speed.
QUARTERS = ((1, 0), (1, 1), (0, 1), (0, 0))
ROUNDING_CLOCKS = 1e-3
Edge = tuple[int, int]  # clock, levels
Passage = tuple[float, int]  # s, levels after it


def params(encoder: EncoderParams, pole_pairs: int = 4, **mechanics: Any) -> PlantParams:
    """Motor-I with other pole pairs, an encoder and a rotor that moves as stated."""
    base = motor_1(machine__pole_pairs=pole_pairs, machine__encoder=encoder)
    return dataclasses.replace(base, mechanics=MechanicsParams(5e-7, **mechanics))


def edges(plant: Plant, last: int, gates: int = 0, every: int | None = None) -> tuple[list[Edge], int]:
    """Changes of the levels up to a clock and the number of calls: as the plant asks, or each `every` clocks."""
    plant.step(0, gates, 2)
    levels = int(plant.io[L.IO_ENCODER])
    found: list[Edge] = []
    t = calls = 0
    while t < last:
        wait = int(plant.io[L.IO_ENCODER_WAIT]) if every is None else every
        assert wait >= 1
        t += wait
        calls += 1
        plant.step(t, gates, 0)
        now = int(plant.io[L.IO_ENCODER])
        if now != levels:
            found.append((t, now))
        levels = now
    return found, calls


def levels_at(encoder: EncoderParams, quarter: int) -> int:
    """A, B, Z in bits 0, 1, 2 in a quarter counted from the mounting angle."""
    a, b = QUARTERS[quarter % 4]
    first, second = (2, 1) if encoder.inverted else (1, 2)
    return first * a + second * b + (4 if encoder.index and quarter % (4 * encoder.lines) == 0 else 0)


def check(found: list[Edge], wanted: list[Passage]) -> None:
    """Each edge at the first clock at which its boundary has been passed, and none besides."""
    for (clock, levels), (instant, expected) in zip(found, wanted, strict=True):
        assert levels == expected, f"clock {clock}"
        late = clock - instant / CLOCK_S
        assert -ROUNDING_CLOCKS < late < 1.0 + ROUNDING_CLOCKS, f"clock {clock}: {late:.3f} clocks late"


@pytest.mark.parametrize(
    ("encoder", "pole_pairs", "omega_m"),
    [
        (EncoderParams(1024, offset_deg=37.0), 4, 420.0),
        (EncoderParams(1024, offset_deg=37.0), 4, -420.0),
        (EncoderParams(1000, index=False, offset_deg=-12.5), 3, 900.0),
        (EncoderParams(16), 1, -8000.0),
        (EncoderParams(1024, offset_deg=37.0, inverted=True), 4, 420.0),
        (EncoderParams(1, offset_deg=180.0), 7, 5000.0),
        (EncoderParams(2500, offset_deg=1.0), 4, 0.5),
    ],
)
@pytest.mark.parametrize("mode", ["jit", "py"])
def test_constant_speed(mode: str, encoder: EncoderParams, pole_pairs: int, omega_m: float) -> None:
    """Closed form at constant speed, both directions, through many turns or a slow line.

    Verifies: PLANT-19
    """
    start = 0.3  # rad
    plant = Plant(params(encoder, pole_pairs, mode="imposed", omega_m_rad_s=omega_m, theta_e_rad=start), 1, mode)
    pitch = 2 * math.pi / (4 * encoder.lines)
    duration_s = min(2.5 * 2 * math.pi, 400 * pitch) / abs(omega_m)
    if mode == "py":
        duration_s = min(duration_s, 1e-3)
    last = int(duration_s / CLOCK_S)
    found, calls = edges(plant, last)
    place = (start / pole_pairs - math.radians(encoder.offset_deg)) / pitch
    wanted = []
    step = 1 if omega_m > 0 else -1
    boundary = math.ceil(place) if step > 0 else math.floor(place)
    while (instant := (boundary - place) * pitch / omega_m) < plant.t_cycle * CLOCK_S:
        wanted.append((instant, levels_at(encoder, boundary if step > 0 else boundary - 1)))
        boundary += step
    check(found, wanted)
    assert mode == "py" or len(found) >= 9
    assert calls <= 2 * len(found) + plant.t_cycle * CLOCK_S / 1e-6 + 2


def test_index_once_a_turn() -> None:
    """Z is high through one quarter a turn, from the mounting angle on; its length and place in degrees.

    Verifies: PLANT-19
    """
    encoder = EncoderParams(64, offset_deg=25.0)
    plant = Plant(params(encoder, 4, mode="imposed", omega_m_rad_s=1000.0), 1)
    found, _ = edges(plant, int(3 * 2 * math.pi / 1000.0 / CLOCK_S))
    z = [(t, levels >> 2) for t, levels in found]
    changes = [(t, level) for (_, before), (t, level) in itertools.pairwise(z) if level != before]
    degrees = [math.degrees(1000.0 * t * CLOCK_S) for t, _ in changes]
    assert [level for _, level in changes] == [1, 0] * 3
    wanted = [25.0 + 360.0 * turn + part for turn in range(3) for part in (0.0, 90.0 / 64)]
    assert degrees == pytest.approx(wanted, abs=math.degrees(1000.0 * CLOCK_S) * 1.01)


@pytest.mark.parametrize("speed", [1000.0, -1000.0])
def test_missing_lines_show_no_edge(speed: float) -> None:
    """Three lines before the index are missing: four edges a line of the others, in their order, each turn.

    Verifies: PLANT-19
    """
    encoder = EncoderParams(32, offset_deg=1.0, missing_lines=3)
    plant = Plant(params(encoder, 4, mode="imposed", omega_m_rad_s=speed), 1)
    found, _ = edges(plant, int(2 * 2 * math.pi / abs(speed) / CLOCK_S))
    tracks = [levels & 3 for _, levels in found]
    quarters = [QUARTERS.index((levels & 1, levels >> 1)) for levels in tracks]
    steps = [(b - a) % 4 for a, b in itertools.pairwise(quarters) if a != b]
    assert set(steps) == {1 if speed > 0 else 3}
    assert len(steps) + 1 == pytest.approx(2 * 4 * 29, abs=1)


@pytest.mark.parametrize("offset_deg", [10.0, 10.0371])
def test_through_zero_speed(offset_deg: float) -> None:
    """Speed falls through zero and on: edges come back in reverse, at the roots of the parabola.

    Verifies: PLANT-19
    """
    encoder = EncoderParams(1024, offset_deg=offset_deg)
    speed, end_s = 60.0, 8e-3
    profile = ((0.0, speed), (end_s, -speed))
    plant = Plant(params(encoder, 4, mode="imposed", profile=profile, theta_e_rad=0.2), 1)
    found, calls = edges(plant, int(end_s / CLOCK_S) - 60)
    pitch = 2 * math.pi / (4 * encoder.lines)
    place = (0.2 / 4 - math.radians(offset_deg)) / pitch
    slope = 2 * speed / end_s
    highest = place + speed**2 / (2 * slope) / pitch
    wanted = []
    for boundary in range(math.ceil(place), math.floor(highest) + 1):
        half = math.sqrt(2 * (highest - boundary) * pitch / slope)
        wanted.append((end_s / 2 - half, levels_at(encoder, boundary)))
        wanted.append((end_s / 2 + half, levels_at(encoder, boundary - 1)))
    for boundary in range(math.ceil(place) - 1, math.floor(place) - 40, -1):
        half = math.sqrt(2 * (highest - boundary) * pitch / slope)
        wanted.append((end_s / 2 + half, levels_at(encoder, boundary - 1)))
    wanted = sorted(edge for edge in wanted if edge[0] < plant.t_cycle * CLOCK_S)
    assert len(wanted) > 100
    check(found, wanted)
    assert calls < 2 * len(found) + 1.3 * end_s / 1e-6


def test_reversal_by_a_jump_of_speed() -> None:
    """An imposed speed that jumps to its negative: the first edge back is not late.

    Verifies: PLANT-19
    """
    encoder = EncoderParams(4096)
    turn_s = 1.00003e-3
    profile = ((0.0, 700.0), (turn_s, 700.0), (turn_s, -700.0), (2e-3, -700.0))
    plant = Plant(params(encoder, 4, mode="imposed", profile=profile, theta_e_rad=0.2), 1)
    found, _ = edges(plant, 99_900)
    pitch = 2 * math.pi / (4 * encoder.lines)
    place, top = (0.2 / 4 + 700.0 * t for t in (0.0, turn_s))
    wanted = []
    for boundary in range(math.ceil(place / pitch), math.floor(top / pitch) + 1):
        instant = (boundary * pitch - place) / 700.0
        wanted.append((instant, levels_at(encoder, boundary)))
        wanted.append((2 * turn_s - instant, levels_at(encoder, boundary - 1)))
    wanted = sorted(edge for edge in wanted if edge[0] < plant.t_cycle * CLOCK_S)
    assert len(wanted) > 700
    # Behind the start the rotor goes on backward.
    check(found[: len(wanted)], wanted)


def test_free_rotor_that_reverses() -> None:
    """A rotor that its currents brake and reverse: the same edges as with a call every clock.

    Verifies: PLANT-19
    """
    encoder = EncoderParams(4096, offset_deg=3.0)
    gates = 0b011000  # from C to B: against a rotor at 0 degrees
    last = 20_000
    asked, calls = edges(Plant(params(encoder, 4, omega_m_rad_s=60.0), 1), last, gates)
    polled, _ = edges(Plant(params(encoder, 4, omega_m_rad_s=60.0), 1), last, gates, every=1)
    assert [levels for _, levels in asked] == [levels for _, levels in polled][: len(asked)]
    clocks = np.array([[a[0], b[0]] for a, b in zip(asked, polled, strict=False)])
    assert len(asked) > 40 and np.abs(clocks[:, 0] - clocks[:, 1]).max() <= 1
    rises = [levels & 3 for _, levels in asked]
    forward = {0: 1, 1: 3, 3: 2, 2: 0}
    senses = {forward[a] == b for a, b in itertools.pairwise(rises)}
    assert senses == {True, False}, "both directions"
    assert calls < last / 4


def test_backward_from_a_boundary() -> None:
    """At rest on the mounting angle, then backward: the edge comes with the first clock.

    Verifies: PLANT-19
    """
    encoder = EncoderParams(1000)
    profile = ((0.0, 0.0), (1e-3, -50.0))
    plant = Plant(params(encoder, 4, mode="imposed", profile=profile), 1)
    found, _ = edges(plant, 10)
    assert found == [(1, levels_at(encoder, -1))]


def test_standstill_and_none() -> None:
    """A locked rotor changes nothing and asks for a call each microsecond; without encoder nothing is asked.

    Verifies: PLANT-19
    """
    plant = Plant(params(EncoderParams(1000, offset_deg=1.0), mode="locked"), 1)
    assert edges(plant, 5000) == ([], 100)
    plant = Plant(motor_1(), seed=1)
    drive(plant, 100)
    assert int(plant.io[L.IO_ENCODER]) == int(plant.io[L.IO_ENCODER_WAIT]) == 0


def test_both_modes_give_the_same_bits() -> None:
    """Compiled and plain kernel with an encoder, in a drive.

    Verifies: PLANT-06, PLANT-19
    """
    ends = []
    for mode in ("py", "jit"):
        plant = Plant(motor_1(machine__encoder=EncoderParams(512, offset_deg=-50.0)), seed=5, mode=mode)
        drive(plant, 800)
        ends.append((plant.state.tobytes(), plant.io.tobytes()))
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lines": 0}, "lines = 0: must be 1 to 1048576"),
        ({"lines": 100, "missing_lines": 100}, "missing_lines = 100: must be 0 to 99"),
        ({"lines": 100, "offset_deg": math.nan}, "offset_deg = nan: must be -360 to 360"),
    ],
)
def test_refused(changes: dict[str, Any], message: str) -> None:
    """Parameters out of range are named.

    Verifies: PLANT-13, PLANT-19
    """
    with pytest.raises(ValueError, match=message):
        EncoderParams(**changes)
