# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Field weakening: the DC link falls below what the speed's EMF needs, and comes back."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fluxlock.config.vector_design import told_machine
from fluxlock.cosim.outcome import Run
from fluxverify.regression.case import Row, case
from fluxverify.regression.runner import Runner
from fluxverify.regression.six_step.measures import event, timeline
from fluxverify.regression.vector.frames import angle_errors_deg, rms

SCENARIO = "vector/start.toml"
SPEED_RPM = 60_000
LOW_V, FULL_V = 11.0, 25.0
FALL_S, RISE_S, RAMP_S = 0.04, 0.14, 0.02
WEAK, BACK, END_S = (0.10, 0.14), (0.20, 0.22), 0.22
SPEED_SHARE, SHORT_SHARE = 0.01, 0.99
RMS_DEG, MAX_DEG = 1.0, 5.0  # as in the whole sequence
BACK_A = 0.5


def voltage_v(run: Run, current_a: complex) -> float:
    """Amplitude of the fundamental voltage that the machine needs at the speed with a current."""
    m, omega = told_machine(run.scenario), run.scenario.motor.omega_e(SPEED_RPM)
    return abs(complex(m.resistance_ohm, omega * m.inductance_h) * current_a + 1j * omega * m.psi_vs)


def _row(run: Run, weakening: bool) -> Row:
    weak, back = run.metrics["weak"], run.metrics["back"]
    current = complex(weak["id_a"], weak["iq_a"])
    errors = angle_errors_deg(run, WEAK)
    kept: dict[str, tuple[float | None, float | None]] = {
        "speed_over_wanted.weak": (1 - SPEED_SHARE, 1 + SPEED_SHARE),
        "voltage_over_link": (None, 1 / math.sqrt(3)),
        "id_a.back": (-BACK_A, BACK_A),
    }
    return Row(
        f"vector/weakening/{'on' if weakening else 'off'}",
        {
            "motor": "Motor-I",
            "load": "fan 20 mN*m at 60 000 r/min",
            "speed_rpm": SPEED_RPM,
            "link_v": LOW_V,
            "emf_v": voltage_v(run, 0j),
            "weakening": str(weakening),
        },
        {
            "speed_over_wanted.weak": weak["speed_rpm"]["mean"] / SPEED_RPM,
            "id_a.weak": current.real,
            "iq_a.weak": current.imag,
            "voltage_over_link": voltage_v(run, current) / LOW_V,
            "angle_error_deg.rms": rms(errors),
            "angle_error_deg.max": float(np.abs(errors).max()),
            "speed_over_wanted.back": back["speed_rpm"]["mean"] / SPEED_RPM,
            "id_a.back": back["id_a"],
            "trips": len(run.result["trips"]),
        },
        {
            **(kept if weakening else {"speed_over_wanted.weak": (None, SHORT_SHARE)}),
            "angle_error_deg.rms": (None, RMS_DEG),
            "angle_error_deg.max": (None, MAX_DEG),
            "speed_over_wanted.back": (1 - SPEED_SHARE, 1 + SPEED_SHARE),
            "trips": (0, 0),
        },
    )


@case("vector/weakening")
def weakening(runner: Runner) -> Iterator[Row]:
    """A link that is too low for the speed: i_d takes what the EMF has too much, and goes back with the link.

    Without weakening the speed falls.
    """
    events: list[dict[str, object]] = [
        event(0.003, "speed_rpm", SPEED_RPM),
        event(0.004, "command", "start"),
        {"at_s": FALL_S, "supply_v": LOW_V, "ramp_s": RAMP_S},
        {"at_s": RISE_S, "supply_v": FULL_V, "ramp_s": RAMP_S},
    ]
    for on in (True,) if runner.quick else (True, False):
        run = runner.drive(
            SCENARIO,
            "on" if on else "off",
            f"initial.speed_rpm={SPEED_RPM}",
            f"drive.vector.weakening={str(on).lower()}",
            "inverter.protection.under_voltage_v=8",
            "expect=[]",
            *timeline(END_S, events, [("weak", *WEAK), ("back", *BACK)]),
            accept=None if on else {"voltage": "without weakening a link this low does not hold the speed"},
        )
        yield _row(run, on)
