"""All sets of cases: importing this registers them."""

from fluxlock.regression import six_step

__all__ = ["six_step"]
