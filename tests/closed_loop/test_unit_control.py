# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`sw/images/bench/unit_control.c`: unit tests of the control algorithms in C, on the host and on the soft core."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_scenario
from fluxlock.cosim.program import run_program
from fluxlock.firmware import build_program_library
from fluxlock.firmware.binding import open_library, types
from fluxlock.firmware.toolchain import SW, _host_library

PROGRAM = "unit_control"
SUMMARY = r"(\d+) tests, (\d+) failed"


def host_report() -> list[str]:
    library = open_library(build_program_library(PROGRAM))
    library.unit_control()
    return bytes(types().string(library.unit_report())).decode().splitlines()


def test_on_the_host() -> None:
    """Every test of the file runs and passes.

    Verifies: FW-95
    """
    report = host_report()
    print("\n".join(report))
    found = re.fullmatch(SUMMARY, report[-1])
    assert found and int(found[2]) == 0
    listed = re.findall(
        r"^static void (\w+)\(void\) \{", (SW / "images" / "bench" / "unit_control.c").read_text(), re.MULTILINE
    )
    assert report[:-1] == [f"ok {name}" for name in listed]
    assert int(found[1]) == len(listed)


def test_on_the_core(tmp_path: Path) -> None:
    """The soft core of the simulated chip writes the report of the host.

    Verifies: FW-95
    """
    scenario = load_scenario(ROOT / "scenarios" / "vector" / "identify.toml", ["duration_s=0.025"])
    run = run_program(PROGRAM, b"", scenario, tmp_path, seed=1)
    assert run.uart == host_report()


@pytest.mark.parametrize("number", [0, 7, -1, 10, -2147483648, 2147483647])
def test_a_failed_check_says_where_and_what(number: int, tmp_path: Path) -> None:
    """A wrong value is told from the right one: line, value and what was expected, and the test has failed.

    Verifies: FW-95
    """
    source = (SW / "images" / "bench" / "unit_control.c").read_text()
    value = f"({number + 1} - 1)" if number < 0 else str(number)
    broken = source.replace("CHECK(ramp.value_rpm_q8, 1000 << 8);", f"CHECK({value}, 256000);")
    assert broken != source
    path = tmp_path / "unit_control.c"
    path.write_text(broken)
    line = next(n for n, text in enumerate(broken.splitlines(), start=1) if ", 256000);" in text)
    library = open_library(_host_library(f"unit{number}", [str(path)], tmp_path))
    assert library.unit_control() == 1
    report = bytes(types().string(library.unit_report())).decode()
    assert f"line {line}: {number}, expected 256000\nFAILED ramp_arrives_and_stays\n" in report
