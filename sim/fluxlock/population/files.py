# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The files of a drawn life: what `fluxlock run` and `fluxlock native --play` read."""

from __future__ import annotations

from pathlib import Path

import tomlkit

from fluxlock.config.fields import Model
from fluxlock.population.injection_life import InjectionLife
from fluxlock.population.life import Life
from fluxlock.writable import check_file

SCENARIO, MOTOR, INVERTER, MACHINE = "scenario.toml", "motor.toml", "inverter.toml", "machine.toml"


def _text(model: Model, *without: str, **more: str) -> str:
    """A file with the keys that the model was made with."""
    stated = model.model_dump(mode="json", exclude_unset=True, exclude_none=True, exclude=set(without))
    plain = {key: value for key, value in stated.items() if not isinstance(value, (dict, list))}
    tables = {key: value for key, value in stated.items() if key not in plain}
    return tomlkit.dumps({**plain, **more, **tables})


def write_life(life: Life | InjectionLife, folder: Path) -> Path:
    """Write scenario, motor and inverter, and the machine if its file is wrong; the scenario's path."""
    s = life.scenario
    texts = {
        SCENARIO: _text(s, "motor", "inverter", motor=MOTOR, inverter=INVERTER),
        MOTOR: _text(s.motor),
        INVERTER: _text(s.inverter),
    }
    if isinstance(life, InjectionLife):
        texts[MACHINE] = _text(life.machine)
    for name, text in texts.items():
        check_file(folder / name)
        (folder / name).write_text(text, encoding="utf-8")
    return folder / SCENARIO
