# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sphinx extension: links `source:PATH` lead to a page with the file in colour, or with the list of a folder."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.util import ClassNotFound
from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[2]
SCHEME = "source:"
PLAIN = {".rdl": "a.sv", ".sby": "a.ini", ".vlt": "a.sv", ".lpf": "a.tcl", ".xdc": "a.tcl"}


def page_name(path: str) -> str:
    """Page of a file or folder of the checkout."""
    return f"source/{path.strip('/')}"


def resolve(app: Sphinx, tree: nodes.document, page: str) -> None:
    """Turn links to sources into links to their pages."""
    for link in tree.findall(nodes.reference):
        target = link.get("refuri", "")
        if target.startswith(SCHEME):
            path, _, anchor = target.removeprefix(SCHEME).partition("#")
            link["refuri"] = app.builder.get_relative_uri(page, page_name(path)) + (f"#{anchor}" if anchor else "")


def linked(sources: Path) -> set[str]:
    """Files and folders that the pages link to, with the files of these folders."""
    found = set()
    for page in sources.rglob("*.md"):
        for path in re.findall(r"\]\(source:([^)#\s]+)", page.read_text(encoding="utf-8")):
            found.add(path.strip("/"))
            if (ROOT / path).is_dir():
                found.update(child.relative_to(ROOT).as_posix() for child in children(ROOT / path))
    return found


def children(folder: Path) -> list[Path]:
    """Files of a folder that can be read."""
    return sorted(path for path in folder.iterdir() if path.is_file() and path.suffix != ".png")


def body_of(path: Path) -> str:
    """A file in colour, or the list of a folder."""
    if path.is_dir():
        items = "".join(
            f'<li><a href="{path.name}/{c.name}.html">{html.escape(c.name)}</a></li>' for c in children(path)
        )
        return f"<ul>{items}</ul>"
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        lexer = get_lexer_for_filename(PLAIN.get(path.suffix, path.name))
    except ClassNotFound:
        lexer = TextLexer()
    return str(highlight(text, lexer, HtmlFormatter(linenos="inline", lineanchors="L", cssclass="highlight")))


def pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """The pages of all sources that are linked to."""
    for path in sorted(linked(Path(app.srcdir))):
        head = f"<h1><code>{html.escape(path)}</code></h1>"
        body = f'<section>{head}<div class="source-page">{body_of(ROOT / path)}</div></section>'
        yield page_name(path), {"title": path, "body": body, "parents": [], "display_toc": False}, "page.html"


def docstring(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Read a docstring as it was meant: bars are bars, an indented paragraph is a formula and keeps its form."""
    blocks = re.split(r"\n\s*\n", "\n".join(lines))
    fields = False
    for i, block in enumerate(blocks):
        fields = block.startswith((":", "..")) or (fields and block.startswith("   "))
        if not fields and all(line.startswith("   ") for line in block.splitlines()):
            blocks[i] = f"::\n\n{block}"
        else:
            blocks[i] = block.replace("|", r"\|")
    lines[:] = "\n\n".join(blocks).splitlines()


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.connect("doctree-resolved", resolve)
    app.connect("autodoc-process-docstring", docstring, priority=600)  # after napoleon
    app.connect("html-collect-pages", pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
