# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What follows from a motor file: derived values and things worth a second look."""

from __future__ import annotations

from dataclasses import dataclass

from fluxlock.config.constants import constants
from fluxlock.config.least_speed import least_six_step_rpm, least_vector_rpm
from fluxlock.config.mistakes import mistakes
from fluxlock.config.motor import COMMUTATION_LEAST, RPM_PER_RAD_S, Motor

LEAST_SPEEDS = (("six_step", "six-step", least_six_step_rpm), ("vector", "vector", least_vector_rpm))


@dataclass(frozen=True)
class Derived:
    """One derived value; `key` holds the unit."""

    key: str
    label: str
    value: float
    unit: str


def _conventions(motor: Motor) -> list[Derived]:
    """Kv, Ke and Kt as makers state them; Ke and Kt on the DC side stand above as EMF and torque constant."""
    shown = {
        "kv_dc_rpm_per_v": ("Kv, DC", "r/min/V"),
        "kv_line_peak_rpm_per_v": ("Kv, peak line EMF", "r/min/V"),
        "kv_line_rms_rpm_per_v": ("Kv, rms line EMF", "r/min/V"),
        "ke_line_peak_v_per_krpm": ("Ke, line peak", "V/(1000 r/min)"),
        "ke_line_rms_v_per_krpm": ("Ke, line rms", "V/(1000 r/min)"),
        "ke_phase_peak_v_per_krpm": ("Ke, phase peak", "V/(1000 r/min)"),
        "ke_phase_rms_v_per_krpm": ("Ke, phase rms", "V/(1000 r/min)"),
        "kt_peak_nm_per_a": ("Kt, peak phase current", "N*m/A"),
        "kt_rms_nm_per_a": ("Kt, rms phase current", "N*m/A"),
    }
    values = constants(motor)
    return [Derived(key, label, values[key], unit) for key, (label, unit) in shown.items()]


def derived_values(motor: Motor) -> list[Derived]:
    """Characteristic values of a machine: with three phases in six-step operation, with five under vector control."""
    resistance = sum(motor.resistance_ohm) / 3
    inductance = motor.mean_inductance_h
    inductance_q = motor.inductance_q_h or inductance
    inductance_d = motor.inductance_h[0] if motor.inductance_q_h else inductance
    torque_per_amp, five = motor.torque_per_amp_nm, motor.phases == 5
    line_v = motor.line_flux_vs * motor.omega_e(motor.max_speed_rpm)
    commutation = 0.0 if five else COMMUTATION_LEAST * motor.omega_e(motor.max_speed_rpm) * inductance
    drop_v = (2 * resistance + commutation) * motor.rated_dc_current_a
    mechanical_s = motor.inertia_kgm2 * 2 * resistance / torque_per_amp**2
    accel = motor.rated_torque_nm / motor.inertia_kgm2 * RPM_PER_RAD_S
    current, emf = ("i_q", "largest line EMF") if five else ("DC current", "mean line EMF")
    return [
        Derived("torque_constant_nm_per_a", f"torque constant ({current})", torque_per_amp, "N*m/A"),
        Derived(
            "emf_v_per_krpm",
            f"{emf} per 1000 r/min",
            motor.line_flux_vs * motor.omega_e(1000.0),
            "V/(1000 r/min)",
        ),
        *(
            Derived(
                f"emf_harmonic_{n}_percent",
                f"phase EMF, harmonic {n} over fundamental",
                100 * motor.emf_harmonic(n),
                "%",
            )
            for n in (3, 5, 7)
        ),
        *(() if five else (Derived("rated_dc_current_a", "DC current of that torque", motor.rated_dc_current_a, "A"),)),
        *(() if five else _conventions(motor)),
        Derived("rated_torque_nm", "torque at rated current", motor.rated_torque_nm, "N*m"),
        Derived("rated_accel_rpm_per_s", "acceleration at rated torque, no load", accel, "r/min/s"),
        Derived("inductance_d_h", "inductance on the d axis, L_d", inductance_d, "H"),
        Derived("inductance_q_h", "inductance on the q axis, L_q", inductance_q, "H"),
        Derived("electrical_time_constant_s", "electrical time constant L/R", inductance / resistance, "s"),
        Derived("mechanical_time_constant_s", "mechanical time constant", mechanical_s, "s"),
        Derived("max_electrical_hz", "frequency at max_speed_rpm", motor.electrical_hz(motor.max_speed_rpm), "Hz"),
        Derived("line_emf_max_v", f"{emf} at max_speed_rpm", line_v, "V"),
        Derived("supply_min_v", "least supply at max_speed_rpm and rated current", line_v + drop_v, "V"),
        Derived(
            "load_at_max_speed_nm",
            "load of the file at max_speed_rpm",
            motor.load.torque_nm(motor.max_speed_rpm),
            "N*m",
        ),
        *(
            Derived(f"least_{key}_rpm", f"least speed, {method}", least_rpm(motor), "r/min")
            for key, method, least_rpm in LEAST_SPEEDS
            if not five
        ),
    ]


# Run-up time of usual machines, from servo motors to fans with heavy wheels.
TIME_CONSTANT_MIN_S, TIME_CONSTANT_MAX_S = 1e-5, 0.1
SALIENCY_MIN, SALIENCY_MAX = 0.5, 10.0  # L_q / L_d, from inset magnets to reluctance machines
EMF_MIN_V, EMF_MAX_V = 1.0, 2000.0
POLES_MIN, POLES_HZ = 8, 2500.0  # pairs and frequency from which they may be poles
RUN_UP_MIN_S, RUN_UP_USUAL_S, RUN_UP_MAX_S = 3e-3, 0.1, 10.0


def _inertia_warning(motor: Motor) -> list[str]:
    """Inertia against the torque and the speed: the run-up time J * omega / T spans few decades among all machines."""
    per_second = motor.rated_torque_nm * RPM_PER_RAD_S / motor.max_speed_rpm
    run_up_s = motor.inertia_kgm2 / per_second
    if RUN_UP_MIN_S <= run_up_s <= RUN_UP_MAX_S:
        return []
    return [
        f"inertia_kgm2: with {motor.inertia_kgm2:g} kg*m^2 the rated torque reaches max_speed_rpm in {run_up_s:.2g} s, "
        f"usual {RUN_UP_MIN_S:g} to {RUN_UP_MAX_S:g} s without load; {RUN_UP_USUAL_S:g} s would be "
        f"{RUN_UP_USUAL_S * per_second:.1g} kg*m^2; check the unit (1 g*cm^2 = 1e-7 kg*m^2)"
    ]


def warnings(motor: Motor) -> list[str]:
    """Legal but unusual contents of a motor file."""
    found = mistakes(motor)
    load_nm = motor.load.torque_nm(motor.max_speed_rpm)
    if load_nm > motor.rated_torque_nm:
        found.append(
            f"load at max_speed_rpm ({load_nm:.3g} N*m) is above the torque at rated_current_a "
            f"({motor.rated_torque_nm:.3g} N*m)"
        )
    for key in ("resistance_ohm", "inductance_h", "psi_vs"):
        values = getattr(motor, key)
        if max(values) > 1.3 * min(values):
            found.append(f"{key}: phases differ by more than 30 %")
    emf_v = motor.line_flux_vs * motor.omega_e(motor.max_speed_rpm)
    drop_v = 2 * sum(motor.resistance_ohm) / 3 * motor.rated_dc_current_a
    if drop_v > emf_v:
        found.append(
            f"rated_current_a drops {drop_v:.3g} V over two phases, more than the EMF at max_speed_rpm ({emf_v:.3g} V)"
        )
    top_hz = motor.electrical_hz(motor.max_speed_rpm)
    if motor.pole_pairs >= POLES_MIN and motor.pole_pairs % 2 == 0 and top_hz > POLES_HZ:
        found.append(
            f"pole_pairs: {motor.pole_pairs} turn at {top_hz:.0f} Hz at max_speed_rpm; check that they are not "
            f"{motor.pole_pairs} poles, {motor.pole_pairs // 2} pairs"
        )
    if motor.inductance_q_h is not None:
        ratio = motor.inductance_q_h / motor.inductance_h[0]
        if not SALIENCY_MIN <= ratio <= SALIENCY_MAX:
            found.append(
                f"inductance_q_h: L_q/L_d is {ratio:.2g}, usual {SALIENCY_MIN:g} to {SALIENCY_MAX:g}; check the units"
            )
    constant_s = 3 * motor.mean_inductance_h / sum(motor.resistance_ohm)
    if not TIME_CONSTANT_MIN_S <= constant_s <= TIME_CONSTANT_MAX_S:
        found.append(
            f"inductance_h, resistance_ohm: L/R is {constant_s:.2g} s, usual {TIME_CONSTANT_MIN_S:g} to "
            f"{TIME_CONSTANT_MAX_S:g} s; check the units"
        )
    if not EMF_MIN_V <= emf_v <= EMF_MAX_V:
        found.append(
            f"psi_vs: the line EMF at max_speed_rpm is {emf_v:.3g} V, usual {EMF_MIN_V:g} to {EMF_MAX_V:g} V; check "
            "the units"
        )
        return found  # The torque, and with it the judgement of the inertia, follows from psi_vs.
    return found + _inertia_warning(motor)
