# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A scenario with its motor and inverter as three files."""

from __future__ import annotations

import tomlkit

from fluxlock.config.fields import Model
from fluxlock.config.scenario import Scenario


def file_text(model: Model, *without: str, **more: str) -> str:
    """A file with the keys that the model was made with."""
    stated = model.model_dump(mode="json", exclude_unset=True, exclude_none=True, exclude=set(without))
    plain = {key: value for key, value in stated.items() if not isinstance(value, (dict, list))}
    tables = {key: value for key, value in stated.items() if key not in plain}
    return tomlkit.dumps({**plain, **more, **tables})


def scenario_texts(scenario: Scenario, name: str, motor: str, inverter: str) -> dict[str, str]:
    """Texts by file name: the scenario, which names the other two, motor and inverter."""
    return {
        name: file_text(scenario, "motor", "inverter", motor=motor, inverter=inverter),
        motor: file_text(scenario.motor),
        inverter: file_text(scenario.inverter),
    }
