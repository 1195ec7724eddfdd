# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware's C types and functions in Python, read from its own headers.

The compiler preprocesses the headers, cffi reads the declarations, and the compiler confirms every size and offset that
cffi computed. Nothing of C is repeated by hand: a name that C no longer has fails by its name.

    >>> from fluxlock.firmware.binding import new, open_library
    >>> ramp = new("ramp_t", value_rpm_q8=256_000)
    >>> open_library().ramp_step(ramp, 512_000, 1000, 1000, 0)  # doctest: +SKIP

How values pass: `new` gives a pointer, which C functions take as it is. A struct by value is a field of another struct,
`pointer[0]`, or a tuple in the order of its fields. Arrays may be lists. Integers out of range raise OverflowError.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterable, Sequence
from contextlib import redirect_stdout
from functools import cache
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import cffi
import numpy as np
from numpy.typing import DTypeLike, NDArray

from fluxlock.firmware.toolchain import SW, FirmwareError, build_host_library, host_headers, run_host_compiler
from fluxlock.paths import BUILD, GENERATED, content_hash
from fluxlock.writable import file_lock

# Data, functions, libraries and type tables of C: a type checker knows none of their members.
CData: TypeAlias = Any

INLINE = re.compile(r"\bstatic inline [^;{]*\{")
# What cffi does not read; the compiler then checks what they ask for.
UNREAD = ("-D__attribute__(x)=", "-D_Static_assert(...)=")
MARK = re.compile(r'# \d+ "([^"]*)"')


def _own(text: str, folders: Sequence[Path]) -> str:
    """Preprocessed text without the lines of system headers; line marks stay."""
    lines, keep = [], False
    for line in text.splitlines():
        if mark := MARK.match(line):
            keep = any(Path(mark[1]).is_relative_to(folder) for folder in folders)
            lines.append(mark[0])
        else:
            lines.append(line if keep else "")
    return "\n".join(lines)


def _without_bodies(text: str) -> str:
    """Text without inline functions, which no library exports; the number of lines stays."""
    while found := INLINE.search(text):
        depth, end = 1, found.end()
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        text = text[: found.start()] + "\n" * text.count("\n", found.start(), end) + text[end:]
    return text


def _claims(ffi: cffi.FFI) -> str:
    """C assertions of every size and offset that cffi has computed."""
    lines = ["#include <stddef.h>"]
    for name in ffi.list_types()[0]:
        kind = ffi.typeof(name)
        if kind.kind != "struct" or kind.fields is None:
            continue
        lines.append(f'_Static_assert(sizeof({name}) == {ffi.sizeof(kind)}, "{name}");')
        for field, place in kind.fields:
            claim = f"offsetof({name}, {field}) == {place.offset}"
            lines.append(f'_Static_assert({claim}, "{name}.{field}");')
    return "\n".join(lines)


def _name(module: Path) -> str:
    return module.stem.replace("-", "_")


def bind(headers: Iterable[Path], root: Path = SW, folder: Path | None = None) -> CData:
    """Type table (`ffi`) of C headers, cached by content hash. root: folder that their includes count from.

    FirmwareError names header and line of what the compiler or cffi cannot read.
    """
    headers = sorted(headers)
    folder = folder or BUILD / "firmware"
    key = content_hash([*headers, Path(__file__)], headers, root, version("cffi"))
    module = folder / f"binding-{key}.py"
    with file_lock(BUILD / ".firmware.lock"):
        if not module.exists():
            folder.mkdir(parents=True, exist_ok=True)
            _write(headers, root, module)
    spec = importlib.util.spec_from_file_location(_name(module), module)
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found.ffi


def _write(headers: Sequence[Path], root: Path, module: Path) -> None:
    with TemporaryDirectory() as name:
        source = Path(name) / "headers.c"
        includes = [f"-I{root}", f"-I{GENERATED}"]
        text = "".join(f'#include "{header}"\n' for header in headers)
        source.write_text(text)
        declared = run_host_compiler(["-E", *UNREAD, *includes, str(source)])
        declared = _without_bodies(_own(declared, (root, GENERATED, *(header.parent for header in headers))))
        ffi = cffi.FFI()
        try:
            ffi.cdef(declared)
        except (cffi.CDefError, cffi.FFIError, NotImplementedError) as error:
            raise FirmwareError(f"no binding of these headers: {error}") from error
        source.write_text(text + _claims(ffi))
        run_host_compiler(["-c", *includes, str(source), "-o", str(source.with_suffix(".o"))])
        ffi.set_source(_name(module), None)
        partial = module.with_suffix(".part")
        with redirect_stdout(StringIO()):  # cffi says what it writes
            ffi.emit_python_code(str(partial))
        partial.replace(module)


@cache
def types() -> CData:
    """Type table of all headers of the firmware's host library."""
    return bind(host_headers())


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


def names(enum: str) -> tuple[str, ...]:
    """Names of the constants of a C enum that counts from 0: in small letters, without their common prefix."""
    elements: dict[int, str] = types().typeof(enum).elements
    found = [elements[number] for number in range(len(elements))]
    prefix = found[0].split("_")[0] + "_"
    return tuple(name.removeprefix(prefix).lower() for name in found)


def constant(prefix: str, name: str) -> int:
    """Value of a C constant: `SEQUENCE`, `held-tian` of SEQUENCE_HELD_TIAN."""
    return int(getattr(open_library(), f"{prefix}_{name}".replace("-", "_").upper()))


def view(pointer: CData, count: int, dtype: DTypeLike) -> NDArray[Any]:
    """`count` elements of C memory as an array that shares it."""
    kind = np.dtype(dtype)
    return np.frombuffer(types().buffer(pointer, count * kind.itemsize), kind)
