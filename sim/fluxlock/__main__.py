"""Entry point of the command `fluxlock`, also `python -m fluxlock`: ready for Ctrl-C before the slow imports begin."""

from __future__ import annotations

from fluxlock.interrupts import leave_when_interrupted, raise_when_interrupted


def main() -> None:
    """Load the command line and run it; exit codes as `fluxlock.cli` states them."""
    leave_when_interrupted()
    import fluxlock.cli

    raise_when_interrupted()
    fluxlock.cli.main()


if __name__ == "__main__":
    main()
