"""Position of a rotor at rest with the polarity of its magnet: the firmware on the float model's machines."""

from __future__ import annotations

import math
from ctypes import byref
from dataclasses import dataclass, replace

import numpy as np
import pytest

from fluxlock.analysis.injection_cases import DEAD_TIMES, IPM_BEST, YU_BEST, ipm, yu
from fluxlock.analysis.injection_loop import Loop
from fluxlock.firmware import injection_library as il
from fluxlock.firmware.vector_library import Complex, Pll, vector_library
from tests.firmware.injection_bench import Q25, Q32, TURN, InjectionBench, firmware_pll

SEED = 5
TRIALS = 25  # a case
Q21 = 2**21
RIGHT_RAD = math.radians(10)


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

    def firmware(self) -> il.RestSettings:
        """In the firmware's formats."""
        ampere = Q25 / self.loop.inverter.current_full_scale_a
        return il.RestSettings(
            *(self.settle, self.frame_count, self.lock, self.current_settle, self.current_count),
            round(self.current_a * ampere),
            round(self.rise_a_per_s * self.loop.settings.ts_s * ampere),
            round(self.sure * 2**16),
            round(self.least_a * Q21 / self.loop.inverter.current_full_scale_a),
        )


@dataclass(frozen=True)
class Outcome:
    """Of a trial: name of the last phase, duration (s), error (rad), largest motion of the rotor (mechanical deg)."""

    name: str
    seconds: float
    error_rad: float
    moved_deg: float


def saturated(loop: Loop, plus: float, minus: float) -> Loop:
    """The drive with another saturation of the d axis."""
    saturation = loop.motor.saturation
    assert saturation is not None
    changed = saturation.model_copy(update={"plus": plus, "minus": minus})
    return replace(loop, motor=loop.motor.model_copy(update={"saturation": changed}))


def trial(setting: Setting, theta: float, seed: int) -> Outcome:
    """From an angle (rad) to the end."""
    lib, vector = il.injection_library(), vector_library()
    loop = setting.loop
    s, full_scale_a = loop.settings, loop.inverter.current_full_scale_a
    bench = InjectionBench(loop, theta, seed)
    hz = 1 / (s.period * s.ts_s)
    method = il.SEPARATOR if s.method == "separator" else il.IQ
    errors = il.error_settings(
        method, bench.m.l_d, bench.m.l_q, r_ohm=bench.m.r, injection_hz=hz, full_scale_a=full_scale_a, minimum_a=0.01
    )
    settings, gains = setting.firmware(), firmware_pll(s.pll, s.tick * s.ts_s)
    state, pll, error_q30, moved = il.RestPosition(), Pll(), 0, 0.0
    lib.rest_position_begin(byref(state))
    while il.REST_PHASES[state.phase] not in ("found", "not sure", "no signal"):
        bench.sample()
        result, fresh = Complex(0, 0), bench.amplitude is not None
        if fresh:
            result = lib.injection_vector_i_q21(byref(errors), byref(bench.amplitude))
            error_q30 = lib.injection_error_q30(byref(errors), byref(bench.amplitude))
        wanted = lib.rest_position_step(byref(state), byref(settings), fresh, result)
        command = bench.command
        command.turn_q32 = wanted.turn_q32
        if wanted.track and bench.step % s.tick == 0:
            command.turn_q32 += vector.pll_correct(byref(pll), byref(gains), error_q30)
        command.speed_turn_q36 = vector.pll_speed_turn_q36(byref(pll))
        command.reference_a = wanted.current_i_q25 / Q25 * full_scale_a + 0j
        moved = max(moved, abs(bench.theta_rad - theta) / loop.motor.pole_pairs)
    saturation = loop.motor.saturation
    curve = saturation.angle_rad[0] if saturation else 0.0
    turn = bench.command.turn_q32 / Q32 * TURN
    name = il.REST_PHASES[state.phase]
    return Outcome(name, bench.step * s.ts_s, bench.error_rad(curve + turn), math.degrees(moved))


def trials(setting: Setting, count: int) -> list[Outcome]:
    """From random angles."""
    rng = np.random.default_rng(SEED)
    return [trial(setting, float(rng.uniform(-math.pi, math.pi)), k) for k in range(count)]


def show(name: str, found: list[Outcome]) -> None:
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
    found = trials(yu_setting(dead_time_s, plus, minus), TRIALS)
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
    found = trials(setting, count)
    show("IPM", found)
    for outcome in found:
        assert outcome.name == "found"
        assert abs(outcome.error_rad) < RIGHT_RAD
        assert outcome.seconds <= 0.05
        assert outcome.moved_deg <= 1.0


def test_too_little_saturation_is_said() -> None:
    """With a tenth of the weak saturation the angle is right up to half a turn, the polarity "not sure".

    Verifies: INJC-05
    """
    for outcome in trials(yu_setting(0.0, -0.003, 0.0015), 5):
        assert outcome.name == "not sure"
        assert abs(math.remainder(2 * outcome.error_rad, TURN)) < 2 * RIGHT_RAD


def test_no_saliency_is_said() -> None:
    """With a hundredth of the voltage the noise has no angle.

    Verifies: INJC-05
    """
    setting = yu_setting(0.0)
    loop = replace(setting.loop, settings=replace(setting.loop.settings, amplitude_v=0.6))
    for outcome in trials(replace(setting, loop=loop), 5):
        assert outcome.name == "no signal"


def test_vector_of_the_amplitudes() -> None:
    """All methods give the same vector of the same currents, d positive, q with its sign against d.

    Verifies: INJC-05
    """
    lib = il.injection_library()
    d, q, turn = 0.31, -0.027, np.exp(1j * 2.1)
    for method, scale, count, shift in (
        (il.IQ, 2**19 / 2, 37, 0),
        (il.SEPARATOR, 2**18, 0, 0),
        (il.LOCK_IN, Q21, 0, 3),
    ):
        settings = il.error_settings(method, 1e-3, 2e-3, shift=shift)
        for sign in (1, -1):
            z = [sign * x * scale * (count * turn if count else 1.0) for x in (d, q * 2**shift)]
            a = il.Amplitude(*(Complex(round(x.real), round(complex(x).imag)) for x in z), count)
            got = lib.injection_vector_i_q21(byref(settings), byref(a))
            assert got.re == pytest.approx(d * Q21, abs=10), method
            assert got.im == pytest.approx(q * Q21, abs=10), method
    empty = il.Amplitude(Complex(0, 0), Complex(5, 5), 0)
    settings = il.error_settings(il.IQ, 1e-3, 2e-3)
    got = lib.injection_vector_i_q21(byref(settings), byref(empty))
    assert (got.re, got.im) == (0, 0)
