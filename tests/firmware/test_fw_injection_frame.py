# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's whole control of an injected machine, on the host against the float model's machine: rows in degrees.

The drive of two subspaces with injection: rest position, angle, cross-coupling, speed loop, references of all four
currents. Limits are those that the chip's runs must reach (docs/theory/five-phase.md), over shorter courses.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fluxlock.firmware import injection_formats as formats
from fluxlock.firmware.binding import names
from fluxlock.theory.injection.cases import DEAD_TIMES
from fluxverify.regression.five_phase.injection_bench import Q25
from tests.firmware.injection_frame_bench import (
    HERTZ,
    SEED,
    EmfObserver,
    FrameBench,
    ipm_setting,
    tian_setting,
    yu_setting,
)


def judge(name: str, value: float, limit: float) -> None:
    """Print the row, hold the limit."""
    print(f"seed {SEED}, {name}: {value:+.3f} deg, limit {limit:g}")
    assert abs(value) <= limit, name


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
    assert not bench.state.resting and names("rest_phase_t")[bench.state.rest.phase] == "found"
    judge("yu, rest position", bench.errors_deg(0.045)[-1], 5.0)
    bench.run(1.0 - at_rest)
    assert bench.chip.state[5] == pytest.approx(speed, rel=0.03)
    judge("yu, to 150 r/min and brake, dynamic", bench.largest_mean_deg(at_rest), math.degrees(0.07))
    judge("yu, rated load: raw less 0.30 rad", float(bench.errors_deg(0.9, raw=True).mean()) - math.degrees(0.30), 1.15)
    judge("yu, rated load: published", float(bench.errors_deg(0.9).mean()), math.degrees(0.01))
    assert names("injection_verdict_t")[bench.state.validity.verdict] == "good"


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


def test_through_the_whole_speed() -> None:
    """Three phases, driven shaft, 0 to 2000 r/min and back with the firmware's EMF observer from 600 r/min on, i_q 3 A.

    One hand-over each way; published angle within 3 degrees, torque within 5 %.

    Verifies: INJC-06
    """
    setting = ipm_setting(0.0)
    omega_e = setting.loop.motor.omega_e
    ts = setting.loop.settings.ts_s

    def drive(bench: FrameBench, t: float) -> None:
        bench.chip.imposed_rad_s = omega_e(2000.0) * float(np.interp(t, [0.1, 0.35, 0.4, 0.65], [0.0, 1.0, 1.0, 0.0]))

    bench = FrameBench(setting, i_q_a=lambda _: 3.0, before=drive)
    bench.emf = EmfObserver(bench.chip)
    up, down = omega_e(600.0) * HERTZ, omega_e(450.0) * HERTZ
    bench.settings.handover = formats.handover_settings(up, down, 2 * ts / 0.02, 10)[0]
    bench.run(0.7)
    changes = int(np.abs(np.diff(np.array(bench.injecting, int))).sum())
    assert changes == 2, "one hand-over each way"
    assert bench.injecting[-1]
    # Away from the corners of the imposed speed, which no loop foresees.
    t = np.array(bench.time_s)
    for name, begin, end in (("up", 0.15, 0.34), ("down", 0.46, 0.64)):
        window = (t >= begin) & (t < end)
        assert np.ptp(np.array(bench.injecting)[window].astype(int)) == 1, "the hand-over is in the window"
        errors = np.degrees(np.array(bench.published_rad)[window])
        n = round(5e-3 / ts)
        kernel = np.full(n, 1 / n)
        judge(f"ipm, hand-over {name}", float(np.abs(np.convolve(errors, kernel, mode="valid")).max()), 3.0)
        torque = np.convolve(np.array(bench.torques_nm)[window], kernel, mode="valid")
        dip = 100 * float(np.abs(torque / torque.mean() - 1).max())
        print(f"seed {SEED}, torque within {dip:.2f} %")
        assert dip < 5.0


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
    assert names("injection_verdict_t")[bench.state.validity.verdict] == "no_saliency"
