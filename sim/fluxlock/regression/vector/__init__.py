"""Vector cases (Yang 2020, chapter 7). Scenarios: scenarios/vector."""

from fluxlock.regression.vector import core

__all__ = ["core"]
