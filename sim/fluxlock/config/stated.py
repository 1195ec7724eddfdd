# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Table `[datasheet]` of a motor file: what the maker states, in the maker's own terms."""

from __future__ import annotations

from pydantic import Field

from fluxlock.config.fields import Model, quantity


def _constant(text: str, unit: str) -> float | None:
    """Optional key of a constant. text: what it is per."""
    value: float | None = quantity(text, unit, 1e-7, 1e6, default=None, absent="not stated")
    return value


class DataSheet(Model):
    """What the maker states, as it stands. The drive takes none of it. `motor check` compares it with the file."""

    source: str = Field(default="", description="Maker, type and document.")
    poles: int | None = quantity("Magnet poles, twice the pole pairs.", "", 2, 100, default=None, absent="not stated")
    terminal_resistance_ohm: float | None = quantity(
        "Resistance between two terminals.", "Ohm", 1e-5, 2e3, default=None, absent="not stated"
    )
    terminal_inductance_h: float | None = quantity(
        "Inductance between two terminals.", "H", 1e-8, 20.0, default=None, absent="not stated"
    )
    kv_dc_rpm_per_v: float | None = _constant("Kv: speed over voltage of the DC link in six-step.", "r/min/V")
    kv_line_peak_rpm_per_v: float | None = _constant("Kv over the peak of the line EMF.", "r/min/V")
    kv_line_rms_rpm_per_v: float | None = _constant("Kv over the rms of the line EMF.", "r/min/V")
    ke_dc_v_per_krpm: float | None = _constant("Ke: mean line EMF over a sector.", "V/(1000 r/min)")
    ke_line_peak_v_per_krpm: float | None = _constant("Ke: peak of the line EMF.", "V/(1000 r/min)")
    ke_line_rms_v_per_krpm: float | None = _constant("Ke: rms of the line EMF.", "V/(1000 r/min)")
    ke_phase_peak_v_per_krpm: float | None = _constant("Ke: peak of the phase EMF, of a star.", "V/(1000 r/min)")
    ke_phase_rms_v_per_krpm: float | None = _constant("Ke: rms of the phase EMF, of a star.", "V/(1000 r/min)")
    kt_dc_nm_per_a: float | None = _constant("Kt per DC current in six-step.", "N*m/A")
    kt_peak_nm_per_a: float | None = _constant("Kt per peak of the phase current.", "N*m/A")
    kt_rms_nm_per_a: float | None = _constant("Kt per rms of the phase current.", "N*m/A")
    rated_torque_nm: float | None = quantity(
        "Torque at the rated current.", "N*m", 1e-6, 1e5, default=None, absent="not stated"
    )
    voltage_v: float | None = quantity(
        "Voltage of the DC link that the machine is made for.", "V", 0.1, 2000, default=None, absent="not stated"
    )
    no_load_speed_rpm: float | None = quantity(
        "Speed without load at `voltage_v`.", "r/min", 1, 2e6, default=None, absent="not stated"
    )
    no_load_current_a: float = quantity("DC current without load at `voltage_v`.", "A", 0, 2000, default=0.0)
    rotor_inertia_gcm2: float | None = quantity(
        "Inertia of the rotor alone.", "g*cm^2", 1e-4, 1e9, default=None, absent="not stated"
    )
    electrical_time_constant_s: float | None = quantity("L/R.", "s", 1e-7, 10.0, default=None, absent="not stated")
    mechanical_time_constant_s: float | None = quantity(
        "Of the rotor alone. Leave it out where `inertia_kgm2` has a load.",
        "s",
        1e-6,
        100.0,
        default=None,
        absent="not stated",
    )
