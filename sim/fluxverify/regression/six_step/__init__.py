# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Six-step cases (Yang 2020, chapters 2 to 6). Scenarios: scenarios/six-step."""

from fluxverify.regression.six_step import (
    asymmetry,
    balance,
    commutation_error,
    correction_a,
    edges,
    freewheel,
    hall,
    highest_speed,
    linearity,
    lost_lock,
    modes,
    patterns,
    ramp,
    spectrum,
    starts,
    torque_limit,
    zcd_methods,
)

__all__ = [
    "asymmetry",
    "balance",
    "commutation_error",
    "correction_a",
    "edges",
    "freewheel",
    "hall",
    "highest_speed",
    "linearity",
    "lost_lock",
    "modes",
    "patterns",
    "ramp",
    "spectrum",
    "starts",
    "torque_limit",
    "zcd_methods",
]
