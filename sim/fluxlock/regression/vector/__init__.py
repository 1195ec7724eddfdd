"""Vector cases (Yang 2020, chapter 7). Scenarios: scenarios/vector."""

from fluxlock.regression.vector import chip_steps, transforms

__all__ = ["chip_steps", "transforms"]
