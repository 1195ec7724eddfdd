# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a data sheet states: each value with its unit and, where makers differ, with its kind."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from fluxlock.config import ConfigError, Problem
from fluxlock.config.constants import CURRENT_KINDS, EMF_KINDS
from fluxlock.config.errors import did_you_mean

if TYPE_CHECKING:
    from pint import UnitRegistry

WINDING_KINDS = ("line", "phase")


@dataclass(frozen=True)
class Entry:
    """One value that a data sheet may have. unit: in which it is kept. bare: a number without unit is in it."""

    option: str
    question: str
    unit: str
    kinds: tuple[str, ...] = ()
    usual: str = ""  # kind of a value that states none; without it the kind must be said
    bare: bool = True
    example: str = ""
    positive: bool = True

    @property
    def hint(self) -> str:
        """How it is written, for help and messages."""
        usual = f", default {self.usual}" if self.usual else ""
        kinds = f" (kind: {', '.join(self.kinds)}{usual})" if self.kinds else ""
        return f'such as "{self.example}"{kinds}'


ENTRIES = (
    Entry("poles", "Magnet poles (twice the pole pairs)", "", example="14"),
    Entry("pole-pairs", "Pole pairs", "", example="7"),
    Entry("kv", "Kv: speed over voltage", "rpm/V", EMF_KINDS[:3], "dc", example="1000"),
    Entry("ke", "Ke: EMF over speed", "V/rpm", EMF_KINDS, bare=False, example="5.2 V/krpm line-rms"),
    Entry("kt", "Kt: torque over current", "N*m/A", CURRENT_KINDS, bare=False, example="0.05 Nm/A rms"),
    Entry("resistance", "Resistance", "ohm", WINDING_KINDS, "line", bare=False, example="0.12 ohm"),
    Entry("inductance", "Inductance", "H", WINDING_KINDS, "line", bare=False, example="60 uH"),
    Entry("inductance-q", "Inductance on the q axis, if it differs", "H", WINDING_KINDS, "line", False, "90 uH"),
    Entry("inertia", "Inertia of rotor and load", "kg*m^2", bare=False, example="48 gcm2"),
    Entry("rated-current", "Rated current", "A", CURRENT_KINDS, example="20 A dc"),
    Entry("peak-current", "Peak current, for seconds", "A", CURRENT_KINDS, example="40 A dc"),
    Entry("rated-torque", "Torque at rated current", "N*m", bare=False, example="0.19 Nm"),
    Entry("voltage", "Voltage of the DC link that no-load speed and current belong to", "V", example="14.8 V"),
    Entry("no-load-speed", "Speed without load at that voltage", "rpm", example="14500"),
    Entry("no-load-current", "DC current without load at that voltage", "A", example="0.9 A", positive=False),
    Entry("max-speed", "Highest speed", "rpm", example="12000"),
    Entry("electrical-time-constant", "Electrical time constant, L/R", "s", bare=False, example="0.5 ms"),
    Entry("mechanical-time-constant", "Mechanical time constant of the rotor", "s", bare=False, example="5 ms"),
)
BY_OPTION = {entry.option: entry for entry in ENTRIES}

# Spellings of data sheets that a unit library does not know; hyphens between letters have become products before.
SPELLINGS = (
    (r"\b(r/min|U/min|tr/min|min\^?-1|1/min|RPM)", "rpm"),
    (r"\b(k|1000 ?)rpm\b", "kilorpm"),
    (r"\bkRPM\b", "kilorpm"),
    (r"\bozf?[ *.]?in\b", "ozf*in"),
    (r"\b([mcµu]?)N[ .]?(c?m)\b", r"\1N*\2"),
    (r"\blbf?[ *.]?(in|ft)\b", r"lbf*\1"),
    (r"\b(k?g)[ .*]?([cm]?m)\^?2\b", r"\1*\2^2"),
    (r"\bs2\b", "s^2"),
    (r"\b(m?)[Oo]hms?\b", r"\1ohm"),
    (r"\b(m?)Vs\b", r"\1V*s"),
)
LETTERS = str.maketrans({"²": "^2", "·": "*", "×": "*", "⋅": "*", "Ω": "ohm", "μ": "µ"})
TOLERANCE = r"\s*(?:±|\+/-)\s*\d+(?:\.\d+)?\s*%"
GLUED = r"\b([AV])(rms|pk|peak|dc)\b"  # a kind at the unit, as in Arms
NUMBER = r"[+-]?(?:\d{1,3}(?: \d{3})+|\d+)?(?:\.\d*)?(?:[eE][+-]?\d+)?"
UNIT = r"[A-Za-zµ*/^ ().-][A-Za-zµ*/^ ()0-9.-]*"
LONGEST = 60


@dataclass(frozen=True)
class Value:
    """A value as stated: in the entry's unit, with its kind, and the text that it was read from."""

    entry: Entry
    number: float
    kind: str
    text: str


@cache
def _units() -> UnitRegistry[float]:
    import pint  # takes half a second

    return pint.UnitRegistry()


def _wrong(entry: Entry, text: str, message: str) -> ConfigError:
    shown = text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
    return ConfigError([Problem(f"--{entry.option}", "", f'"{shown}" {message}')])


def _quantity(entry: Entry, text: str) -> float:
    """A number with or without unit, in the entry's unit."""
    found = re.fullmatch(rf"({NUMBER})\s*({UNIT})?", text.translate(LETTERS)) if len(text) <= LONGEST else None
    if found is None or not re.search(r"\d", found[1]):
        comma = " with a decimal point" if re.match(r"\d+,\d", text) else ""
        raise _wrong(entry, text, f"is no value, write it{comma} {entry.hint}")
    number, unit = float(found[1].replace(" ", "")), (found[2] or "").strip()
    if not unit:
        if not entry.bare:
            raise _wrong(entry, text, f"has no unit, write {entry.hint}")
        return number
    unit = re.sub(r"(?<=[A-Za-z0-9])-(?=[A-Za-z])", "*", unit)
    for pattern, word in SPELLINGS:
        unit = re.sub(pattern, word, unit)
    # A whole turn a second and a radian a second are both 1/s to the library.
    powers = re.findall(r"\^-?\d+", unit)
    if not entry.unit or "Hz" in unit or "**" in unit or any(len(power) > 3 for power in powers):
        raise _wrong(entry, text, f"is not in {entry.unit or 'a plain number'}, write {entry.hint}")
    import pint

    try:
        return float(_units().Quantity(number, _units().parse_units(unit)).to(entry.unit).magnitude)
    except pint.UndefinedUnitError:
        raise _wrong(entry, text, f"has an unknown unit, write {entry.hint}") from None
    except pint.DimensionalityError:
        raise _wrong(entry, text, f"is not in {entry.unit}, write {entry.hint}") from None
    except Exception:  # the library raises what its parser meets
        raise _wrong(entry, text, f"is no value, write {entry.hint}") from None


def read_value(entry: Entry, text: str) -> Value:
    """A value as a person writes it: number, unit, kind. Raises ConfigError with what would be right."""
    stated = re.sub(TOLERANCE, "", text) if len(text) <= LONGEST else text
    glued = re.search(GLUED, stated)
    words = re.sub(GLUED, r"\1", stated).split()
    kind = ""
    if entry.kinds and words and re.fullmatch(r"[a-z]+(-[a-z]+)?", words[-1]) and len(words) > 1:
        last = words[-1]
        if last in entry.kinds:
            kind, words = last, words[:-1]
        elif did := did_you_mean(last, entry.kinds):
            raise _wrong(entry, last, f"is no kind, permitted: {', '.join(entry.kinds)}{did}")
    number = _quantity(entry, " ".join(words))
    if glued is not None:
        of_unit = "peak" if glued[2] == "pk" else glued[2]
        kind = kind or (of_unit if of_unit in entry.kinds else "")
        if entry.kinds and kind and not kind.endswith(of_unit):
            raise _wrong(entry, text, f"says {of_unit} at its unit and {kind} behind it")
    if not kind and entry.kinds:
        if not entry.usual:
            raise _wrong(entry, text, f"does not say its kind: add {' or '.join(entry.kinds)}")
        kind = entry.usual
    if not (number > 0.0 or (number == 0.0 and not entry.positive)) or number == float("inf"):
        raise _wrong(entry, text, f"must be {'above' if entry.positive else 'at least'} 0")
    return Value(entry, number, kind, text)
