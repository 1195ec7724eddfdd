# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Shape of the RTL, which `make lint` keeps: a source names modules and packages of its folder and of `SHARED` alone.

What is in `SHARED` names nothing of the blocks either. `soc/` and `board/` wire the blocks, and alone may name all.
Register blocks are generated from `regs/`, and their wrappers stand in `soc/`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from fluxlock.base.paths import RTL

WIRING: Final = ("soc", "board")
SHARED: Final = ("pkg", "common", "regs")  # from the bottom up
NOT_CODE: Final = re.compile(r'//[^\n]*|/\*.*?\*/|"[^"\n]*"', re.DOTALL)
REGISTERS: Final = re.compile(r"fl_\w+_regs(?:_pkg)?")


def complaints(rtl: Path = RTL) -> Iterator[str]:
    """What breaks the rule, by file, line and name."""
    home = {path.stem: path.parent.name for path in sorted(rtl.glob("*/*.sv"))}
    for path in sorted(rtl.glob("*/*.sv")):
        folder = path.parent.name
        if folder in WIRING:
            continue
        known = {folder, *(SHARED[: SHARED.index(folder)] if folder in SHARED else SHARED)}
        code = NOT_CODE.sub(lambda match: "\n" * match[0].count("\n"), path.read_text(encoding="utf-8"))
        for number, line in enumerate(code.splitlines(), 1):
            for name in re.findall(r"\bfl_\w+", line):
                its = "regs" if REGISTERS.fullmatch(name) else home.get(name, folder)
                if its not in known:
                    place = path.relative_to(rtl.parent).as_posix()
                    yield f"{place}:{number} names {name} of {its}/, which a source of {folder}/ must not know"


def check() -> str:
    """What breaks the rule, for `make lint`."""
    return "\n".join(complaints())
