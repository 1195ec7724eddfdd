# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's C types and functions in Python, from its own headers.

    >>> from fluxlock.firmware.binding import new, open_library
    >>> ramp = new("ramp_t", value_rpm_q8=256_000)
    >>> open_library().ramp_step(ramp, 512_000, 1000, 1000, 0)  # doctest: +SKIP

How values pass: `new` gives a pointer, which C functions take as it is. A struct by value is a field of another struct,
`pointer[0]`, or a tuple in the order of its fields. Arrays may be lists. Integers out of range raise OverflowError. A
struct that is a field lives as long as the one around it: keep that one.
"""

from __future__ import annotations

import threading
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fluxlock.firmware.toolchain import SW, build_host_library, host_headers
from fluxlock.headers import CData, bind

Number = TypeVar("Number", bound=np.number)
_BINDING = threading.Lock()


def types() -> CData:
    """Type table of all headers of the firmware's host library, one a process: another would not know its types."""
    with _BINDING:
        return _types()


@cache
def _types() -> CData:
    return bind(host_headers(), SW)


@cache
def open_library(path: Path | None = None) -> CData:
    """Functions and enum constants of a library of the firmware, default the host library. It stays loaded."""
    return types().dlopen(str(path or build_host_library()))


def new(kind: str, *values: object, **fields: object) -> CData:
    """A C object of a type, zeroed but for its first values or for some fields; returns the pointer to it.

    kind: `ramp_t`, or `int32_t[6]` for an array, whose values come one by one.
    """
    table = types()
    whole = kind if kind.endswith("]") else f"{kind} *"
    made = table.new(whole, values) if values else table.new(whole)
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def address(value: CData) -> CData:
    """Pointer to a struct that is a field of another, or that a function returned."""
    return types().addressof(value)


@cache
def names(enum: str) -> tuple[str, ...]:
    """Names of the constants of a C enum that counts from 0: in small letters, without their common prefix."""
    elements: dict[int, str] = types().typeof(enum).elements
    found = [elements[number] for number in range(len(elements))]
    prefix = found[0].split("_")[0] + "_"
    return tuple(name.removeprefix(prefix).lower() for name in found)


@cache
def constant(prefix: str, name: str) -> int:
    """Value of a C constant: `SEQUENCE`, `held-tian` of SEQUENCE_HELD_TIAN."""
    return int(getattr(open_library(), f"{prefix}_{name}".replace("-", "_").upper()))


def view(pointer: CData, count: int, kind: type[Number]) -> NDArray[Number]:
    """`count` elements of C memory as an array that shares it."""
    return np.frombuffer(types().buffer(pointer, count * np.dtype(kind).itemsize), kind)
