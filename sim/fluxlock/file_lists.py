# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""File lists of the RTL: `rtl/fl_soc.f` names the sources of the chip, `rtl/board/<top>.f` those of a board top.

Every build reads these lists. A line is a file, `-F` and another list, or a comment. Paths count from the list itself.
"""

from __future__ import annotations

from pathlib import Path

from fluxlock.base.paths import BUILD, ROOT, RTL

CHIP_LIST = RTL / "fl_soc.f"
BOARD_FOLDER = RTL / "board"
VENDOR = BOARD_FOLDER / "vendor"  # declarations that a vendor's own tool must not see


def read_list(path: Path) -> list[Path]:
    """Sources in compile order."""
    files: list[Path] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        words = line.partition("//")[0].split()
        if not words:
            continue
        named = (path.parent / words[-1]).resolve()
        if named.is_relative_to(ROOT / "build"):  # generated: an installed package builds elsewhere
            named = BUILD / named.relative_to(ROOT / "build")
        files += read_list(named) if words[0] == "-F" else [named]
    return files


def chip_files() -> list[Path]:
    """Sources of the chip."""
    return read_list(CHIP_LIST)


def board_lists() -> list[Path]:
    """The list of each board top."""
    return sorted(BOARD_FOLDER.glob("*.f"))
