# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Help of the command line: groups, examples, completion, any width, no colour, a pipe that closes."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
import typer.core

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.base.writable import EXIT_READER_GONE
from fluxlock.help import GROUPS, complete_toml
from fluxlock.motor_info import number, scale
from fluxverify import cli as verify_cli
from tests.docs.test_commands import check_fluxlock

EXAMPLE = re.compile(r"^fluxlock (.+)$", re.MULTILINE)
RUN = ("run", "--help")
INFO = ("motor", "info", str(ROOT / "motors" / "motor-1.toml"))


def run_command(*words: str, shell: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
    """The real command in a process of its own, its output in a pipe; shell: what follows it on the line."""
    line = f"{shlex.join([sys.executable, '-m', 'fluxlock', *words])} {shell}"
    env = {key: value for key, value in os.environ.items() if key not in ("COLUMNS", "NO_COLOR", "FORCE_COLOR", "TERM")}
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"],
        env=env | environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def all_commands(command: Any, *words: str) -> list[tuple[tuple[str, ...], Any]]:
    """Every command below one, with the words that call it."""
    found = [(words, command)]
    for name, below in getattr(command, "commands", {}).items():
        found += all_commands(below, *words, name)
    return found


COMMANDS = all_commands(typer.main.get_command(cli.app))


def test_groups() -> None:
    """Every command of a user is in a group, groups come in their order, what verifies comes last.

    Verifies: FRONT-60
    """
    root = COMMANDS[0][1]
    panels = {name: command.rich_help_panel for name, command in root.commands.items()}
    assert set(panels.values()) == set(GROUPS)
    out = run_command("--help", COLUMNS="100").stdout
    assert re.findall(r"^╭─ ([\w ]+) ─", out, re.M) == ["Options", *GROUPS]
    listed = re.findall(r"^│ ([a-z][a-z-]*)  ", out, re.M)
    assert listed.index("demo") == 0 and sorted(listed) == sorted(panels)
    last = {name for name, panel in panels.items() if panel == "Verify"}
    assert last == set(listed[-len(last) :])


@pytest.mark.parametrize(("words", "command"), COMMANDS, ids=[" ".join(words) or "fluxlock" for words, _ in COMMANDS])
def test_examples(words: tuple[str, ...], command: Any) -> None:
    """Every command has an example of its own below its help, and it can be typed as it stands.

    Verifies: FRONT-60, DOC-04
    """
    if words == ("vector",):
        return  # its commands have them
    lines = EXAMPLE.findall(command.epilog or "")
    assert lines, "no example"
    for line in lines:
        assert line.split()[: len(words)] == list(words)
        check_fluxlock(shlex.split(line))


@pytest.mark.parametrize("name", ["regression", "campaign", "fuzz", "figures", "mutate"])
def test_examples_of_verification(name: str) -> None:
    """The same for the commands of `fluxverify`.

    Verifies: FRONT-60, DOC-04
    """
    command: Any = typer.main.get_command(verify_cli.app)
    assert len(command.commands) == 5
    (line,) = re.findall(r"^fluxverify (.+)$", command.commands[name].epilog or "", re.MULTILINE)
    assert line.split()[0] == name
    check_fluxlock(shlex.split(line), verify_cli.app)


@pytest.mark.parametrize("words", [("--help",), RUN, ("motor",), INFO], ids=["help", "run", "motor", "info"])
@pytest.mark.parametrize("columns", [40, 200])
def test_widths(words: tuple[str, ...], columns: int) -> None:
    """Narrow and wide terminals: no line is longer, no word of a key is cut.

    Verifies: FRONT-61
    """
    done = run_command(*words, COLUMNS=str(columns))
    assert done.returncode == (2 if words == ("motor",) else 0) and done.stderr == ""
    assert max(map(len, done.stdout.splitlines())) <= columns
    assert "…" not in done.stdout or words is INFO, "something is cut"
    if words is RUN:
        assert "--sanitize" in done.stdout and re.search("--debugger +COMMAND", done.stdout)
    if words is INFO:
        assert all(key in done.stdout for key in ("resistance_ohm", "rated_current_a", "max_speed_rpm"))
        assert ("in motors/" in done.stdout) == (columns == 200)


@pytest.mark.parametrize("environment", [{"NO_COLOR": "1", "FORCE_COLOR": "1"}, {"TERM": "dumb"}, {}], ids=str)
def test_no_colours(environment: dict[str, str]) -> None:
    """No colour where none is wanted, where the terminal has none, and in a pipe.

    Verifies: FRONT-61
    """
    for words in (("--help",), INFO):
        done = run_command(*words, **environment)
        assert done.returncode == 0 and not re.search("\x1b\\[[0-9;]*3[0-9]", done.stdout)
    if not environment:
        assert "\x1b" not in done.stdout
        assert "\x1b[" in run_command(*INFO, FORCE_COLOR="1").stdout


@pytest.mark.parametrize("words", [("--help",), INFO, (*INFO, "--json")], ids=["help", "info", "json"])
def test_reader_that_goes(words: tuple[str, ...]) -> None:
    """A pipe whose reader ends first: nothing on the error output, and the exit code of a closed pipe.

    Verifies: FRONT-61
    """
    done = run_command(*words, shell="| true")
    assert done.stderr == "" and done.returncode == EXIT_READER_GONE
    first = run_command(*words, shell="| head -n 1")
    assert first.stderr == "" and len(first.stdout.splitlines()) == 1


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(shell: str) -> None:
    """The shell gets a script, and the script's call names commands and files.

    Verifies: FRONT-62
    """
    script = run_command(_FLUXLOCK_COMPLETE=f"source_{shell}").stdout
    assert "_FLUXLOCK_COMPLETE" in script and f"complete_{shell}" in script


def test_completion_of_words(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Commands by their beginning; motor and scenario files of the current folder.

    Verifies: FRONT-62
    """
    done = run_command(_FLUXLOCK_COMPLETE="complete_bash", COMP_WORDS="fluxlock mo", COMP_CWORD="1")
    assert done.stdout.split() == ["motor"]
    monkeypatch.chdir(ROOT)
    done = run_command(_FLUXLOCK_COMPLETE="complete_bash", COMP_WORDS="fluxlock run ", COMP_CWORD="2")
    assert "scenarios/demo.toml" in done.stdout.split()
    for name in ("a.toml", "b.toml", "a.txt", "deeper/c.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    complete = complete_toml("motors")
    assert complete("") == ["a.toml", "b.toml", "deeper/"] and complete("b") == ["b.toml"]
    assert complete(f"{tmp_path}/de") == [f"{tmp_path}/deeper/"] and complete("deeper/") == ["deeper/c.toml"]
    assert complete("none/") == []


def test_demo_from_another_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The demo finds its scenario and its folder from wherever it is called.

    Verifies: FRONT-63
    """
    asked: list[tuple[Path, Path]] = []
    monkeypatch.setattr(cli, "run", lambda scenario, out, seed: asked.append((scenario, out)))
    for folder, shown in ((ROOT, Path("build/demo")), (ROOT / "docs", ROOT / "build" / "demo")):
        monkeypatch.chdir(folder)
        cli.demo(out=cli.BUILD / "demo")
        assert asked.pop() == (ROOT / "scenarios" / "demo.toml", shown)


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (2.2e-05, "H", "22 µH"),
        (0.02, "Ohm", "20 mΩ"),
        (14_620.0, "s", "14 620 s"),
        (5e-7, "kg*m^2", "5 g·cm²"),
        (94_000.0, "r/min", "94 000 r/min"),
        (0.0, "H", "0 H"),
        (1e-3, "V*s/rad", "1 mV·s/rad"),
        (123_456.0, "r/min/s", "123 500 r/min per s"),
        (1e-12, "H", "0.001 nH"),
        (3e12, "N*m", "3e+09 kN·m"),
    ],
)
def test_values_with_prefixes(value: float, unit: str, expected: str) -> None:
    """Values stand in the unit that a person would choose.

    Verifies: FRONT-64
    """
    factor, name = scale(value, unit)
    assert f"{number(factor * value)} {name}" == expected


def test_help_loads_nothing_heavy() -> None:
    """Compilers, solvers and plots are left to the commands that need them: every command would wait for them.

    Verifies: FRONT-60
    """
    heavy = ("cocotb_tools", "matplotlib", "numba", "scipy")
    program = f"import sys, fluxlock.cli; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
