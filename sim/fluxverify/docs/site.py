# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The documentation as a site: `python -m fluxverify.docs.site`, `make site`.

The pages of `docs` are copied to `build/site/source`; what only the site has is added there: the navigation
(`fluxverify.docs.navigation`), a line that says for whom a page is where it does not say so itself, a page per folder
of the RTL, one per public module, one of the commands, one of the settings by name. Sphinx makes `build/site/html` of
it, and any warning is an error. Links to sources lead to pages with the source in colour.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from fluxlock.base.paths import BUILD, ROOT
from fluxverify.docs import navigation
from fluxverify.docs.gallery import HEADING
from fluxverify.docs.navigation import DOCS, Entry, normal
from fluxverify.docs.site_pages import added_pages

CONFIGURATION = ROOT / "docs" / "site"
FOLDER = BUILD / "site"
SOURCE = FOLDER / "source"
HTML = FOLDER / "html"
LINK = re.compile(r"(\]\()([^)\s#:]+)((?:#[^)\s]*)?\))")
FENCE = re.compile(r"^( *)```.*?^\1```", re.DOTALL | re.MULTILINE)
PICTURE = re.compile(
    r"<picture>\s*<source media=\"\(([\w-]+): [^>]*srcset=\"([^\"]+)\"[^>]*>"
    r"\s*<img src=\"([^\"]+)\" alt=\"([^\"]+)\"[^>]*>\s*</picture>"
)
# Which of the two images of a picture is shown: classes of the theme and of static/fluxlock.css.
CHOICES = {
    "prefers-color-scheme": ("only-light", "only-dark"),
    "prefers-reduced-motion": ("only-moving", "only-still"),
}
LEFT_OUT = shutil.ignore_patterns("site", "gallery", "requirements.d", "*.toml", "places.txt", "record.json")
SHOWN = {".md", ".png", ".svg", ".gif"}
README = Path("README.md")  # the site has its own first page
GALLERY = Path("gallery")  # written by sphinx-gallery
PROJECT = Path("project")  # where the pages of the checkout's root stand on the site


def place(path: Path) -> Path | None:
    """Where a page of the checkout stands among the sources of the site; None: it is no page of the site."""
    if path == README:
        return Path("index.md")
    if path.suffix == ".md" and path.parent == Path():
        return PROJECT / path.name.lower()
    if path.is_relative_to(DOCS) and "requirements.d" not in path.parts and path.suffix in SHOWN:
        return path.relative_to(DOCS)
    return None


def relink(text: str, page: Path, root: Path = ROOT) -> str:
    """The text of a page with its links as the site has them: sources by the scheme `source:`."""
    here = place(page)
    assert here is not None

    def replaced(match: re.Match[str]) -> str:
        target = normal(page.parent / match[2])
        if not (root / target).exists():
            return match[0]
        there = place(target)
        if there is None:
            return f"{match[1]}source:{target.as_posix()}{match[3]}"
        anchor = ")" if target == README else match[3]
        return f"{match[1]}{os.path.relpath(there, here.parent)}{anchor}"

    text = PICTURE.sub(_two_images, text)
    parts, end = [], 0
    for fence in FENCE.finditer(text):
        parts += [LINK.sub(replaced, text[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, LINK.sub(replaced, text[end:])])


def _two_images(match: re.Match[str]) -> str:
    """A picture for two kinds of readers as two images, of which the site shows one."""
    first, second = CHOICES[match[1]]
    return f"![{match[4]}]({match[3]}){{.{first}}}\n![{match[4]}]({match[2]}){{.{second}}}"


def with_audience(text: str, inherited: str) -> str:
    """The page with a first line that says for whom it is: its own, else that of the page above it."""
    if navigation.audience(text) or not inherited:
        return text
    return re.sub(r"\A(# .*\n)", lambda match: f"{match[1]}\n{inherited}\n", text, count=1)


def with_titles(text: str) -> str:
    """The page with the titles of its figures as the words that stand for them."""
    titles = {f"Figure {number}": title for title, number in HEADING.findall(text)}
    return re.sub(r"!\[([^\]]+)\]", lambda match: f"![{titles.get(match[1], match[1])}]", text)


def toctree(page: Path, below: Sequence[Entry]) -> str:
    """The hidden table of contents that puts pages below one."""
    lines = []
    for entry in below:
        target = place(entry.page)
        assert target is not None
        name = "/" + target.with_suffix("").as_posix()
        lines.append(f"{entry.title} <{name}>" if entry.title else name)
    return "\n\n```{toctree}\n:hidden:\n\n" + "\n".join(lines) + "\n```\n"


def stage(root: Path = ROOT, source: Path = SOURCE) -> None:
    """Write the sources of the site."""
    fresh = source.with_name(source.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    shutil.copytree(root / DOCS, fresh, ignore=LEFT_OUT)

    def write(entry: Entry, inherited: str) -> None:
        target = place(entry.page)
        assert target is not None
        text = (root / entry.page).read_text(encoding="utf-8")
        own = navigation.audience(text) or inherited
        extra, added = added_pages(entry.page, text, own)
        for name, content in added.items():
            (fresh / name).parent.mkdir(parents=True, exist_ok=True)
            (fresh / name).write_text(content, encoding="utf-8")
        text = with_audience(with_titles(relink(text, entry.page, root)), inherited)
        below = [*(child for child in entry.below if child.page not in extra.replaced), *extra.entries]
        (fresh / target).parent.mkdir(parents=True, exist_ok=True)
        (fresh / target).write_text(text + (toctree(entry.page, below) if below else ""), encoding="utf-8")
        for child in entry.below:
            write(child, own)

    write(navigation.tree(root), "")
    _replace(fresh, source)


def _replace(fresh: Path, source: Path) -> None:
    """Put the new sources in the old ones' place; files of equal content keep their time, for Sphinx to leave them."""
    for path in fresh.rglob("*"):
        old = source / path.relative_to(fresh)
        if path.is_file() and old.is_file() and old.read_bytes() == path.read_bytes():
            shutil.copystat(old, path)
    if (source / GALLERY).exists():  # figures of scripts that have not changed are not drawn again
        shutil.copytree(source / GALLERY, fresh / GALLERY, dirs_exist_ok=True)
    shutil.rmtree(source, ignore_errors=True)
    fresh.rename(source)


def main(arguments: Sequence[str] | None = None) -> int:
    """Stage and build; the exit code of Sphinx."""
    parser = argparse.ArgumentParser(description="The documentation as a site below build/site/html.")
    parser.add_argument("--fresh", action="store_true", help="build every page anew")
    chosen = parser.parse_args(arguments)
    if chosen.fresh:
        shutil.rmtree(FOLDER, ignore_errors=True)
    stage()
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
    command += ["-c", str(CONFIGURATION), "-d", str(FOLDER / "doctrees"), str(SOURCE), str(HTML)]
    done = subprocess.run(command, cwd=ROOT, check=False)
    if done.returncode == 0:
        print(f"open {(HTML / 'index.html').relative_to(ROOT)}")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
