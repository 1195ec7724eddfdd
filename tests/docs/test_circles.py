# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Who may know whom, in Python and in the RTL, and the checks that say so notice a breach."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT, RTL
from fluxverify.rtl_shape import complaints


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """The contracts of pyproject.toml on the package of a folder."""
    tool = Path(sys.executable).with_name("lint-imports")
    line = [str(tool), str(ROOT / "pyproject.toml"), "--no-cache", "--no-logo"]
    env = {**os.environ, "PYTHONPATH": str(folder)}
    return subprocess.run(line, cwd=folder, env=env, capture_output=True, text=True, check=False)


def test_no_circles() -> None:
    """The package as it is.

    Verifies: CHK-03
    """
    done = lint(ROOT / "sim")
    assert done.returncode == 0, done.stdout
    assert "No circles KEPT" in done.stdout
    assert "The product does not know its verification KEPT" in done.stdout


@pytest.mark.parametrize(
    ("module", "line", "named"),
    [
        ("fluxlock/plant/emf.py", "import fluxlock.cosim.run", "No cycles are allowed in fluxlock."),
        (
            "fluxverify/regression/runner.py",
            "from fluxverify.regression import sets",
            "No cycles are allowed in fluxverify.regression.",
        ),
        (
            "fluxlock/base/progress.py",
            "def late():\n    from fluxlock.results import metrics",
            "No cycles are allowed in fluxlock.",
        ),
        ("fluxlock/api.py", "import fluxverify.regression.case", "The product does not know its verification BROKEN"),
    ],
)
def test_a_planted_breach_is_found(module: str, line: str, named: str, tmp_path: Path) -> None:
    """A circle between packages, within one, inside a function, and the product that asks its verification: by name.

    Verifies: CHK-03
    """
    for package in ("fluxlock", "fluxverify"):
        shutil.copytree(ROOT / "sim" / package, tmp_path / package, ignore=shutil.ignore_patterns("*.pyc", "page"))
    planted = tmp_path / module
    planted.write_text(planted.read_text(encoding="utf-8") + f"\n\n{line}\n", encoding="utf-8")
    done = lint(tmp_path)
    assert done.returncode == 1 and named in done.stdout, done.stdout


def test_blocks_do_not_know_each_other() -> None:
    """The RTL as it is.

    Verifies: CHK-04
    """
    assert list(complaints()) == []


# Source, the text before which something is planted, what is planted, what the check says of it.
PLANTED = {
    "instance": ("zcd/fl_hall.sv", "endmodule", "  fl_gate_guard u_guard ();\n", "fl_gate_guard of safety/"),
    "package": ("pwm/fl_sequencer.sv", "module fl_sequencer", "import fl_foc_pkg::*;\n", "fl_foc_pkg of foc/"),
    "type": ("sense/fl_sense.sv", "endmodule", "  fl_vector_pkg::tap_t tap;\n", "fl_vector_pkg of soc/"),
    "registers": ("can/fl_can_tx.sv", "endmodule", "  fl_can_regs u_regs ();\n", None),
    "block within what is shared": ("common/fl_fifo.sv", "endmodule", "  fl_irq u_irq ();\n", "fl_irq of soc/"),
    "registers within what is shared": (
        "common/fl_sync.sv",
        "endmodule",
        "  fl_sys_regs u ();\n",
        "fl_sys_regs of regs/",
    ),
    "shared module within the package": ("pkg/fl_pkg.sv", "endpackage", "  fl_sync u_sync;\n", "fl_sync of common/"),
    "comment": ("zcd/fl_hall.sv", "endmodule", "  // fl_gate_guard\n  /* fl_trip\n fl_trip */\n", None),
    "text": ("zcd/fl_hall.sv", "endmodule", '  initial $info("as fl_trip does");\n', None),
    "behind a comment": (
        "zcd/fl_hall.sv",
        "endmodule",
        "  /* as\n it is */ fl_brake u_brake ();\n",
        "fl_brake of safety/",
    ),
}


@pytest.mark.parametrize("planted", PLANTED)
def test_a_planted_name_of_another_block_is_found(planted: str, tmp_path: Path) -> None:
    """An instance, a package, a type of another folder: named with their line. Not so what is shared, comments, texts.

    Verifies: CHK-04
    """
    shutil.copytree(RTL, tmp_path / "rtl")
    file, before, added, said = PLANTED[planted]
    source = tmp_path / "rtl" / file
    text = source.read_text(encoding="utf-8")
    at = text.index(f"\n{before}") + 1
    source.write_text(text[:at] + added + text[at:], encoding="utf-8")
    line = text[:at].count("\n") + added.count("\n")
    found = list(complaints(tmp_path / "rtl"))
    folder = file.partition("/")[0]
    assert found == ([f"rtl/{file}:{line} names {said}, which a source of {folder}/ must not know"] if said else [])
