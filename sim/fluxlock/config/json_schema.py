# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""JSON schemas of motor, inverter and scenario files: an editor completes and checks the keys while they are typed."""

from __future__ import annotations

from typing import Any

from fluxlock.config.fields import Model, words_of
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import Motor
from fluxlock.config.scenario import Scenario

DIALECT = "https://json-schema.org/draft/2020-12/schema"
MODELS: dict[str, type[Model]] = {"motor": Motor, "inverter": Inverter, "scenario": Scenario}


def json_schema(kind: str) -> dict[str, Any]:
    """Schema of a kind of file, draft 2020-12. kind: motor, inverter, scenario.

    `unit` beside a key is ours. The loader checks more: how keys fit each other, and whether the drive can do it.
    """
    schema = MODELS[kind].model_json_schema()
    for name in ("motor", "inverter") if kind == "scenario" else ():  # a scenario names these files
        text = schema["properties"][name]["description"]
        schema["properties"][name] = {"type": "string", "description": text}
    for table in (schema, *schema["$defs"].values()):
        if "description" in table:
            table["description"] = words_of(table["description"])
    return {"$schema": DIALECT, **schema}
