"""Six-step cases (Yang 2020, chapters 2 to 6). Scenarios: scenarios/six-step."""

from fluxlock.regression.six_step import (
    commutation_error,
    freewheel,
    highest_speed,
    linearity,
    patterns,
    ramp,
    spectrum,
    starts,
    torque_limit,
)

__all__ = [
    "commutation_error",
    "freewheel",
    "highest_speed",
    "linearity",
    "patterns",
    "ramp",
    "spectrum",
    "starts",
    "torque_limit",
]
