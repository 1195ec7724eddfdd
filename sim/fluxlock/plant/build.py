# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Makes the kernel callable: compiled by numba, or the same source as plain Python behind a ctypes callback.

Rules of kernel code (`circuit`, `edge`, `emf`, `encoder`, `events`, `flux`, `kernel`, `mechanics`, `record`, `sensing`,
`series`), which make both give the same bits: only `math.*` functions, no `**`, no min and max, no exceptions and no
division by what may be zero, state only through `s[i]`, integer products masked before they are used. The functions
carry no decorator: they are cloned with the clones of their callees as globals, which are compiled where asked for.

A `Variant` gives the globals PHASES and FIELD of the clones their values. To the compiler they are constants: a
three-phase machine of constant inductances pays nothing for what other machines need.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import os
import types
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from fluxlock.base.paths import BUILD

from . import circuit, edge, emf, encoder, events, flux, kernel, mechanics, record, sensing, series
from . import layout as L
from .vector import int_view_of, view_of

Mode = Literal["jit", "py"]
ENVIRONMENT = "FLUXLOCK_PLANT"
MODULES = (flux, emf, series, circuit, events, mechanics, encoder, edge, sensing, record, kernel)

CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int32,
    ctypes.c_int64,
    ctypes.c_int32,
    ctypes.c_int32,
    ctypes.POINTER(ctypes.c_double),
    ctypes.POINTER(ctypes.c_int32),
)


@dataclass(frozen=True)
class Variant:
    """Kernel for a number of phases; field: for a machine by its flux linkages."""

    phases: int = 3
    field: bool = False

    @property
    def constants(self) -> dict[str, int | bool]:
        """Values of the modules' globals."""
        return {"PHASES": self.phases, "FIELD": self.field}

    @property
    def suffix(self) -> str:
        """Of the clones' names: code from two caches in one process is told apart by name alone."""
        return f"_{self.phases}{'_field' if self.field else ''}"


@dataclass
class Kernel:
    """A callable kernel: `call` from Python, `address` for native code; `error`: exception of mode "py"."""

    call: Callable[[int, int, int], int]
    address: int
    keep: object
    error: BaseException | None = None


def chosen_mode(mode: str | None) -> Mode:
    """The mode asked for, else that of the environment variable FLUXLOCK_PLANT, else "jit"."""
    name = mode or os.environ.get(ENVIRONMENT) or "jit"
    if name == "jit":
        return "jit"
    if name == "py":
        return "py"
    raise ValueError(f"plant mode {name!r} (argument mode or {ENVIRONMENT}): must be 'jit' or 'py'")


def cache_folder() -> Path:
    """Folder of compiled code, keyed by all sources: numba itself misses a change in another file."""
    digest = hashlib.sha256()
    for path in (Path(__file__), *(Path(str(module.__file__)) for module in (L, *MODULES))):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return BUILD / "plant" / digest.hexdigest()[:16]


def clones(variant: Variant, wrap: Callable[[types.FunctionType], Any]) -> dict[Callable[..., Any], Any]:
    """All kernel functions and their wrapped clones, which call each other."""
    done: dict[Callable[..., Any], Any] = {}
    clone: types.FunctionType
    for module in MODULES:
        names = dict(vars(module))
        constants = {k: v for k, v in variant.constants.items() if k in names}
        names.update(constants)
        for name, value in vars(module).items():
            if isinstance(value, types.FunctionType):
                if value.__module__ == module.__name__:
                    # A function made from another one's code differs in a global; its name keys the cache.
                    own = {k: v for k, v in value.__globals__.items() if vars(module).get(k) is not v}
                    scope = {**names, **own} if own else names
                    clone = types.FunctionType(value.__code__, scope, name, value.__defaults__)
                    clone.__module__ = module.__name__
                    clone.__qualname__ = name + variant.suffix
                    done[value] = wrap(clone)
                names[name] = done[value]
    return done


@lru_cache(maxsize=4)
def interpreted(variant: Variant) -> dict[Callable[..., Any], Any]:
    """The kernel functions of a variant as plain Python."""
    return clones(variant, lambda clone: clone)


def is_compiled(variant: Variant) -> bool:
    """Whether a kernel stands in the cache, or is not compiled at all here."""
    name = kernel.take_event.__name__ + variant.suffix
    return chosen_mode(None) == "py" or any(cache_folder().glob(f"*/kernel.{name}-*.nbi"))


@lru_cache(maxsize=4)
def compiled(variant: Variant) -> Any:  # noqa: ANN401 - numba has no types
    """The kernel as a numba cfunc, from the cache if possible."""
    # Loaded by name: numba's type stubs do not cover what is used here.
    numba: Any = importlib.import_module("numba")
    nt: Any = importlib.import_module("numba.types")
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        options = {"cache": True, "fastmath": False, "error_model": "numpy"}
        inner = numba.njit(**options)
        # Compiled as what native code calls itself: a function around it would have it in a closure, whose hash is
        # another one in each process, and would be compiled in each.
        functions = clones(
            variant, lambda clone: clone if clone.__name__ == kernel.take_event.__name__ else inner(clone)
        )
        signature = nt.int32(nt.int64, nt.int32, nt.int32, nt.CPointer(nt.double), nt.CPointer(nt.int32))
        return numba.cfunc(signature, **options)(functions[kernel.take_event])
    finally:
        numba.config.CACHE_DIR = before


def make_kernel(mode: Mode, variant: Variant, state: Any, io: Any) -> Kernel:  # noqa: ANN401 - numpy arrays
    """Bind the kernel to one plant's arrays."""
    if mode == "jit":
        function = compiled(variant)
        native = CALLBACK(function.address)
        s_pointer = state.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        io_pointer = io.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))

        def call_native(t_cycle: int, gates: int, flags: int) -> int:
            return int(native(t_cycle, gates, flags, s_pointer, io_pointer))

        return Kernel(call_native, int(function.address), (function, native, state, io))

    s_view = view_of(state)
    io_view = int_view_of(io)
    take_event = interpreted(variant)[kernel.take_event]

    def call(t_cycle: int, gates: int, flags: int) -> int:
        try:
            return int(take_event(t_cycle, gates, flags, s_view, io_view))
        except Exception as error:  # ctypes would print it and return garbage
            result.error = error
            return L.FAULT_EXCEPTION

    callback = CALLBACK(lambda t_cycle, gates, flags, _s, _io: call(t_cycle, gates, flags))
    address = ctypes.cast(callback, ctypes.c_void_p).value
    assert address is not None
    result = Kernel(call, address, callback)
    return result
