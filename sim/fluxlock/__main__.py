# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Entry point of the command `fluxlock`, also `python -m fluxlock`: ready for Ctrl-C before the slow imports begin."""

from __future__ import annotations

import gc
import subprocess
import sys

from fluxlock.base.interrupts import leave_when_interrupted, raise_when_interrupted
from fluxlock.base.paths import BUILD, ROOT


def refuse_place() -> None:
    """End with exit code 2 in a folder or on a machine that the tools refuse; they say why."""
    code = subprocess.call(["sh", ROOT / "tools" / "place.sh", BUILD])
    if code:
        sys.exit(code)


def main() -> None:
    """Load the command line and run it; exit codes as `fluxlock.cli` states them."""
    leave_when_interrupted()
    refuse_place()
    gc.disable()  # what is imported stays: to look for garbage in it takes a sixth of the time
    import fluxlock.cli

    gc.freeze()
    gc.enable()
    raise_when_interrupted()
    fluxlock.cli.main()


if __name__ == "__main__":
    main()
