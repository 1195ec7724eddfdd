# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""C headers read into Python: types and functions as the compiler has them.

The compiler preprocesses the headers, cffi reads the declarations, and the compiler confirms every size and offset that
cffi computed. Nothing of C is repeated by hand: a name that C no longer has fails by its name.
"""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from collections.abc import Iterable, Sequence
from contextlib import redirect_stdout
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from fluxlock.base.paths import BUILD, GENERATED, content_hash
from fluxlock.base.writable import file_lock

# Data, functions, libraries and type tables of C: a type checker knows none of their members.
CData: TypeAlias = Any

COMPILER = (sys.executable, "-m", "ziglang", "cc", "-std=c11", "-DFL_HOST=1")
# What cffi does not read; the compiler then checks the layout that they ask for.
UNREAD = ("-D__attribute__(x)=", "-D_Static_assert(...)=")
INLINE = re.compile(r"\bstatic inline [^;{]*\{")
MARK = re.compile(r'# \d+ "([^"]*)"')


class HeaderError(RuntimeError):
    """The compiler or cffi cannot read a header; names it and the line."""


def _compile(*arguments: str) -> str:
    done = subprocess.run([*COMPILER, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise HeaderError(done.stderr)
    return done.stdout


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


def _claims(ffi: CData) -> str:
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


def bind(headers: Iterable[Path], root: Path, folder: Path | None = None) -> CData:
    """Type table of C headers: `new`, `typeof`, `dlopen` and what else an FFI object of cffi has.

    root: folder that their includes count from. Cached by content hash in `folder`, for which `headers` must hold what
    they include.
    """
    headers = sorted(headers)
    folder = folder or BUILD / "bindings"
    module = folder / f"{content_hash([*headers, Path(__file__)], headers, root, version('cffi'))}.py"
    if not module.exists():
        folder.mkdir(parents=True, exist_ok=True)
        with file_lock(BUILD / ".bindings.lock"):
            if not module.exists():
                _write(headers, root, module)
    spec = importlib.util.spec_from_file_location(f"binding_{module.stem}", module)
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found.ffi


def _write(headers: Sequence[Path], root: Path, module: Path) -> None:
    import cffi  # takes its time, and what is written does without it

    with TemporaryDirectory() as name:
        source = Path(name) / "headers.c"
        includes = [f"-I{root}", f"-I{GENERATED}"]
        text = "".join(f'#include "{header}"\n' for header in headers)
        source.write_text(text)
        declared = _compile("-E", *UNREAD, *includes, str(source))
        declared = _without_bodies(_own(declared, (root, GENERATED, *(header.parent for header in headers))))
        ffi = cffi.FFI()
        try:
            ffi.cdef(declared)
        except (cffi.CDefError, cffi.FFIError, NotImplementedError) as error:  # the last: C that cffi does not know
            raise HeaderError(str(error)) from error
        source.write_text(text + _claims(ffi))
        _compile("-c", *includes, str(source), "-o", str(source.with_suffix(".o")))
        ffi.set_source(f"binding_{module.stem}", None)
        partial = module.with_suffix(".part")
        with redirect_stdout(StringIO()):  # cffi says what it writes
            ffi.emit_python_code(str(partial))
        partial.replace(module)
