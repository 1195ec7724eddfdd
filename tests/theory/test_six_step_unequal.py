# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Crossing errors of unequal phases against closed forms."""

from __future__ import annotations

import itertools
import math

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.config.motor import Motor
from fluxlock.theory.six_step.unequal import (
    commutation_intervals_deg,
    crossing_errors_deg,
    crossing_intervals_deg,
    phase_inductances_h,
    sector_errors_deg,
)

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


def test_resistive_drop() -> None:
    """What the resistances take, the unequal inductances do not divide: as with a supply so much lower.

    Verifies: THEORY-20
    """
    motor = machine(inductance_h=[27e-6, 22e-6, 22e-6])
    dropped = sector_errors_deg(motor, VDC_V, SPEED_RPM, drop_v=2.0)
    assert dropped == pytest.approx(sector_errors_deg(motor, VDC_V - 2.0, SPEED_RPM))
    assert max(dropped) < 0.9 * max(sector_errors_deg(motor, VDC_V, SPEED_RPM))


def test_what_has_no_crossing_is_refused() -> None:
    """Another EMF, and an asymmetry that leaves no crossing in reach, raise an error that names the machine.

    Verifies: THEORY-20
    """
    with pytest.raises(ValueError, match=r"Motor-I.*trapezoidal"):
        crossing_errors_deg(machine(emf="trapezoidal"), VDC_V, SPEED_RPM)
    with pytest.raises(ValueError, match=r"Motor-I.*no crossing"):
        crossing_errors_deg(machine(inductance_h=[90e-6, 22e-6, 22e-6]), VDC_V, 2_000.0)


def test_divider_gain() -> None:
    """A divider high by a share: its threshold on the terminal is low, both of its crossings shift opposite ways.

    Verifies: THEORY-20
    """
    motor, gain = machine(), 1.1
    slope_v = 1.5e-3 * motor.omega_e(SPEED_RPM)
    early = math.degrees(math.asin(0.5 * VDC_V * (1 - 1 / gain) / slope_v))
    # A floats in sector III with a falling voltage, in VI with a rising one.
    assert sector_errors_deg(motor, VDC_V, SPEED_RPM, (gain, 1.0, 1.0)) == pytest.approx(
        (0.0, 0.0, early, 0.0, 0.0, -early), abs=1e-9
    )


def test_intervals_of_errors() -> None:
    """Intervals are 60 degrees and the difference of errors; a commutation adds half the last interval.

    Verifies: THEORY-20
    """
    errors = (-10.0, 10.0, 0.0, -10.0, 10.0, 0.0)
    assert crossing_intervals_deg(errors) == pytest.approx((50.0, 80.0, 50.0) * 2)
    crossings = [60.0 * k + errors[k % 6] for k in range(14)]
    commutations = [1.5 * crossings[k] - 0.5 * crossings[k - 1] for k in range(1, 14)]
    steps = [after - before for before, after in itertools.pairwise(commutations)]
    assert commutation_intervals_deg(errors) == pytest.approx((*steps[4:10],))
