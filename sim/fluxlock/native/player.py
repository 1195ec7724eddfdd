# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The native drive that plays a scenario, by its method."""

from __future__ import annotations

from fluxlock.config import ConfigError, Scenario
from fluxlock.native import six_step_run, vector_run
from fluxlock.native.play import ScenarioPlay


def player(scenario: Scenario, seed: int, kept_s: float | None = None) -> ScenarioPlay:
    """Ready to run; ConfigError for what no native drive is.

    kept_s: without end; `take` comes at least so often, s.
    """
    if scenario.drive.method == "vector":
        return vector_run.Play(scenario, seed, kept_s)
    return six_step_run.Play(scenario, seed, kept_s)


def check_playable(scenario: Scenario) -> None:
    """ConfigError for what no native drive is, before anything is compiled."""
    problems = (vector_run if scenario.drive.method == "vector" else six_step_run).refusals(scenario)
    if problems:
        raise ConfigError(problems)
