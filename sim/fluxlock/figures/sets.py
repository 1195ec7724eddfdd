"""All families of figures: importing this registers them."""

from fluxlock.figures import blac, six_step

__all__ = ["blac", "six_step"]
