# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What `make check` runs for which changed files, and the page of the tests' times."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from fluxverify import check
from fluxverify.docs import tests as times

TEXTS = {
    "cocotb_tests/zcd/test_fl_zcd.py": 'from cocotb_tests.zcd.zcd_bench import TB\nSOURCES = ["zcd/fl_zcd.sv"]',
    "cocotb_tests/zcd/zcd_bench.py": 'SHARED = ["zcd/fl_interpolator.sv"]',
    "cocotb_tests/pwm/test_fl_pwm.py": '"pwm/fl_pwm.sv"',
    "cocotb_tests/safety/test_fl_trip.py": '"safety/fl_trip.sv"  # the safety bench',
    "cocotb_tests/can/bench.py": 'SOURCES = ["can/fl_can.sv"]',
    "cocotb_tests/can/test_fl_can.py": "from cocotb_tests.can.bench import SOURCES",
    "cocotb_tests/soc/bench.py": "",
    "cocotb_tests/soc/test_fl_irq.py": "from cocotb_tests.soc.bench import Bench",
    "cocotb_tests/safety/fl_trip.sby": """# Licence

[tasks]
prove
second
[options]
[files]
../../rtl/safety/fl_trip.sv
""",
    "tests/plant/test_hall.py": "",
    "tests/canopen/test_sdo.py": "",
    "tests/canopen/test_chip.py": "data = run_chip(folder)",
    "tests/closed_loop/test_runs.py": "",
    "tests/config/test_files.py": "",
}
PROOF = "tests/formal/test_safety_proofs.py::test_proof"


@pytest.mark.parametrize(
    ("changed", "wanted"),
    [
        ("rtl/zcd/fl_zcd.sv", ["cocotb_tests/zcd/test_fl_zcd.py"]),
        ("rtl/zcd/fl_interpolator.sv", ["cocotb_tests/zcd/test_fl_zcd.py"]),  # by its bench
        ("cocotb_tests/zcd/zcd_bench.py", ["cocotb_tests/zcd/test_fl_zcd.py"]),
        ("rtl/can/fl_can.sv", ["cocotb_tests/can/test_fl_can.py"]),  # by one bench among several of that name
        (
            "rtl/safety/fl_trip.sv",
            ["cocotb_tests/safety/test_fl_trip.py", f"{PROOF}[fl_trip-prove]", f"{PROOF}[fl_trip-second]"],
        ),
        (
            "cocotb_tests/safety/fl_trip.sby",
            ["cocotb_tests/safety/test_fl_trip.py", f"{PROOF}[fl_trip-prove]", f"{PROOF}[fl_trip-second]"],
        ),
        ("sim/fluxlock/plant/kernel.py", ["tests/plant/test_hall.py"]),
        ("tests/canopen/node_bench.py", ["tests/canopen/test_sdo.py"]),  # not the one that runs a chip
        ("tests/closed_loop/test_runs.py", []),
        ("sim/fluxlock/config/loader.py", []),  # a unit, which is run in any case
        ("docs/index.md", []),
    ],
)
def test_selection(changed: str, wanted: list[str]) -> None:
    """What names a changed source or bench, directly or through a bench, is run; nothing else is.

    Verifies: CHK-01
    """
    assert check.selection([changed], TEXTS) == wanted


def test_packages_are_in_every_block() -> None:
    """The package of all blocks asks for all blocks and proofs.

    Verifies: CHK-01
    """
    blocks = [name for name in TEXTS if name.startswith("cocotb_tests/") and "test_" in name]
    found = check.selection(["rtl/pkg/fl_pkg.sv"], TEXTS)
    assert set(found) == {*blocks, f"{PROOF}[fl_trip-prove]", f"{PROOF}[fl_trip-second]"}


def test_every_source_has_a_block_test() -> None:
    """In this checkout every block's source asks for a test or proof by name, but packages and what only wires others.

    Verifies: CHK-01
    """
    texts = check.read_texts()
    wiring = {"board", "vendor", "soc", "pkg"}
    sources = [
        p for p in (check.ROOT / "rtl").glob("*/*.sv") if p.parent.name not in wiring and not p.stem.endswith("_pkg")
    ]
    assert len(sources) > 40
    missed = [p.name for p in sources if not check.selection([p.relative_to(check.ROOT).as_posix()], texts)]
    assert not missed


def test_green_files_are_not_asked_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A file that is as it was at the last green end is left out, until it changes again or goes.

    Verifies: CHK-01
    """
    monkeypatch.setattr(check, "ROOT", tmp_path)
    monkeypatch.setattr(check, "GREEN", tmp_path / "check.json")
    (tmp_path / "a.sv").write_text("1")
    (tmp_path / "b.sv").write_text("1")
    assert check.not_green(["a.sv", "b.sv"]) == ["a.sv", "b.sv"]
    check.GREEN.write_text(json.dumps({"a.sv": check._hash("a.sv"), "b.sv": check._hash("b.sv")}))
    (tmp_path / "b.sv").write_text("2")
    assert check.not_green(["a.sv", "b.sv"]) == ["b.sv"]
    (tmp_path / "a.sv").unlink()
    assert check.not_green(["a.sv", "b.sv"]) == ["a.sv", "b.sv"]


def test_unknown_revision() -> None:
    """A revision that there is none of is one line and exit code 2.

    Verifies: CHK-01
    """
    command = [sys.executable, "-m", "fluxverify.check", "--list", "--since", "no-such-revision"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and "--since" in done.stderr


def row(name: str, cpu_s: float, outcome: str = "passed", reason: str = "") -> dict[str, object]:
    return {"id": name, "cpu_s": cpu_s, "wall_s": 2 * cpu_s, "outcome": outcome, "reason": reason}


def test_page_of_times() -> None:
    """Sums by folder, the slowest first, before beside now, and each skipped test with its reason.

    Verifies: CHK-02
    """
    rows = [row("tests/a/test_x.py::test_1", 1.0), row("tests/a/test_x.py::test_2[a|b]", 3.0)]
    rows.append(row("cocotb_tests/b/test_y.py::test_3", 0.0, "skipped", "needs gdb"))
    text = times.page(rows, [])
    assert "| tests/a | 4.0 | 2 |" in text and "| all | 4.0 | 3 |" in text
    assert text.index("test_2") < text.index("test_1")
    assert "## Skipped: 1" in text and "| `cocotb_tests/b/test_y.py::test_3` | needs gdb |" in text
    text = times.page(rows, [row("tests/a/test_x.py::test_1", 9.0), row("tests/c/test_z.py::test_4", 2.0)])
    assert "| tests/a | 9.0 | 4.0 | 2 |" in text and "| tests/c | 2.0 | – | 0 |" in text
    assert "| `tests/a/test_x.py::test_1` | 9.0 | 1.0 |" in text
    assert times.by_place(rows, 9) == {"tests/a/test_x.py": 4.0, "cocotb_tests/b/test_y.py": 0.0}
