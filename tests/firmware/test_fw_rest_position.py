# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Position of a rotor at rest with the polarity of its magnet: the firmware on the float model's machines."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from fluxlock.firmware import injection_formats as formats
from fluxlock.firmware.binding import names, new, open_library
from fluxlock.firmware.vector_formats import Complex
from fluxlock.headers import CData
from fluxlock.theory.injection.cases import DEAD_TIMES, IPM_BEST, YU_BEST, ipm, yu
from fluxlock.theory.injection.loop import Loop
from fluxverify.regression.five_phase.injection_bench import Q25, TURN
from fluxverify.regression.five_phase.rest_trial import RIGHT_RAD, Trial, saturated, trials

SEED = 5
TRIALS = 25  # a case
Q21 = 2**21


@dataclass(frozen=True)
class Setting:
    """Of a drive: I (A), its rise (A/s), counts of results."""

    loop: Loop
    current_a: float
    rise_a_per_s: float
    least_a: float  # of the saliency's amplitude
    settle: int = 8
    frame_count: int = 16
    lock: int = 24
    current_settle: int = 6
    current_count: int = 8
    sure: float = 0.012

    def firmware(self) -> CData:
        """rest_position_settings_t."""
        ampere = Q25 / self.loop.inverter.current_full_scale_a
        return new(
            "rest_position_settings_t",
            settle=self.settle,
            frame_count=self.frame_count,
            lock=self.lock,
            current_settle=self.current_settle,
            current_count=self.current_count,
            current_i_q25=round(self.current_a * ampere),
            rise_i_q25=round(self.rise_a_per_s * self.loop.settings.ts_s * ampere),
            sure_q16=round(self.sure * 2**16),
            minimum_i_q21=round(self.least_a * Q21 / self.loop.inverter.current_full_scale_a),
        )


def ran(setting: Setting, count: int) -> list[Trial]:
    """Trials from random angles."""
    return trials(setting.loop, setting.firmware(), count, SEED)


def show(name: str, found: list[Trial]) -> None:
    """Largest values of the trials."""
    seconds, error, moved = (max(abs(getattr(x, key)) for x in found) for key in ("seconds", "error_rad", "moved_deg"))
    print(f"seed {SEED}, {name}: {1e3 * seconds:.1f} ms, error {math.degrees(error):.2f} deg, moved {moved:.2f} deg")


def yu_setting(dead_time_s: float, plus: float = -0.10, minus: float = 0.05) -> Setting:
    """Yu's machine, test current 5 A."""
    return Setting(saturated(yu(YU_BEST, dead_time_s), plus, minus), 5.0, 2500.0, 0.008)


@pytest.mark.parametrize("dead_time_s", DEAD_TIMES)
@pytest.mark.parametrize(("plus", "minus"), [(-0.10, 0.05), (-0.03, 0.015)])
def test_position_and_polarity_from_any_angle(plus: float, minus: float, dead_time_s: float) -> None:
    """Yu's machine from random angles, strong and weak saturation: all right, in 50 ms, rotor within 1 degree.

    Verifies: INJC-05
    """
    found = ran(yu_setting(dead_time_s, plus, minus), TRIALS)
    show(f"{plus:g}, dead time {1e6 * dead_time_s:g} us", found)
    for outcome in found:
        assert outcome.name == "found"
        assert abs(outcome.error_rad) < RIGHT_RAD
        assert outcome.seconds <= 0.05
        assert outcome.moved_deg <= 1.0


def test_three_phases_with_sums(count: int = 10) -> None:
    """The three-phase machine with I/Q sums.

    Verifies: INJC-05
    """
    setting = Setting(ipm(IPM_BEST), 10.0, 4000.0, 0.1, settle=6, frame_count=8, lock=20)
    found = ran(setting, count)
    show("IPM", found)
    for outcome in found:
        assert outcome.name == "found"
        assert abs(outcome.error_rad) < RIGHT_RAD
        assert outcome.seconds <= 0.05
        assert outcome.moved_deg <= 1.0


def test_too_little_saturation_is_said() -> None:
    """With a tenth of the weak saturation the angle is right up to half a turn, the polarity "not_sure".

    Verifies: INJC-05
    """
    for outcome in ran(yu_setting(0.0, -0.003, 0.0015), 5):
        assert outcome.name == "not_sure"
        assert abs(math.remainder(2 * outcome.error_rad, TURN)) < 2 * RIGHT_RAD


def test_no_saliency_is_said() -> None:
    """With a hundredth of the voltage the noise has no angle.

    Verifies: INJC-05
    """
    setting = yu_setting(0.0)
    loop = replace(setting.loop, settings=replace(setting.loop.settings, amplitude_v=0.6))
    for outcome in ran(replace(setting, loop=loop), 5):
        assert outcome.name == "no_signal"


def test_vector_of_the_amplitudes() -> None:
    """All methods give the same vector of the same currents, d positive, q with its sign against d.

    Verifies: INJC-05
    """
    lib = open_library()
    d, q, turn = 0.31, -0.027, np.exp(1j * 2.1)
    for method, scale, count, shift in (
        ("iq", 2**19 / 2, 37, 0),
        ("separator", 2**18, 0, 0),
        ("lock_in", Q21, 0, 3),
    ):
        settings = formats.error_settings(method, 1e-3, 2e-3, shift=shift)
        for sign in (1, -1):
            z = [sign * x * scale * (count * turn if count else 1.0) for x in (d, q * 2**shift)]
            a = new("injection_amplitude_t", *(Complex(round(x.real), round(complex(x).imag)) for x in z), count)
            got = lib.injection_vector_i_q21(settings, a)
            assert got.re == pytest.approx(d * Q21, abs=10), method
            assert got.im == pytest.approx(q * Q21, abs=10), method
    empty = new("injection_amplitude_t", Complex(0, 0), Complex(5, 5), 0)
    settings = formats.error_settings("iq", 1e-3, 2e-3)
    got = lib.injection_vector_i_q21(settings, empty)
    assert (got.re, got.im) == (0, 0)


@pytest.mark.parametrize("share", [0.09, 0.03, 0.004, -0.004, -0.03, -0.09])
def test_poles_of_a_frame_that_is_held(share: float) -> None:
    """The amplitude falls or grows with i_d: +1 along the magnet, -1 against it, 0 below what is sure; then no current.

    Verifies: INJC-17
    """
    lib, phases = open_library(), names("rest_phase_t")
    settings, full_i_q21 = yu_setting(0.0).firmware(), 100_000
    state = new("rest_position_t", phase=phases.index("found"))
    lib.rest_position_again(state, settings, True)
    seen = []
    for _ in range(200):
        i_d = state.current_i_q25
        vector = Complex(round(full_i_q21 * (1 + share * i_d / settings.current_i_q25)), 0)
        command = lib.rest_position_step(state, settings, new("rest_position_input_t", True, vector, i_d, 0))
        assert command.turn_q32 == 0 and abs(command.current_i_q25) <= settings.current_i_q25
        seen.append(int(state.pole))
    sign = 0 if abs(share) < 0.012 else round(math.copysign(1, share))
    assert seen[-1] == sign and set(seen) <= {0, sign}
    lib.rest_position_again(state, settings, False)
    for _ in range(200):
        lib.rest_position_step(state, settings, new("rest_position_input_t", False, Complex(0, 0), 0, 0))
    assert state.current_i_q25 == 0


def test_held_frame_takes_no_more_current_than_it_needs() -> None:
    """A search that has seen nine times the difference that is sure: a quarter of its current is enough.

    Verifies: INJC-17
    """
    lib, phases = open_library(), names("rest_phase_t")
    settings = yu_setting(0.0).firmware()
    for difference, halvings in ((0.03, 0), (0.06, 1), (0.11, 2)):
        plus, minus = round(100_000 * (1 + difference)), round(100_000 * (1 - difference))
        state = new("rest_position_t", phase=phases.index("found"), plus_i_q21=plus, minus_i_q21=minus)
        lib.rest_position_again(state, settings, True)
        assert state.halvings == halvings, difference
