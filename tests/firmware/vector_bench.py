# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's vector drive on the host, closed over the native twin of the vector path and its exact machine."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from fluxlock.config import Inverter, Motor
from fluxlock.config.drive import Drive
from fluxlock.config.machine import Machine
from fluxlock.config.vector import Regulator
from fluxlock.config.vector_modes import PLL_BANDWIDTH
from fluxlock.firmware import compile_parameters, gain
from fluxlock.firmware.binding import names
from fluxlock.firmware.block import Value
from fluxlock.native.vector_chip import Sampling, VectorChip
from tests.firmware.firmware_bench import INVERTER_1, MOTOR_1
from tests.firmware.machines import drive, scenario
from tests.firmware.vector_float import CLOCK_HZ, Subspace

Q25, Q30, Q32, Q36 = 2**25, 2**30, 2**32, 2**36


@dataclass(frozen=True)
class VectorSettings:
    """What the scenario would say; SI units, electrical frequencies in Hz."""

    sample_cycles: int = 2500
    tick_samples: int = 1
    delay: float = 0.5  # T_d / T_s
    exact_park: bool = True
    order: int = 2
    gamma: float = 0.35
    observer_pole: float = 0.7
    pll_pole: float = 0.95
    start_a: float = 10.0
    start_rise_a_per_s: float = 750.0
    start_align_s: float = 0.03
    start_hz_per_s: float = 1500.0
    handover_hz: float = 300.0
    back_hz: float = 200.0
    fade_a_per_s: float = 750.0
    speed_bandwidth_hz: float = 15.0
    weakening_lowest_a: float = 0.0
    mtpa_ratio_a: float = 0.0
    sensored: bool = False
    encoder_lines: int = 0
    encoder_index: bool = True
    encoder_offset_turn: float = 0.0  # electrical, of the index
    encoder_inverted: bool = False
    encoder_missing_lines: int = 0
    encoder_told: float = 1.0  # factor of the lines
    direct: bool = False  # the regulator in C is the drive's


def vector_drive(motor: Motor, s: VectorSettings) -> Drive:
    """The table [drive] of the scenario."""
    rpm, tick_s = 60.0 / motor.pole_pairs, s.sample_cycles * s.tick_samples / CLOCK_HZ
    vector = {
        "update": "single",
        "observer_every": s.tick_samples,
        "delay": s.delay,
        "park": "exact" if s.exact_park else "held",
        "regulator": get_args(Regulator)[s.order],
        "current_regulator": "c" if s.direct else "rtl",
        "gamma": s.gamma,
        "observer_pole": s.observer_pole,
        "pll_hz": -math.log(s.pll_pole) / (2.0 * math.pi * tick_s) * PLL_BANDWIDTH[3],
        "start_current_a": s.start_a,
        "start_accel_rpm_per_s": s.start_hz_per_s * rpm,
        "handover_rpm": s.handover_hz * rpm,
        "speed_hz": s.speed_bandwidth_hz,
        "dead_time_compensation": False,
    }
    return drive(method="vector", carrier_hz=CLOCK_HZ / s.sample_cycles, vector=vector)


def vector_values(motor: Motor, inverter: Inverter, s: VectorSettings) -> dict[str, Value]:
    """Parameters that the scenario would give otherwise: the bench has its own clocks, limits and encoder."""
    full_v, full_a = inverter.sensing.voltage_full_scale_v, inverter.sensing.current_full_scale_a
    tick, hertz = s.sample_cycles * s.tick_samples / CLOCK_HZ, Q36 / CLOCK_HZ  # 2^-36 turn a clock
    volt, amp = Q25 / full_v, Q25 / full_a
    told_lines = round(s.encoder_lines * s.encoder_told)
    return {
        "vector_from_cycles": round((1.0 - s.delay) * s.sample_cycles),
        "vector_delay_q30": round(s.delay * Q30),
        "vector_emf_minimum_v_q25": round(0.5 * volt),
        "vector_speed_max_turn_q36": round(1.3 * motor.max_speed_rpm / 60 * motor.pole_pairs * hertz),
        "vector_start_rise_i_q25": round(s.start_rise_a_per_s * tick * amp),
        "vector_start_align_ticks": round(s.start_align_s / tick),
        "vector_start_steady_ticks": 60,
        "vector_start_turned_ticks": 0 if s.encoder_lines else round(s.start_align_s / tick / 2),
        **({"vector_start_damping": gain(0.0)} if s.encoder_lines else {}),
        "vector_back_turn_q36": round(s.back_hz * hertz),
        "vector_fade_i_q25": round(s.fade_a_per_s * tick * amp),
        "vector_circle_q16": round(0.97 * 2**16),
        "vector_weakening_ki": gain(0.02 * 32 * full_v / full_a / 2),
        "vector_weakening_lowest_i_q25": round(s.weakening_lowest_a * amp),
        "vector_mtpa_ratio_i_q25": round(s.mtpa_ratio_a * amp),
        "vector_band": gain(0.0),
        "vector_slope_shift": 20,
        "vector_margin_cycles": 0,
        "vector_angle": int(s.sensored),
        "encoder_quarters": 4 * told_lines if told_lines else 1,
        "encoder_index": int(s.encoder_index),
        "encoder_filter_cycles": 20,
        "encoder_turn": gain(motor.pole_pairs / (8 * told_lines) * Q32) if told_lines else gain(0.0),
        "encoder_offset_q32": round(s.encoder_offset_turn * Q32),
    }


@dataclass(frozen=True)
class Sample:
    """One sample period; the state is that of its beginning, the speed mechanical, the current stationary."""

    time_s: float
    state: str
    error_deg: float
    rpm: float
    current_a: complex


def _shown(record: str, name: str, kind: type) -> Any:
    """A field of the chip's records as an attribute."""

    def get(bench: VectorBench) -> object:
        return kind(getattr(bench, record)[name][0])

    def put(bench: VectorBench, value: object) -> None:
        getattr(bench, record)[name] = value

    return property(get, put)


class VectorBench(VectorChip):
    """One vector drive on one machine.

    values: over the computed ones. noise_lsb: of a 12-bit converter, rms. locked: the speed stays. dead_time: the legs
    lose what the modulator is told to add for a current at the time of action. library: of the firmware, if it is
    another one. unprotected: no trip by the phase current.
    """

    theta, omega, error_deg = (_shown("state", name, float) for name in ("theta", "omega", "error_deg"))
    i, torque_nm = _shown("state", "i", complex), _shown("state", "torque_nm", float)
    samples, trips, missed = (_shown("state", name, int) for name in ("samples", "trips", "missed"))
    late_commits, late_answers = _shown("state", "late_commits", int), _shown("state", "late_answers", int)
    masked_steps = _shown("state", "masked_steps", int)
    direct_steps, direct_limited = _shown("state", "direct_steps", int), _shown("state", "direct_limited", int)
    direct_differences = _shown("state", "direct_differences", int)
    encoder, indexed, enable = (
        _shown("state", "encoder", int),
        _shown("state", "indexed", bool),
        _shown("state", "enable", bool),
    )
    silent, locked = _shown("state", "silent", bool), _shown("plant", "guided", bool)
    limit, unit_v = _shown("state", "limit", int), _shown("plant", "unit_v", float)
    power_up_quarter = _shown("plant", "power_up_quarter", int)

    def __init__(
        self,
        settings: VectorSettings | None = None,
        motor: Motor = MOTOR_1,
        inverter: Inverter = INVERTER_1,
        values: dict[str, Value] | None = None,
        fan_nm: float = 0.015,
        fan_rpm: float = 90_000.0,
        theta: float = 0.6,
        noise_lsb: float = 0.0,
        locked: bool = False,
        dead_time: bool = False,
        library: Path | None = None,
        unprotected: bool = False,
    ) -> None:
        s = self.settings = settings or VectorSettings()
        block = compile_parameters(scenario(motor, inverter, vector_drive(motor, s)))
        assert block.number("vector_sample_cycles") == s.sample_cycles, "whole periods of the converter"
        block.update(vector_values(motor, inverter, s))
        block.update(values or {})
        super().__init__(block, motor, inverter, Sampling(s.sample_cycles, s.tick_samples, s.delay), library)
        told, sensing = Machine.of(motor, inverter), inverter.sensing
        self.machine = Subspace(
            told.resistance_ohm,
            told.inductance_h,
            told.psi_vs,
            sensing.current_full_scale_a,
            sensing.voltage_full_scale_v,
            s.sample_cycles,
            s.delay,
        )
        self.fan_rpm, self.fan_nm, self.theta, self.locked = fan_rpm, fan_nm, theta, locked
        self.plant.dead_time = dead_time
        self.set_noise(noise_lsb)
        if s.encoder_lines:
            self.set_encoder(
                s.encoder_lines, s.encoder_index, s.encoder_offset_turn, s.encoder_inverted, s.encoder_missing_lines
            )
        if unprotected:
            self.plant.trip_a = math.inf
        self.record: list[Sample] = []

    @property
    def fan_nm(self) -> float:
        """Torque of the fan at `fan_rpm`."""
        return float(self.plant.fan_nm_s2_per_rad2[0]) * (self.fan_rpm * math.pi / 30) ** 2

    @fan_nm.setter
    def fan_nm(self, torque: float) -> None:
        self.plant.fan_nm_s2_per_rad2 = torque / (self.fan_rpm * math.pi / 30) ** 2

    def signed(self, name: str, element: int = 0) -> int:
        """Signed value of a register."""
        value = self.get(name, element)
        return value - 2**32 if value >> 31 else value

    def sample(self) -> None:
        """One sample period."""
        self.advance(1)

    def left_running(self) -> bool:
        """The drive is in another state than running."""
        return self.fw.state != "running"

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Run for a time or until a condition; true if the condition came."""
        rest = round(seconds / self.timing.period_s)
        chunk = 1 if until is not None else min(rest, 1000)
        while rest > 0:
            self._record(min(rest, chunk))
            rest -= chunk
            if until is not None:
                chunk = 8
                if until():
                    return True
        return False

    def _record(self, samples: int) -> None:
        self.keep_rows(samples)
        self.advance(samples)
        states, pairs = names("drive_state_t"), self.motor.pole_pairs
        self.record += [
            Sample(
                row["t_cycle"] / CLOCK_HZ,
                states[row["state"]],
                row["error_deg"],
                row["omega"] / pairs * 30 / math.pi,
                row["i"],
            )
            for row in self.rows()
        ]

    def until_state(self, state: str, seconds: float) -> bool:
        """Run until the drive is in a state."""
        return self.run(seconds, lambda: self.fw.state == state)

    def console(self, name: str) -> str:
        """Value of a console item."""
        return self.fw.command(f"get {name}")[0].split(maxsplit=1)[1]

    def start(self, rpm: int, seconds: float = 1.0) -> None:
        """Boot to ready, set the speed, start; fails the test if it does not come to run."""
        assert self.until_state("ready", 0.1), self.fw.command("status")
        assert self.fw.command(f"set speed_rpm {rpm}") == ["ok"]
        assert self.fw.command("start") == ["ok"]
        assert self.until_state("running", seconds), self.fw.command("status")
