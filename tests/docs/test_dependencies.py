# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Packages that the product's modules import against the dependency groups of pyproject.toml."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from itertools import chain

from fluxlock.base.paths import ROOT

# Packages that come with one of the group, and modules named otherwise than their package.
SHIPPED_WITH = {
    "elftools": "pyelftools",
    "can": "python_can",
    "cocotb_tools": "cocotb",
    "find_libpython": "cocotb",
    "pil": "matplotlib",
    "pydantic_core": "pydantic",
}


def test_modules_import_only_what_make_demo_installs() -> None:
    """Every command but the tests' own works after `make demo`; what only the tests need is not imported.

    Packages of the extras count as there: where they are imported, their absence says what to install.

    Verifies: FRONT-33
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    texts = [*project["project"]["dependencies"], *chain(*project["project"]["optional-dependencies"].values())]
    installed = {re.split(r"[^\w-]", text)[0].lower().replace("-", "_") for text in texts}
    wrong = []
    for path in sorted((ROOT / "sim" / "fluxlock").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and node.module and not node.level else []
            tops = {name.partition(".")[0].lower() for name in names} - sys.stdlib_module_names - {"fluxlock"}
            wrong += [f"{path.relative_to(ROOT)}: {top}" for top in tops if SHIPPED_WITH.get(top, top) not in installed]
    assert not wrong, wrong
