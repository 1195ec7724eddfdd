# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The plant as Python sees it: parameters in, sample codes and records out.

`Plant` joins inverter, machine, DC link, load and sense chain. It is event-driven: `step` advances it to the clock of
a gate edge or of a sample strobe. The kernel (`kernel.py`) does the work, compiled by numba or as plain Python with the
same bits. Equations and sources: `docs/architecture.md` (section Plant), `docs/theory/five-phase-plant.md`.

Units: SI unless the name says otherwise (`speed_rpm`), angles in electrical radians, times in clocks of the chip
(`t_cycle`).
Shapes: gates are one integer, bit 2X the upper and bit 2X + 1 the lower switch of leg X. A sample set is [channel] of
the channels 2 * phases + 3, codes 0 to 4095. Records are structured arrays, one row per event.
Errors: `PlantError` with the text of the kernel's fault code (`layout.FAULT_TEXT`): shoot-through, a value that is not
finite, a full buffer. The plant shares no code with the controller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import layout as L
from .build import chosen_mode, interpreted, make_kernel
from .circuit import terminals_now
from .emf import shape_now, torque_now
from .magnetics import FluxMap, axes_matrix, rotor_axes
from .params import MECHANICS_MODES, PlantParams, channel_names, check_profile
from .require import require
from .state import FloatArray, initial_state, variant_of, write_machine, write_profile, write_zoom
from .trajectory import RecordArray, angle_between, event_buffer, wave_buffer, zoom_buffer
from .vector import view_of

NO_HEARTBEAT = -2  # fault code of the simulator main
RPM_PER_RAD_S = 60.0 / (2.0 * math.pi)
BREAK_ROUNDS = 20  # of Newton's method for the currents that take over those of a broken phase


class PlantError(RuntimeError):
    """The kernel returned a fault code."""


FAULT_KINDS = (
    "shorted_winding",
    "open_phase",
    "stuck_high",
    "stuck_low",
    "supply",
    "stuck_channel",
    "noisy_channels",
    "stuck_rotor",
    "fault_pin",
    "clear",
)


@dataclass(frozen=True)
class Drained:
    """New records of one `drain`."""

    waves: RecordArray
    events: RecordArray
    zoom: RecordArray


class Plant:
    """Machine, inverter, load and sensing, event-driven.

    Either this object is stepped from Python, or native code calls the kernel at `address` with the addresses
    of `state` and `io`. mode: "jit" (compiled) or "py" (plain Python), default from FLUXLOCK_PLANT, else
    "jit".
    """

    def __init__(self, params: PlantParams, seed: int, mode: str | None = None) -> None:
        self.params = params
        self.mode = chosen_mode(mode)
        self.state: FloatArray = initial_state(params, seed)
        self.io: npt.NDArray[np.int32] = np.zeros(L.IO_SIZE, np.int32)
        if params.machine.encoder is not None:
            self.io[L.IO_ENCODER_WAIT] = 1  # its levels are there before anything else happens
        self.phases = params.machine.phases
        self.channels = channel_names(self.phases)
        variant = variant_of(params.machine)
        self._kernel = make_kernel(self.mode, variant, self.state, self.io)
        self._functions = interpreted(variant)
        self._flux_map = FluxMap(params.machine) if params.machine.by_flux else None
        self._waves = wave_buffer(self.state, self.phases)
        self._zoom = zoom_buffer(self.state, self.phases)
        self._events = event_buffer(self.state)
        self._turns = [1.0] * self.phases
        self._broken: set[str] = set()  # by a fault: `stuck_rotor`, `noisy_channels`

    @property
    def address(self) -> int:
        """Address of `int32 step(int64 t_cycle, int32 gates, int32 flags, double* s, int32* io)`."""
        return self._kernel.address

    def step(self, t_cycle: int, gates: int, flags: int = 0) -> None:
        """Advance to t_cycle with the old gates, sample if flags bit 0 is set, then take gates and brake (bit 2)."""
        code = self._kernel.call(t_cycle, gates, flags)
        if code != L.OK:
            raise PlantError(self.fault_text(code, t_cycle)) from self._kernel.error

    def advance(self, t_cycle: int) -> None:
        """Advance to t_cycle."""
        self.step(t_cycle, int(self.state[L.GATES]), self._brake)

    def set_gates(self, gates: int) -> None:
        """Change the gates now."""
        self.step(int(self.state[L.T_CYCLE]), gates, 2 | self._brake)

    def set_brake(self, on: bool) -> None:
        """Switch a driven brake chopper now."""
        self.step(int(self.state[L.T_CYCLE]), int(self.state[L.GATES]), L.BRAKE if on else 0)

    @property
    def _brake(self) -> int:
        return L.BRAKE if self.state[L.CHOPPER_ON] else 0

    def sample(self, t_cycle: int) -> npt.NDArray[np.int32]:
        """Advance to t_cycle, sample there and return the codes of all channels."""
        self.step(t_cycle, int(self.state[L.GATES]), L.STROBE | self._brake)
        return self.io[: len(self.channels)].copy()

    def fault_text(self, code: int, t_cycle: int | None = None) -> str:
        """What a fault code means."""
        unlisted = "the kernel was left by an exception" if code == NO_HEARTBEAT else "unknown"
        text = L.FAULT_TEXT.get(code, unlisted)
        if self._kernel.error is not None:
            text += f" ({type(self._kernel.error).__name__}: {self._kernel.error})"
        at = "" if t_cycle is None else f" at cycle {t_cycle}"
        return f"plant fault {code}{at}: {text}"

    @property
    def t_cycle(self) -> int:
        """Time of the last event, clock cycles."""
        return int(self.state[L.T_CYCLE])

    @property
    def currents_a(self) -> FloatArray:
        """Phase currents into the machine."""
        return self.state[L.I : L.I + self.phases].copy()

    @property
    def terminals_v(self) -> FloatArray:
        """Terminal voltages against the negative rail."""
        self._functions[terminals_now](view_of(self.state))
        return self.state[L.VT : L.VT + self.phases].copy()

    @property
    def rotor_currents_a(self) -> FloatArray:
        """Currents in rotor axes: d, q, with five phases d and q of the third plane too."""
        return rotor_axes(self.theta_e_rad, self.phases, self.currents_a)

    @property
    def torque_nm(self) -> float:
        """Torque of the machine, before friction."""
        return float(self.state[L.TORQUE])

    @property
    def theta_e_rad(self) -> float:
        """Electrical angle, unwrapped."""
        return float(self.state[L.TURNS] * 2.0 * math.pi + self.state[L.THETA])

    @property
    def omega_e_rad_s(self) -> float:
        """Electrical speed."""
        return float(self.state[L.OMEGA])

    @property
    def speed_rpm(self) -> float:
        """Mechanical speed."""
        return float(self.state[L.OMEGA]) / self.params.machine.pole_pairs * RPM_PER_RAD_S

    def energies_j(self) -> dict[str, float]:
        """Energies since the start, if `RecordingParams.energies` asks for them, and what is stored now."""
        s = self.state
        e = s[L.ENERGY : L.ENERGY + L.ENERGIES]
        capacitor = 0.5 * s[L.VDC] ** 2 / s[L.LINK_C_INV] if s[L.LINK_C_INV] else 0.0
        return {
            "supply": float(e[L.E_SUPPLY]),
            "source_resistance": float(e[L.E_SOURCE_R]),
            "copper": float(e[L.E_COPPER]),
            "switches": float(e[L.E_SWITCH]),
            "diodes": float(e[L.E_DIODE]),
            "chopper": float(e[L.E_CHOPPER]),
            "shaft": float(e[L.E_SHAFT]),
            "load": float(e[L.E_LOAD]),
            "magnetic_now": self._magnetic_j(),
            "capacitor_now": float(capacitor),
            "kinetic_now": float(0.5 * s[L.INERTIA] * (s[L.OMEGA] / s[L.POLE_PAIRS]) ** 2),
        }

    def _inductances(self) -> FloatArray:
        return self.state[L.LM : L.LM + self.phases**2].reshape(self.phases, self.phases)

    def _magnetic_j(self) -> float:
        i = self.currents_a
        if self._flux_map is None or min(self._turns) < 1.0:
            return float(0.5 * i @ self._inductances() @ i)
        return self._flux_map.energy(self.rotor_currents_a)

    def _ramp(self, index: int, value: float, ramp_s: float, at_cycle: int | None) -> None:
        s = self.state
        t0 = (s[L.T_CYCLE] if at_cycle is None else at_cycle) * s[L.CLOCK_S]
        s[L.RAMP_V0 + index] = s[L.VALUE + index]
        s[L.RAMP_V1 + index] = value
        s[L.RAMP_T0 + index] = t0
        s[L.RAMP_T1 + index] = t0 + ramp_s
        s[L.RAMP_BUSY + index] = 1.0

    def set_load(
        self,
        *,
        fan_nm_s2_per_rad2: float | None = None,
        constant_nm: float | None = None,
        viscous_nm_s_per_rad: float | None = None,
        coulomb_nm: float | None = None,
        ramp_s: float = 0.0,
        at_cycle: int | None = None,
    ) -> None:
        """Change the given loads, in a ramp of ramp_s (0: step) from at_cycle (default: last event) on."""
        require(ramp_s >= 0.0, "ramp_s", ramp_s, "at least 0")
        values = {
            L.FAN: fan_nm_s2_per_rad2,
            L.CONSTANT: constant_nm,
            L.VISCOUS: viscous_nm_s_per_rad,
            L.COULOMB: coulomb_nm,
        }
        require(coulomb_nm is None or coulomb_nm >= 0.0, "coulomb_nm", coulomb_nm, "at least 0")
        for index, value in values.items():
            if value is not None:
                self._ramp(index, value, ramp_s, at_cycle)

    def hold_load(self, torque_nm: float) -> None:
        """Put one more load torque on the shaft from the last event on, in place of the one held before."""
        require(math.isfinite(torque_nm), "torque_nm", torque_nm, "finite")
        self.state[L.OUTER_NM] = torque_nm

    def set_supply(self, supply_v: float, ramp_s: float = 0.0, at_cycle: int | None = None) -> None:
        """Change the supply voltage, as `set_load` does a load."""
        require(supply_v >= 0.0, "supply_v", supply_v, "at least 0")
        require(ramp_s >= 0.0, "ramp_s", ramp_s, "at least 0")
        self._ramp(L.SUPPLY, supply_v, ramp_s, at_cycle)

    def set_mechanics(self, mode: str, profile: tuple[tuple[float, float], ...] | None = None) -> None:
        """Change to "free", "imposed" (corners (t_s, omega_m rad/s); none: the present speed) or "locked"."""
        require(mode in MECHANICS_MODES, "mode", mode, " or ".join(MECHANICS_MODES))
        if profile is not None:
            check_profile(profile)
            write_profile(self.state, profile)
        elif mode == "imposed":
            write_profile(self.state, ())
        self.state[L.MECHANICS] = MECHANICS_MODES[mode]

    def disturb(
        self,
        channel: str | None = None,
        *,
        offset_lsb: float = 0.0,
        gain: float = 1.0,
        noise_lsb: float | None = None,
    ) -> None:
        """Disturb the sensing: add offset_lsb to a channel's codes, multiply its gain; noise_lsb is of all channels."""
        if channel is not None:
            require(channel in self.channels, "channel", channel, " or ".join(self.channels))
            index = self.channels.index(channel)
            self.state[L.CODE_ZERO + index] += offset_lsb
            self.state[L.CODES_PER_UNIT + index] *= gain
        if noise_lsb is not None:
            require(noise_lsb >= 0.0, "noise_lsb", noise_lsb, "at least 0")
            self.state[L.NOISE_LSB] = noise_lsb

    def inject_fault(
        self,
        kind: str,
        *,
        phases: tuple[int, ...] = (0,),
        turns_fraction: float = 0.05,
        supply_v: float = 0.0,
        ramp_s: float = 0.0,
        channel: str = "ia",
        code: int | None = None,
        level: bool = True,
        noise_lsb: float = 0.0,
    ) -> None:
        """Break something, now.

        "shorted_winding": of the windings of `phases` only turns_fraction of the turns still act: resistance,
        flux and mutual inductance scale with it, self inductance with its square. Currents are kept; the
        energy of the lost turns is spent in the short. One phase is a short to the star point, two are a
        short between terminals.
        "open_phase": the connections of the inverter's legs to `phases` break, beyond the voltage dividers' taps on the
        machine's side. Their currents end at once, the other phases take them over as flux linkages demand; the energy
        of the arc is not counted.
        "stuck_high", "stuck_low": the upper or lower switch of the legs of `phases` conducts for ever. Where the other
        switch of a leg is asked for, the driver sees the short, does not turn it on and sets its fault output.
        "supply": the supply goes to supply_v within ramp_s. "stuck_channel": the converter channel stays at
        `code` (None: at its present one). "noisy_channels": the noise of all of them is noise_lsb, rms. "stuck_rotor":
        it stands at once, and stays. "fault_pin": the gate driver's fault output goes to `level`.
        "clear": windings, legs, channels, rotor and pin are whole again (not the supply).
        """
        s = self.state
        if kind == "shorted_winding":
            require(0.0 < turns_fraction <= 1.0, "turns_fraction", turns_fraction, "above 0, at most 1")
            self._check_phases(phases)
            for phase in phases:
                self._turns[phase] = turns_fraction
            self._rewind()
        elif kind == "open_phase":
            self._check_phases(phases)
            self._break(phases)
        elif kind in ("stuck_high", "stuck_low"):
            self._check_phases(phases)
            for phase in phases:
                s[L.LEG_FAULT + phase] = L.STUCK_HIGH if kind == "stuck_high" else L.STUCK_LOW
        elif kind == "supply":
            self.set_supply(supply_v, ramp_s)
        elif kind == "stuck_channel":
            require(channel in self.channels, "channel", channel, " or ".join(self.channels))
            index = self.channels.index(channel)
            stuck = int(self.io[index]) if code is None else code
            require(0 <= stuck <= s[L.ADC_MAX], "code", stuck, f"0 to {s[L.ADC_MAX]:.0f}")
            s[L.STUCK + index] = stuck
        elif kind == "noisy_channels":
            self.disturb(noise_lsb=noise_lsb)
            self._broken.add(kind)
        elif kind == "stuck_rotor":
            self.set_mechanics("locked")
            self._broken.add(kind)
        elif kind == "fault_pin":
            s[L.FAULT_PIN] = float(level)
            self.io[L.IO_PINS] = int(self.io[L.IO_PINS]) & ~1 | int(level)
        elif kind == "clear":
            self._turns = [1.0] * self.phases
            self._rewind()
            s[L.LEG_FAULT : L.LEG_FAULT + L.LEGS] = L.WHOLE
            s[L.STUCK : L.STUCK + L.CHANNELS] = -1.0
            s[L.FAULT_PIN] = 0.0
            if "noisy_channels" in self._broken:
                self.disturb(noise_lsb=self.params.sensing.noise_lsb_rms)
            if "stuck_rotor" in self._broken:
                self.set_mechanics(self.params.mechanics.mode)
            self._broken.clear()
            self.io[L.IO_PINS] = int(self.io[L.IO_PINS]) & ~1
        else:
            require(False, "kind", kind, ", ".join(FAULT_KINDS[:-1]) + f" or {FAULT_KINDS[-1]}")

    def _rewind(self) -> None:
        write_machine(self.state, self.params.machine, tuple(self._turns))
        self._functions[torque_now](view_of(self.state))

    def _check_phases(self, phases: tuple[int, ...]) -> None:
        for phase in phases:
            require(0 <= phase < self.phases, "phases", phases, f"numbers 0 to {self.phases - 1}")

    def _phase_flux(self) -> FloatArray:
        """Flux linkages of the phases, V s, without the magnets' in a machine of constant inductances."""
        if self._flux_map is None:
            return np.asarray(self._inductances() @ self.currents_a)
        axes = axes_matrix(self.theta_e_rad, self.phases) * np.array(self._turns)
        return np.asarray(self.state[L.FLUX : L.FLUX + self.phases - 1] @ axes)

    def _break(self, phases: tuple[int, ...]) -> None:
        """Open phases: the voltage of the arc reaches the others through the star point, each with the same impulse."""
        s, view = self.state, view_of(self.state)
        for phase in phases:
            s[L.LEG_FAULT + phase] = L.BROKEN
        whole = [x for x in range(self.phases) if s[L.LEG_FAULT + x] != L.BROKEN]
        current = s[L.I : L.I + self.phases]
        before = self._phase_flux()[whole]
        current[[x for x in range(self.phases) if x not in whole]] = 0.0
        if len(whole) < 2:
            current[:] = 0.0
        n = len(whole)
        for _ in range(BREAK_ROUNDS if n > 1 else 0):
            self._functions[shape_now](view)
            matrix = np.ones((n + 1, n + 1))
            matrix[:n, :n] = self._inductances()[np.ix_(whole, whole)]
            matrix[n, n] = 0.0
            missing = np.append(before - self._phase_flux()[whole], -current.sum())
            # Henry beside ones: the impulse, the last unknown, is of no interest.
            matrix[:n, n] = matrix[:n, :n].max()
            change = np.linalg.solve(matrix, missing)[:n]
            current[whole] += change
            if np.abs(change).max() <= 1e-13 * np.abs(current).max():
                break
        self._functions[shape_now](view)
        s[L.G_MASK] = -1.0

    def configure_recording(self, every_strobes: int, zoom: tuple[tuple[int, int], ...] = ()) -> None:
        """Change the grid of the waveform records (0: none) and the zoom windows (first, last cycle)."""
        require(every_strobes >= 0, "every_strobes", every_strobes, "at least 0")
        require(len(zoom) <= L.ZOOM_MAX, "zoom", zoom, f"at most {L.ZOOM_MAX} windows")
        self.state[L.WAVE_EVERY] = every_strobes
        write_zoom(self.state, zoom)

    def drain(self) -> Drained:
        """Empty the kernel's record buffers and return the new rows. Call it before a buffer is full."""
        return Drained(self._waves.drain(), self._events.drain(), self._zoom.drain())

    def forget(self) -> None:
        """Drop all rows drained so far: of a run without end."""
        for buffer in (self._waves, self._events, self._zoom):
            buffer.forget()

    def records(self) -> RecordArray:
        """All waveform records so far (`WAVE_DTYPE`)."""
        return self._waves.all()

    def zoom_records(self) -> RecordArray:
        """All rows recorded in zoom windows so far (`WAVE_DTYPE`); gate edges have two, before and after."""
        return self._zoom.all()

    def events(self) -> RecordArray:
        """All diode events so far (`EVENT_DTYPE`)."""
        return self._events.all()

    def theta_at(self, t_cycles: npt.ArrayLike) -> FloatArray:
        """True electrical angle (rad, unwrapped) at any times within the waveform records."""
        return angle_between(self.records(), t_cycles, self.params.clock_period_s)
