"""All sets of cases: importing this registers them."""

from fluxlock.regression import six_step, vector

__all__ = ["six_step", "vector"]
