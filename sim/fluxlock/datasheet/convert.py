# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The motor file that follows from the values of a data sheet; what contradicts itself is refused by name."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from fluxlock.config import ConfigError, Problem
from fluxlock.config.constants import CURRENT_KINDS, EMF_KINDS, emf_factors, torque_factors
from fluxlock.config.mistakes import AGREE
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.datasheet.entries import BY_OPTION, Value

SAME = 1.05  # a ratio within this says that another kind was meant
USUAL_RUN_UP_S = 0.1  # at rated torque to the highest speed: stands in for an inertia that the sheet does not state
# Option, key of [datasheet] with its kind, and how many of the key's unit make one of the option's.
STATED = (
    ("poles", "poles", 1.0),
    ("resistance", "terminal_resistance_ohm", 1.0),
    ("inductance", "terminal_inductance_h", 1.0),
    ("kv", "kv_{}_rpm_per_v", 1.0),
    ("ke", "ke_{}_v_per_krpm", 1e3),
    ("kt", "kt_{}_nm_per_a", 1.0),
    ("rated-torque", "rated_torque_nm", 1.0),
    ("voltage", "voltage_v", 1.0),
    ("no-load-speed", "no_load_speed_rpm", 1.0),
    ("no-load-current", "no_load_current_a", 1.0),
    ("inertia", "rotor_inertia_gcm2", 1e7),
    ("electrical-time-constant", "electrical_time_constant_s", 1.0),
    ("mechanical-time-constant", "mechanical_time_constant_s", 1.0),
)
SPEED_OVER_NO_LOAD = 1.1  # weakening aside, nothing turns faster than without load


@dataclass(frozen=True)
class Claim:
    """What one value of the sheet says about psi, V s/rad. others: the same for the kinds that it does not state."""

    value: Value
    psi_vs: float
    others: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The value as the sheet's reader wrote it."""
        kind = f" ({self.value.kind})" if self.value.kind and self.value.kind not in self.value.text else ""
        return f"--{self.value.entry.option} {self.value.text}{kind}"


@dataclass(frozen=True)
class Sheet:
    """Values of one data sheet; each may be missing. winding: star or delta, for values of the kind phase.

    source: maker, type, document. notes: sentences for the head of the file, such as what is estimated and how.
    """

    name: str
    values: Mapping[str, Value]
    emf: str = "sinusoidal"
    winding: str = "star"
    source: str = ""
    notes: tuple[str, ...] = ()

    def number(self, option: str) -> float | None:
        """A value's number in its entry's unit; None where the sheet has none."""
        value = self.values.get(option)
        return None if value is None else value.number

    @property
    def pole_pairs(self) -> int:
        """From poles or pole pairs."""
        poles, pairs = self.number("poles"), self.number("pole-pairs")
        if poles is not None and (poles != int(poles) or int(poles) % 2):
            raise _problem("poles", f"{poles:g} must be an even number; pole pairs are --pole-pairs")
        if pairs is not None and pairs != int(pairs):
            raise _problem("pole-pairs", f"{pairs:g} must be a whole number")
        if poles is not None and pairs is not None and poles != 2 * pairs:
            raise _problem("poles", f"{poles:g} poles are {poles / 2:g} pole pairs, --pole-pairs says {pairs:g}")
        if pairs is None and poles is None:
            raise _problem("pole-pairs", "is missing: state --poles or --pole-pairs")
        return int(pairs if pairs is not None else (poles or 0) / 2)

    def of_phase(self, option: str) -> tuple[float, str]:
        """Resistance or inductance of a phase of the equivalent star, and how it was found."""
        value = self.values[option]
        unit = value.entry.unit.replace("ohm", "Ohm")
        if value.kind == "line":
            return value.number / 2, f"half of {value.number:.4g} {unit} between two terminals, in star or delta"
        if self.winding == "delta":
            return value.number / 3, f"a third of {value.number:.4g} {unit} of a winding in delta"
        return value.number, "of a phase"

    def emf_scale(self, kind: str) -> float:
        """Star equivalent over the sheet's EMF of a kind: a winding in delta has the line's EMF."""
        return 1 / math.sqrt(3.0) if self.winding == "delta" and kind.startswith("phase") else 1.0

    def claims(self) -> list[Claim]:
        """What each constant says about psi, the most direct first."""
        emf, torque, pairs = emf_factors(self.emf), torque_factors(self.emf), self.pole_pairs
        found = []
        if ke := self.values.get("ke"):
            each = {k: ke.number * RPM_PER_RAD_S / (pairs * emf[k]) * self.emf_scale(k) for k in EMF_KINDS}
            found.append(Claim(ke, each[ke.kind], each))
        if kv := self.values.get("kv"):
            each = {kind: RPM_PER_RAD_S / (pairs * kv.number * emf[kind]) for kind in EMF_KINDS[:3]}
            found.append(Claim(kv, each[kv.kind], each))
        if kt := self.values.get("kt"):
            each = {kind: kt.number / (pairs * torque[kind]) for kind in CURRENT_KINDS}
            found.append(Claim(kt, each[kt.kind], each))
        speed, voltage = self.number("no-load-speed"), self.number("voltage")
        if speed and voltage:
            current = self.number("no-load-current") or 0.0
            drop = 2 * current * self.of_phase("resistance")[0] if "resistance" in self.values else 0.0
            if drop >= voltage:
                raise _problem("no-load-current", f"drops {drop:.3g} V over the resistance, all of {voltage:g} V")
            found.append(
                Claim(self.values["no-load-speed"], (voltage - drop) * RPM_PER_RAD_S / (speed * pairs * emf["dc"]))
            )
        if (rated := self.values.get("rated-torque")) and "rated-current" in self.values and "kt" not in self.values:
            amplitude = self.amplitude("rated-current")[0]
            found.append(Claim(rated, rated.number / (pairs * torque["peak"] * amplitude)))
        return found

    def amplitude(self, option: str) -> tuple[float, str]:
        """Peak of sinusoidal phase currents with the torque of a current of the sheet, and how it was found."""
        value, torque = self.values[option], torque_factors(self.emf)
        ratio = torque[value.kind] / torque["peak"]
        if value.kind == "peak":
            return value.number, "peak of a phase"
        return value.number * ratio, f"{ratio:.4g} times {value.number:.4g} A {value.kind}"


def _problem(option: str, message: str) -> ConfigError:
    return ConfigError([Problem(f"--{option}", "", message)])


def contradictions(claims: list[Claim]) -> list[Problem]:
    """Pairs of values that say different things about the same constant, with the kind that would agree."""
    found = []
    for one, other in itertools.combinations(claims, 2):
        ratio = max(one.psi_vs, other.psi_vs) / min(one.psi_vs, other.psi_vs)
        if ratio <= AGREE:
            continue
        agreeing = [
            f"--{claim.value.entry.option} as {kind} would agree"
            for claim, against in ((one, other), (other, one))
            for kind, psi in claim.others.items()
            if 1 / SAME <= psi / against.psi_vs <= SAME
        ]
        hint = "; ".join(agreeing) or "check units, kinds and pole pairs"
        text = (
            f"gives a flux of {one.psi_vs:.4g} V*s/rad, {other.name} one of {other.psi_vs:.4g}: they differ by a "
            f"factor of {ratio:.3g}; {hint}"
        )
        found.append(Problem(one.name, "", text))
    return found


def missing(values: Mapping[str, Value]) -> list[str]:
    """Options without which no file can be made, each with what it may be replaced by."""
    needed = [
        (("poles", "pole-pairs"), ""),
        (("ke", "kv", "kt", "no-load-speed"), ""),
        (("resistance",), ""),
        (("inductance",), ", measured between two terminals if the sheet has none"),
        (("rated-current",), ""),
        (("max-speed", "no-load-speed"), ""),
    ]
    return [
        f"{' or '.join(f'--{option}' for option in options)}{remedy}"
        for options, remedy in needed
        if not any(option in values for option in options)
    ] + (["--voltage beside --no-load-speed"] if "no-load-speed" in values and "voltage" not in values else [])


def _line(key: str, value: float, comment: str, digits: int = 4) -> str:
    return f"{key} = {float(f'{value:.{digits}g}')!r}  # {comment}"


def motor_text(sheet: Sheet) -> str:
    """Text of the motor file, each conversion in a comment. Raises ConfigError with all that lacks or disagrees."""
    if lacking := missing(sheet.values):
        raise ConfigError([Problem("motor new", "", f"missing: {item}") for item in lacking])
    claims = sheet.claims()
    problems = contradictions(claims)
    best = claims[0]
    speed, why = sheet.number("max-speed"), "stated"
    top = sheet.number("no-load-speed")
    if speed is None:
        speed, why = top or 0.0, "the speed without load"
    elif top is not None and speed > SPEED_OVER_NO_LOAD * top:
        problems.append(
            Problem(
                "--max-speed", "", f"{speed:g} r/min is above the speed without load, --no-load-speed {top:g} r/min"
            )
        )
    emf_v = speed * sheet.pole_pairs * best.psi_vs * emf_factors(sheet.emf)["dc"] / RPM_PER_RAD_S
    voltage = sheet.values.get("voltage")
    if voltage and emf_v > SPEED_OVER_NO_LOAD * voltage.number:
        text = (
            f"{voltage.text} is below the line EMF at the highest speed, {emf_v:.4g} V; check {best.name} and the speed"
        )
        problems.append(Problem("--voltage", "", text))
    current, how = sheet.amplitude("rated-current")
    torque = sheet.pole_pairs * best.psi_vs * torque_factors(sheet.emf)["peak"] * current
    rated = sheet.values.get("rated-torque")
    if rated and "kt" in sheet.values and not 1 / AGREE <= rated.number / torque <= AGREE:
        problems.append(
            Problem(
                f"--rated-torque {rated.text}",
                "",
                f"is {rated.number / torque:.3g} times what the rated current makes, {torque:.4g} N*m; check the kind "
                "of --rated-current",
            )
        )
    if "peak-current" in sheet.values and sheet.amplitude("peak-current")[0] < current:
        problems.append(Problem("--peak-current", "", f"{sheet.values['peak-current'].text} is below --rated-current"))
    if problems:
        raise ConfigError(problems)
    return "\n".join(_lines(sheet, best, (speed, why), (current, how), torque)) + "\n"


def _lines(sheet: Sheet, best: Claim, top: tuple[float, str], rated: tuple[float, str], torque_nm: float) -> list[str]:
    """The file, line by line. torque_nm: at the rated current."""
    resistance, inductance = sheet.of_phase("resistance"), sheet.of_phase("inductance")
    inertia, taken = sheet.number("inertia"), "stated, of the rotor alone if the sheet does not say otherwise"
    if inertia is None:
        inertia = USUAL_RUN_UP_S * torque_nm * RPM_PER_RAD_S / top[0]
        taken = f"GUESSED: rated torque reaches the highest speed in {USUAL_RUN_UP_S:g} s"
    poles = sheet.values.get("poles")
    lines = [
        *(f"# {' '.join(note.split())}" for note in sheet.notes),
        f"name = {_quoted(sheet.name)}",
        f"pole_pairs = {sheet.pole_pairs}" + (f"  # half of {poles.number:g} poles" if poles else ""),
        _line("resistance_ohm", *resistance),
        _line("inductance_h", *inductance),
    ]
    if "inductance-q" in sheet.values:
        lines.append(_line("inductance_q_h", *sheet.of_phase("inductance-q")))
    lines += [
        _line("psi_vs", best.psi_vs, f"from {best.name}"),
        f'emf = "{sheet.emf}"',
        _line("inertia_kgm2", inertia, taken),
        _line("rated_current_a", *rated),
        f"max_speed_rpm = {top[0]:g}  # {top[1]}",
    ]
    if "peak-current" in sheet.values:
        peak = sheet.amplitude("peak-current")
        lines.insert(-1, f"# peak current {peak[0]:.4g} A, {peak[1]}: highest `drive.current_limit_a` of a scenario")
    if current := sheet.number("no-load-current"):
        speed = sheet.number("no-load-speed") or top[0]
        loss = sheet.pole_pairs * best.psi_vs * emf_factors(sheet.emf)["dc"] * current
        lines += [
            "",
            "[load]  # of the motor itself, half and half; add what its shaft drives",
            _line("coulomb_nm", loss / 2, f"half of the torque of {current:g} A without load, {loss:.3g} N*m"),
            _line("viscous_nm_s_per_rad", loss / 2 * RPM_PER_RAD_S / speed, f"the other half, at {speed:g} r/min"),
        ]
    return lines + _datasheet(sheet)


def _datasheet(sheet: Sheet) -> list[str]:
    """Table of what the sheet states, which `motor check` compares with the keys above."""
    stated: dict[str, str] = {}
    if sheet.source:
        stated["source"] = _quoted(sheet.source)
    for option, key, factor in STATED:
        value = sheet.values.get(option)
        if value is None or (value.kind == "phase" and option in ("resistance", "inductance")):
            continue
        if option in ("ke", "kv") and value.kind.startswith("phase") and sheet.winding == "delta":
            continue
        number = float(f"{factor * value.number:.6g}")
        stated[key.format(value.kind.replace("-", "_"))] = f"{number:g}" if option == "poles" else repr(number)
    return [
        "",
        "[datasheet]  # what the sheet states; `motor check` compares",
        *(f"{k} = {v}" for k, v in stated.items()),
    ]


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def question_of(option: str) -> str:
    """What to ask for a value, with an example."""
    entry = BY_OPTION[option]
    return f"{entry.question} ({entry.hint}; nothing if the sheet has none)"
