# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The injected drives of this folder."""

from __future__ import annotations

from pathlib import Path

from fluxlock.config import Scenario, load_scenario

SCENARIOS = Path(__file__).parent / "scenarios"
MACHINES = tuple(sorted(path.stem for path in SCENARIOS.glob("*.toml")))


def scenario_of(name: str, *overrides: str) -> Scenario:
    """One of the machines of this folder."""
    return load_scenario(SCENARIOS / f"{name}.toml", overrides)
