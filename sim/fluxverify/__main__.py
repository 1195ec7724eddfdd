# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Entry point of the command `fluxverify`, also `python -m fluxverify`."""

from __future__ import annotations

from fluxlock.__main__ import refuse_place
from fluxlock.base.interrupts import leave_when_interrupted, raise_when_interrupted


def main() -> None:
    """Load the command line and run it; exit codes as `fluxlock.command_line` states them."""
    leave_when_interrupted()
    refuse_place()
    import fluxverify.cli

    raise_when_interrupted()
    fluxverify.cli.main()


if __name__ == "__main__":
    main()
