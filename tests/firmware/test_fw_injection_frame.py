"""The firmware's whole control of an injected machine, on the host against the float model's machine: rows in degrees.

The drive of two subspaces with injection: rest position, angle, cross-coupling, speed loop, references of all four
currents. Limits are those that the chip's runs must reach (docs/theory/five-phase.md), over shorter courses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from ctypes import byref
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from fluxlock.analysis.injection_cases import DEAD_TIMES, IPM_BEST, TIAN_BEST, YU_BEST, ipm, tian, yu
from fluxlock.analysis.injection_chain import HfMachine
from fluxlock.analysis.injection_loop import CURVE_REACH
from fluxlock.analysis.injection_theory import amplitude as hf_amplitude
from fluxlock.analysis.injection_theory import with_third_plane
from fluxlock.analysis.rundata import FloatArray
from fluxlock.firmware import injection_library as il
from fluxlock.firmware.control_library import PiGains
from fluxlock.firmware.vector_compiler import PI_INTEGRAL
from fluxlock.firmware.vector_library import from_complex, real_gain
from tests.firmware.injection_bench import (
    CLOCK_HZ,
    Q25,
    Q32,
    Q36,
    TURN,
    InjectionBench,
    firmware_pll,
)
from tests.firmware.test_fw_injection_error import machine_for
from tests.firmware.test_fw_rest_position import Setting

SEED = 12
Q16, Q21 = 2**16, 2**21
HERTZ = Q36 / CLOCK_HZ / TURN  # of rad/s, in 2^-36 turn a clock


def frame_settings(setting: Setting) -> il.FrameSettings:
    """The firmware's settings from those of the float model."""
    loop = setting.loop
    s, motor, full_scale_a = loop.settings, loop.motor, loop.inverter.current_full_scale_a
    bench = InjectionBench(loop)
    m, tick = bench.m, s.tick * s.ts_s
    hf = HfMachine(m.r, m.l_d, m.l_q)
    if m.phases == 5:
        hf = with_third_plane(hf, m.l_13, m.l_d3, m.l_q3)
    unit = Q21 / full_scale_a
    expected = hf_amplitude(hf, s.amplitude_v, s.period * s.ts_s).d
    if s.method == "iq":
        expected *= 8 / math.pi**2  # fundamental of a triangle
    ratio = hf.lq_h / hf.ld_h
    noise = hf.lq_h / (hf.lq_h - hf.ld_h) / (4 / math.sqrt(math.pi))
    saturation = motor.saturation
    curve, most = ((0.0,), 1.0)
    if saturation is not None:
        curve = saturation.angle_rad
        most = CURVE_REACH * (saturation.angle_current_a or saturation.current_a)
    method = il.SEPARATOR if s.method == "separator" else il.IQ
    hz = 1 / (s.period * s.ts_s)
    ampere_per_rad_s = Q25 / full_scale_a / HERTZ
    top = motor.omega_e(motor.max_speed_rpm)
    return il.FrameSettings(
        il.error_settings(
            method, hf.ld_h, hf.lq_h, r_ohm=m.r, injection_hz=hz, full_scale_a=full_scale_a, minimum_a=0.1 * expected
        ),
        setting.firmware(),
        il.HandoverSettings(round(2 * top * HERTZ), round(top * HERTZ), 1, 1),
        il.ValiditySettings(
            *(round(0.2 * expected * unit), round(expected * unit), round(ratio * Q16)),
            *(round((0.4 * ratio + 0.6) * Q16), round((0.1 * ratio + 0.9) * Q16)),
            *(round(noise * Q16), round(0.3 * Q16), round(0.6 * Q16), 6, 100),
        ),
        firmware_pll(s.pll, tick, 2 * top),
        il.SEQUENCES.index(s.sequence),
        machine_for(1.0, bench.cycles),
        il.cross_coupling_settings(
            curve, most, full_scale_a, 1 - math.exp(-TURN * s.curve_hz * tick), s.compensation == "following"
        ),
        PiGains(real_gain(s.speed_p * ampere_per_rad_s), real_gain(s.speed_i * tick * ampere_per_rad_s * PI_INTEGRAL)),
        round((1 - math.exp(-TURN * s.speed_hz * tick)) * Q16),
        round(s.third_ratio * Q16),
        round(s.current_limit_a / full_scale_a * Q25),
    )


@dataclass
class FrameBench:
    """Firmware and machine; wanted: speed (electrical rad/s) or None, i_q (A), at a time."""

    setting: Setting
    theta: float = 0.7
    error_rad: float = 0.0  # of the published angle at the start
    resting: bool = False
    speed_rad_s: float = 0.0
    wanted: Callable[[float], float | None] = lambda _: None
    i_q_a: Callable[[float], float] = lambda _: 0.0
    before: Callable[[FrameBench, float], None] = lambda *_: None  # a sample: loads
    time_s: list[float] = field(default_factory=list)
    published_rad: list[float] = field(default_factory=list)
    raw_rad: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.lib = il.injection_library()
        self.settings = frame_settings(self.setting)
        self.chip = InjectionBench(self.setting.loop, self.theta, SEED, self.speed_rad_s)
        self.state = il.Frame()
        speed = round(self.speed_rad_s * HERTZ)
        self.lib.injection_frame_begin(byref(self.state), byref(self.settings), self.resting, speed)
        frame = self.theta + self.error_rad - self.state.curve_q32 / Q32 * TURN
        self.chip.nco_q36 = round(frame / TURN * Q36) % int(Q36)
        self.chip.command.speed_turn_q36 = speed
        self.amplitude: il.Amplitude | None = None
        self.report = 0.0

    def run(self, seconds: float) -> None:
        """So long."""
        chip, s = self.chip, self.setting.loop.settings
        full_scale_a = self.setting.loop.inverter.current_full_scale_a
        ampere = Q25 / full_scale_a
        for _ in range(round(seconds / s.ts_s)):
            t = chip.step * s.ts_s
            self.before(self, t)
            chip.sample()
            self.amplitude = chip.amplitude or self.amplitude
            if chip.step % s.tick == 0:
                wanted = self.wanted(t)
                given = il.FrameInput(
                    self.amplitude is not None,
                    self.amplitude or il.Amplitude(),
                    from_complex(chip.current_a, ampere),
                    0,
                    False,
                    wanted is not None,
                    round((wanted or 0.0) * HERTZ),
                    from_complex(1j * self.i_q_a(t), ampere),
                )
                self.amplitude = None
                made = self.lib.injection_frame_step(byref(self.state), byref(self.settings), byref(given))
                c = chip.command
                c.turn_q32, c.speed_turn_q36 = made.turn_q32, made.speed_turn_q36
                c.lead_q32, c.curve_q32, c.inject = made.lead_q32, made.curve_q32, made.inject
                c.reference_a, c.third_a = (complex(z.re, z.im) / ampere for z in made.reference_i_q25)
                self.report = made.report_q32 / Q32 * TURN
            self.time_s.append(t)
            self.raw_rad.append(chip.error_rad(self.report))
            self.published_rad.append(chip.error_rad(self.report + self.state.curve_q32 / Q32 * TURN))

    def errors_deg(self, begin_s: float, raw: bool = False) -> FloatArray:
        """From an instant on."""
        e = np.array(self.raw_rad if raw else self.published_rad)
        return np.degrees(e[np.array(self.time_s) >= begin_s])

    def largest_mean_deg(self, begin_s: float) -> float:
        """Largest 5 ms mean."""
        n = round(5e-3 / self.setting.loop.settings.ts_s)
        return float(np.abs(np.convolve(self.errors_deg(begin_s), np.full(n, 1 / n), mode="valid")).max())


def judge(name: str, value: float, limit: float) -> None:
    """Print the row, hold the limit."""
    print(f"seed {SEED}, {name}: {value:+.3f} deg, limit {limit:g}")
    assert abs(value) <= limit, name


def tian_setting(dead_time_s: float) -> Setting:
    """Tian's machine, best scheme."""
    return Setting(tian(TIAN_BEST, dead_time_s), 3.0, 1500.0, 0.05)


def yu_setting(dead_time_s: float) -> Setting:
    """Yu's machine, best scheme."""
    return Setting(yu(YU_BEST, dead_time_s), 5.0, 2500.0, 0.008)


def ipm_setting(dead_time_s: float) -> Setting:
    """Three-phase IPM."""
    return Setting(ipm(IPM_BEST, dead_time_s), 10.0, 4000.0, 0.1, settle=6, frame_count=8, lock=20)


@pytest.mark.parametrize("dead_time_s", DEAD_TIMES)
@pytest.mark.parametrize("rpm", [5.0, 100.0])
def test_tian_steady(rpm: float, dead_time_s: float) -> None:
    """Driven shaft, i_q 2 A: mean and rms.

    Verifies: INJC-08
    """
    setting = tian_setting(dead_time_s)
    speed = setting.loop.motor.omega_e(rpm)
    bench = FrameBench(setting, speed_rad_s=speed, i_q_a=lambda _: 2.0)
    bench.chip.imposed_rad_s = speed
    bench.run(0.4)
    e = bench.errors_deg(0.2)
    text = f"tian {rpm:g} r/min, dead time {1e6 * dead_time_s:g} us"
    judge(f"{text}: mean", float(e.mean()), 1.0 if dead_time_s else 0.3)
    if not dead_time_s:
        judge(f"{text}: rms", float(np.sqrt((e * e).mean())), 0.5)


@pytest.mark.parametrize("error_deg", [-30.0, 30.0])
def test_tian_start(error_deg: float) -> None:
    """Free rotor, i_q 2 A at once, 30 degrees off: within 5 degrees for good after 60 ms; then torque reversed.

    Verifies: INJC-08
    """
    bench = FrameBench(tian_setting(2e-6), error_rad=math.radians(error_deg), i_q_a=lambda t: 2.0 if t < 0.3 else -2.0)
    bench.run(0.5)
    text = f"tian from {error_deg:g} deg"
    judge(f"{text}, after 60 ms", bench.largest_mean_deg(0.06), 5.0)


def test_third_subspace_follows() -> None:
    """The current of subspace 3 is k i_q on its q axis.

    Verifies: INJC-08
    """
    setting = tian_setting(0.0)
    speed = setting.loop.motor.omega_e(50.0)
    bench = FrameBench(setting, speed_rad_s=speed, i_q_a=lambda _: 1.5)
    bench.chip.imposed_rad_s = speed
    bench.run(0.3)
    i = np.zeros(4)
    count = 400
    for _ in range(count):
        bench.run(setting.loop.settings.ts_s)
        i += bench.chip.state[:4] / count
    assert i[1] == pytest.approx(1.5, abs=0.03)
    assert i[2] == pytest.approx(0.0, abs=0.02)
    assert i[3] == pytest.approx(0.15 * 1.5, abs=0.02)


def test_yu_from_unknown_rest_to_speed_against_the_brake() -> None:
    """Rest position, 0 to 150 r/min, then the rated brake: one run of the whole.

    Raw against the curve at the rated load 0.30 rad, published 0.01 rad; dynamic 0.07 rad.

    Verifies: INJC-08
    """
    setting = yu_setting(2e-6)
    at_rest = 0.05
    speed = setting.loop.motor.omega_e(150.0)

    def brake(bench: FrameBench, t: float) -> None:
        bench.chip.coulomb_nm = 11.0 * float(np.interp(t, [0.4, 0.7], [0.0, 1.0]))

    bench = FrameBench(
        setting,
        theta=2.9,
        error_rad=-1.9,
        resting=True,
        wanted=lambda t: speed * min(max(t - at_rest, 0.0) / 0.3, 1.0),
        before=brake,
    )
    bench.run(at_rest)
    assert not bench.state.resting and il.REST_PHASES[bench.state.rest.phase] == "found"
    judge("yu, rest position", bench.errors_deg(0.045)[-1], 5.0)
    bench.run(1.0 - at_rest)
    assert bench.chip.state[5] == pytest.approx(speed, rel=0.03)
    judge("yu, to 150 r/min and brake, dynamic", bench.largest_mean_deg(at_rest), math.degrees(0.07))
    judge("yu, rated load: raw less 0.30 rad", float(bench.errors_deg(0.9, raw=True).mean()) - math.degrees(0.30), 1.15)
    judge("yu, rated load: published", float(bench.errors_deg(0.9).mean()), math.degrees(0.01))
    assert il.VERDICTS[bench.state.validity.verdict] == "good"


def test_ipm_reversal() -> None:
    """Three phases, I/Q at every second tick: to a tenth of the speed, reversal, rated torque.

    Verifies: INJC-08
    """
    setting = ipm_setting(2e-6)
    motor = setting.loop.motor
    top = motor.omega_e(0.1 * motor.max_speed_rpm)
    torque = motor.pole_pairs * 1.5 * motor.psi_vs[0] * motor.rated_current_a

    def load(bench: FrameBench, t: float) -> None:
        bench.chip.load_nm = torque * float(np.interp(t, [0.3, 0.4], [0.0, 1.0]))

    bench = FrameBench(
        setting, wanted=lambda t: top * float(np.interp(t, [0.0, 0.1, 0.15, 0.3], [0.0, 1.0, 1.0, -1.0])), before=load
    )
    bench.run(0.6)
    e = bench.errors_deg(0.5)
    judge("ipm, reversal and rated torque, dynamic", bench.largest_mean_deg(0.02), 5.0)
    judge("ipm, rated torque: mean", float(e.mean()), 0.5)
    judge("ipm, rated torque: rms", float(np.sqrt((e * e).mean())), 1.0)


def test_derated_current() -> None:
    """A weak injection leaves less of the current, and at last none, with its name.

    Verifies: INJC-08
    """
    setting = yu_setting(0.0)
    bench = FrameBench(setting, i_q_a=lambda _: 4.0)
    bench.chip.imposed_rad_s = 0.0
    bench.run(0.2)
    assert bench.state.wanted_i_q25 == round(4.0 / 10.0 * Q25)
    # The voltage halves: so does the ratio that is seen.
    bench.chip.loop = replace(setting.loop, settings=replace(setting.loop.settings, amplitude_v=30.0))
    bench.run(0.15)
    assert bench.state.wanted_i_q25 == 0 and bench.state.limited
    assert il.VERDICTS[bench.state.validity.verdict] == "no_saliency"
