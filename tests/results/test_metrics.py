# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Metrics against synthetic runs whose errors are known.

One clock is 0.0072 deg at 60 000 r/min; stamps are whole clocks, so 0.01 deg is the tolerance of an angle.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.paths import ROOT, RTL
from fluxlock.config.scenario import METRICS, Expect
from fluxlock.results.angles import AngleTrack
from fluxlock.results.metrics import Advance, Analysis, gate_change_cycles, judge, lookup, trips
from fluxlock.results.rundata import RECORD_DTYPE, TRIP_CAUSES, LogKind, load_trace, save_trace
from tests.results.synthetic import Drive, make_run, make_vector_run

ANGLE_TOL_DEG = 0.01
SPEEDS = (60_000.0, -60_000.0, 8_000.0)


def flat(metrics: dict, prefix: str = "") -> set[str]:
    keys: set[str] = set()
    for name, value in metrics.items():
        keys |= flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name}
    return keys


@pytest.mark.parametrize("speed", SPEEDS)
def test_ideal_run_has_no_error(speed: float) -> None:
    """An ideal drive in either direction: zero errors, 60 deg intervals.

    Verifies: FRONT-10, FRONT-11
    """
    m = Analysis(make_run(Drive(speed_rpm=speed))).window(0.002, 0.018)
    for name in ("zcp_error_deg", "commutation_error_deg"):
        assert m[name]["max"] < ANGLE_TOL_DEG, m[name]
    for name in ("sector_interval_deg", "commutation_interval_deg"):
        assert abs(m[name]["min"] - 60) < 2 * ANGLE_TOL_DEG and abs(m[name]["max"] - 60) < 2 * ANGLE_TOL_DEG, m[name]
    assert m["late_crossings"] == 0


@pytest.mark.parametrize("speed", SPEEDS)
def test_injected_errors_are_found(speed: float) -> None:
    """Known patterns of lateness appear with their sign, mean, std, rms and maximum.

    Verifies: FRONT-10, FRONT-11
    """
    commutation = np.array([2.0, -1.0, 0.5, 0.5, -3.0, 4.0])
    crossing = np.array([-2.0, 0.2, 0.4, 1.0, 0.0, -0.2])
    drive = Drive(
        speed_rpm=speed,
        # A whole number of turns in the window, so that each of the six errors has equal weight.
        duration_s=0.04,
        commutation_error=lambda k: float(commutation[k % 6]),
        crossing_error=lambda k: float(crossing[k % 6]),
        late=frozenset(range(0, 10_000, 6)),
    )
    turn_s = 60.0 / abs(speed)
    m = Analysis(make_run(drive)).window(0.002, 0.002 + int(0.036 / turn_s) * turn_s)
    for name, values in (("commutation_error_deg", commutation), ("zcp_error_deg", crossing)):
        assert m[name]["mean"] == pytest.approx(values.mean(), abs=ANGLE_TOL_DEG)
        assert m[name]["std"] == pytest.approx(values.std(), abs=ANGLE_TOL_DEG)
        assert m[name]["rms"] == pytest.approx(np.sqrt((values**2).mean()), abs=ANGLE_TOL_DEG)
        assert m[name]["max"] == pytest.approx(np.abs(values).max(), abs=ANGLE_TOL_DEG)
    for name, values in (("commutation_interval_deg", commutation), ("sector_interval_deg", crossing)):
        steps = 60 + np.roll(values, -1) - values
        assert m[name]["min"] == pytest.approx(steps.min(), abs=2 * ANGLE_TOL_DEG)
        assert m[name]["max"] == pytest.approx(steps.max(), abs=2 * ANGLE_TOL_DEG)
    assert m["late_crossings"] == int(0.036 / turn_s)


@pytest.mark.parametrize("speed", SPEEDS[:2])
def test_advance_is_not_an_error(speed: float) -> None:
    """Commutations early by the configured advance have no error; without the setting they are early.

    Verifies: FRONT-11
    """
    data = make_run(Drive(speed_rpm=speed, commutation_error=lambda k: -7.0, current_a=8.0))
    omega = abs(speed) * np.pi / 30
    # The synthetic torque keeps its sign in reverse: there it brakes, and a braking current adds nothing.
    by_current_deg = 2.0 if speed > 0 else 0.0
    both = Advance(3.0, (4.0 - by_current_deg) / omega, 2.0 / 8.0)
    for advance in (Advance(7.0), Advance(1.0, 6.0 / omega), both):
        assert Analysis(data, advance).window(0.004, 0.018)["commutation_error_deg"]["max"] < ANGLE_TOL_DEG, advance
    assert Analysis(data).window(0.002, 0.018)["commutation_error_deg"]["mean"] == pytest.approx(
        -7.0, abs=ANGLE_TOL_DEG
    )


def test_advance_is_limited() -> None:
    """As the drive does, the metrics hold the whole advance within 30 deg.

    Verifies: FRONT-11
    """
    limited = Advance(20.0, 0.01, 1.0).at(np.array([1000.0, -2000.0, 100.0]), np.array([5.0, 0.0, -50.0]))
    assert limited == pytest.approx([30.0, 30.0, 21.0])


def test_missed_crossing_shows_as_double_interval() -> None:
    """A sector without crossing makes an interval of 120 deg.

    Verifies: FRONT-10
    """
    data = make_run(Drive())
    rows = np.flatnonzero(data.log[:, 1] == LogKind.CROSSING)
    data.log = np.delete(data.log, rows[40], axis=0)
    m = Analysis(data).window(0.002, 0.018)
    assert m["sector_interval_deg"]["max"] == pytest.approx(120.0, abs=2 * ANGLE_TOL_DEG)
    assert m["sector_interval_deg"]["min"] == pytest.approx(60.0, abs=2 * ANGLE_TOL_DEG)


@pytest.mark.parametrize("speed", SPEEDS[:2])
def test_freewheel_angle(speed: float) -> None:
    """First extinction of the outgoing phase counts; later ones and other phases do not.

    Verifies: FRONT-12
    """
    m = Analysis(make_run(Drive(speed_rpm=speed, freewheel_deg=13.5))).window(0.002, 0.018)
    assert m["freewheel_deg"]["mean"] == pytest.approx(13.5, abs=ANGLE_TOL_DEG)
    assert m["freewheel_deg"]["max"] == pytest.approx(13.5, abs=ANGLE_TOL_DEG)


def test_freewheel_without_extinction() -> None:
    """Without an event: no current means 0 deg, current that never ends means the whole sector.

    Verifies: FRONT-12
    """
    data = make_run(Drive(freewheel_deg=None))
    assert Analysis(data).window(0.002, 0.018)["freewheel_deg"]["mean"] == pytest.approx(60.0, abs=2 * ANGLE_TOL_DEG)
    for name in ("ia", "ib", "ic"):
        data.records[name] = 0.0
    assert Analysis(data).window(0.002, 0.018)["freewheel_deg"]["max"] == 0.0


def test_waveform_metrics() -> None:
    """Speed, current and torque of a run with constant acceleration.

    Verifies: FRONT-13
    """
    drive = Drive(speed_rpm=30_000, accel_rpm_per_s=200_000, pole_pairs=2, current_a=8.0)
    m = Analysis(make_run(drive)).window(0.005, 0.015)
    # The window's ends are records of the 10 us grid, so only rounding remains.
    assert m["speed_rpm"]["min"] == pytest.approx(31_000, rel=1e-9)
    assert m["speed_rpm"]["mean"] == pytest.approx(32_000, rel=1e-9)
    assert m["speed_rpm"]["max"] == pytest.approx(33_000, rel=1e-9)
    assert m["phase_current_pp_a"] == pytest.approx(16.0)
    # Ripple at 3001 Hz sampled at 100 kHz: the peaks are met within 1 - cos(pi * 3001 / 100e3).
    assert m["torque_nm"]["ripple_pp"] == pytest.approx(0.004, rel=5e-3)
    assert m["torque_nm"]["mean"] == pytest.approx(0.02, rel=5e-3)


def test_metric_names_are_those_of_the_scenario() -> None:
    """The keys that expectations may name are the keys that are computed.

    Verifies: FRONT-07
    """
    assert flat(Analysis(make_run(Drive())).window(0.002, 0.018)) == set(METRICS)


def test_empty_window_has_no_values() -> None:
    """A rotor at rest has no errors to report rather than zeros or NaN.

    Verifies: FRONT-10
    """
    data = make_run(Drive())
    data.log = data.log[:0]
    m = Analysis(data).window(0.002, 0.018)
    assert m["zcp_error_deg"] == {"mean": None, "std": None, "rms": None, "max": None}
    assert m["freewheel_deg"] == {"mean": None, "max": None}
    verdict = judge(Expect(window="w", metric="zcp_error_deg.rms", max=1.0), {"w": m})
    assert not verdict["pass"]


def test_gate_change_is_found_among_carrier_edges() -> None:
    """The instant of a commutation is the edge of the outgoing or incoming leg, not one of the chopping leg.

    Verifies: FRONT-11
    """
    data = make_run(Drive(duration_s=0.004))
    # I -> II at cycle 1000: B- goes off, C- on; the carrier's edge in leg A two clocks earlier is not it.
    data.log = np.array(
        [
            [500, LogKind.GATES, 0b001001, 0],
            [999, LogKind.COMMUTATION, 0, 0],
            [1500, LogKind.COMMUTATION, 1, 0],
            [1501, LogKind.GATES, 0b001000, 0],
            [1503, LogKind.GATES, 0b100000, 0],
            [3000, LogKind.COMMUTATION, 2, 0],
        ],
        dtype=np.int64,
    )
    assert gate_change_cycles(data).tolist() == [1000, 1503, 3001]


def test_hermite_interpolation_is_exact_enough() -> None:
    """Angle between records 10 us apart with a speed ripple of 5 % at 1200 Hz and 100 000 r/min.

    Verifies: FRONT-11
    """
    clock, omega, ripple, pulse = 50e6, 100_000 * np.pi / 30, 0.05, 2 * np.pi * 1200.0
    t = np.arange(0, 0.01, 10e-6)
    records = np.zeros(t.size, RECORD_DTYPE)
    records["t_cycle"] = t * clock
    records["theta_e"] = omega * (t - ripple / pulse * np.cos(pulse * t))
    records["omega_e"] = omega * (1 + ripple * np.sin(pulse * t))
    at = np.linspace(0.001, 0.009, 9973)
    true = omega * (at - ripple / pulse * np.cos(pulse * at))
    error = np.degrees(AngleTrack(records, clock).theta_rad(at * clock) - true)
    assert np.abs(error).max() < 1e-4
    assert np.isnan(AngleTrack(records, clock).theta_rad(np.array([0.02 * clock]))).all()


def test_trips_are_named() -> None:
    """A trip has time and cause; causes of one clock are joined.

    Verifies: FRONT-14
    """
    data = make_run(Drive(trip_at_s=0.01, trip_mask=0b101))
    assert trips(data) == [{"cause": "phase_current+fault_pin", "time_s": 0.01}]


def test_trip_names_are_those_of_the_rtl() -> None:
    """Order of the causes as in the RTL package.

    Verifies: FRONT-14
    """
    package = (RTL / "pkg" / "fl_pkg.sv").read_text(encoding="utf-8")
    found = re.findall(r"logic (\w+);\s*// bit (\d)", package)
    assert {int(bit): name for name, bit in found} == dict(enumerate(TRIP_CAUSES))


@pytest.mark.parametrize(
    ("low", "high", "passes"), [(None, 0.5, True), (None, 0.1, False), (0.3, None, False), (0.1, 0.5, True)]
)
def test_expectations(low: float | None, high: float | None, passes: bool) -> None:
    """Limits are inclusive ranges about the measured value.

    Verifies: FRONT-07
    """
    metrics = {"steady": {"zcp_error_deg": {"rms": 0.2}}}
    expect = Expect(window="steady", metric="zcp_error_deg.rms", min=low, max=high)
    verdict = judge(expect, metrics)
    assert verdict["pass"] is passes and verdict["value"] == 0.2
    assert lookup(metrics["steady"], "zcp_error_deg.rms") == 0.2


def test_trace_round_trip_and_repeatability(tmp_path: Path) -> None:
    """A trace file holds the run, and the same run gives the same bytes.

    Verifies: FRONT-15
    """
    data = make_run(Drive(duration_s=0.004))
    save_trace(tmp_path / "a.npz", data)
    data.wall_s = 99.0
    save_trace(tmp_path / "b.npz", data)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    back = load_trace(tmp_path / "a.npz")
    for name in ("log", "records", "plant_events", "zoom"):
        assert np.array_equal(getattr(back, name), getattr(data, name))
    assert (back.clock_hz, back.pole_pairs, back.cycles, back.seed, back.uart) == (
        50e6,
        1,
        data.cycles,
        7,
        ["ok"],
    )


# ---- vector control


@pytest.mark.parametrize("speed", SPEEDS)
def test_angle_error_of_the_estimate(speed: float) -> None:
    """Known errors of the claimed angle with their sign, wrapped, in both directions; only samples inside count.

    Verifies: VCONF-05
    """
    drive, errors_deg = Drive(speed_rpm=speed, accel_rpm_per_s=2e5), np.array([2.0, -1.0, 0.5, 4.0, -3.5])
    m = Analysis(make_vector_run(drive, errors_deg)).window(0.002, 0.018)["angle_error_deg"]
    assert m["mean"] == pytest.approx(errors_deg.mean(), abs=ANGLE_TOL_DEG)
    assert m["rms"] == pytest.approx(np.sqrt((errors_deg**2).mean()), abs=ANGLE_TOL_DEG)
    assert m["max"] == pytest.approx(4.0, abs=ANGLE_TOL_DEG)
    # A claim that is a turn off is the same angle; half a turn off is the largest error there is.
    turned = Analysis(make_vector_run(drive, errors_deg + 360.0)).window(0.002, 0.018)["angle_error_deg"]
    assert turned["rms"] == pytest.approx(m["rms"], abs=1e-6)
    half = Analysis(make_vector_run(drive, np.array([180.0]))).window(0.002, 0.018)["angle_error_deg"]
    assert half["max"] == pytest.approx(180.0, abs=ANGLE_TOL_DEG)
    empty = Analysis(make_run(drive)).window(0.002, 0.018)["angle_error_deg"]
    assert empty == {"mean": None, "rms": None, "max": None}


def test_angles_beyond_the_records_are_left_out() -> None:
    """A sample after the plant's last record, or before its first, has no true angle: it is no sample, not a NaN.

    Verifies: VCONF-05
    """
    whole = make_vector_run(Drive(), np.array([2.0]))
    data = replace(whole, records=whole.records[10:-10])
    seen, rows = Analysis(data).angles, whole.rows(LogKind.ANGLE)[:, 0]
    first, last = data.records["t_cycle"][[0, -1]]
    assert np.array_equal(seen.cycle, rows[(rows >= first) & (rows <= last)])
    assert 0 < seen.cycle.size < rows.size
    assert np.allclose(seen.error_deg, 2.0, atol=ANGLE_TOL_DEG)


@pytest.mark.parametrize("speed", SPEEDS)
def test_currents_of_the_rotors_frame(speed: float) -> None:
    """Phase currents made of i_d and i_q give them back, amplitude-invariant; i_q > 0 has the sign of the torque.

    Verifies: VCONF-05
    """
    m = Analysis(make_vector_run(Drive(speed_rpm=speed), np.zeros(1), d_a=-3.0, q_a=12.0)).window(0.002, 0.018)
    assert (m["id_a"], m["iq_a"]) == (pytest.approx(-3.0, abs=1e-6), pytest.approx(12.0, abs=1e-6))


def test_currents_of_five_phases() -> None:
    """i_d and i_q of subspace 1 whatever flows in subspace 3; peak to peak of all five phases.

    Verifies: VCONF-05
    """
    third = make_vector_run(Drive(), np.zeros(1), d_a=-3.0, q_a=12.0, phases=5, third_a=2.0)
    m = Analysis(third).window(0.002, 0.018)
    assert (m["id_a"], m["iq_a"]) == (pytest.approx(-3.0, abs=1e-6), pytest.approx(12.0, abs=1e-6))
    data = make_vector_run(Drive(), np.zeros(1), d_a=-3.0, q_a=4.0, phases=5)
    assert Analysis(data).window(0.002, 0.018)["phase_current_pp_a"] == pytest.approx(10.0, rel=1e-3)
    data.records["ie"] *= 2.0
    assert Analysis(data).window(0.002, 0.018)["phase_current_pp_a"] == pytest.approx(12.0, rel=1e-3)


def test_log_kinds_are_those_of_the_simulator() -> None:
    """Names and numbers of the log's rows in the simulator's main and in the analysis.

    Verifies: VCONF-05
    """
    header = (ROOT / "sim" / "native" / "cosim.h").read_text(encoding="utf-8")
    kinds = {name: int(value) for name, value in re.findall(r"^    LOG_(\w+) = (\d+),", header, re.MULTILINE)}
    assert kinds == {kind.name: int(kind) for kind in LogKind}
