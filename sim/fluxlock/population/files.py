# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The files of a drawn life: what `fluxlock run` and `fluxlock native --play` read."""

from __future__ import annotations

from pathlib import Path

from fluxlock.base.writable import check_file
from fluxlock.config.write import file_text, scenario_texts
from fluxlock.population.injection_life import InjectionLife
from fluxlock.population.life import Life

SCENARIO, MOTOR, INVERTER, MACHINE = "scenario.toml", "motor.toml", "inverter.toml", "machine.toml"


def write_life(life: Life | InjectionLife, folder: Path) -> Path:
    """Write scenario, motor and inverter, and the machine if its file is wrong; the scenario's path."""
    texts = scenario_texts(life.scenario, SCENARIO, MOTOR, INVERTER)
    if isinstance(life, InjectionLife):
        texts[MACHINE] = file_text(life.machine)
    for name, text in texts.items():
        check_file(folder / name)
        (folder / name).write_text(text, encoding="utf-8")
    return folder / SCENARIO
