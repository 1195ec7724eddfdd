# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip's vector path as the firmware on the host sees it, with its machine: registers at every current sample."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Inverter, Load, Motor
from fluxlock.firmware import ParameterBlock
from fluxlock.firmware.binding import types as c_types
from fluxlock.firmware.binding import view
from fluxlock.firmware.host import HostFirmware
from fluxlock.native import vector_kernel as kernel

SEED = 31
POWER_UP_QUARTER = 1234  # the encoder's position is not that of the rotor before the index
CAPTURE_RECORDS = 1024  # as the chip has
# Rows that a call of the kernel may log of a sample: its angle, an update, a trip.
LOGGED_A_SAMPLE = 3


@dataclass(frozen=True)
class Sampling:
    """T_s in clocks, samples per control tick, T_d over T_s."""

    cycles: int
    tick_samples: int
    delay: float

    @property
    def period_s(self) -> float:
        """T_s."""
        return self.cycles / CLOCK_HZ


def _matrix(motor: Motor) -> NDArray[np.float64]:
    """Inductances of the phases, of a salient machine none: its phases are equal."""
    if motor.inductance_q_h is not None:
        return np.zeros((3, 3))
    return np.array(motor.inductance_matrix_h)


def _unequal(matrix: NDArray[np.float64]) -> complex:
    """What a matrix of the phases does to the conjugate of a vector; 0 if they are equal."""
    axes = np.exp(2j * np.pi * np.arange(3) / 3)
    found = complex(axes @ matrix @ axes) / 3
    return found if abs(found) > 1e-9 * abs(matrix).max(initial=0.0) else 0j


def set_machine(machine: kernel.Array, motor: Motor, switch_ohm: float) -> None:
    """Fill a record of `vector_kernel.MACHINE` with a motor on switches."""
    saliency_h = motor.inductance_q_h - motor.inductance_h[0] if motor.inductance_q_h else 0.0
    machine.resistance_ohm = sum(motor.resistance_ohm) / 3 + switch_ohm
    machine.l_d_h, machine.l_q_h = (motor.mean_inductance_h + sign * saliency_h / 2 for sign in (-1, 1))
    machine.psi_vs = sum(motor.psi_vs) / 3
    machine.unequal_ohm, machine.unequal_h = _unequal(np.diag(motor.resistance_ohm)), _unequal(_matrix(motor))
    machine.flux_share = np.array(motor.psi_vs) / machine.psi_vs
    machine.ramp_rad = math.radians(180.0 - motor.flat_top_deg) / 2 if motor.emf == "trapezoidal" else 0.0
    machine.pole_pairs, machine.inertia_kgm2 = motor.pole_pairs, motor.inertia_kgm2


class VectorChip:
    """One vector drive on one machine; the firmware has booted. State and machine are records: see `vector_kernel`."""

    def __init__(
        self,
        block: ParameterBlock,
        motor: Motor,
        inverter: Inverter,
        timing: Sampling,
        library: Path | None = None,
        seed: int = SEED,
    ) -> None:
        self.block, self.motor, self.inverter, self.timing = block, motor, inverter, timing
        self.fw = HostFirmware(library)
        self.fw.load(block)
        self.fw.boot()
        # Of the phases, codes Q12.4: what the drive measures before it is ready.
        middle = 2 ** (inverter.sensing.bits - 1)
        self.fw.auto_zero_offsets[3:6] = [round(16 * (middle + lsb)) for lsb in inverter.sensing.offset_lsb]
        self.state = np.zeros(1, kernel.STATE).view(np.recarray)
        self.plant = np.zeros(1, kernel.MACHINE).view(np.recarray)
        self._set_machine()
        self._regulator, self._gains = np.zeros(6, np.int32), np.zeros(7, np.int32)
        self._calls = kernel.calls(self.fw.lib)
        self._rng = np.random.default_rng(seed)
        self._places = self._find_places()
        words = c_types().sizeof("telemetry_t") // 4
        self._telemetry = view(self.fw.lib.fl_host_telemetry(), words, np.uint32)
        self._rows, self._log = np.zeros(0, kernel.ROW), np.zeros((0, 4), np.int64)
        self._records = view(self.fw.lib.fl_host_capture(), 4 * CAPTURE_RECORDS, np.int32).reshape(-1, 4)
        self.put("capture.status", CAPTURE_RECORDS << 16)
        self.set_wiring(inverter.sensing.sources)
        kernel.take(self.fw.registers, self._places, self.state.view(np.ndarray), self._gains)

    def _set_machine(self) -> None:
        sensing, p = self.inverter.sensing, self.plant
        set_machine(p, self.motor, self.inverter.on_resistance_ohm)
        p.period_s, p.period_cycles = self.timing.period_s, self.timing.cycles
        p.tick_samples, p.delay = self.timing.tick_samples, self.timing.delay
        p.stiction_ratio = 1.0
        p.supply_v = self.inverter.supply_v
        p.supply_ohm, p.diode_v = self.inverter.supply_resistance_ohm, self.inverter.diode_drop_v
        p.trip_a = self.inverter.protection.phase_current_a
        p.unit_a = kernel.Q17 / sensing.current_full_scale_a
        p.unit_v = kernel.Q17 / sensing.voltage_full_scale_v
        p.power_up_quarter = POWER_UP_QUARTER
        self.state.vdc = p.supply_v

    def _find_places(self) -> NDArray[Any]:
        found = np.zeros(1, kernel.PLACES)
        for name in kernel.REGISTERS:
            found[name.replace(".", "_")] = self.fw.index(name)
        for name in kernel.WORDS:
            found[name] = c_types().offsetof("telemetry_t", name) // 4
        found["machine_timer"], found["phase_trip"] = self.fw.lib.IRQ_MACHINE_TIMER, self.fw.lib.TRIP_PHASE_CURRENT
        return found

    def set_load(self, load: Load, factor: float = 1.0) -> None:
        """Change the load."""
        p = self.plant
        p.fan_nm_s2_per_rad2 = factor * load.fan_nm_s2_per_rad2
        p.viscous_nm_s_per_rad = factor * load.viscous_nm_s_per_rad
        p.constant_nm, p.coulomb_nm = factor * load.constant_nm, factor * load.coulomb_nm
        p.stiction_ratio = load.stiction_ratio

    def set_noise(self, lsb: float) -> None:
        """Noise of the converter's codes, rms."""
        sensing = self.inverter.sensing
        code_a = sensing.current_full_scale_a / 2 ** (sensing.bits - 1)
        self.plant.noise_a = lsb * code_a * math.sqrt(2 / 3)

    def set_wiring(self, sources: Mapping[str, tuple[str, float]]) -> None:
        """Signal at an input of the converter and its factor, by the channels' names: what is not right."""
        p = self.plant
        p.wired = bool(sources)
        for kind, gains in (("i", p.current_gain[0]), ("v", p.voltage_gain[0])):
            gains[:] = np.eye(3)
            for channel, (source, factor) in sources.items():
                if channel[0] == kind:
                    row = "abc".index(channel[1])
                    gains[row] = 0.0
                    gains[row, "abc".index(source[1])] = factor

    def set_left_voltage(self, volt: float) -> None:
        """Voltage that a leg loses beyond its dead time's compensation."""
        self.plant.left_v = volt

    def set_encoder(
        self, lines: int, index: bool, offset_turn: float, inverted: bool = False, missing_lines: int = 0
    ) -> None:
        """Put an encoder on the shaft. offset_turn: electrical, of the index."""
        p = self.plant
        p.quarters, p.index, p.offset_turn = 4 * lines, index, offset_turn
        p.inverted, p.missing_lines = inverted, missing_lines

    def keep_rows(self, samples: int) -> None:
        """From now on record up to so many samples; begins anew."""
        self._rows = np.zeros(samples, kernel.ROW)
        self._log = np.zeros((LOGGED_A_SAMPLE * samples, 4), np.int64)
        self.state.rows = self.state.logged = 0

    def rows(self) -> NDArray[Any]:
        """What was recorded, `vector_kernel.ROW`."""
        return self._rows[: int(self.state.rows[0])]

    def log(self) -> NDArray[np.int64]:
        """Rows of the chip's log, `LogKind`."""
        return self._log[: int(self.state.logged[0])]

    def advance(self, samples: int) -> None:
        """So many sample periods."""
        kernel.advance(
            samples,
            self.fw.registers,
            self._places,
            self._telemetry,
            self.state.view(np.ndarray),
            self.plant.view(np.ndarray),
            self._regulator,
            self._gains,
            self._calls,
            self._rng,
            self._rows,
            self._log,
            self._records,
        )

    def get(self, name: str, element: int = 0) -> int:
        """Value of a register."""
        return int(self.fw.registers[self.fw.index(name, element)])

    def put(self, name: str, value: int, element: int = 0) -> None:
        """Set a register, signed values in two's complement."""
        self.fw.registers[self.fw.index(name, element)] = value & 0xFFFFFFFF

    def trip(self, causes: int) -> None:
        """Latch trip causes and open the gates."""
        kernel.trip(self.fw.registers, self._places, self.state.view(np.ndarray), causes)

    @property
    def now(self) -> float:
        """Simulated time, s."""
        return float(self.state.samples[0]) * self.timing.period_s

    @property
    def rpm(self) -> float:
        """True mechanical speed."""
        return float(self.state.omega[0]) / self.motor.pole_pairs * 30 / math.pi

    @property
    def current_a(self) -> complex:
        """Current vector in the stationary frame."""
        return complex(self.state.i[0] * np.exp(1j * self.state.theta[0]))
