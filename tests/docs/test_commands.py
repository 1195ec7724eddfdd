# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Command lines of README and docs against the commands, targets, cases, files and keys that there are."""

from __future__ import annotations

import importlib.util
import inspect
import re
import shlex
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import typer

from fluxlock.base.paths import ROOT
from fluxlock.cli import app
from fluxlock.config import ConfigError, Scenario, load_scenario
from fluxlock.config.wording import keys_of
from fluxlock.drive import Drive
from fluxlock.synth.blocks import ALL_BLOCKS, block_files, load_settings
from fluxlock.synth.configurations import load_configurations
from fluxverify.cli import app as verify_app
from fluxverify.regression.run import select

PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
LINE = re.compile(r"(?:[A-Z]+=\w+ +)*(?:\.venv/bin/)?(fluxlock|fluxverify|make|python -m|pytest) +(.*)")
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.DOTALL | re.MULTILINE)
# Made or filled in by the reader.
OWN = re.compile(r"my-motor|my-drive|[A-Z]{4}|…")


def command_lines(text: str) -> list[tuple[str, list[str]]]:
    """Program and words of the command lines in a page's code: blocks without a language, and code within a line."""
    blocks = [re.sub(r"\\\n\s*", "", block) for _, kind, block in BLOCK.findall(text) if not kind]
    lines = [line for block in blocks for line in block.splitlines()]
    lines += re.findall(r"`([^`\n]+)`", BLOCK.sub("", text))
    found = (LINE.fullmatch(line.strip()) for line in lines)
    return [(match[1], shlex.split(match[2], comments=True)) for match in found if match]


def check_fluxlock(words: list[str], app: typer.Typer = app) -> None:
    """Command, options and arguments are accepted; the files that it reads are there and their keys too."""
    command: Any = typer.main.get_command(app)
    while hasattr(command, "commands"):
        name, *words = words
        own = [option for parameter in command.params for option in parameter.opts]
        if OWN.fullmatch(name) or name in (*own, "--help"):
            return
        assert name in command.commands, f"no command {name}"
        command = command.commands[name]
    if not words:  # the name alone, in a sentence
        return
    given = command.make_context(command.name, list(words)).params
    files = [ROOT / word for word in words if word.endswith(".toml") and not OWN.search(word)]
    missing = [str(path) for path in files if not path.exists()]
    assert not missing, f"no file {', '.join(missing)}"
    if command.name == "run" and files:
        load_scenario(files[0], given["set_"] or ())


def check_make(words: list[str]) -> None:
    """Targets are there, and the cases that CASES and what ONLY names."""
    for word in words:
        if word.startswith("CASES="):
            assert select([word.removeprefix("CASES=")]), f"no case {word}"
        elif word.startswith("ONLY="):
            settings = load_settings()
            built = {ALL_BLOCKS, *load_configurations(), *block_files(settings), *settings.sets}
            assert word.removeprefix("ONLY=") in built, f"neither configuration nor block {word}"
        elif "=" not in word:
            assert word in TARGETS, f"no target {word}"


def check_module(words: list[str]) -> None:
    """The module is there."""
    assert importlib.util.find_spec(words[0]), f"no module {words[0]}"


def check_pytest(words: list[str]) -> None:
    """Files and folders are there."""
    for word in words:
        assert word.startswith("-") or (ROOT / word).exists(), f"no file {word}"


CHECKS: dict[str, Callable[[list[str]], None]] = {
    "fluxlock": check_fluxlock,
    "fluxverify": partial(check_fluxlock, app=verify_app),
    "make": check_make,
    "python -m": check_module,
    "pytest": check_pytest,
}


def check_page(text: str) -> None:
    """Every command line can be typed as it stands."""
    for program, words in command_lines(text):
        try:
            CHECKS[program](words)
        except (AssertionError, ConfigError, typer.TyperException) as error:
            raise AssertionError(f"{program} {' '.join(words)}: {error}") from None


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_command_lines(page: Path) -> None:
    """The command lines of the pages name what there is.

    Verifies: DOC-04
    """
    check_page(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "line",
    [
        "fluxlock runs scenarios/demo.toml",
        "fluxlock run scenarios/none.toml",
        "fluxlock run scenarios/demo.toml --sett drive.pattern=ON-PWM",
        "fluxlock run scenarios/demo.toml --set drive.patern=ON-PWM",
        "fluxlock motor chek motors/motor-1.toml",
        "fluxlock soa Motor-I, 25 V",
        "make regression CASES=six-step/none",
        "make tests",
        "python -m fluxverify.docs.none",
        "pytest tests/none.py -q",
    ],
)
def test_wrong_command_lines_are_found(line: str) -> None:
    """A line that names something else is found, in a block and in a sentence.

    Verifies: DOC-04
    """
    for text in (f"```\n{line}\n```\n", f"   ```\n   SEED=1 {line}   # a remark\n   ```\n", f"A sentence, `{line}`.\n"):
        with pytest.raises(AssertionError, match=re.escape(line.split()[0])):
            check_page(text)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_keys(page: Path) -> None:
    """The keys of a scenario's drive that a page names are there; where it is about `Drive`, what that has.

    Verifies: DOC-04
    """
    keys, text = set(keys_of(Scenario)), page.read_text(encoding="utf-8")
    source = inspect.getsource(Drive) if "fluxlock.drive" in text else ""
    of_drive = {*dir(Drive), *re.findall(r"self\.([a-z_]+)\b.* = ", source)} if source else set()
    named = re.findall(r"`(drive(?:\.[a-z_]+)+)\b", text)
    wrong = [k for k in named if k not in keys and k.split(".")[1] not in of_drive]
    assert not wrong, f"no key {', '.join(wrong)}"
