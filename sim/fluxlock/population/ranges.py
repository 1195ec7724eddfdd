# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The ranges that machines are drawn from, as `ranges.toml` states them."""

from __future__ import annotations

import functools
import tomllib
from pathlib import Path

from pydantic import BaseModel, ConfigDict

PATH = Path(__file__).with_name("ranges.toml")
Span = tuple[float, float]


class Table(BaseModel):
    """Part of a ranges file: no key that is not known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class FileError(Table):
    """How far a motor file is off, as shares."""

    resistance: float
    inductance: float
    flux: float
    inertia: float


class Ranges(Table):
    """Least and most of each quantity; per unit of EMF, rated current and frequency at base speed."""

    power_w: Span
    supply_v: Span
    pole_pairs: tuple[int, int]
    base_hz: Span
    carriers_per_sector_min: float
    resistance_pu: Span
    inductance_pu: Span
    emf: tuple[str, ...]
    saliency: Span
    phases_unequal: float
    run_up_s: Span
    file_error: FileError


@functools.cache
def ranges() -> Ranges:
    """Of the file."""
    return Ranges.model_validate(tomllib.loads(PATH.read_text(encoding="utf-8")))
