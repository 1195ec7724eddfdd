# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The compiled kernel is kept for later processes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from fluxlock.plant.build import Variant, cache_folder, compiled


def kept() -> set[Path]:
    """Compiled code of three phases and constant inductances."""
    return {path for path in cache_folder().rglob("*.nbc") if path.name.split("-")[0].endswith(Variant().suffix)}


def test_next_process_compiles_nothing() -> None:
    """All of the kernel that another process has compiled is read: nothing comes to the cache.

    Verifies: PLANT-42
    """
    compiled(Variant())
    before = kept()
    code = "from fluxlock.plant.build import Variant, compiled; compiled(Variant())"
    subprocess.run([sys.executable, "-c", code], check=True)
    assert before and kept() == before
