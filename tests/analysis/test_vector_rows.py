"""What the vector rows of the regression compute from their runs, on data whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fluxlock.analysis.vector import frequency
from fluxlock.analysis.vector.controllers import KINDS, cross_peak
from fluxlock.analysis.vector.model import coefficients
from fluxlock.figures.blac.support import bench, identified
from fluxlock.regression.vector.bandwidth import CARRIER_HZ, POINTS, SPEED, TONES
from fluxlock.regression.vector.current_bench import AFTER, FOLLOWED, STEP_A, Ground, Setting, Step, step_reference
from fluxlock.regression.vector.sines import PERIOD, Response, phase_bandwidth, phase_margin_deg, sines
from fluxlock.regression.vector.specified import PEAKS_PERCENT


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
    """Phi and the Gammas of the exact model come back from a step's currents and voltages.

    Verifies: FIG-07
    """
    model = coefficients(bench().machine, bench().omega(0.1), bench().sampling(0.75))
    rng = np.random.default_rng(3)
    u = rng.standard_normal(60) + 1j * rng.standard_normal(60)
    i = np.zeros(60, dtype=np.complex128)
    for k in range(59):
        i[k + 1] = model.phi * i[k] + model.gamma1 * u[k] + model.gamma2 * (u[k - 1] if k else 0.0)
    found = identified([Step(i, u, i, 0.0, 0.0, 0)])
    for name in ("phi", "gamma1", "gamma2"):
        assert complex(getattr(found, name)) == pytest.approx(complex(getattr(model, name)), rel=1e-9)
    assert math.isnan(float(found.gamma_e.real))
