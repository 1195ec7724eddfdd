"""Six-step cases (Yang 2020, chapters 2 to 6). Scenarios: scenarios/six-step."""

from fluxlock.regression.six_step import (
    asymmetry,
    balance,
    correction_a,
    lost_lock,
    ramp,
    spectrum,
    starts,
)

__all__ = [
    "asymmetry",
    "balance",
    "correction_a",
    "lost_lock",
    "ramp",
    "spectrum",
    "starts",
]
