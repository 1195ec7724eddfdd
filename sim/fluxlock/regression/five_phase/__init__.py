"""Cases of injection: five-phase machines of Tian 2019 and Yu 2022. Scenarios: scenarios/five-phase."""

from fluxlock.regression.five_phase import ipm, tian, tian_events, yu, yu_events

__all__ = ["ipm", "tian", "tian_events", "yu", "yu_events"]
