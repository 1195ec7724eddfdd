"""Firmware on the host, closed over the averaged model: plays the chip at every control tick."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fluxlock.firmware import DriveSpec, InverterSpec, MotorSpec, ParameterBlock, compile_parameters
from fluxlock.firmware.host import HostFirmware
from tests.firmware import averaged_motor as am
from tests.firmware.averaged_motor import AveragedMotor, Load

MOTOR_1 = MotorSpec(
    pole_pairs=1,
    resistance_ohm=20e-3,
    inductance_h=22e-6,
    psi_vs=1e-3,
    inertia_kgm2=5e-7,
    rated_current_a=20.0,
    max_speed_rpm=100_000.0,
)
INVERTER_1 = InverterSpec(
    supply_v=25.0,
    on_resistance_ohm=2e-3,
    voltage_full_scale_v=30.0,
    current_full_scale_a=50.0,
    phase_current_trip_a=45.0,
    dc_current_trip_a=45.0,
)
SAMPLING_ONCE = 3
FAN_1 = Load(fan_torque_nm=20e-3, fan_speed_rpm=60_000.0)
# Machines of other pole pairs, voltages and EMF, with a speed (r/min) to hold.
OTHERS = [
    (
        MotorSpec(2, 0.15, 120e-6, 5e-3, 8e-6, 10.0, 22_000.0),
        InverterSpec(48.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 60.0, 25.0, 200e-9),
        Load(0.02, 15_000, 2e-3),
        15_000,
    ),
    (
        MotorSpec(4, 0.08, 80e-6, 2.4e-3, 2e-5, 12.0, 9_000.0, "trapezoidal"),
        InverterSpec(24.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 30.0, 30.0, 200e-9),
        Load(0.12, 8_000, 3e-3),
        6_000,
    ),
    (
        MotorSpec(7, 0.06, 30e-6, 7.8e-4, 1.5e-5, 20.0, 12_000.0),
        InverterSpec(14.8, 3e-3, 0.7, 200e-9, 400e-9, 12, 1e-6, 20.0, 60.0, 200e-9),
        Load(0.10, 9_000),
        8_000,
    ),
    (
        MotorSpec(4, 0.5, 1.2e-3, 14e-3, 6e-5, 6.0, 4_000.0),
        InverterSpec(48.0, 5e-3, 0.7, 300e-9, 600e-9, 12, 1e-6, 60.0, 15.0, 200e-9),
        Load(0.2, 3_000, 0.02),
        3_000,
    ),
]


@dataclass
class Bench:
    """One drive on one machine."""

    motor: MotorSpec = MOTOR_1
    inverter: InverterSpec = INVERTER_1
    drive: DriveSpec = field(default_factory=DriveSpec)
    load: Load = field(default_factory=lambda: replace(FAN_1))
    theta_rad: float = 0.4
    speed_rpm: float = 0.0
    model_motor: MotorSpec | None = None  # what the machine really is, if not `motor`
    hall_offset_deg: tuple[float, float, float] | None = None  # sensors A, B, C; None: there are none
    library: Path | None = None  # of the firmware, if it holds more
    cut_pulses: bool = False  # CSC: the mean of a sector is that of its cut pulse train

    def __post_init__(self) -> None:
        self.block: ParameterBlock = compile_parameters(self.motor, self.inverter, self.drive)
        self.model = AveragedMotor(
            self.model_motor or self.motor,
            self.inverter,
            self.drive,
            self.load,
            self.theta_rad,
            self.speed_rpm,
            self.hall_offset_deg,
        )
        self.fw = HostFirmware(self.library)
        self.fw.load(self.block)
        self.fw.boot()
        self.ticks = 0
        self.samples = 0
        self.trips = 0
        self.sampling = True
        self.idc_offset_a = 0.0
        self.stuck: dict[int, int] = {}  # voltage channels that keep a value, q17
        self.overridden = 0  # late crossings besides those of the model
        self.computed_back = 0
        self.trace: list[tuple[float, float, float, int, float]] = []
        self.clock = self.drive.clock_hz
        self.tick_s = 1.0 / self.drive.tick_hz
        self._was_timer = 0
        self._was_seq = 0
        self._reg = {name: self.fw.offsets[name] // 4 for name in self.fw.offsets}

    # Registers as integers.
    def get(self, name: str, element: int = 0) -> int:
        """Value of a register."""
        return int(self.fw.registers[self._reg[name] + element])

    def put(self, name: str, value: int, element: int = 0) -> None:
        """Set a register, signed values in two's complement."""
        self.fw.registers[self._reg[name] + element] = value & 0xFFFFFFFF

    def _mean(self, duty: float, period: int) -> float:
        """Mean over a sector: whole carriers and a cut one, if the bench looks so closely."""
        carriers = self.model.s[am.INTERVAL] * self.clock / period
        if not self.cut_pulses or carriers <= 0.0:
            return duty
        whole = math.floor(carriers)
        return float((whole * duty + min(duty, carriers - whole)) / carriers)

    def _update(self) -> None:
        """The update event: committed settings become active."""
        if not self.get("timer.update") & 2:
            return
        self.put("timer.update", 0)
        s, c = self.model.s, self.model.c
        control = self.get("pwm.control")
        seq, timer = control & 3, self.get("comm.control") & 3
        sync = bool(control & 0x1000)
        period = self.get("pwm.period")
        dead = self.get("safety.dead_time") if sync and seq != am.SEQ_OFF else 0
        pulse = self.get("pwm.duty") / 256.0
        c[am.C_DUTY] = self._mean(min(1.0, max(0.0, pulse - dead) / period), period)
        c[am.C_SYNC] = float(sync)
        c[am.C_REVERSE] = float(bool(control & 0x2000))
        c[am.C_FORCED] = self.get("comm.forced_interval") / self.clock
        delay = self.get("comm.delay")
        advance = ((delay >> 16) ^ 0x8000) - 0x8000
        c[am.C_DELAY] = ((delay & 0xFFFF) - advance) / 65536.0
        c[am.C_TIMEOUT] = self.get("comm.timeout") / 4096.0
        c[am.C_FORCE] = float(bool(self.get("comm.control") & 16))
        c[am.C_MISS_LIMIT] = (self.get("comm.control") >> 8) & 0xFF
        c[am.C_ZCD] = float(self.get("zcd.control") & 1)
        for sector in range(6):
            c[am.C_THRESHOLD + sector] = self.get("zcd.threshold", sector) / 2**17
        manual = self.get("pwm.manual")
        for x in range(3):
            c[am.C_LEG + x] = (manual >> (4 * x)) & 7
        for sector in range(6):
            offset = self.get("comm.hall_offset", sector)
            c[am.C_HALL_OFFSET + sector] = ((offset ^ 0x8000) - 0x8000) / 65536.0
        if seq == am.SEQ_SIX and self._was_seq != am.SEQ_SIX:
            s[am.SECTOR] = (control >> 16) & 7
            if control & 1 << 19 and s[am.H_POSITION] >= 0.0:
                s[am.SECTOR] = (s[am.H_POSITION] + 3 * c[am.C_REVERSE]) % 6
            s[am.T_COMM] = s[am.T]
            s[am.I_LINE] = math.hypot(s[am.I_ALPHA], s[am.I_BETA]) * 0.75
        if timer != am.TIMER_OFF and self._was_timer == am.TIMER_OFF:
            s[[am.CROSSINGS, am.LATE, am.COMMUTATIONS, am.MISSES, am.TIMEOUTS, am.FOUND, am.ARMED]] = 0.0
            s[am.T_ZC] = 0.0
            s[am.INTERVAL] = c[am.C_FORCED]
            s[am.T_SCHED] = s[am.T] + c[am.C_FORCED] if timer == am.TIMER_FORCED else 1e30
            s[[am.H_TIME, am.H_KNOWN]] = 0.0
        elif timer == am.TIMER_HALL and self._was_timer == am.TIMER_ZCD:
            # The intervals go on, the sensors' sector is driven.
            s[am.H_TIME], s[am.H_KNOWN], s[am.H_LOAD] = 0.0, 6.0, (s[am.H_POSITION] + 3 * c[am.C_REVERSE]) % 6
            s[am.T_SCHED] = s[am.T]
        elif timer == am.TIMER_ZCD and self._was_timer == am.TIMER_HALL:
            s[am.T_ZC] = s[am.T_FOUND]
        c[am.C_SEQ], c[am.C_TIMER] = seq, timer
        self._was_seq, self._was_timer = seq, timer

    def _snapshot(self) -> None:
        """Measurements of the period that ends at this tick."""
        s, c, m = self.model.s, self.model.c, self.model.m
        v_unit = 2**17 / self.inverter.voltage_full_scale_v
        i_unit = 2**17 / self.inverter.current_full_scale_a
        count = round(self.tick_s / self.inverter.sample_period_s)
        if self.sampling:
            self.samples += count
        idc = s[am.IDC_SUM] / max(s[am.SUM_TIME], 1e-12) + self.idc_offset_a
        if self.get("sense.scheduler") & 3 == SAMPLING_ONCE:
            idc = s[am.I_LINE] + self.idc_offset_a  # a sample in the pulse
        s[am.IDC_SUM] = s[am.SUM_TIME] = 0.0
        self.put("sense.snap_number", self.samples)
        self.put("sense.snap_vdc_sum", round(m[am.M_VDC] * v_unit) * count)
        self.put("sense.snap_idc_sum", round(idc * i_unit) * count)
        self.put("sense.snap_count", count if self.sampling else 0)
        omega_e = s[am.OMEGA] * m[am.M_P]
        emf = np.array([am.emf_shape(s[am.THETA], x, m[am.M_TRAPEZOID]) for x in range(3)]) * m[am.M_PSI] * omega_e
        # Gates off: the terminals sum to zero, a diode holds the lowest one; the converter shows nothing negative.
        terminal = emf - emf.min()
        if c[am.C_SEQ] == am.SEQ_OFF or c[am.C_GATES] == 0.0:
            terminal = np.maximum(emf - emf.mean() + max(0.0, emf.mean() - emf.min() - m[am.M_DIODE]), 0.0)
        current = np.zeros(3)
        if c[am.C_SEQ] == am.SEQ_SIX:
            sector = int(s[am.SECTOR])
            current[am.HIGH[sector]], current[am.LOW[sector]] = s[am.I_LINE], -s[am.I_LINE]
        else:
            angles = 2.0 * np.pi / 3.0 * np.arange(3)
            current = s[am.I_ALPHA] * np.cos(angles) + s[am.I_BETA] * np.sin(angles)
        for x in range(3):
            self.put("sense.snap_channel", self.stuck.get(x, round(float(terminal[x]) * v_unit)), x)
            self.put("sense.snap_channel", round(float(current[x]) * i_unit), 3 + x)
        self.put("comm.snap_interval", min(0xFFFFFF, round(s[am.INTERVAL] * self.clock)))
        period = float(s[am.RING_FIRST : am.RING_FIRST + 6].sum())
        self.put("comm.snap_period", min(0x7FFFFFF, round(period * self.clock)))
        # Ring entry k is the interval that ended k crossings after the ring began; its next entry is the oldest.
        for back in range(6):
            sector = int(s[am.ZC_SECTOR] - back * (-1 if c[am.C_REVERSE] > 0.0 else 1)) % 6
            interval = s[am.RING_FIRST + int(s[am.RING_AT] - 1 - back) % 6]
            self.put("comm.snap_sector_interval", min(0xFFFFFF, round(float(interval) * self.clock)), sector)
        counters = (int(s[am.CROSSINGS]) & 0xFFFF) | (min(255, int(s[am.MISSES])) << 16)
        self.put("comm.snap_counters", counters | ((int(s[am.LATE]) & 0xFF) << 24))
        self.put("zcd.counters", ((int(s[am.LATE]) + self.overridden) & 0xFFFF) << 16)
        self.put("zcd.method_counters", self.computed_back & 0xFFFF)
        if self.hall_offset_deg is not None:
            self._hall_registers()
        events = (int(s[am.COMMUTATIONS]) & 0xFFFF) | ((int(s[am.TIMEOUTS]) & 0xFF) << 24)
        self.put("comm.snap_events", events)
        if s[am.TRIPS] > 0.0:
            self.trip(int(s[am.TRIPS]))
            s[am.TRIPS] = 0.0

    def _hall_registers(self) -> None:
        s, reverse = self.model.s, self.model.c[am.C_REVERSE] > 0.0
        valid = am.HALL_MAP[int(s[am.H_CODE])] < 6
        sector = int(s[am.H_POSITION] + 3 * reverse) % 6
        state = sector << 8 | int(valid) << 12 | int(s[am.H_BACKWARD]) << 13
        self.put("hall.state", state)
        counters = int(s[am.H_EDGES]) & 0xFFFF | (int(s[am.H_INVALID]) & 0xFF) << 16
        self.put("hall.counters", counters | (int(s[am.H_SKIPPED]) & 0xFF) << 24)
        for k in range(6):
            self.put("hall.phase", min(0xFFFFFF, round(float(s[am.H_PHASE + k]) * self.clock)), k)

    def trip(self, causes: int, now: int = 0) -> None:
        """Latch trip causes and open the gates, as the hardware does."""
        old = self.get("safety.trip")
        first = (old >> 16) & 0x7F or causes
        self.put("safety.trip", (old & 0x7F) | causes | (now << 8) | (first << 16))
        self.put("safety.guard", self.get("safety.guard") & ~1)
        self.trips += 1

    def step(self) -> None:
        """One control tick, then the machine up to the next."""
        self._snapshot()
        self._update()
        self.put("timer.tick_time", round(self.ticks * self.tick_s * self.clock))
        self.put("sys.time_now", round(self.ticks * self.tick_s * self.clock) + 20)
        self.fw.tick()
        latched = self.get("safety.trip") & 0x7F
        self.model.c[am.C_GATES] = float((self.get("safety.guard") & 1) and not latched)
        self.ticks += 1
        self.model.advance(self.ticks * self.tick_s)

    @property
    def now(self) -> float:
        """Simulated time in seconds."""
        return self.ticks * self.tick_s

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Run for a time or until a condition; true if the condition came."""
        for _ in range(round(seconds / self.tick_s)):
            self.step()
            if self.ticks % 10 == 0:
                t = self.fw.telemetry()
                self.trace.append(
                    (self.now, self.model.rpm, t["speed_rpm_q8"] / 256.0, t["state"], t["duty_q30"] / 2**30)
                )
            if until is not None and until():
                return True
        return False

    def until_state(self, state: str, seconds: float) -> bool:
        """Run until the drive is in a state."""
        return self.run(seconds, lambda: self.fw.state == state)

    def start(self, rpm: int, seconds: float = 2.0) -> None:
        """Boot to ready, set the speed, start; fails the test if it does not come to run."""
        assert self.until_state("ready", 0.1), f"not ready: {self.fw.command('status')}"
        assert self.fw.command(f"set speed_rpm {rpm}") == ["ok"]
        assert self.fw.command("start") == ["ok"]
        assert self.until_state("running", seconds), f"not running: {self.fw.command('status')}"


def fault_of(bench: Bench) -> str:
    """Name of the present fault."""
    return bench.fw.command("get fault")[0].split()[1]
