# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Type of the kernel's arrays: anything indexed by int (numpy array, memoryview, C pointer)."""

from __future__ import annotations

from typing import Any, Protocol, cast


class Vector(Protocol):
    """Array of float64."""

    def __getitem__(self, index: int, /) -> float: ...

    def __setitem__(self, index: int, value: float, /) -> None: ...


class IntVector(Protocol):
    """Array of int32."""

    def __getitem__(self, index: int, /) -> int: ...

    def __setitem__(self, index: int, value: int, /) -> None: ...


def view_of(array: Any) -> Vector:  # noqa: ANN401 - a numpy array
    """The same float64 memory with plain floats as elements: several times faster than numpy scalars."""
    return cast(Vector, memoryview(array))


def int_view_of(array: Any) -> IntVector:  # noqa: ANN401 - a numpy array
    """The same int32 memory with plain ints as elements."""
    return cast(IntVector, memoryview(array))
