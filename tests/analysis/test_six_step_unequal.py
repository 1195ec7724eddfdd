"""Crossing errors of unequal phases against closed forms."""

from __future__ import annotations

import math

import pytest

from fluxlock.analysis.six_step.unequal import crossing_errors_deg, phase_inductances_h
from fluxlock.config import load_motor
from fluxlock.config.motor import Motor
from fluxlock.paths import ROOT

VDC_V = 15.0
SPEED_RPM = 40_130.0


def machine(**changes: object) -> Motor:
    motor = load_motor(ROOT / "motors" / "motor-1.toml")
    return Motor.model_validate(motor.model_dump() | changes)


def test_equal_phases_have_no_error() -> None:
    """A symmetric machine, also with equal mutual inductances, has its crossings in the middle.

    Verifies: THEORY-20
    """
    for motor in (machine(), machine(mutual_h=-6e-6)):
        assert crossing_errors_deg(motor, VDC_V, SPEED_RPM) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
        assert phase_inductances_h(motor) == pytest.approx((22e-6,) * 3)


@pytest.mark.parametrize("share", [0.01, 0.05, -0.05])
def test_weak_phase(share: float) -> None:
    """EMF of A low: C late, B early by atan(sqrt(3)/2 share / (3 - share/2)), A unmoved, at any speed and voltage.

    Verifies: THEORY-20
    """
    motor = machine(psi_vs=[1e-3 * (1 - share), 1e-3, 1e-3])
    late = math.degrees(math.atan(math.sqrt(3) / 2 * share / (3 - share / 2)))
    for vdc_v, speed_rpm in ((15.0, 20_060.0), (25.0, 60_170.0)):
        assert crossing_errors_deg(motor, vdc_v, speed_rpm) == pytest.approx((0.0, -late, late), abs=1e-9)


def test_one_inductance() -> None:
    """5 uH in A: the shift of (3.12) over the slope, B late, C early, to second order; A unmoved.

    Verifies: THEORY-20
    """
    motor = machine(inductance_h=[27e-6, 22e-6, 22e-6])
    for speed_rpm in (20_060.0, 40_130.0, 60_170.0):
        emf_v = 1e-3 * motor.omega_e(speed_rpm)
        late = math.degrees(0.5 * (VDC_V - math.sqrt(3) * emf_v) * (5 / 49) / (1.5 * emf_v))
        errors = crossing_errors_deg(motor, VDC_V, speed_rpm)
        assert errors == pytest.approx((0.0, late, -late), rel=0.02, abs=1e-9)
        assert errors[1] == pytest.approx(-errors[2], abs=1e-9)


def test_mutual_is_phase_inductance() -> None:
    """Mutual inductances and the phase inductances that stand for them give the same crossings.

    Verifies: THEORY-20
    """
    mutual = machine(mutual_h=[-9e-6, -7e-6, -5e-6])
    assert phase_inductances_h(mutual) == pytest.approx((22e-6, 25e-6, 19e-6))
    plain = machine(inductance_h=[22e-6, 25e-6, 19e-6])
    assert crossing_errors_deg(mutual, VDC_V, SPEED_RPM) == pytest.approx(crossing_errors_deg(plain, VDC_V, SPEED_RPM))


def test_what_has_no_crossing_is_refused() -> None:
    """Another EMF, and an asymmetry that leaves no crossing in reach, raise an error that names the machine.

    Verifies: THEORY-20
    """
    with pytest.raises(ValueError, match=r"Motor-I.*trapezoidal"):
        crossing_errors_deg(machine(emf="trapezoidal"), VDC_V, SPEED_RPM)
    with pytest.raises(ValueError, match=r"Motor-I.*no crossing"):
        crossing_errors_deg(machine(inductance_h=[90e-6, 22e-6, 22e-6]), VDC_V, 2_000.0)
