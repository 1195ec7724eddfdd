# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The guides of docs/develop, followed step by step on a copy of the tree."""

from __future__ import annotations

import ast
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from fluxlock.base.paths import GENERATED, ROOT
from fluxlock.generate.registers import generate_registers

FOLDERS = ("sw", "sim", "rtl/regs", "docs", "motors", "inverters", "scenarios")
STEP = re.compile(r"(?:[^\n]*`([\w./-]+)`[^\n]*:\n\n)?```(\w+)\n(.*?)```\n", re.DOTALL)
BOOT = """
from fluxlock.config import load_scenario
from fluxlock.firmware import compile_parameters
from fluxlock.firmware.host import HostFirmware
def booted(*changes, **parameters):
    block = compile_parameters(load_scenario("scenarios/demo.toml", changes))
    block.update(parameters)
    drive = HostFirmware()
    drive.load(block)
    drive.boot()
    return drive
"""


@dataclass(frozen=True)
class Tree:
    """A copy of the tree that the guides change."""

    root: Path

    def text(self, name: str) -> str:
        """A file."""
        return (self.root / name).read_text(encoding="utf-8")

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Python on the copy's package."""
        env = {**os.environ, "PYTHONPATH": str(self.root / "sim")}
        return subprocess.run(
            [sys.executable, *arguments], cwd=self.root, env=env, capture_output=True, text=True, check=False
        )

    def printed(self, script: str) -> list[object]:
        """What a script prints, a Python value a line."""
        done = self.run("-c", script)
        assert done.returncode == 0, done.stderr
        return [ast.literal_eval(line) for line in done.stdout.splitlines()]

    def follow(self, page: str) -> list[str]:
        """Carry out the steps of a page; what the builds said that it foretells."""
        said = []
        for name, kind, block in STEP.findall(self.text(page)):
            if kind == "toml":
                with (self.root / name).open("a", encoding="utf-8") as file:
                    file.write(f"\n{block}")
            elif kind == "diff":
                self._replace(name, block)
            elif kind == "python":
                (self.root / name).write_text(block, encoding="utf-8")
            elif kind == "text":
                done = self.run("-c", "from fluxlock.firmware import build_canopen_library as build; build()")
                assert done.returncode and block.strip() in done.stderr, done.stderr
                said.append(block.strip())
            else:
                for line in block.splitlines():
                    done = self.run(*shlex.split(line)[1:])
                    assert line.startswith(".venv/bin/python ") and done.returncode == 0, f"{line}: {done.stderr}"
        return said

    def _replace(self, name: str, block: str) -> None:
        lines = block.splitlines(keepends=True)
        old = "".join(line[1:] for line in lines if line[0] != "+")
        new = "".join(line[1:] for line in lines if line[0] != "-")
        text = self.text(name)
        assert text.count(old) == 1, f"{name}: {old}"
        (self.root / name).write_text(text.replace(old, new), encoding="utf-8")


@pytest.fixture(scope="module")
def said(tree: Tree) -> dict[str, list[str]]:
    """All guides followed, one after the other, so that their firmware is built once; by page what its builds said."""
    pages = sorted((ROOT / "docs" / "develop" / "add").glob("a*-*.md"))
    return {page.stem: tree.follow(f"docs/develop/add/{page.name}") for page in pages}


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Tree:
    """The copy, with the registers' headers that it would generate."""
    root = tmp_path_factory.mktemp("guides")
    generate_registers()
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, root / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(GENERATED, root / "build" / "generated", ignore=shutil.ignore_patterns("python"))
    return Tree(root)


def test_add_a_setting(tree: Tree, said: dict[str, list[str]]) -> None:
    """The setting answers on the console, begins as the scenario says, and is in objects, keys and pages.

    Verifies: DOC-16
    """
    assert said["a-setting"] == ["no C source uses the setting coast_stop"]
    answers = """
from fluxlock.canopen.dictionary import load_dictionary
drive = booted()
print([drive.command(line) for line in ("get coast_stop", "set coast_stop 1", "get coast_stop", "set coast_stop 2")])
print([booted("drive.coast_stop=true").command("get coast_stop"), "coast_stop" in booted().command("help")[1]])
entry = load_dictionary()["setting_coast_stop"]
print((entry.index, entry.sub, entry.type, entry.choices))
"""
    assert tree.printed(BOOT + answers) == [
        [["coast_stop 0", "ok"], ["ok"], ["coast_stop 1", "ok"], ["error: value out of range"]],
        [["coast_stop 1", "ok"], True],
        (0x2020, 15, "u8", (0, 1)),
    ]
    for page, name in (("console", ""), ("parameters", ""), ("files", ""), ("objects", "setting_")):
        assert f"| `{name}coast_stop` |" in tree.text(f"docs/reference/{page}.md"), page


def test_add_a_fault(tree: Tree, said: dict[str, list[str]]) -> None:
    """The drive stops in the fault by its name, which has an EMCY code, and scenario and pages know it.

    Verifies: DOC-16
    """
    name = "parameter_dead_time"
    assert said["a-fault"] == [f"no C source reports the fault {name}"]
    answers = f"""
from fluxlock.interface.names import load_faults
print(booted(dead_time_cycles=20, min_pulse_cycles=19).command("get fault"))
print(booted(dead_time_cycles=20, min_pulse_cycles=20).command("get fault")[0] != "fault {name}")
print([fault.emcy for fault in load_faults() if fault.name == "{name}"])
print([load_scenario("scenarios/demo.toml", ["expect_fault={name}"]).expect_fault])
"""
    assert tree.printed(BOOT + answers) == [
        ["state init", f"fault {name}", "ok"],
        True,
        [0x6320],
        [name],
    ]
    for page in ("console", "objects", "files"):
        assert f"`{name}`" in tree.text(f"docs/reference/{page}.md"), page


def test_add_a_value(tree: Tree, said: dict[str, list[str]]) -> None:
    """The value answers on the console, alone and among all, and the page has it.

    Verifies: DOC-16
    """
    assert not said["a-value"]
    answers = """
drive = booted()
print((drive.command("get faults_total"), "faults_total 0" in drive.command("get")))
"""
    assert tree.printed(BOOT + answers) == [(["faults_total 0", "ok"], True)]
    assert "| `faults_total` |" in tree.text("docs/reference/console.md")


def test_add_an_object(tree: Tree, said: dict[str, list[str]]) -> None:
    """The node reads the drive for it; EDS and page have it.

    Verifies: DOC-16
    """
    assert said["an-object"] == ["link_read does not read the object observer_limit"]
    answers = """
from fluxlock.canopen.dictionary import load_dictionary
from fluxlock.canopen.eds import eds
entry = load_dictionary()["observer_limit"]
print(((entry.index, entry.sub, entry.type, entry.live), "[2022sub8]" in eds(load_dictionary())))
"""
    assert tree.printed(answers) == [((0x2022, 8, "u8", True), True)]
    assert "observer_limit" in tree.text("docs/reference/objects.md")


def test_add_a_case(tree: Tree, said: dict[str, list[str]]) -> None:
    """The case is in its set; a speed that is held keeps the limits, one that is not misses them.

    Verifies: DOC-16
    """
    assert not said["a-case"]
    answers = """
from types import SimpleNamespace as Space
from fluxverify.regression.sets import CASES
found = CASES["six-step/light-load"]
print(found.title)
for rpm in (60_100.0, 60_130.0):
    run = Space(metrics={"steady": {"speed_rpm": {"mean": rpm}}})
    rows = list(found.body(Space(quick=False, drive=lambda *_: run)))
    print(len(rows), [bool(list(row.misses())) for row in rows])
"""
    assert tree.run("-c", answers).stdout.splitlines() == [
        "A tenth and a hundredth of the fan's torque: speed held.",
        "2 [False, False]",
        "2 [True, True]",
    ]
