# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The native drive that plays a scenario, by its method."""

from __future__ import annotations

from types import ModuleType

from fluxlock.config import ConfigError, Scenario
from fluxlock.native import injection_play, six_step_run, vector_run
from fluxlock.native.play import ScenarioPlay


def _module(scenario: Scenario) -> ModuleType:
    drive = scenario.drive
    if drive.method != "vector":
        return six_step_run
    return vector_run if drive.vector.injection is None else injection_play


def player(scenario: Scenario, seed: int, kept_s: float | None = None) -> ScenarioPlay:
    """Ready to run; ConfigError for what no native drive is.

    kept_s: without end; `take` comes at least so often, s.
    """
    made: ScenarioPlay = _module(scenario).Play(scenario, seed, kept_s)
    return made


def check_playable(scenario: Scenario) -> None:
    """ConfigError for what no native drive is, before anything is compiled."""
    problems = _module(scenario).refusals(scenario)
    if problems:
        raise ConfigError(problems)
