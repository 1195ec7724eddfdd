# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The usual mistakes between a data sheet and a motor file, by what they do to the numbers.

A motor file alone cannot show most of them: machines differ by more than the mistakes do. `[datasheet]` repeats what
the maker states, in the maker's terms. Each rule works out what the file would have to say, and takes the ratio q of
what it says to that. Tolerances of makers keep q within `AGREE`; every mistake is a number of its own beyond that:

- Two windings of a star lie in series between two terminals, R_terminal = 2 R. In delta one winding lies beside the two
  others, R_terminal = 2/3 R_winding, and the equivalent star has R_winding / 3: again half. The same holds for
  inductance. So q = 2: the terminal value was taken; q = 3: that of a winding in delta; q = 1/2: halved twice.
- psi is the peak EMF of a phase over the *electrical* speed p Omega. Over the mechanical speed it is p psi: q = p.
- The mean torque of three sinusoidal currents of amplitude I along the EMF is 3/2 p psi I. So Kt taken for psi is
  q = 3/2 p per peak ampere, sqrt 2 times that per rms ampere, and the mean line EMF over a sector, 3 sqrt 3/pi p, per
  DC ampere of six-step.
- The peak line EMF is sqrt 3 psi p Omega: q = sqrt 3 for line, 1/sqrt 2 for rms, sqrt(3/2) for both. Poles taken for
  pole pairs give q = 1/2.
- Units of inertia are powers of ten apart: 1 g cm^2 = 1e-7, 1 kg cm^2 = 1e-4 kg m^2. q = 10^k: a slip of the point. A
  load makes q larger than 1 by any number, nothing makes it smaller.
- The mechanical time constant J R/Kt^2 and the electrical one L/R follow from values that the rules above judge; they
  show a mistake where a sheet states nothing else. Makers differ in what they call R and Kt there by a factor of up to
  3 (`TIME_AGREE`), less than a decade of J.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from fluxlock.config.constants import CURRENT_KINDS, EMF_KINDS, emf_factors, torque_factors
from fluxlock.config.motor import RPM_PER_RAD_S, Motor
from fluxlock.config.stated import DataSheet

AGREE = 1.15  # ratio of two figures of one sheet for the same thing: tolerances are 5 to 10 %
WARM = 1.35  # resistance: copper that is 80 K warmer has 1.31 times as much
TORQUE_AGREE = 1.3  # friction, saturation and a rated point at another speed
LAG_AGREE = 1.5  # electrical time constant: L at 1 kHz or at DC
TIME_AGREE = 3.0  # mechanical time constant
SAME = 1.04  # a ratio this close to that of a mistake is the mistake
EMF_SHARE = (0.25, AGREE)  # line EMF at the highest speed over the supply, without weakening


def _off(ratio: float, agree: float) -> bool:
    return not 1 / agree <= ratio <= agree


def _named(ratio: float, known: dict[str, float]) -> str:
    """Mistakes that give a ratio, or none."""
    found = [text for text, value in known.items() if 1 / SAME <= ratio / value <= SAME]
    return f": {' or '.join(found)}" if found else ""


def _pairs(motor: Motor, sheet: DataSheet) -> int:
    """Pole pairs by the sheet, else by the file."""
    return motor.pole_pairs if sheet.poles is None else max(1, sheet.poles // 2)


def _poles(motor: Motor, sheet: DataSheet) -> Iterator[str]:
    if sheet.poles is not None and 2 * motor.pole_pairs != sheet.poles:
        taken = ": these are the poles" if motor.pole_pairs == sheet.poles else ""
        yield f"pole_pairs: {motor.pole_pairs}, datasheet.poles {sheet.poles} are {sheet.poles / 2:g} pairs{taken}"


def _windings(motor: Motor, sheet: DataSheet) -> Iterator[str]:
    """Resistance and inductance of a phase against half the value between two terminals."""
    inductances = sorted((motor.inductance_h[0], motor.inductance_q_h)) if motor.inductance_q_h else []
    mean_ohm, mean_h = sum(motor.resistance_ohm) / 3, motor.mean_inductance_h
    for key, value, stated, agree, unit in (
        ("resistance_ohm", mean_ohm, sheet.terminal_resistance_ohm, WARM, "Ohm"),
        ("inductance_h", mean_h, sheet.terminal_inductance_h, AGREE, "H"),
    ):
        if stated is None or not _off(2 * value / stated, agree):
            continue
        if key == "inductance_h" and inductances and inductances[0] <= stated / 2 <= inductances[1]:
            continue
        known = {
            "the value between two terminals": 2.0,
            "that of a winding in delta": 3.0,
            "halved twice": 0.5,
        }
        ratio = 2 * value / stated
        yield (
            f"{key}: {value:.4g} {unit} is {ratio:.3g} times half of the terminals' {stated:.4g} {unit}"
            f"{_named(ratio, known)}"
        )


def _stated_flux(motor: Motor, sheet: DataSheet) -> Iterator[tuple[str, float]]:
    """Keys of the sheet and the flux in V s/rad that each says."""
    pairs = _pairs(motor, sheet)
    emf, torque = (of(motor.emf, motor.flat_top_deg) for of in (emf_factors, torque_factors))
    for kind in EMF_KINDS:
        key = kind.replace("-", "_")
        if kv := getattr(sheet, f"kv_{key}_rpm_per_v", None):
            yield f"kv_{key}_rpm_per_v", RPM_PER_RAD_S / (pairs * emf[kind] * kv)
        if ke := getattr(sheet, f"ke_{key}_v_per_krpm", None):
            yield f"ke_{key}_v_per_krpm", ke * RPM_PER_RAD_S / 1e3 / (pairs * emf[kind])
    for kind in CURRENT_KINDS:
        if kt := getattr(sheet, f"kt_{kind}_nm_per_a", None):
            yield f"kt_{kind}_nm_per_a", kt / (pairs * torque[kind])
    if sheet.voltage_v and sheet.no_load_speed_rpm:
        ohm = sheet.terminal_resistance_ohm or 2 * sum(motor.resistance_ohm) / 3
        emf_v = sheet.voltage_v - ohm * sheet.no_load_current_a
        yield "no_load_speed_rpm", emf_v * RPM_PER_RAD_S / (sheet.no_load_speed_rpm * pairs * emf["dc"])


def _flux(motor: Motor, sheet: DataSheet) -> Iterator[str]:
    pairs, psi = _pairs(motor, sheet), sum(motor.psi_vs) / 3
    torque = torque_factors(motor.emf, motor.flat_top_deg)
    known = {
        f"per mechanical rad/s ({pairs} pole pairs)": float(pairs),
        "Kt per peak ampere": torque["peak"] * pairs,
        "Kt per rms ampere": torque["rms"] * pairs,
        "Kt per DC ampere": torque["dc"] * pairs,
        "of the line": math.sqrt(3.0),
        "rms": math.sqrt(0.5),
        "rms of the line": math.sqrt(1.5),
        "of poles in place of pole pairs": 0.5,
    }
    for key, stated in _stated_flux(motor, sheet):
        if _off(psi / stated, AGREE):
            ratio = psi / stated
            yield (
                f"psi_vs: {psi:.4g} V*s/rad is {ratio:.3g} times what datasheet.{key} gives, {stated:.4g}"
                f"{_named(ratio, known)}"
            )
            return


def _current(motor: Motor, sheet: DataSheet) -> Iterator[str]:
    """Rated current against the rated torque, where nothing else is wrong with the flux."""
    if sheet.rated_torque_nm is None:
        return
    ratio = motor.rated_torque_nm / sheet.rated_torque_nm
    if _off(ratio, TORQUE_AGREE):
        known = {"rms for peak": math.sqrt(0.5), "peak taken for rms": math.sqrt(2.0)}
        yield (
            f"rated_current_a, psi_vs: together they make {motor.rated_torque_nm:.4g} N*m, {ratio:.3g} times "
            f"datasheet.rated_torque_nm{_named(ratio, known)}"
        )


def _supply(motor: Motor, sheet: DataSheet) -> Iterator[str]:
    """EMF at the highest speed against the supply: above it no machine turns without weakening its field."""
    if sheet.voltage_v is None or motor.inductance_q_h is not None:
        return
    emf_v = motor.line_flux_vs * motor.omega_e(motor.max_speed_rpm)
    if not EMF_SHARE[0] <= emf_v / sheet.voltage_v <= EMF_SHARE[1]:
        yield (
            f"psi_vs, pole_pairs, max_speed_rpm: the line EMF at the highest speed is {emf_v:.3g} V, "
            f"datasheet.voltage_v {sheet.voltage_v:g} V"
        )


def _inertia(motor: Motor, sheet: DataSheet) -> Iterator[str]:
    if sheet.rotor_inertia_gcm2 is None:
        return
    ratio = motor.inertia_kgm2 / (1e-7 * sheet.rotor_inertia_gcm2)
    decade = round(math.log10(ratio))
    slip = decade != 0 and 1 / SAME <= ratio / 10.0**decade <= SAME
    if slip or ratio < 1 / AGREE:
        why = f": off by 10^{decade}, 1 g*cm^2 is 1e-7 kg*m^2" if slip else ": a load only adds"
        yield f"inertia_kgm2: {motor.inertia_kgm2:.4g} kg*m^2 is {ratio:.3g} times datasheet.rotor_inertia_gcm2{why}"


def _time_constants(motor: Motor, sheet: DataSheet) -> Iterator[str]:
    ohm, per_amp = sum(motor.resistance_ohm) / 3, motor.torque_per_amp_nm
    found = (
        ("inductance_h, resistance_ohm", "electrical", motor.mean_inductance_h / ohm, LAG_AGREE),
        ("inertia_kgm2, resistance_ohm, psi_vs", "mechanical", 2 * ohm * motor.inertia_kgm2 / per_amp**2, TIME_AGREE),
    )
    for keys, kind, value, agree in found:
        stated = getattr(sheet, f"{kind}_time_constant_s")
        if stated and _off(value / stated, agree):
            yield (
                f"{keys}: {kind} time constant {value:.3g} s, {value / stated:.3g} times "
                f"datasheet.{kind}_time_constant_s"
            )


def mistakes(motor: Motor) -> list[str]:
    """What the file and its `[datasheet]` say differently: keys, ratio, and the mistake that gives it.

    Later rules rest on what the earlier ones judge, so each pair of rules speaks once.
    """
    sheet = motor.datasheet
    if sheet is None:
        return []
    direct = [*_poles(motor, sheet), *_windings(motor, sheet), *_flux(motor, sheet), *_inertia(motor, sheet)]
    if direct:
        return direct
    return [*_current(motor, sheet), *_supply(motor, sheet), *_time_constants(motor, sheet)]
