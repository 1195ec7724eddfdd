# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""cocotb's handles where they would keep silent or say too little: a write, and a name that cocotb does not see."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NoReturn

from cocotb.handle import EnumObject, HierarchyObject, IntegerObject, LogicArrayObject, LogicObject, PackedObject

FORCED = "the plant drives the chip and its RTL drives the rest; force_pin gives an input a level"
UNSEEN = 'cocotb sees the pins of fl_soc, and what run_tests(..., signals=["fl_trip.*"]) names of the inside'

CLOCK = "clk_i"
NO_EDGES = "has no edges for cocotb: the simulator makes it in a loop of its own; await drive.run(seconds)"
EDGES = ("rising_edge", "falling_edge", "value_change")


def _with_edges(look: Callable[[Any], object]) -> Callable[[Any], object]:
    """An edge of a handle; of the chip's clock a TypeError, as a test would wait for ever."""

    def edge(handle: Any) -> object:  # noqa: ANN401  # of any kind
        if handle._name == CLOCK and handle._path.count(".") == 1:
            raise TypeError(f"{handle._path} {NO_EDGES}")
        return look(handle)

    return edge


def _refuse_clock() -> None:
    for name in EDGES:
        owner = next(kind for kind in LogicObject.__mro__ if name in vars(kind))
        edge = cached_property(_with_edges(vars(owner)[name].func))
        edge.__set_name__(LogicObject, name)
        setattr(LogicObject, name, edge)


def refuse_writes() -> None:
    """From now on, in this process: a write to a handle raises TypeError, an unknown name says what cocotb sees.

    An edge of the chip's clock raises TypeError too.

    A write would have no effect. For all handles, as those of bits and of the inside come into being when asked for.
    """
    look = HierarchyObject.__getattr__

    def refuse(handle: Any, *_: object) -> NoReturn:  # noqa: ANN401  # of any kind
        raise TypeError(f"{handle._path} can be read and awaited, not written: {FORCED}")

    def child(handle: HierarchyObject, name: str) -> object:
        try:
            return look(handle, name)
        except AttributeError as error:
            if name.startswith("_"):
                raise
            raise AttributeError(f"{error}; {UNSEEN}") from None

    _refuse_clock()
    for kind in (LogicObject, LogicArrayObject, PackedObject, IntegerObject, EnumObject):
        kind._set_value = refuse  # type: ignore[assignment,method-assign]  # cocotb has no hook
    HierarchyObject.__getattr__ = child  # type: ignore[assignment,method-assign]  # cocotb has no hook
