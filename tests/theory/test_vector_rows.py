# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the vector rows of the regression compute from their runs, on data whose answer is known."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.vector_timing import output_shift_cycles
from fluxlock.results.rundata import FloatArray, LogKind
from fluxlock.theory.vector import frequency
from fluxlock.theory.vector.controllers import KINDS, cross_peak
from fluxlock.theory.vector.model import ComplexArray, coefficients
from fluxverify.figures.blac.support import bench, identified
from fluxverify.regression.runner import RunFailed
from fluxverify.regression.vector import current_bench
from fluxverify.regression.vector.bandwidth import CARRIER_HZ, POINTS, SPEED, TONES
from fluxverify.regression.vector.current_bench import (
    AFTER,
    CURRENT_SHARE,
    FOLLOWED,
    LEAST_BANDS,
    STEP_A,
    VOLTAGE_SHARE,
    Ground,
    Setting,
    step_reference,
)
from fluxverify.regression.vector.sines import PERIOD, Excited, Response, phase_bandwidth, phase_margin_deg, sines
from fluxverify.regression.vector.specified import PEAKS_PERCENT


def exact_response(delay: float, gamma: float) -> tuple[frequency.Loop, Response]:
    """The loop of a point of the bandwidth row and what its tones would give on the exact model."""
    setting = Setting("C", SPEED, delay, "exact", update="double", carrier_hz=CARRIER_HZ, gamma=gamma)
    loop = Ground.of(setting).theory.loop
    at = np.array(sorted(TONES)) / PERIOD
    return loop, Response(at, loop.closed(frequency.on_circle(at)), 0.0, 0)


@pytest.mark.parametrize("name", list(POINTS))
def test_bandwidth_and_margin_from_tones(name: str) -> None:
    """The tones of the row lie close enough: bandwidth within 1 %, phase margin within 1 degree of the whole curve's.

    Verifies: SYS-12
    """
    loop, response = exact_response(*POINTS[name])
    assert phase_bandwidth(response) == pytest.approx(frequency.phase_bandwidth(loop), rel=0.01)
    assert phase_margin_deg(response) == pytest.approx(frequency.phase_margin_deg(loop), abs=1.0)


def test_tones_have_the_amplitude() -> None:
    """Every tone is there with its amplitude and nothing else; sines on d alone are real.

    Verifies: SYS-12
    """
    wave = sines(TONES, 2.0)
    spectrum = np.abs(np.fft.fft(wave[:PERIOD])) / PERIOD
    expected = np.zeros(PERIOD)
    expected[np.array(TONES) % PERIOD] = 2.0
    assert spectrum == pytest.approx(expected, abs=1e-12)
    assert wave[PERIOD:] == pytest.approx(wave[:PERIOD])
    assert np.abs(sines([1, 5, -1, -5], 1.0, real=True).imag).max() < 1e-12


def test_reference_begins_where_the_response_does() -> None:
    """The chip's own T_s and T_d give the peaks of the specification within 1 % of the step; the first current is 0.

    Verifies: SYS-12
    """
    for (speed, delay), peaks in PEAKS_PERCENT.items():
        for kind in KINDS:
            response = Ground.of(Setting(kind, speed, delay)).theory.response(np.ones(FOLLOWED, dtype=np.complex128))
            assert response[0] == 0.0
            assert 100 * cross_peak(response) == pytest.approx(peaks[kind], abs=1.0), (speed, delay, kind)
    reference = step_reference()
    assert np.count_nonzero(reference) == FOLLOWED + AFTER and reference[-1] == STEP_A


def test_plant_from_currents_and_voltages() -> None:
    """Phi and the Gammas of the exact model come back from currents and voltages that begin from rest.

    Verifies: FIG-07
    """
    model = coefficients(bench().machine, bench().omega(0.1), bench().sampling(0.75))
    rng = np.random.default_rng(3)
    u = rng.standard_normal(60) + 1j * rng.standard_normal(60)
    i = np.zeros(60, dtype=np.complex128)
    for k in range(59):
        i[k + 1] = model.phi * i[k] + model.gamma1 * u[k] + model.gamma2 * (u[k - 1] if k else 0.0)
    found = identified(Excited(i, u, 1.0))
    for name in ("phi", "gamma1", "gamma2"):
        assert complex(getattr(found, name)) == pytest.approx(complex(getattr(model, name)), rel=1e-9)
    assert math.isnan(float(found.gamma_e.real))


@pytest.mark.parametrize(("speed", "bound"), [(0.05, "current"), (0.1, "voltage")])
def test_sines_are_as_large_as_there_is_room(speed: float, bound: str) -> None:
    """At 750 Hz the current's limit binds, at 1500 Hz the voltage's circle; the other one is kept too.

    Verifies: SYS-12
    """
    ground = Ground.of(Setting("B", speed, 0.5, gamma=0.4))
    unit = sines([1, 3, 6, 10, 17, -1, -3, -6, -10, -17], 0.5, real=True)
    amplitude = ground.amplitude_a(unit)
    current = amplitude * ground.theory.response(unit)
    # The voltage from the plant's equation, not from the regulator: (i[k+1] - Phi i[k] - Gamma2 u[k-1]) / Gamma1.
    model, u, before = ground.theory.model, [], 0j
    for now, after in itertools.pairwise(current):
        before = complex((after - model.phi * now - model.gamma2 * before) / model.gamma1)
        u.append(ground.held_v + before)
    share_i = (
        np.abs(np.concatenate([current, amplitude * unit])).max() / ground.scenario.inverter.protection.phase_current_a
    )
    share_u = np.abs(u).max() / ground.limit_v
    assert share_i <= CURRENT_SHARE + 1e-6 and share_u <= VOLTAGE_SHARE + 1e-6
    assert (share_i if bound == "current" else share_u) == pytest.approx(
        CURRENT_SHARE if bound == "current" else VOLTAGE_SHARE, rel=1e-3
    )


def test_sines_within_the_dead_time_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where current and voltage leave less than the dead time's band, nothing is measured.

    Verifies: SYS-12
    """
    ground = Ground.of(Setting("B", 0.05, 0.5, gamma=0.4))
    unit = sines([1, 3, -1, -3], 0.5, real=True)
    rms = ground.amplitude_a(unit) * float(np.sqrt(np.mean(np.abs(ground.theory.response(unit)) ** 2)))
    monkeypatch.setattr(current_bench, "CURRENT_SHARE", 0.9 * CURRENT_SHARE * LEAST_BANDS * ground.band_a / rms)
    with pytest.raises(RunFailed, match="the dead time would be measured"):
        ground.amplitude_a(unit)


def test_ripple_of_a_pulsed_voltage() -> None:
    """A machine without resistance on pulses of one vector: the ripple is what the pulses are ahead of their mean.

    Verifies: FIG-07
    """
    ground = Ground.of(Setting("C", 0.1, 0.25))
    t, machine = ground.timing, ground.machine
    shift = output_shift_cycles(ground.scenario.inverter)
    carrier, count = t.carrier_cycles, 12
    omega = 2 * math.pi * ground.setting.fundamental_hz / CLOCK_HZ
    rng = np.random.default_rng(5)
    pulse = rng.uniform(0.2, 0.8, count) * np.exp(2j * np.pi * rng.random(count))  # duty along a direction
    edges = [(k + 0.5 + sign * abs(duty) / 2) * carrier + shift for k, duty in enumerate(pulse) for sign in (-1, 1)]
    instants: FloatArray = np.arange(count, dtype=np.float64) * carrier + t.from_cycles
    time = np.unique(np.concatenate([np.arange(0, (count + 1) * carrier, 25.0), edges, instants]))

    def charge(at: FloatArray) -> ComplexArray:
        """Integral of the voltage (V clocks)."""
        total = np.zeros(at.size, dtype=np.complex128)
        for k, duty in enumerate(pulse):
            begin, end = edges[2 * k], edges[2 * k + 1]
            total += 25.0 * np.exp(1j * np.angle(duty)) * (np.clip(at, begin, end) - begin)
        return total

    current = (charge(time) / CLOCK_HZ - machine.psi_vs * np.exp(1j * omega * time)) / machine.l_h
    records = np.zeros(time.size, dtype=[(name, "f8") for name in ("t_cycle", "theta_e", "ia", "ib", "ic")])
    records["t_cycle"], records["theta_e"] = time, omega * time
    for k, name in enumerate(("ia", "ib", "ic")):
        records[name] = (current * np.exp(-2j * np.pi / 3 * k)).real
    rows = {
        LogKind.ANGLE: np.column_stack([instants.astype(np.int64), np.zeros((count, 3), dtype=np.int64)]),
        LogKind.GATES: np.array([[round((count + 1) * carrier), 1, 0, 0]]),
    }
    run: Any = SimpleNamespace(zoom=records, rows=rows.__getitem__)
    begin: FloatArray = np.arange(count, dtype=np.float64) * carrier + shift
    ahead = charge(instants) - charge(begin) - (instants - begin) / carrier * (charge(begin + carrier) - charge(begin))
    expected = ahead / CLOCK_HZ / machine.l_h * np.exp(-1j * omega * instants)
    found = current_bench._ripple(run, ground, count - 1)
    assert np.abs(expected).max() > 1.0
    assert found == pytest.approx(expected[1:], abs=1e-3)  # straight lines between records
