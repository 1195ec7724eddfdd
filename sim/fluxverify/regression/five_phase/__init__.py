# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Cases of injection: five-phase machines of Tian 2019 and Yu 2022. Scenarios: scenarios/five-phase."""

from fluxverify.regression.five_phase import (
    handover,
    ipm,
    leakage,
    lock_in,
    modulation,
    open_phase,
    rest_position,
    saliency,
    tian,
    tian_events,
    tian_printed,
    yu,
    yu_events,
    yu_loaded,
)

__all__ = [
    "handover",
    "ipm",
    "leakage",
    "lock_in",
    "modulation",
    "open_phase",
    "rest_position",
    "saliency",
    "tian",
    "tian_events",
    "tian_printed",
    "yu",
    "yu_events",
    "yu_loaded",
]
