"""Cases of injection: five-phase machines of Tian 2019 and Yu 2022. Scenarios: scenarios/five-phase."""

from fluxlock.regression.five_phase import ipm, tian, yu

__all__ = ["ipm", "tian", "yu"]
