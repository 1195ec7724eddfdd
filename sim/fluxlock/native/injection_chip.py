# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip with injection as the firmware on the host sees it, with its machine: three or five phases, saturation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Load, Motor, Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.vector_timing import vector_timing
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware.binding import names, view
from fluxlock.firmware.binding import types as c_types
from fluxlock.firmware.host import HostFirmware
from fluxlock.firmware.injection_compiler import LOW_K
from fluxlock.firmware.toolchain import build_host_library
from fluxlock.native import injection_kernel as kernel
from fluxlock.native.chip import without_noise
from fluxlock.native.vector_chip import LOGGED_A_SAMPLE
from fluxlock.native.vector_kernel import Q17, WORDS, calls
from fluxlock.theory.injection.loop import Inverter as Converter
from fluxlock.theory.injection.machine import (
    OMEGA_AT,
    THETA_AT,
    axis_tables,
    machine_set,
    scratch,
)

PLACES = np.dtype(
    [(name.replace(".", "_"), "i8") for name in (*kernel.REGISTERS, *WORDS, "machine_timer", "phase_trip")]
)


class InjectionChip:
    """One drive with injection on one machine; the firmware has booted.

    machine: what the motor really is, if it is not that of the scenario.
    """

    def __init__(self, scenario: Scenario, seed: int = 1, machine: Motor | None = None) -> None:
        self.scenario = scenario
        motor, inverter = machine or scenario.motor, scenario.inverter
        self.motor, phases = motor, motor.phases
        timing = vector_timing(scenario.drive, inverter)
        self.block = parameter_block(without_noise(scenario))
        self.fw = HostFirmware(None if phases == 3 else build_host_library(phases=phases))
        self.fw.load(self.block)
        self.fw.boot()
        sensing = inverter.sensing
        self.setup = kernel.Setup(
            period_s=timing.sample_cycles / CLOCK_HZ,
            period_cycles=timing.sample_cycles,
            tick_samples=timing.tick_samples,
            delay=min(max(timing.delay, 0.0), 1.0),
            unit_a=Q17 / sensing.current_full_scale_a,
            unit_v=Q17 / sensing.voltage_full_scale_v,
            trip_a=inverter.protection.phase_current_a,
            low_k=LOW_K,
            diode_v=inverter.diode_drop_v,
        )
        self._saturated = machine_set(motor)
        self._saturated = self._saturated._replace(r=self._saturated.r + inverter.on_resistance_ohm)
        self.converter = self._converter().kernel_set(scenario.drive.vector.update == "double")
        self.state = np.zeros(7)
        self.state[THETA_AT] = math.radians(scenario.initial.theta_deg)
        self.state[OMEGA_AT] = scenario.initial.speed_rpm / RPM_PER_RAD_S * motor.pole_pairs
        self.hardware = np.zeros(1, kernel.STATE).view(np.recarray)
        n, (cosine, sine) = phases, axis_tables(phases)
        self._room = kernel.Room(
            legs=np.zeros(n),
            later=np.zeros(n),
            seen=np.zeros(n),
            last=np.zeros(n),
            vector=np.zeros(4),
            filters=np.zeros(12),
            scratch=scratch(),
            edges=np.zeros((2, n)),
            cosine=cosine,
            sine=sine,
            regulator=np.zeros((2, 6), np.int32),
            gains=np.zeros((2, 7), np.int32),
        )
        self._calls = calls(self.fw.lib)
        self._places = self._find_places()
        words = c_types().sizeof("telemetry_t") // 4
        self._telemetry = view(self.fw.lib.fl_host_telemetry(), words, np.uint32)
        self._rows, self._log = np.zeros(0, kernel.ROW), np.zeros((0, 4), np.int64)
        self.imposed_rpm = math.nan
        self._load, self._load_factor = scenario.shaft_load, 1.0
        self.held_nm = 0.0  # on top of it
        kernel.seed_noise(seed)
        kernel.take(self.fw.registers, self._places, self.hardware.view(np.ndarray), self._room)

    def _converter(self) -> Converter:
        """Inverter of the float model. The compensation has the currents at the edges, as the chip has them."""
        s, sensing = self.scenario, self.scenario.inverter.sensing
        injection = s.drive.vector.injection
        assert injection is not None
        slope = self.block.number("vector_slope") * 2.0 ** -self.block.number("vector_slope_shift")
        lost = self.block.number("vector_dead_comp_cycles")
        zone_a = max(lost / slope / Q17 * sensing.current_full_scale_a, 1e-3) if lost else 1e-3
        return Converter(
            s.inverter.supply_v,
            s.inverter.dead_time_s,
            zone_a=zone_a,
            compensate=lost > 0,
            compensation_zone_a=zone_a,
            model=True,
            current_full_scale_a=sensing.current_full_scale_a,
            bits=sensing.bits,
            noise_lsb=sensing.noise_lsb,
            average=injection.samples,
        )

    def _find_places(self) -> NDArray[Any]:
        found = np.zeros(1, PLACES)
        for name in kernel.REGISTERS:
            found[name.replace(".", "_")] = self.fw.index(name)
        for name in WORDS:
            found[name] = c_types().offsetof("telemetry_t", name) // 4
        found["machine_timer"], found["phase_trip"] = self.fw.lib.IRQ_MACHINE_TIMER, self.fw.lib.TRIP_PHASE_CURRENT
        return found

    def set_load(self, load: Load, factor: float = 1.0) -> None:
        """Change the load."""
        self._load, self._load_factor = load, factor

    def set_supply(self, volt: float) -> None:
        """Change the voltage of the DC link; the dead time costs its share of it."""
        self.converter = self.converter._replace(vdc=volt, dead_vs=volt * self.scenario.inverter.dead_time_s)

    def set_noise(self, lsb: float) -> None:
        """Noise of the converter's codes, rms."""
        self.converter = self.converter._replace(noise_lsb=lsb)

    def open_phase(self, phase: int | None) -> None:
        """A leg loses the machine; None: no one has."""
        self.converter = self.converter._replace(lost=-1 if phase is None else phase)

    def get(self, name: str) -> int:
        """Value of a register."""
        return int(self.fw.registers[self.fw.index(name)])

    def put(self, name: str, value: int) -> None:
        """Set a register."""
        self.fw.registers[self.fw.index(name)] = value

    def trip(self, causes: int) -> None:
        """Latch trip causes and open the gates."""
        kernel.trip(self.fw.registers, self._places, self.hardware.view(np.ndarray), causes)

    def stop(self) -> None:
        """The rotor stands."""
        self.state[OMEGA_AT] = 0.0

    @property
    def samples(self) -> int:
        """Sample periods so far."""
        return int(self.hardware.samples[0])

    @property
    def link_a(self) -> float:
        """Current from the DC link at the latest sample that was recorded."""
        rows = self.rows()
        return float(rows["idc"][-1]) if rows.size else 0.0

    def keep_rows(self, samples: int) -> None:
        """From now on record up to so many samples; begins anew."""
        self._rows = np.zeros(samples, kernel.ROW)
        self._log = np.zeros((LOGGED_A_SAMPLE * samples, 4), np.int64)
        self.hardware.rows = self.hardware.logged = 0

    def rows(self) -> NDArray[Any]:
        """What was recorded, `injection_kernel.ROW`."""
        return self._rows[: int(self.hardware.rows[0])]

    def log(self) -> NDArray[np.int64]:
        """Rows of the chip's log, `LogKind`."""
        return self._log[: int(self.hardware.logged[0])]

    def advance(self, samples: int) -> None:
        """So many sample periods."""
        load, factor = self._load, self._load_factor
        kernel.run(
            samples,
            self.fw.registers,
            self._places,
            self._telemetry,
            self.hardware.view(np.ndarray),
            self._saturated._replace(viscous=factor * load.viscous_nm_s_per_rad, fan=factor * load.fan_nm_s2_per_rad2),
            self.converter,
            self.state,
            self.setup,
            kernel.Shaft(
                factor * load.constant_nm + self.held_nm,
                factor * load.coulomb_nm,
                self.imposed_rpm / RPM_PER_RAD_S,
            ),
            self._room,
            self._calls,
            self._rows,
            self._log,
        )

    def turn(self, angle_rad: float) -> None:
        """Turn the rotor under the drive, electrical: its angle is lost from now on."""
        self.state[THETA_AT] += angle_rad

    @property
    def now(self) -> float:
        """Simulated time, s."""
        return float(self.hardware.samples[0]) * self.setup.period_s

    @property
    def shaft(self) -> tuple[float, float]:
        """Mechanical speed, rad/s, and angle, rad, unwrapped."""
        return float(self.state[OMEGA_AT]) / self.motor.pole_pairs, float(self.state[THETA_AT]) / self.motor.pole_pairs

    @property
    def rpm(self) -> float:
        """True mechanical speed."""
        return self.shaft[0] * RPM_PER_RAD_S

    @property
    def error_deg(self) -> float:
        """Published angle less the true one, electrical."""
        return float(self.hardware.error_deg[0])

    @property
    def fault(self) -> str:
        """Name of the fault, `none` without one."""
        return names("fault_t")[int(self.fw.telemetry().fault)]
