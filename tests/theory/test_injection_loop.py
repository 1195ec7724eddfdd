# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The float model of the whole drive with injection: its parts against independent ones, rows of the settings found."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config.motor import machine_params
from fluxlock.plant.magnetics import FluxMap
from fluxlock.theory.injection import cases, kernel
from fluxlock.theory.injection import machine as injection_machine
from fluxlock.theory.injection.cases import TIAN_BEST, TIAN_TS, YU_BEST, YU_PRINTED, Row, machine, tian, yu
from fluxlock.theory.injection.dead_time import LIMITS, WAYS, yu_driven_rad, yu_start_rad
from fluxlock.theory.injection.loop import Course, Inverter, Loop, Schedule, Settings, designed_pll

YU = machine("five-phase-yu")
TIAN = machine("five-phase-tian")
EXACT = Inverter(200.0)  # no dead time, exact currents


def machine_set(monkeypatch: pytest.MonkeyPatch, loop: Loop) -> Any:
    """The kernel's machine of a drive."""
    found: list[Any] = []

    def catch(m: Any, *_: Any) -> Any:
        found.append(m)
        return np.zeros((1, kernel.COLUMNS))

    with monkeypatch.context() as patch:
        patch.setattr(kernel, "run", catch)
        loop.run(Schedule(1e-3))
    return found[0]


def test_magnetics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flux linkages and incremental inductances are the plant's, saturated, at random currents.

    Verifies: INJT-04
    """
    flux = FluxMap(machine_params(YU))
    m, out = machine_set(monkeypatch, yu(YU_BEST)), np.zeros(7)
    for i in np.random.default_rng(3).uniform(-9, 9, (200, 4)):
        injection_machine.flux_now(m, *i, out)
        assert out[:4] == pytest.approx(flux.flux(i), abs=1e-12)
        inductance = flux.inductance(i)
        assert out[4:] == pytest.approx([inductance[0, 0], inductance[0, 1], inductance[1, 1]], abs=1e-12)


def test_currents_solve_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """The derivative of the currents fits flux linkages whose difference quotient is the voltage's rest.

    Verifies: INJT-04
    """
    for loop in (yu(YU_BEST), tian(TIAN_BEST), cases.ipm(cases.IPM_BEST)):
        flux = FluxMap(machine_params(loop.motor))
        m, work, slope = machine_set(monkeypatch, loop), np.zeros(7), np.zeros(4)
        r = loop.motor.resistance_ohm[0]
        rng, five = np.random.default_rng(4), loop.motor.phases == 5
        for _ in range(20):
            i = rng.uniform(-4, 4, 4) * (1, 1, five, five)
            v = rng.uniform(-40, 40, 4) * (1, 1, five, five)
            theta, omega, h = rng.uniform(0, 6), rng.uniform(-200, 200), 1e-7
            injection_machine.slope_now(m, i, v, theta, omega, work, slope)
            axes = 4 if five else 2

            def stationary(current: Any, angle: float, flux: FluxMap = flux, axes: int = axes) -> Any:
                linkage = flux.flux(current[:axes])
                turn = np.exp(1j * angle * np.array([1, 3][: axes // 2]))
                return (linkage[::2] + 1j * linkage[1::2]) * turn

            change = stationary(i + h * slope, theta + h * omega) - stationary(i - h * slope, theta - h * omega)
            turn = np.exp(1j * theta * np.array([1, 3][: axes // 2]))
            drop = r * (i[:axes:2] + 1j * i[1:axes:2]) * turn
            assert change / (2 * h) + drop == pytest.approx(v[:axes:2] + 1j * v[1:axes:2], abs=1e-3)
            assert five or not slope[2:].any()


def settled_currents(dead_time_s: float, compensate: bool, double: bool = False) -> Course:
    """Standing rotor, known angle, no injection worth the name: i_d 5 A, i_q 3 A."""
    settings = replace(
        TIAN_BEST, amplitude_v=1e-9, pll=(0.0, 0.0, 0.0), remove=False, third_ratio=0.0, double=double, current_hz=60.0
    )
    inverter = Inverter(200.0, dead_time_s, compensate=compensate)
    return Loop(TIAN, inverter, settings).run(Schedule(0.3, imposed_rad_s=0.0, i_d_a=5.0, i_q_a=3.0))


def test_regulators_and_dead_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Currents reach their references; the dead time costs a step of current that the compensation gives back.

    Verifies: INJT-05
    """
    reached = {}
    for dead, compensate in ((0.0, False), (2e-6, False), (2e-6, True)):
        for double in (False, True):
            course = settled_currents(dead, compensate, double)
            assert course.column(kernel.I_D)[-1] == pytest.approx(5.0, abs=0.06)
            assert course.i_q_a[-1] == pytest.approx(3.0, abs=0.06)
            reached[dead, compensate, double] = course.column(kernel.I_D)[: round(6e-3 / TIAN_TS)].mean()
    for double in (False, True):
        clean = reached[0.0, False, double]
        assert reached[2e-6, False, double] < clean - 0.08
        assert reached[2e-6, True, double] == pytest.approx(clean, abs=0.03)


def test_switched_legs() -> None:
    """Every edge at its instant: without a dead time as mean voltages; with one the edges' currents give it back.

    Sampled and moved currents do not: they know nothing of the carrier's ripple.

    Verifies: INJT-05
    """
    edges, moved, sampled = (yu_start_rad(way, 0.0, 0.6) for way in WAYS.values())
    assert edges <= 0.07 < min(moved, sampled)
    mean = cases.yu(YU_BEST)
    speed = np.where(mean.times(0.6) > 0.3, mean.motor.omega_e(50.0), 0.0)
    without = mean.run(Schedule(0.6, speed_rad_s=speed)).largest_mean(0.2)
    assert yu_start_rad({}, 0.0, 0.6, dead_time_s=0.0) == pytest.approx(without, abs=0.01)


def test_currents_at_the_edges_turn_with_the_rotor() -> None:
    """16 degrees of the rotor an injection period: taken as they were they would cost 0.05 rad.

    Verifies: INJT-05
    """
    edges, moved, sampled = (abs(yu_driven_rad(way, 600.0, 0.6)) for way in WAYS.values())
    assert edges <= LIMITS["driven"] < min(moved, sampled)


def test_mechanics() -> None:
    """Constant torque against inertia and viscous load; a brake stops and holds the rotor but never drives it.

    Verifies: INJT-05
    """
    loop = Loop(TIAN, EXACT, replace(TIAN_BEST, third_ratio=0.0))
    course = loop.run(Schedule(2.0, i_q_a=1.0))
    i_q = float(course.i_q_a[-2000:].mean())
    tau = TIAN.inertia_kgm2 / TIAN.load.viscous_nm_s_per_rad
    expected = TIAN.torque_per_amp_nm * i_q / 1.2 * 30 / math.pi
    assert course.speed_rpm[-1] == pytest.approx(expected, rel=0.01)
    at_tau = course.speed_rpm[round(tau / course.ts_s)]
    assert at_tau == pytest.approx((1 - math.exp(-1)) * expected, rel=0.03)
    held = loop.run(Schedule(0.5, i_q_a=1.0, coulomb_nm=8.0))
    assert not held.speed_rpm.any()
    stopped = loop.run(
        Schedule(
            1.5, i_q_a=np.where(loop.times(1.5) < 1.0, 1.0, 0.0), coulomb_nm=np.where(loop.times(1.5) < 1.0, 0.0, 8.0)
        )
    )
    assert stopped.speed_rpm[round(0.9 / TIAN_TS)] > 20 and abs(stopped.speed_rpm[-1]) == 0.0


def test_third_plane_follows() -> None:
    """The regulators of plane 3 hold i_q3 = k i_q, and the torque is the machine's.

    Verifies: INJT-05
    """
    course = Loop(TIAN, EXACT, TIAN_BEST).run(Schedule(0.6, imposed_rad_s=0.0, i_q_a=2.0))
    plain = Loop(TIAN, EXACT, replace(TIAN_BEST, third_ratio=0.0)).run(Schedule(0.6, imposed_rad_s=0.0, i_q_a=2.0))
    window = slice(-2000, None)
    more = course.column(kernel.TORQUE)[window].mean() - plain.column(kernel.TORQUE)[window].mean()
    assert more == pytest.approx(2.5 * 4 * 3 * 0.033492 * 0.15 * 2.0, rel=0.03)


@pytest.mark.parametrize("settings", [TIAN_BEST, cases.LOCK_IN, cases.CONVENTIONAL, replace(TIAN_BEST, over=8)])
def test_methods_find_the_rotor(settings: Settings) -> None:
    """Each demodulator, also oversampled, takes away an error of 15 degrees at standstill, of either sign.

    Verifies: INJT-06
    """
    for sign in (-1.0, 1.0):
        course = Loop(TIAN, EXACT, settings).run(Schedule(0.8, imposed_rad_s=0.0, error_rad=sign * math.radians(15)))
        assert math.degrees(abs(course.error()[0])) == pytest.approx(15.0, abs=1e-6)
        assert abs(course.statistics(0.6).degrees().mean) < 0.1


def test_same_seed_same_run() -> None:
    """Noise follows the seed."""
    a, b, c = (tian(TIAN_BEST).run(Schedule(0.05, i_q_a=1.0), seed) for seed in (1, 1, 2))
    assert np.array_equal(a.record, b.record) and not np.array_equal(a.record, c.record)


def test_bad_settings() -> None:
    """Messages name the value."""
    with pytest.raises(ValueError, match="period = 5"):
        replace(TIAN_BEST, period=5)
    with pytest.raises(ValueError, match="separator needs 4"):
        replace(YU_BEST, period=8)
    with pytest.raises(ValueError, match="over = 0"):
        replace(TIAN_BEST, over=0)


def failed(rows: list[Row]) -> list[str]:
    return [row.text() for row in rows if not row.passed]


@pytest.mark.parametrize("subject", ["yu-sequences", "yu-leakage", "yu-compensation", "tian-start"])
def test_rows(subject: str) -> None:
    """Limits of the issue's table in the float model.

    Verifies: INJT-07
    """
    rows = cases.SUBJECTS[subject]()
    assert any(row.limit is not None for row in rows) and not failed(rows)


def test_steady_rows() -> None:
    """Tian's best scheme without dead time, and at standstill with it where the compensation has the moved current.

    Verifies: INJT-07
    """
    for rpm in (0.0, 100.0):
        found = tian(TIAN_BEST).run(Schedule(0.8, imposed_rad_s=TIAN.omega_e(rpm))).statistics(0.3).degrees()
        assert abs(found.mean) <= 0.3 and found.rms <= 0.5
    angles = np.arange(5) * math.pi / 25
    worst = {
        moved: max(
            abs(
                tian(TIAN_BEST, 2e-6, moved)
                .run(Schedule(0.6, imposed_rad_s=0.0, theta_rad=float(theta)))
                .statistics(0.3)
                .degrees()
                .mean
            )
            for theta in angles
        )
        for moved in (True, False)
    }
    assert worst[True] <= 1.0 < worst[False]


def test_printed_methods_are_worse() -> None:
    """Conventional above lock-in above the best at 50 r/min.

    Verifies: INJT-07
    """
    found = [
        abs(cases.tian_steady(settings, 0.0, 50.0).statistics(2.0).degrees().mean)
        for settings in (cases.CONVENTIONAL, cases.LOCK_IN, TIAN_BEST)
    ]
    assert found[0] > 1.5 * found[1] > 15 * found[2]


def test_curve_under_a_changing_load() -> None:
    """The limit holds with the curve and does not without.

    Verifies: INJT-07
    """
    largest = [
        cases.yu_loaded(replace(YU_BEST, compensation=compensation), 0.0).largest_mean(0.6)
        for compensation in ("following", "off")
    ]
    assert largest[0] <= 0.07 < largest[1]


def test_command() -> None:
    """The rows are printed with their limits; a subject that there is not is refused."""
    command = [sys.executable, "-m", "fluxlock.theory.injection.cases"]
    done = subprocess.run([*command, "yu-leakage"], capture_output=True, text=True, cwd=ROOT, check=True)
    assert "limit 10   ok" in done.stdout
    wrong = subprocess.run([*command, "nothing"], capture_output=True, text=True, cwd=ROOT, check=False)
    assert wrong.returncode == 2 and "nothing" in wrong.stderr and "Traceback" not in wrong.stderr
    assert Path(injection_machine.FOLDER).exists()


def test_pll_designs() -> None:
    """Third order has a gain on the acceleration, second order has none."""
    assert designed_pll(2, 30.0, TIAN_TS)[2] == 0.0 < designed_pll(3, 30.0, TIAN_TS)[2]
    assert YU_PRINTED.pll == pytest.approx((115 * 125e-6, 3306 * 125e-6, 0.0))
