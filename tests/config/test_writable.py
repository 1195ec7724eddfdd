# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A build folder that may not be written to, as under another user's checkout: one line, exit code 2."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import traceback
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.base.writable import write_whole

WRITES, LONG = 2_000, 10_000
DROP_BOUNDING, MAY_WRITE_ALL = 24, 1  # PR_CAPBSET_DROP, CAP_DAC_OVERRIDE
ADVICE = "Permission denied; let this user write there, or work in a checkout of your own\n"
DEMO = str(ROOT / "scenarios" / "demo.toml")
COMMANDS = {
    "run": ["run", DEMO, "--out", "OUT"],
    "regression": ["regression", "six-step/patterns", "--quick"],
    "figures": ["figures", "six-step", "5.10", "--out", "OUT"],
}


def without_rights() -> None:
    """Root may write everywhere, unless the process that is begun lacks that right."""
    if os.geteuid() == 0:
        ctypes.CDLL(None).prctl(DROP_BOUNDING, MAY_WRITE_ALL, 0, 0, 0)  # noqa: TID251  # of the system, not the firmware


def call(build: Path, program: str) -> tuple[int, str]:
    """Exit code and error output of a program with its build folder elsewhere."""
    begin = (
        f"import sys; from pathlib import Path; from fluxlock.base import paths; paths.BUILD = Path({str(build)!r}); "
    )
    done = subprocess.run(
        [sys.executable, "-c", f"{begin}paths.GENERATED = paths.BUILD / 'generated'; {program}"],
        cwd=build.parent,
        preexec_fn=without_rights,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    return done.returncode, done.stderr


def locked(folder: Path) -> Path:
    folder.mkdir(parents=True)
    folder.chmod(0o555)
    return folder


pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="capabilities")


@pytest.mark.parametrize(
    ("command", "refused"),
    [
        ("run", "."),
        ("run", "chip"),
        ("run", "plant"),
        ("regression", "regression/quick"),
        ("regression", "regression/keys"),
        ("figures", "regression"),
    ],
)
def test_commands(tmp_path: Path, command: str, refused: str) -> None:
    """The folder that refuses is named before anything takes time.

    Verifies: FRONT-32
    """
    folder = locked(tmp_path / "build" / refused)
    words = [str(tmp_path / "out") if word == "OUT" else word for word in COMMANDS[command]]
    package = "fluxlock" if command == "run" else "fluxverify"
    program = f"sys.argv[1:] = {words}; from {package}.cli import main; main()"
    code, error = call(tmp_path / "build", program)
    last = error.splitlines(keepends=True)[-1]
    assert code == 2 and last.startswith(f"error: {folder.resolve()}") and last.endswith(f": {ADVICE}"), error
    assert "Traceback" not in error


def test_results_of_another_user(tmp_path: Path) -> None:
    """The file of the regression may not be written: found before the runs, not after them.

    Verifies: FRONT-32
    """
    result = tmp_path / "build" / "regression.json"
    result.parent.mkdir()
    result.touch()
    result.chmod(0o444)
    program = "sys.argv[1:] = ['regression', 'six-step/patterns', '--quick']; from fluxverify.cli import main; main()"
    assert call(tmp_path / "build", program) == (2, f"error: {result}: {ADVICE}")


@pytest.mark.parametrize("module", ["fluxlock.generate.registers", "fluxverify.bench", "fluxverify.lint"])
def test_modules(tmp_path: Path, module: str) -> None:
    """The same from the modules that the targets of make call.

    Verifies: FRONT-32
    """
    arguments = {"registers": ["regs"], "bench": [], "lint": ["c"]}[module.rpartition(".")[2]]
    build = locked(tmp_path / "build")
    program = f"import runpy; sys.argv[1:] = {arguments}; runpy.run_module('{module}', run_name='__main__')"
    code, error = call(build, program)
    assert code == 2 and error.endswith(f": {ADVICE}") and error.count("\n") == 1 and str(build) in error, error


@pytest.mark.parametrize("command", ["soa", "figures"])
def test_folder_of_results(tmp_path: Path, command: str) -> None:
    """A folder of results that is there but may not be written to is refused before the work.

    Verifies: FRONT-32
    """
    out = locked(tmp_path / "out" / "six-step" if command == "figures" else tmp_path / "out")
    words = {"soa": ["soa", "--no-simulate"], "figures": ["figures", "six-step", "5.10"]}[command]
    words += ["--out", str(tmp_path / "out")]
    (tmp_path / "build").mkdir()
    package = {"soa": "fluxlock", "figures": "fluxverify"}[command]
    program = f"sys.argv[1:] = {words}; from {package}.cli import main; main()"
    code, error = call(tmp_path / "build", program)
    assert code == 2 and error == f"error: --out: {out}: cannot be written: Permission denied; name another folder\n"


def test_files_of_two_threads_stay_whole(tmp_path: Path) -> None:
    """Threads of a process, such as two sweeps in one folder, write the same file; no one takes another's away.

    Verifies: DRV-04
    """
    path = tmp_path / "point.json"

    def write(letter: str) -> None:
        for _ in range(WRITES):
            write_whole(path, LONG * letter)
            assert path.read_text() in (LONG * "a", LONG * "b")

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(write, "ab"))
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_files_of_two_writers_stay_whole(tmp_path: Path) -> None:
    """Copies of a process, such as the ends of a branch, write the same file; no one takes another's away.

    Verifies: DRV-04
    """
    path = tmp_path / "progress.json"
    copies = []
    for letter in "ab":
        if (pid := os.fork()) == 0:
            try:
                for _ in range(WRITES):
                    write_whole(path, LONG * letter)
                    assert path.read_text() in (LONG * "a", LONG * "b")
            except BaseException:
                traceback.print_exc()
                os._exit(1)
            os._exit(0)
        copies.append(pid)
    assert [os.waitpid(pid, 0)[1] for pid in copies] == [0, 0]
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
