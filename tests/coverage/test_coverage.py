# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Coverage: reading and adding up counters, the report, reasons for what is not reached."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.firmware.toolchain import COVERAGE_VARIABLE, build_host_library
from fluxlock.sources import named, source_hashes
from fluxverify.coverage import __main__ as command
from fluxverify.coverage import rtl, software
from fluxverify.coverage.report import by_folder, details, page
from fluxverify.coverage.rtl import Point, explain, merge, read_points, summary

FILE = "rtl/safety/a.sv"


def counter(line: int, kind: str, what: str, count: int, file: str = FILE, instance: str = "top") -> str:
    fields = {"f": str(ROOT / file), "l": line, "n": 3, "t": kind, "page": f"v_{kind}/a", "o": what, "h": instance}
    return "C '" + "".join(f"\x01{k}\x02{v}" for k, v in fields.items()) + f"' {count}"


def test_counters_of_all_instances_and_builds_are_added() -> None:
    """Counts of one point are summed; other files and other lines are left out.

    Verifies: COV-01
    """
    first = [counter(2, "line", "block", 0), counter(2, "line", "block", 3, instance="top.u_b"), "# a comment"]
    second = [counter(2, "line", "block", 4), counter(7, "toggle", "x:0->1", 1), counter(1, "line", "if", 1, "a.sv")]
    assert merge([read_points(first), read_points(second)]) == {
        Point(FILE, 2, 3, False, "block"): 7,
        Point(FILE, 7, 3, True, "x:0->1"): 1,
    }


def test_reasons_fit_what_is_not_reached() -> None:
    """A missing reason, and a reason for what is reached, are problems; elsewhere none is asked for.

    Verifies: COV-02
    """
    other = "rtl/zcd/b.sv"
    counts = read_points(
        [
            counter(1, "line", "block", 5),
            counter(2, "branch", "else", 0),
            counter(3, "branch", "if", 0),
            counter(3, "toggle", "x[1]:1->0", 0),
            counter(1, "line", "if", 0, other),
        ]
    )
    files = summary(counts, {FILE: ["a <= 1;", "if (b)", "if (c)"], other: ["if (d)"]})
    assert files[FILE]["statements"] == [3, 1] and files[FILE]["toggles"] == [1, 0]
    assert files[FILE]["still"] == ["3: x[1]:1->0"]
    given = [{"code": "if (b)", "reason": "never"}, {"code": "a <= 1", "reason": "stale"}]
    report, problems = explain(files, {FILE: given, "rtl/safety/not_measured.sv": given})
    assert report == [f"- {FILE}:2 (else) `if (b)`: never", f"- {FILE}:3 (if) `if (c)`: no reason given"]
    assert len(problems) == 2
    assert problems[0].startswith(f"{FILE}:3 (if)") and "reached, or not there: 'a <= 1'" in problems[1]
    text = page(files, {}, {}, report, ["safety", "zcd"], {"chip": "aaaaaaaaaaaa"}) + details(files, {}, {})
    assert f"| {FILE} | 3 | 33.3 | 1 | 0.0 |" in text and f"- {other}:1 (if) `if (d)`" in text
    assert "| rtl/safety | 3 | 33.3 | 1 | 0.0 |\n| rtl/zcd | 1 | 0.0 | 0 | - |\n| all | 4 | 25.0 | 1 | 0.0 |" in text
    assert "\nBlock tests of safety, zcd.\n" in text


def test_folders_are_added_up() -> None:
    """Files below a folder are summed, those of its own folders too; nothing gives no row.

    Verifies: COV-03
    """
    files = {"sw/a/x.c": [4, 2, 10, 5], "sw/a/b/y.c": [1, 1, 2, 2], "sw/z.c": [0, 0, 3, 0]}
    assert by_folder(files, 2) == {"sw": [0, 0, 3, 0], "sw/a": [5, 3, 12, 7], "all": [5, 3, 15, 7]}
    assert by_folder({}, 2) == {}


def test_numbers_of_the_tools_are_read() -> None:
    """Branches and lines of gcovr's and coverage.py's files, each with what was reached.

    Verifies: COV-03
    """
    row = {"filename": "sw/a.c", "branch_total": 4, "branch_covered": 3, "line_total": 9, "line_covered": 8}
    assert software.c_files({"files": [row]}) == {"sw/a.c": [4, 3, 9, 8]}
    numbers = {"num_branches": 6, "covered_branches": 5, "num_statements": 20, "covered_lines": 19}
    assert software.python_files({"files": {"sim/fluxlock/a.py": {"summary": numbers}}}) == {
        "sim/fluxlock/a.py": [6, 5, 20, 19]
    }


def test_every_host_test_is_run_once() -> None:
    """The parts hold each test file of their folders once; folders left out are those of chips, proofs and whole lives.

    Verifies: COV-03
    """
    files = [file for part in software.parts() for file in part]
    there = {str(p.relative_to(ROOT)) for p in (ROOT / "tests").rglob("test_*.py")}
    assert len(files) == len(set(files))
    left_out = {"campaign", "can", "closed_loop", "drive", "export", "formal", "mutation", "package", "population"}
    left_out |= {"live", "prove"}
    assert {Path(file).parts[1] for file in there - set(files)} == left_out


@pytest.mark.skipif(shutil.which("gcov") is None, reason="no GCC on this machine")
def test_branches_of_c_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that calls one function of the counted library leaves its branches, and those alone, as taken.

    Verifies: COV-03
    """
    monkeypatch.setenv(COVERAGE_VARIABLE, str(tmp_path))
    library = build_host_library()
    assert library.parent == tmp_path
    code = f"import ctypes; print(ctypes.CDLL({str(library)!r}).crc32(b'a', 1))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) % (1 << 32) == 0xE8B7BE43
    monkeypatch.setattr(software, "C_COUNTS", tmp_path)
    files = software.read_c()
    branches, taken, lines, reached = files["sw/control/crc32.c"]
    assert 0 < taken <= branches and 0 < reached <= lines
    assert files["sw/control/ramp.c"][1] == files["sw/control/ramp.c"][3] == 0


def test_missing_reason_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is not reached in a safety block without a reason is in the report, fails, and leaves the page alone.

    Verifies: COV-02
    """
    counts = read_points([counter(3, "branch", "if", 0, "rtl/safety/fl_sync.sv"), counter(4, "line", "block", 1)])
    files = summary(counts, {FILE: [""] * 9, "rtl/safety/fl_sync.sv": ["a"] * 9})
    written = tmp_path / "page.md"

    def run_tests(folders: list[str], _: int) -> int:
        (tmp_path / "coverage").mkdir()
        (tmp_path / "coverage" / "folders").write_text(" ".join(folders))
        return 0

    for module, name, value in (
        (command, "FOLDER", tmp_path / "coverage"),
        (command, "PAGE", written),
        (software, "run_tests", lambda _: True),
        (software, "read_c", lambda: {"sw/a.c": [4, 3, 9, 8]}),
        (software, "read_python", lambda: {"sim/fluxlock/b/c.py": [2, 1, 4, 4]}),
        (rtl, "FOLDERS", tmp_path / "coverage" / "folders"),
        (rtl, "run_tests", run_tests),
        (rtl, "read_files", lambda: files),
        (rtl, "read_reasons", dict),
    ):
        monkeypatch.setattr(module, name, value)
    assert command.main([]) == 1 and not written.exists()
    monkeypatch.setattr(rtl, "read_reasons", lambda: {"rtl/safety/fl_sync.sv": [{"code": "a", "reason": "so"}]})
    assert command.main([]) == 0
    text = written.read_text()
    assert named(text) == source_hashes()
    assert "`a`: so" in text and "| sw | 4 | 75.0 | 9 | 88.9 |" in text
    assert "| sim/fluxlock/b | 2 | 50.0 | 4 | 100.0 |" in text
    results = json.loads((tmp_path / "coverage" / "coverage.json").read_text())
    assert results["c"] == {"sw/a.c": [4, 3, 9, 8]}
