# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A scenario with injection on the twin: the same call, metrics, traces and refusals as of other drives."""

from __future__ import annotations

import json
import math

import matplotlib as mpl
import numpy as np
import pytest

import fluxlock
from fluxlock.base.paths import ROOT

IPM = ROOT / "scenarios" / "vector" / "ipm-injection.toml"
YU = ROOT / "scenarios" / "five-phase" / "yu.toml"
RECORD = ROOT / "docs" / "verification" / "record.json"
ROW = "five-phase/ipm-reversal"
BEGIN = ({"at_s": 0.002, "speed_rpm": 400}, {"at_s": 0.004, "command": "start"})
REVERSAL = {
    "event": [*BEGIN, {"at_s": 0.18, "command": "set speed_rpm -400"}],
    "window": [{"name": "steady", "from_s": 0.06, "to_s": 0.42}],
    "expect": [],
    "duration_s": 0.42,
}
LOAD_SHARE = 1e-3


@pytest.fixture(scope="module")
def reversal() -> fluxlock.Run:
    """The scenario of the chip's row."""
    return fluxlock.simulate(IPM, twin=True, **REVERSAL)


def test_within_the_chips_record(reversal: fluxlock.Run) -> None:
    """Three phases with dead time: mean, rms and maximum of the reversal lie in the bands of the chip's row.

    Verifies: INJC-14, INJC-18
    """
    row = json.loads(RECORD.read_text())["rows"][ROW]["values"]
    assert reversal.verdict.passed, reversal.verdict.failures
    for name, found in reversal.metrics["steady"]["angle_error_deg"].items():
        if f"angle_error_deg.{name}" in row:
            low, high = row[f"angle_error_deg.{name}"]["band"]
            assert low <= found <= high, (name, found, low, high)
    assert reversal.traces["speed_rpm"][-1] == pytest.approx(-400, abs=20)


def test_traces(reversal: fluxlock.Run) -> None:
    """Currents sum to zero, terminals lie between the rails, and the machine's torque moves the rotor.

    Verifies: INJC-18
    """
    t = reversal.traces
    assert set(t) < set(fluxlock.UNITS) and {len(trace) for trace in t.values()} == {len(t["t_s"])}
    assert t["t_s"][-1] == pytest.approx(0.42, abs=1e-3)
    drop_v = reversal.scenario.inverter.supply_resistance_ohm * np.abs(t["idc"]).max()
    moved_v = np.abs(t["vdc"] - 48.0).max()
    assert 0.0 < moved_v <= drop_v < 1.0
    np.testing.assert_allclose(t["ia"] + t["ib"] + t["ic"], 0.0, atol=1e-9)
    assert np.abs(t["ia"]).max() > 3.0
    assert all(t[name].min() >= -1.0 and t[name].max() <= 49.0 for name in ("va", "vb", "vc"))
    motor, load = reversal.scenario.motor, reversal.scenario.shaft_load
    omega = t["speed_rpm"] * math.pi / 30
    asked = np.trapezoid(t["torque_nm"] - load.viscous_nm_s_per_rad * omega, t["t_s"])
    assert asked == pytest.approx(motor.inertia_kgm2 * (omega[-1] - omega[0]), rel=0.02)


def test_five_phases() -> None:
    """Five phases hold the scenario's limit; the same seed gives the same bits, another one others. All have traces.

    Verifies: INJC-18, PACKAGE-7
    """
    short = {"duration_s": 0.12, "window.settled.to_s": 0.12}
    first, again, other = (fluxlock.simulate(YU, twin=True, seed=seed, **short) for seed in (1, 1, 2))
    assert first.verdict.passed, first.verdict.failures
    np.testing.assert_array_equal(first.data.records, again.data.records)
    assert not np.array_equal(first.data.records, other.data.records)
    assert set(first.traces) == set(fluxlock.UNITS) == {"t_s", *first.to_dataframe().attrs["units"]}
    np.testing.assert_allclose(sum(first.traces[f"i{phase}"] for phase in "abcde"), 0.0, atol=1e-9)
    mpl.use("Agg")
    assert [panel.get_ylabel() for panel in first.plot("ie", "vd")] == ["ie / A", "vd / V"]


def test_events() -> None:
    """Supply, load, a locked rotor and the driver's fault pin act.

    Verifies: INJC-18
    """
    events = [
        *BEGIN,
        *({"at_s": 0.15, "supply_v": 44.0}, {"at_s": 0.15, "load_factor": 3.0}),
        *({"at_s": at_s, "fault": {"kind": kind}} for at_s, kind in ((0.18, "stuck_rotor"), (0.182, "fault_pin"))),
    ]
    keys = {"event": events, "window": [], "expect": [], "duration_s": 0.19}
    run = fluxlock.simulate(IPM, twin=True, **keys)
    t = run.traces
    at = np.searchsorted(t["t_s"], [0.149, 0.17, 0.181, 0.189])
    np.testing.assert_allclose(t["vdc"][at], [48.0, 44.0, 44.0, 44.0], atol=0.1)
    assert t["speed_rpm"][at[1]] > 100.0 and t["speed_rpm"][at[2]] == t["speed_rpm"][at[3]] == 0.0
    assert run.data.fault == "fault_pin" and np.all(t["ia"][t["t_s"] > 0.1822] == 0.0)


def test_load_written_in_python() -> None:
    """Viscous and constant load in Python slow a rotor down as the scenario's own do.

    Verifies: PACKAGE-11
    """
    start_rpm, length_s = 400.0, 0.02
    omega = start_rpm * math.pi / 30
    constant = 0.1 * fluxlock.load_scenario(IPM).motor.inertia_kgm2 * omega / length_s
    viscous = constant / omega
    keys = {"duration_s": length_s, "event": [], "window": [], "expect": [], "initial.speed_rpm": start_rpm}

    def load_nm(speed_rad_s: float, angle_rad: float, time_s: float) -> float:
        assert angle_rad > 0.0 and time_s > 0.0
        return constant + viscous * speed_rad_s

    file = {"load": {"constant_nm": constant, "viscous_nm_s_per_rad": viscous}}
    loads = (file, {"load": {"constant_nm": 0.0}, "load_nm": load_nm})
    ends = [fluxlock.simulate(IPM, twin=True, **keys, **load).traces["speed_rpm"][-1] for load in loads]
    lost_rpm = start_rpm - ends[0]
    print("difference over the speed lost", abs(ends[1] - ends[0]) / lost_rpm)
    assert lost_rpm > 0.15 * start_rpm
    assert abs(ends[1] - ends[0]) < LOAD_SHARE * lost_rpm


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"event": [{"at_s": 0.1, "fault": {"kind": "stuck_high", "phases": ["A"]}}]}, r"event\[0\]\.fault"),
        ({"inverter.supply_diode": True}, "supply_diode"),
    ],
)
def test_refused_by_name(keys: dict[str, object], text: str) -> None:
    """What this twin is not, is named with its key.

    Verifies: INJC-18
    """
    with pytest.raises(fluxlock.ConfigError, match=text):
        fluxlock.simulate(IPM, twin=True, window=[], expect=[], **keys)
