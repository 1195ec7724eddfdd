"""The shipped scenarios: each carries its limits, and the run fails if one is missed."""

from __future__ import annotations

import pytest

from tests.closed_loop.support import drive


def test_demo() -> None:
    """Standstill to 60 000 r/min, load step, ramp down, gates off.

    Verifies: SYS-01, SYS-02
    """
    run = drive("demo.toml", "demo")
    assert not run.result["failures"]
    assert not run.result["trips"]
    assert run.gates()[-1, 1] == 0, "gates are off at the end"
    assert run.data.overruns == 0
    for window in ("steady", "loaded"):
        m = run.metrics[window]
        assert m["speed_rpm"]["min"] >= 59_700 and m["speed_rpm"]["max"] <= 60_300
        assert abs(m["commutation_error_deg"]["mean"]) <= 0.3
        assert m["commutation_error_deg"]["rms"] <= 0.3
        assert m["late_crossings"] == 0
    assert run.metrics["loaded"]["torque_nm"]["mean"] == pytest.approx(0.025, rel=0.02)


@pytest.mark.parametrize("pattern", ["RSC", "NSC", "CSC"])
def test_commutation_patterns(pattern: str) -> None:
    """RSC: uniform over a carrier (8.85 deg mean, 5.1 deg std at N = 3.39); NSC and CSC: no delay.

    Verifies: SYS-03
    """
    run = drive("patterns.toml", f"patterns-{pattern}", f"drive.commutation={pattern}")
    assert not run.result["trips"]
    error = run.metrics["steady"]["commutation_error_deg"]
    if pattern == "RSC":
        carrier_deg = 360.0 * 59_000 / 60 / 20_000
        assert error["mean"] == pytest.approx(carrier_deg / 2, abs=0.5)
        assert error["std"] == pytest.approx(carrier_deg / 12**0.5, abs=0.4)
    else:
        assert abs(error["mean"]) <= 0.3
        assert error["rms"] <= 0.3


@pytest.mark.parametrize("name", ["own-spindle", "own-pump", "own-outrunner"])
def test_motor_from_its_file_alone(name: str) -> None:
    """Machines nobody tuned for start and hold speed: 2, 4 (trapezoidal) and 7 pole pairs.

    Verifies: SYS-04
    """
    run = drive(f"{name}.toml", name)
    assert not run.result["failures"]
    assert not run.result["trips"]
