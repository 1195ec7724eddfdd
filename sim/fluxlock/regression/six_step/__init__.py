"""Six-step cases (Yang 2020, chapters 2 to 6). Scenarios: scenarios/six-step."""

from fluxlock.regression.six_step import (
    ramp,
    spectrum,
    starts,
)

__all__ = [
    "ramp",
    "spectrum",
    "starts",
]
