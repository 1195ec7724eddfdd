# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a cocotb test of a block measured, for rows of the regression."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from fluxlock.cosim.block import run_block_test


def measure(
    top: str, sources: Sequence[str | Path], module: str, testcase: str, seed: int, parameters: Mapping[str, int]
) -> dict[str, float]:
    """What one cocotb test measured."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "measured.jsonl"
        run_block_test(
            top,
            sources,
            module,
            parameters=parameters,
            testcase=testcase,
            extra_env={"FLUXLOCK_MEASURED": str(path)},
            seed=seed,
        )
        found: dict[str, float] = {}
        for line in path.read_text(encoding="utf-8").splitlines():
            found.update(json.loads(line))
    return found
