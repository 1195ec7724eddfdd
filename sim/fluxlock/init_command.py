# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Command `fluxlock init`: a folder for a drive of one's own, with files that run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, Problem
from fluxlock.config.json_schema import MODELS, json_schema
from fluxlock.theory.six_step.output import prepare_folder

# What a new folder begins with: kind -> shipped file.
FIRST = {
    "motor": ROOT / "motors" / "spindle-2pp.toml",
    "inverter": ROOT / "inverters" / "drive-48v.toml",
    "scenario": ROOT / "scenarios" / "own-spindle.toml",
}
CELLS = (
    "# A run on the twin, the firmware on an averaged motor. Without twin=True it runs on the chip, clock by clock.",
    'import fluxlock\n\nrun = fluxlock.simulate("scenario.toml", twin=True)\n'
    'print(run.verdict.lines)\nrun.plot("speed_rpm", "ia");',
    "# How far off may the resistance in the file be?",
    'made = fluxlock.sweep("scenario.toml", {"motor.resistance_ohm": [0.10, 0.15, 0.20]}, twin=True)\n'
    'made.to_dataframe()[["motor.resistance_ohm", "status", "steady.commutation_error_deg.rms"]]',
)


TEST = '''\
"""Closed-loop test of the whole chip with this folder's motor: python -m pytest."""

from fluxlock.drive import Drive, drive_test, run_tests


@drive_test()
async def carries_a_load_step(drive: Drive) -> None:
    await drive.start(15_000)
    drive.load(constant_nm=0.01)
    await drive.run(0.05)
    assert abs(drive.speed_rpm - 15_000) < 300
    assert abs(drive.angle_error_deg) < 1.0


def test_drive() -> None:
    # The rotor spins already, which saves the time of a start.
    run_tests("scenario.toml", __file__, "initial.speed_rpm=14_000")
'''


def notebook(cells: tuple[str, ...] = CELLS) -> dict[str, Any]:
    """Notebook of format 4.5; a cell that is one comment becomes text."""
    made = []
    for index, source in enumerate(cells):
        text = source.startswith("# ") and "\n" not in source
        cell: dict[str, Any] = {
            "id": f"cell-{index}",
            "metadata": {},
            "source": source.removeprefix("# ") if text else source,
        }
        made.append({"cell_type": "markdown", **cell} if text else _code(cell))
    return {"cells": made, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}


def _code(cell: dict[str, Any]) -> dict[str, Any]:
    return {"cell_type": "code", "execution_count": None, "outputs": [], **cell}


def files() -> dict[str, str]:
    """Name -> text of each file of a new folder."""
    made = {f"schema/{kind}.json": json.dumps(json_schema(kind), indent=1) + "\n" for kind in MODELS}
    for kind, path in FIRST.items():
        text = path.read_text(encoding="utf-8")
        for other in ("motor", "inverter"):
            text = text.replace(f'{other} = "../{other}s/{FIRST[other].name}"', f'{other} = "{other}.toml"')
        made[f"{kind}.toml"] = f"#:schema schema/{kind}.json\n{text}"
    made["test_drive.py"] = TEST
    made["first.ipynb"] = json.dumps(notebook(), indent=1) + "\n"
    return made


def init(folder: Annotated[Path, typer.Argument(help="Folder to make.")]) -> None:
    """Make a folder for your drive: motor, inverter, scenario, a cocotb test, a notebook.

    The files run as they are; write your values into them. JSON schemas beside them let an editor complete keys.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError([Problem(str(folder), "", "exists and is not empty: name a new folder")])
    for part in (folder, folder / "schema"):
        prepare_folder(part)
    for name, text in files().items():
        (folder / name).write_text(text, encoding="utf-8")
    print(f"written: {folder}/{', '.join(sorted(files()))}")
    commands = (
        "fluxlock motor info {}/motor.toml",
        "fluxlock run {}/scenario.toml",
        "python -m pytest {}/test_drive.py",
    )
    print(f"next: {'; '.join(command.format(folder) for command in commands)}")
