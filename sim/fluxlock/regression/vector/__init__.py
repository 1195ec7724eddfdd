"""Vector cases (Yang 2020, chapter 7). Scenarios: scenarios/vector."""

from fluxlock.regression.vector import bandwidth, chip_steps, controllers, core, encoder, identify, transforms

__all__ = ["bandwidth", "chip_steps", "controllers", "core", "encoder", "identify", "transforms"]
