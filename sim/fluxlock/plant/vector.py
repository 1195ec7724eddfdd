"""Type of the kernel's arrays: anything indexed by int (numpy array, memoryview, C pointer)."""

from __future__ import annotations

from typing import Protocol


class Vector(Protocol):
    """Array of float64."""

    def __getitem__(self, index: int, /) -> float: ...

    def __setitem__(self, index: int, value: float, /) -> None: ...


class IntVector(Protocol):
    """Array of int32."""

    def __getitem__(self, index: int, /) -> int: ...

    def __setitem__(self, index: int, value: int, /) -> None: ...
