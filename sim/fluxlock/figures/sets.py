"""All families of figures: importing this registers them."""

from fluxlock.figures import six_step

__all__ = ["six_step"]
