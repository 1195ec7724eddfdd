# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's vector drive on the host, closed over the exact discrete machine: plays the chip at every sample.

Hardware: the regulator is complex_regulator.c, which the RTL equals bit for bit; angle accumulator, shadowed settings
and tick as the registers describe them. Machine: exact from sample to sample, mechanics by Euler's rule.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import get_args

from fluxlock.config import Inverter, Motor
from fluxlock.config.drive import Drive
from fluxlock.config.machine import Machine
from fluxlock.config.vector import Regulator
from fluxlock.firmware import ParameterBlock, compile_parameters, gain
from fluxlock.firmware.binding import new, open_library
from fluxlock.firmware.block import Value
from fluxlock.firmware.host import HostFirmware
from fluxlock.firmware.vector_compiler import PLL_BANDWIDTH
from fluxlock.firmware.vector_formats import Complex
from tests.firmware.firmware_bench import INVERTER_1, MOTOR_1
from tests.firmware.machines import drive, scenario
from tests.firmware.vector_float import CLOCK_HZ, Subspace, float_model

Q17, Q25, Q30, Q32, Q36 = 2**17, 2**25, 2**30, 2**32, 2**36
PENDING = 2
SEED = 31


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
    return {
        "vector_from_cycles": round((1.0 - s.delay) * s.sample_cycles),
        "vector_delay_q30": round(s.delay * Q30),
        "vector_emf_minimum_v_q25": round(0.5 * volt),
        "vector_speed_max_turn_q36": round(1.3 * motor.max_speed_rpm / 60 * motor.pole_pairs * hertz),
        "vector_start_rise_i_q25": round(s.start_rise_a_per_s * tick * amp),
        "vector_start_align_ticks": round(s.start_align_s / tick),
        "vector_start_tolerance_q32": round(Q32 / 360),
        "vector_start_steady_ticks": 60,
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
        "encoder_quarters": 4 * s.encoder_lines if s.encoder_lines else 1,
        "encoder_index": int(s.encoder_index),
        "encoder_filter_cycles": 20,
        "encoder_turn": gain(motor.pole_pairs / (8 * s.encoder_lines) * Q32) if s.encoder_lines else gain(0.0),
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


@dataclass
class VectorBench:
    """One vector drive on one machine."""

    settings: VectorSettings = field(default_factory=VectorSettings)
    motor: Motor = MOTOR_1
    inverter: Inverter = INVERTER_1
    values: dict[str, Value] = field(default_factory=dict)  # over the computed ones
    fan_nm: float = 0.015
    fan_rpm: float = 90_000.0
    theta: float = 0.6
    noise_lsb: float = 0.0  # of a 12-bit converter, rms
    locked: bool = False
    dead_time: bool = False  # the legs lose what the modulator is told to add for a current at the time of action
    library: Path | None = None  # of the firmware, if it is another one
    unprotected: bool = False  # no trip by the phase current

    def __post_init__(self) -> None:
        s = self.settings
        told = scenario(self.motor, self.inverter, vector_drive(self.motor, s))
        self.block: ParameterBlock = compile_parameters(told)
        assert self.block.number("vector_sample_cycles") == s.sample_cycles, "whole periods of the converter"
        self.block.update(vector_values(self.motor, self.inverter, s))
        self.block.update(self.values)
        self.lib = open_library()
        self.fw = HostFirmware(self.library)
        self.fw.load(self.block)
        self.fw.boot()
        self.told, sensing = Machine.of(self.motor, self.inverter), self.inverter.sensing
        self.machine = Subspace(
            self.told.resistance_ohm,
            self.told.inductance_h,
            self.told.psi_vs,
            sensing.current_full_scale_a,
            sensing.voltage_full_scale_v,
            s.sample_cycles,
            s.delay,
        )
        self.unit_a = Q17 / sensing.current_full_scale_a
        self.unit_v = Q17 / sensing.voltage_full_scale_v
        self.regulator = new("complex_regulator_t")
        self.omega = 0.0  # electrical
        self.i = 0j
        self.u_before = self.u_stationary_before = 0j
        self.torque_nm = 0.0
        self.nco_q36 = 0
        self.omega_q36 = 0
        self.samples = self.steps = 0
        self.direct_steps = self.direct_limited = self.direct_differences = 0
        self.late_answers = 0  # direct steps whose answer is to come after their update
        self.masked_steps = 0  # direct steps whose update is to pass before the core has looked at them
        self.missed = 0  # updates without new compares
        self.kept = 0j  # voltage of the compares in use, stationary
        self.sum = [0, 0]
        self.since_timer = 0  # clocks
        self.trips = 0
        self.encoder, self.place, self.indexed = 0, 0, False
        self.power_up_quarter = 1234  # the position is not that of the rotor before the index
        self.lost_quarters = 0
        self.sampling = True
        self.noise = Random(SEED)
        self.late_commits = 0  # ticks that the next set is to miss
        self._index = {name: offset // 4 for name, offset in self.fw.offsets.items()}
        self._take()
        self.error_deg = 0.0
        self.record: list[Sample] = []

    def get(self, name: str, element: int = 0) -> int:
        """Value of a register."""
        return int(self.fw.registers[self._index[name] + element])

    def signed(self, name: str, element: int = 0, bits: int = 32) -> int:
        """Signed value of a register."""
        value = self.get(name, element) & (2**bits - 1)
        return value - 2**bits if value >> (bits - 1) else value

    def put(self, name: str, value: int, element: int = 0) -> None:
        """Set a register, signed values in two's complement."""
        self.fw.registers[self._index[name] + element] = value & 0xFFFFFFFF

    def _pair(self, name: str) -> Complex:
        return Complex(self.signed(f"foc.{name}", 0, 18), self.signed(f"foc.{name}", 1, 18))

    def _take(self) -> None:
        """The update event: the settings written become those in use."""
        control = self.get("foc.control")
        self.enable, self.regulate = bool(control & 2), bool(control & 16)
        self.gains = new(
            "regulator_gains_t", self._pair("gain"), self._pair("hold"), self._pair("ratio"), self.get("foc.shift")
        )
        self.reference, self.preset = self._pair("reference"), self._pair("preset")
        self.limit = self.get("foc.limit") & (Q17 - 1)
        self.lead = self.get("foc.lead")
        scale = self.get("foc.scale")
        self.scale = (scale & (Q17 - 1)) * 2.0 ** -(scale >> 24 & 31)
        self.omega_q36 = self.signed("foc.omega")
        # A correction counts once; the firmware writes it before the commit that it belongs to.
        self.nco_q36 = (self.nco_q36 + (self.get("foc.correct") << 4)) % Q36
        self.put("foc.correct", 0)

    def sample(self) -> None:
        """One sample period: currents, regulator, voltage, and the tick if it is due."""
        m = self.machine
        angle = self.nco_q36 >> 4
        frame = cmath.exp(2j * math.pi * angle / Q32)
        rotor = cmath.exp(1j * self.theta)
        stationary = self.i * rotor + self._noise()
        measured = stationary / frame
        self.error_deg = math.degrees(cmath.phase(frame / rotor))
        self._encode()
        i17 = Complex(round(measured.real * self.unit_a), round(measured.imag * self.unit_a))
        direct = bool(self.get("foc.control") & 64)
        masked = direct and self.masked_steps > 0
        late = direct and not masked and self.late_answers > 0
        limited = False if masked else self._regulate(i17)
        if direct:
            limited = self._direct(i17, masked, late)
        u = self.regulator.voltage_v_q25
        v = ((u.re + 128) >> 8, (u.im + 128) >> 8)
        if masked or late:
            self.masked_steps -= masked
            self.late_answers -= late
            self.missed += 1
        else:
            self.steps += 1
            self.sum[0] += v[0]
            self.sum[1] += v[1]
        tripped = self.get("safety.trip") & 0xFF
        gates = bool(self.get("safety.guard") & 1) and not tripped and self.enable
        # Clocks of the modulator over its period.
        duty = complex(*v) * self.scale / (m.period_cycles * (2 if self.get("foc.control") & 4 else 1))
        if not (masked or late):
            self.kept = duty * self.inverter.supply_v * frame * cmath.exp(2j * math.pi * self.lead / Q32)
        applied = self.kept
        if self.dead_time:
            later = cmath.exp(1j * self.omega * (self.settings.delay + 0.5) * m.period_s)
            applied += self._dead_time_v(stationary) - self._dead_time_v(stationary * later)
        self._machine(applied if gates else None)
        self.nco_q36 = (self.nco_q36 + self.omega_q36 * m.period_cycles) % Q36
        self.samples += 1
        if self.steps >= self.settings.tick_samples and not (masked or late):
            self._tick(i17, v, bool(limited), angle)
        self.since_timer += m.period_cycles
        if self.since_timer >= self.get("timer.machine_period"):
            self.since_timer -= self.get("timer.machine_period")
            self.fw.lib.fl_host_raise(self.fw.lib.IRQ_MACHINE_TIMER)
            self.fw.poll()

    def _regulate(self, current: Complex) -> bool:
        """The hardware's regulator; returns whether the limit acted."""
        if self.regulate:
            step = self.lib.complex_regulator_step
            return bool(step(self.regulator, self.gains, self.reference, current, self.limit))
        error = Complex(self.reference.re - current.re, self.reference.im - current.im)
        preset = Complex(self.preset.re * 256, self.preset.im * 256)
        self.lib.complex_regulator_preset(self.regulator, preset, error)
        return False

    def _direct(self, current: Complex, masked: bool, late: bool) -> bool:
        """The firmware's regulator; counts where the state is not the one that the hardware's would have.

        An answer that comes late is ignored: the step is abandoned, as one is that the core was not let look at. The
        hardware's regulator keeps the state of a step whose compares miss their update, and makes none for a current
        that it has to ignore.
        """
        number = self.samples & 0xFFFF
        self.put("foc.direct_run", number | (not masked) << 31)
        self.put("foc.direct_i", current.re, 0)
        self.put("foc.direct_i", current.im, 1)
        self.put("foc.direct_go", ~number & 0xFFFF)
        self.fw.lib.fl_host_current()
        if masked:
            assert self.get("foc.direct_go") == ~number & 0xFFFF, "an answer to no step"
            return False
        assert self.get("foc.direct_go") == number, "no answer"
        if late:
            return False
        wanted = Complex(self.signed("foc.direct_v", 0, 28), self.signed("foc.direct_v", 1, 28))
        limited = new("bool")
        bound = self.lib.circle_limit_v_q25(wanted, self.limit, limited)
        hardware = self.regulator.voltage_v_q25
        self.direct_steps += 1
        self.direct_limited += limited[0]
        self.direct_differences += (bound.re, bound.im) != (hardware.re, hardware.im)
        self.regulator.voltage_v_q25 = bound
        return bool(limited[0])

    def _encode(self) -> None:
        """Position of the encoder now, as filter and synchronisers show it."""
        s = self.settings
        if not s.encoder_lines:
            return
        quarters = 4 * s.encoder_lines
        seen = self.theta - self.omega * (20 + 3) / CLOCK_HZ
        place = math.floor((seen / (2 * math.pi) - s.encoder_offset_turn) / self.motor.pole_pairs * quarters)
        if s.encoder_index and (place // quarters != self.place // quarters or place % quarters == 0):
            self.lost_quarters, self.indexed = 0, True
        self.place = place
        position = (place + (0 if self.indexed else self.power_up_quarter) + self.lost_quarters) % quarters
        self.encoder = position | self.indexed << 31

    def _dead_time_v(self, current_a: complex) -> complex:
        """Vector of the modulator's compensation for a stationary current."""
        slope, most = self.get("foc.slope"), self.get("foc.dead_time")
        per_ampere = (slope & (Q17 - 1)) * 2.0 ** -(slope >> 24 & 31) * self.unit_a
        band = self.get("foc.band") / self.unit_a
        v = 0j
        for turn in (cmath.exp(2j * math.pi * x / 3) for x in range(3)):
            current = (current_a / turn).real
            beyond = math.copysign(max(abs(current) - band, 0.0), current)
            cycles = min(max(beyond * per_ampere, -most), most)
            v += 2 / 3 * cycles * turn
        periods = self.machine.period_cycles * (2 if self.get("foc.control") & 4 else 1)
        return v * self.inverter.supply_v / periods

    def _noise(self) -> complex:
        rms = self.noise_lsb * self.inverter.sensing.current_full_scale_a / 2**11 * math.sqrt(2 / 3)
        return complex(self.noise.gauss(0.0, rms), self.noise.gauss(0.0, rms)) if rms else 0j

    def _salient(self, u_stationary: complex, before: complex) -> None:
        """One sample of a salient machine: flux in the stationary frame, Runge-Kutta."""
        m, told = self.machine, self.told
        l_d, l_q = (told.inductance_h + sign * told.saliency_h / 2.0 for sign in (-1.0, 1.0))

        def current(flux: complex, theta: float) -> complex:
            rotor = flux * cmath.exp(-1j * theta)
            return complex((rotor.real - told.psi_vs) / l_d, rotor.imag / l_q) * cmath.exp(1j * theta)

        theta = self.theta
        flux = complex(l_d * self.i.real + told.psi_vs, l_q * self.i.imag) * cmath.exp(1j * theta)
        for u, time in ((before, m.delay * m.period_s), (u_stationary, (1.0 - m.delay) * m.period_s)):
            h = time / 6.0
            for _ in range(6 if h > 0.0 else 0):
                turn = self.omega * h
                k1 = u - m.resistance_ohm * current(flux, theta)
                k2 = u - m.resistance_ohm * current(flux + h / 2 * k1, theta + turn / 2)
                k3 = u - m.resistance_ohm * current(flux + h / 2 * k2, theta + turn / 2)
                k4 = u - m.resistance_ohm * current(flux + h * k3, theta + turn)
                flux += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
                theta += turn
        # In the rotor's frame of the next sample.
        self.i = current(flux, theta) * cmath.exp(-1j * theta)

    def _machine(self, u_stationary: complex | None) -> None:
        m, p = self.machine, self.motor.pole_pairs
        if u_stationary is None:
            self.i, self.u_before = 0j, 1j * self.told.psi_vs * self.omega
            self.u_stationary_before = self.u_before * cmath.exp(1j * self.theta)
            torque = 0.0
        else:
            u = u_stationary * cmath.exp(-1j * self.theta)
            torque = 1.5 * p * (self.told.psi_vs - self.told.saliency_h * self.i.real) * self.i.imag
            self.torque_nm = torque
            # The voltage before was latched in the stationary frame; its model counts in the frame of its own instant.
            if self.told.saliency_h:
                self._salient(u_stationary, self.u_stationary_before)
            else:
                step = float_model(m, self.omega).step(self.i, u, self.u_before, 1j * self.told.psi_vs * self.omega)
                self.i = step
            self.u_before, self.u_stationary_before = u, u_stationary
            peak = abs(self.i)
            if peak > self.inverter.protection.phase_current_a and not self.unprotected:
                self.trip(1)
        mech = self.omega / p
        fan = self.fan_rpm * math.pi / 30
        load = self.fan_nm * (mech / fan) * abs(mech / fan)
        self.theta += self.omega * m.period_s
        self.omega += 0.0 if self.locked else p * (torque - load) / self.motor.inertia_kgm2 * m.period_s

    def trip(self, causes: int) -> None:
        """Latch trip causes and open the gates."""
        old = self.get("safety.trip")
        first = (old >> 16) & 0xFF or causes
        self.put("safety.trip", (old & 0xFF) | causes | (first << 16))
        self.put("safety.guard", self.get("safety.guard") & ~1)
        self.trips += 1

    def _tick(self, i17: Complex, v: tuple[int, int], limited: bool, angle: int) -> None:
        put = self.put
        if self.sampling:
            put("sense.snap_number", self.samples)
        vdc = round(self.inverter.supply_v * self.unit_v)
        put("sense.snap_vdc_sum", vdc * self.steps)
        put("sense.snap_count", self.steps)
        emf = self.i if self.enable else 1j * self.told.psi_vs * self.omega * cmath.exp(1j * self.theta)
        phases = [(emf * cmath.exp(-2j * math.pi * x / 3)).real for x in range(3)]
        for x in range(3):
            put("sense.snap_channel", max(0, round((phases[x] - min(phases)) * self.unit_v)), x)
        u = self.regulator.voltage_v_q25
        for axis, (i_axis, u_axis) in enumerate(((i17.re, u.re), (i17.im, u.im))):
            put("foc.snap_i", i_axis, axis)
            put("foc.snap_u", u_axis, axis)
            put("foc.snap_v", v[axis], axis)
            put("foc.snap_v_sum", self.sum[axis], axis)
        put("foc.snap_count", self.steps | 1 << 16 | int(limited) << 24)
        put("foc.snap_theta_sample", angle)
        put("foc.snap_encoder", self.encoder)
        put("foc.snap_omega", self.omega_q36)
        self.steps, self.sum = 0, [0, 0]
        if self.late_commits > 0:
            self.late_commits -= 1
        elif self.get("timer.update") & PENDING:
            put("timer.update", 0)
            self._take()
        self.fw.tick()

    @property
    def now(self) -> float:
        """Simulated time, s."""
        return self.samples * self.machine.period_s

    @property
    def rpm(self) -> float:
        """True mechanical speed."""
        return self.omega / self.motor.pole_pairs * 30 / math.pi

    def left_running(self) -> bool:
        """The drive is in another state than running."""
        return self.fw.state != "running"

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Run for a time or until a condition; true if the condition came."""
        for k in range(round(seconds / self.machine.period_s)):
            before = self.fw.state
            self.sample()
            self.record.append(Sample(self.now, before, self.error_deg, self.rpm, self.i * cmath.exp(1j * self.theta)))
            if until is not None and k % 8 == 0 and until():
                return True
        return False

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
