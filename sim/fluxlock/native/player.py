# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The native drive that plays a scenario, by its method."""

from __future__ import annotations

from fluxlock.config import Scenario
from fluxlock.native import six_step_run, vector_run
from fluxlock.native.play import ScenarioPlay


def player(scenario: Scenario, seed: int) -> ScenarioPlay:
    """Ready to run; ConfigError for what no native drive is."""
    if scenario.drive.method == "vector":
        return vector_run.Play(scenario, seed)
    return six_step_run.Play(scenario, seed)
