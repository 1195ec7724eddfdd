# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a block test measured, for who asks for more than pass or fail (rows of the regression)."""

from __future__ import annotations

import json
import os
from pathlib import Path

MEASURED_ENV = "FLUXLOCK_MEASURED"  # file to which lines {name: value} are added


def measured(name: str, value: float) -> None:
    """Add a value to the file that the environment names, if it names one."""
    path = os.environ.get(MEASURED_ENV)
    if path:
        with Path(path).open("a", encoding="utf-8") as out:
            out.write(json.dumps({name: value}) + "\n")
