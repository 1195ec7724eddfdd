"""Vector cases (Yang 2020, chapter 7). Scenarios: scenarios/vector."""

from fluxlock.regression.vector import identify

__all__ = ["identify"]
