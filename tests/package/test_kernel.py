# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A notebook: cells in a Jupyter kernel, their progress, and what *Interrupt* leaves behind."""

from __future__ import annotations

import ast
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jupyter_client
import pytest
from typer.testing import CliRunner

from fluxlock.cli import app

PATIENCE_S = 600.0  # a chip may be built first, on a busy machine
LONG = "twin=True, duration_s=60.0, progress=True, event=[], window=[], expect=[]"
ENDLESS = {
    "twin": f'fluxlock.simulate("scenarios/own-spindle.toml", {LONG})',
    "chip": f'fluxlock.simulate("scenarios/own-spindle.toml", {LONG.replace("twin=True", "twin=False")})',
    "pool": "short = fluxlock.scenario_of('scenarios/own-spindle.toml', {'duration_s': 1.2})\n"
    "fluxlock.sweep(short, {'seed': range(1, 1001)}, twin=True, jobs=2, progress=True, done=lambda row: print('row'))",
}
BEGUN = {"twin": "simulating", "chip": "simulating", "pool": "row"}
# What the process of the kernel has begun and not ended.
CHILDREN = """
import os
from pathlib import Path
found = Path(f"/proc/{os.getpid()}/task").glob("*/children")
print([Path(f"/proc/{p}/cmdline").read_text() for f in found for p in f.read_text().split()])
"""


class Notebook:
    """A kernel of this Python in a folder."""

    def __init__(self, folder: Path) -> None:
        self.manager = jupyter_client.KernelManager(kernel_name="python3")
        self.manager.start_kernel(cwd=str(folder))
        self.client = self.manager.blocking_client()
        self.client.start_channels()
        self.client.wait_for_ready(timeout=PATIENCE_S)

    def run(self, source: str, seen: Callable[[str], None] = lambda _: None) -> tuple[dict[str, Any], list[Any]]:
        """Run a cell; its reply, and the contents of what it showed. seen: called with each text as it comes."""
        shown: list[Any] = []

        def show(message: dict[str, Any]) -> None:
            shown.append(message["content"])
            seen(text_of(shown[-1:]))

        reply = self.client.execute_interactive(source, timeout=PATIENCE_S, output_hook=show)
        return reply["content"], shown


def text_of(shown: list[Any]) -> str:
    """Text of what cells showed, of streams and of displays."""
    return "".join(c.get("text", "") + c.get("data", {}).get("text/plain", "") for c in shown)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("kernel") / "my-drive"
    assert CliRunner().invoke(app, ["init", str(made)]).exit_code == 0
    return made


@pytest.fixture(scope="module")
def notebook(folder: Path) -> Iterator[Notebook]:
    made = Notebook(folder)
    yield made
    made.client.stop_channels()
    made.manager.shutdown_kernel(now=True)


def test_first_notebook(folder: Path, notebook: Notebook) -> None:
    """The notebook of `init` shows verdict, traces and table in a Jupyter kernel.

    Verifies: PACKAGE-10
    """
    book, shown = json.loads((folder / "first.ipynb").read_text(encoding="utf-8")), []
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            reply, contents = notebook.run(cell["source"])
            assert reply["status"] == "ok", reply
            shown += contents
    kinds = {kind for content in shown for kind in content.get("data", {})}
    assert {"image/png", "text/html"} <= kinds and "steady.commutation_error_deg.rms" in text_of(shown)


def test_progress(notebook: Notebook) -> None:
    """A cell that asks for progress gets a line for a tenth, of a quick run for some of them, and the verdict.

    Verifies: PACKAGE-7
    """
    reply, shown = notebook.run('import fluxlock\nfluxlock.simulate("scenario.toml", twin=True, progress=True)')
    assert reply["status"] == "ok", reply
    text = text_of(shown)
    assert 1 <= text.count("simulating ") <= 12, text
    assert "<Run of own-spindle: ok: " in text


@pytest.mark.parametrize("place", ENDLESS)
def test_interrupt(place: str, notebook: Notebook) -> None:
    """*Interrupt* ends a run and its processes with KeyboardInterrupt; the next cell works.

    Verifies: PACKAGE-7
    """
    asked = []

    def seen(text: str) -> None:
        if BEGUN[place] in text and not asked:
            asked.append(text)
            notebook.manager.interrupt_kernel()

    reply, shown = notebook.run(f"import fluxlock\n{ENDLESS[place]}", seen)
    assert asked and (reply["status"], reply.get("ename")) == ("error", "KeyboardInterrupt"), (reply, text_of(shown))
    _, shown = notebook.run(CHILDREN)
    assert [words for words in ast.literal_eval(text_of(shown)) if "resource_tracker" not in words] == []
    reply, shown = notebook.run('print(fluxlock.simulate("scenario.toml", twin=True).verdict.passed)')
    assert (reply["status"], text_of(shown)) == ("ok", "True\n"), reply
