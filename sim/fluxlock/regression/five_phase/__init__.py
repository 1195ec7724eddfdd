"""Cases of injection: five-phase machines of Tian 2019 and Yu 2022. Scenarios: scenarios/five-phase."""

from fluxlock.regression.five_phase import handover, ipm, open_phase, saliency, tian, tian_events, yu

__all__ = ["handover", "ipm", "open_phase", "saliency", "tian", "tian_events", "yu"]
