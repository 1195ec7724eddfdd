"""All sets of cases: importing this registers them."""

from fluxlock.regression import five_phase, six_step, vector

__all__ = ["five_phase", "six_step", "vector"]
