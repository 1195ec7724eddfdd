# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's search of a rotor at rest on the host: the compiled C against the float model's machine."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fluxlock.firmware import injection_formats as formats
from fluxlock.firmware.binding import names, new, open_library
from fluxlock.firmware.vector_formats import Complex
from fluxlock.headers import CData
from fluxlock.theory.injection.loop import Loop
from fluxverify.regression.five_phase.injection_bench import Q25, Q32, TURN, InjectionBench, firmware_pll

RIGHT_RAD = math.radians(10)


@dataclass(frozen=True)
class Trial:
    """Name of the last phase, duration (s), error (rad), largest motion of the rotor (mechanical deg)."""

    name: str
    seconds: float
    error_rad: float
    moved_deg: float

    @property
    def right(self) -> bool:
        """Found, with the right polarity."""
        return self.name == "found" and abs(self.error_rad) < RIGHT_RAD


def saturated(loop: Loop, plus: float, minus: float) -> Loop:
    """The drive with another saturation of the d axis."""
    saturation = loop.motor.saturation
    assert saturation is not None
    changed = saturation.model_copy(update={"plus": plus, "minus": minus})
    return replace(loop, motor=loop.motor.model_copy(update={"saturation": changed}))


def trial(loop: Loop, settings: CData, theta: float, seed: int) -> Trial:
    """From an angle (rad) to the end; seed: of the noise."""
    lib, phases = open_library(), names("rest_phase_t")
    s, full_scale_a = loop.settings, loop.inverter.current_full_scale_a
    bench = InjectionBench(loop, theta, seed)
    hz = 1 / (s.period * s.ts_s)
    errors = formats.error_settings(
        s.method, bench.m.l_d, bench.m.l_q, r_ohm=bench.m.r, injection_hz=hz, full_scale_a=full_scale_a, minimum_a=0.01
    )
    gains = firmware_pll(s.pll, s.tick * s.ts_s)
    state, pll, error_q30, moved = new("rest_position_t"), new("pll_t"), 0, 0.0
    lib.rest_position_begin(state)
    turned_q32 = 0
    while phases[state.phase] not in ("found", "not_sure", "no_signal"):
        bench.sample()
        result, amplitude = Complex(0, 0), bench.amplitude
        if amplitude is not None:
            result = lib.injection_vector_i_q21(errors, amplitude)
            error_q30 = lib.injection_error_q30(errors, amplitude)
        d_i_q25 = round(bench.current_a.real / full_scale_a * Q25)
        given = new("rest_position_input_t", amplitude is not None, result, d_i_q25, turned_q32)
        wanted = lib.rest_position_step(state, settings, given)
        command = bench.command
        command.turn_q32, turned_q32 = wanted.turn_q32, 0
        if wanted.track and bench.step % s.tick == 0:
            turned_q32 = lib.pll_correct(pll, gains, error_q30)
            command.turn_q32 += turned_q32
        command.speed_turn_q36 = lib.pll_speed_turn_q36(pll)
        turned_q32 += round(command.speed_turn_q36 * bench.cycles / 16)
        command.reference_a = wanted.current_i_q25 / Q25 * full_scale_a + 0j
        moved = max(moved, abs(bench.theta_rad - theta) / loop.motor.pole_pairs)
    saturation = loop.motor.saturation
    curve = saturation.angle_rad[0] if saturation else 0.0
    turn = bench.command.turn_q32 / Q32 * TURN
    name = phases[state.phase]
    return Trial(name, bench.step * s.ts_s, bench.error_rad(curve + turn), math.degrees(moved))


def trials(loop: Loop, settings: CData, count: int, seed: int) -> list[Trial]:
    """From random angles; seed: of the angles, the noise of the k-th trial has the seed k."""
    rng = np.random.default_rng(seed)
    return [trial(loop, settings, float(rng.uniform(-math.pi, math.pi)), k) for k in range(count)]
