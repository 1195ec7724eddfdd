"""Cases of injection: five-phase machines of Tian 2019 and Yu 2022. Scenarios: scenarios/five-phase."""

from fluxlock.regression.five_phase import (
    ipm,
    leakage,
    lock_in,
    modulation,
    tian,
    tian_events,
    tian_printed,
    yu,
    yu_events,
    yu_loaded,
)

__all__ = [
    "ipm",
    "leakage",
    "lock_in",
    "modulation",
    "tian",
    "tian_events",
    "tian_printed",
    "yu",
    "yu_events",
    "yu_loaded",
]
