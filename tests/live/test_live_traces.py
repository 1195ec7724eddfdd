# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The scope's memory: newest rows, least and largest value per pixel, triggers."""

from __future__ import annotations

import json
from typing import Any, get_args

import numpy as np

from fluxlock.firmware.binding import names
from fluxlock.live import messages
from fluxlock.live.server import triggered
from fluxlock.live.traces import MARKS, MARKS_SHOWN, NAMES, TOLD, Ring, columns, marks_of
from fluxlock.native.play import Taken
from fluxlock.plant.trajectory import wave_dtype
from fluxlock.results.rundata import LogKind

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
    shown, picture = ring.picture(0.0, POINTS * 5e-5, list(NAMES[:12]), WIDTH)
    assert picture.shape == (12, 2 * WIDTH) and shown.size == 2 * WIDTH and np.all(np.diff(shown) > 0.0)
    assert picture[5].max() == 99.0
    assert np.array_equal(picture.max(axis=1), rows[:12].max(axis=1))
    assert np.array_equal(picture.min(axis=1), rows[:12].min(axis=1))


def test_a_pixel_is_a_stretch_of_time() -> None:
    """Rows that come in bursts: an extreme stands in its pixel, and between bursts stands the last row's value.

    Verifies: LIVE-05
    """
    ring, width = Ring(), 100
    time_s = np.concatenate([0.1 + np.arange(1000) * 1e-5, 0.8 + np.arange(1000) * 1e-5])
    rows = np.zeros((len(NAMES), 2000), np.float32)
    rows[0, 300], rows[1, 999:1001] = 9.0, 5.0  # within the first burst; end of it and begin of the second
    ring.append(time_s, rows)
    shown, picture = ring.picture(0.0, 1.0, list(NAMES[:2]), width)
    assert np.all(np.diff(shown) >= 0.0) and shown.size <= 4 * width
    assert abs(shown[picture[0].argmax()] - time_s[300]) <= 1.0 / width
    before, after = np.searchsorted(shown, 0.5) - 1, np.searchsorted(shown, 0.5)
    assert (shown[before], shown[after]) == (time_s[999], time_s[1000])
    assert picture[:, before].tolist() == picture[:, after].tolist() == [0.0, 5.0]


def test_a_falling_trace_falls() -> None:
    """Within a pixel the extremes come in the order in which the trace goes."""
    ring, time_s = Ring(), np.arange(2000) * 1e-4
    ring.append(time_s, np.tile(-time_s.astype(np.float32), (len(NAMES), 1)))
    _, picture = ring.picture(0.0, 0.2, [NAMES[0]], 100)
    assert picture.shape == (1, 200) and np.all(np.diff(picture[0]) < 0.0)


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


def test_trigger_on_an_instant() -> None:
    """The last instant of its kind; what was before it was armed is passed by, and a picture of too many has none.

    Verifies: LIVE-14
    """
    ring = Ring()
    ring.mark([(0.1, MARKS.index("commutation")), (0.2, MARKS.index("crossing late"))])
    ring.mark([(0.3, MARKS.index("commutation")), (0.4, MARKS.index("fault"))])

    def found(mark: str, until_s: float, after_s: float = -1.0) -> float | None:
        asked = {"kind": "view", "traces": ["ia"], "width": 16, "span_s": 0.1}
        view = messages.parse(json.dumps(asked | {"trigger": {"mark": mark, "after_s": after_s}}))
        assert isinstance(view, messages.View) and view.trigger is not None
        return triggered(ring, view.trigger, until_s)

    assert found("commutation", 1.0) == 0.3 and found("commutation", 0.25) == 0.1
    assert found("fault", 1.0) == 0.4 and found("fault", 1.0, 0.4) is None and found("trip", 1.0) is None
    assert ring.marks(0.15, 0.35) == [(0.2, MARKS.index("crossing late")), (0.3, MARKS.index("commutation"))]
    ring.mark([(1.0 + k * 1e-3, 0) for k in range(MARKS_SHOWN + 1)])
    assert ring.marks(1.0, 2.0) == [] and len(ring.marks(1.0, 1.0995)) == 100


def test_marks_of_a_log() -> None:
    """Commutation, crossing, late crossing, trip, change of the state and fault, each at its row's time.

    Verifies: LIVE-14
    """
    running, fault = (names("drive_state_t").index(state) for state in ("running", "fault"))
    told = [
        (1, LogKind.COMMUTATION, 3),
        (2, LogKind.CROSSING, 3),
        (3, LogKind.CROSSING, 3 | 1 << 4),
        (4, LogKind.GATES, 1),
    ]
    told += [
        (5, LogKind.UPDATE, running),
        (6, LogKind.UPDATE, running),
        (7, LogKind.TRIP, 1),
        (8, LogKind.UPDATE, fault),
    ]
    log = np.array([(cycle, kind, a, 0) for cycle, kind, a in told], np.int64)
    found = [(at_s, MARKS[number]) for at_s, number in marks_of(log, 1.0, 0)]
    assert found == [
        (1.0, "commutation"),
        (2.0, "crossing"),
        (3.0, "crossing late"),
        (5.0, "state change"),
        (7.0, "trip"),
        (8.0, "fault"),
    ]


def test_marks_of_the_messages() -> None:
    """A page may trigger on every kind of mark, and on no other.

    Verifies: LIVE-14
    """
    assert get_args(messages.Trigger.model_fields["mark"].annotation) == ("", *MARKS)


def test_planes_of_five_phases() -> None:
    """Balanced currents of five phases are a circle in the stationary plane; all five have a trace.

    Verifies: LIVE-12
    """
    records = np.zeros(1000, wave_dtype(5))
    records["t_cycle"] = np.arange(1000) * 1000.0
    records["theta_e"] = np.arange(1000) * 0.05
    for k, leg in enumerate("abcde"):
        records[f"i{leg}"] = 3.0 * np.cos(records["theta_e"] - 2 * np.pi * k / 5)
    time_s, rows = columns(Taken(records, np.zeros((0, 4), np.int64), {}, 0), 50e6, 3, np.zeros(len(TOLD)))
    ring = Ring()
    ring.append(time_s, rows)
    shown: dict[str, Any] = ring.planes(0.0, 1.0)
    assert np.allclose(np.hypot(shown["alpha"], shown["beta"]), 3.0, atol=1e-3) and np.ptp(shown["alpha"]) > 5.9
    assert np.allclose(shown["id"], 3.0, atol=1e-3)
    for name in ("ia", "current_d", "current_e"):
        assert np.abs(rows[NAMES.index(name)]).max() > 2.9


def test_planes_of_what_knows_no_current() -> None:
    """Rows of a board have no true currents: no points, and nothing that JSON does not have.

    Verifies: LIVE-12
    """
    ring = Ring()
    rows = np.full((len(NAMES), 50), np.nan, np.float32)
    rows[NAMES.index("motor_a")] = 1.0
    ring.append(np.arange(50) * 0.02, rows)
    shown = ring.planes(0.0, 1.0)
    assert json.loads(json.dumps(shown, allow_nan=False)) == {
        **{name: [] for name in ("alpha", "beta", "id", "iq")}, "theta_deg": None, "error_deg": None,
    }  # fmt: skip
