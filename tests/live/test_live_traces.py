# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The scope's memory: newest rows, least and largest value per pixel, triggers."""

from __future__ import annotations

import numpy as np

from fluxlock.live.traces import NAMES, Ring

POINTS, WIDTH = 60_000, 1200


def filled(points: int = POINTS) -> tuple[Ring, np.ndarray, np.ndarray]:
    ring, rng = Ring(), np.random.default_rng(1)
    time_s = np.arange(points) * 5e-5
    rows = rng.standard_normal((len(NAMES), points)).astype(np.float32)
    for part in np.array_split(np.arange(points), 37):
        ring.append(time_s[part], rows[:, part])
    return ring, time_s, rows


def test_extremes() -> None:
    """12 traces of 60 000 points: no peak is lost, two points a pixel are sent.

    Verifies: LIVE-05
    """
    ring, time_s, rows = filled()
    rows[5, 31_234] = 99.0
    ring = Ring()
    ring.append(time_s, rows)
    names = list(NAMES[:12])
    shown, picture = ring.picture(0.0, time_s[-1] + 1.0, names, WIDTH)
    assert picture.shape == (12, 2 * WIDTH) and shown.size == 2 * WIDTH and np.all(np.diff(shown) > 0.0)
    assert picture[5].max() == 99.0
    assert np.array_equal(picture.max(axis=1), rows[:12].max(axis=1))
    assert np.array_equal(picture.min(axis=1), rows[:12].min(axis=1))


def test_few_points_are_sent_as_they_are() -> None:
    """Below two points a pixel nothing is merged."""
    ring, time_s, rows = filled()
    shown, picture = ring.picture(time_s[100], time_s[200], [NAMES[3]], WIDTH)
    assert np.array_equal(shown, time_s[100:200]) and np.array_equal(picture[0], rows[3, 100:200])


def test_newest_stay() -> None:
    """A full memory keeps at least the newer half."""
    ring = Ring(1000)
    for k in range(0, 5000, 100):
        ring.append(np.arange(k, k + 100) * 1.0, np.full((len(NAMES), 100), k, np.float32))
    time_s, _ = ring.cut(0.0, 1e9, ["ia"])
    assert time_s[-1] == 4999.0 and time_s.size >= 500 and np.all(np.diff(time_s) == 1.0)


def test_trigger() -> None:
    """The last passage of a level before an instant, up, down and of the magnitude.

    Verifies: LIVE-05
    """
    ring, time_s = Ring(), np.arange(10_000) * 1e-4
    rows = np.zeros((len(NAMES), time_s.size), np.float32)
    rows[NAMES.index("angle_error_deg")] = 40.0 * np.sin(2 * np.pi * 5 * time_s)
    ring.append(time_s, rows)

    def found(level: float, rising: bool, size: bool, until_s: float) -> float | None:
        return ring.last_crossing("angle_error_deg", level, rising, size, until_s)

    first = np.arcsin(30 / 40) / (2 * np.pi * 5)
    assert found(30.0, True, False, 0.1) == np.float64(np.ceil(first / 1e-4) * 1e-4)
    up, down, size = (found(*how, 0.19) for how in ((30.0, True, False), (30.0, False, False), (30.0, True, True)))
    assert up is not None and down is not None and size is not None and up < down < size
    assert found(41.0, True, False, 1.0) is None
