# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""All images of the documentation, with the command of each: `python -m fluxverify.docs.gallery [--check]`."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

from fluxlock import generated
from fluxlock.base.paths import ROOT
from fluxverify.docs.navigation import normal

PAGE = Path("docs/figures/index.md")
IMAGES = Path("docs/images")
SUFFIXES = {".png", ".svg", ".gif"}
# Pattern of an image below docs/images -> command; the first one counts. Numbered figures have their own.
COMMANDS = {
    "demo.png": "make demo",
    "scope*.svg": "fluxlock scope build/demo",
    "badge-*.svg": "python -m fluxverify.docs.readme",
    "blocks-*.svg": "python -m fluxverify.docs.diagram",
    "blocks/*.svg": "python -m fluxverify.docs.hierarchy",
    "timing/*.svg": "make diagrams",
    "identify.png": "fluxlock identify --plant motors/motor-2.toml --inverter inverters/bench-25v.toml"
    " --out motors/my-motor.toml",
    "live.png": "fluxlock live scenarios/vector/start.toml",
    "live-first-start.png": "fluxlock live scenarios/own-spindle.toml --first-start",
    "live-chip.png": "fluxlock live scenarios/own-spindle.toml --chip",
    "six-step-soa.png": "fluxlock soa",
    "six-step-stability.png": "fluxlock stability",
    "six-step-spectrum.png": "fluxlock spectrum",
    "vector-parameters.png": "fluxlock vector parameters",
    "vector-parameters-chip.png": "make regression CASES=vector/parameter-errors",
    "five-phase/frequency.png": "fluxlock injection motors/five-phase-tian.toml",
    "five-phase/tian-*.png": "python -m fluxlock.theory.injection.cases --figures docs/images/five-phase",
    "five-phase/yu-*.png": "python -m fluxlock.theory.injection.cases --figures docs/images/five-phase",
}
SHOWN = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)|<img\s[^>]*src=\"([^\"]+)\"[^>]*alt=\"([^\"]*)\"")
HEADING = re.compile(r"^## (Figure (\S+): .*)$", re.MULTILINE)
HEAD = """# Figures

For readers who want to see the evidence, and to draw it again.

Written by `python -m fluxverify.docs.gallery`.

Our own runs beside print:

- [Figures of the six-step thesis](../verification/figures-six-step.md): chapters 2 to 6, from our own runs.
- [Figures of vector control](../verification/figures-blac.md): chapter 7, the exact model and runs of the chip.
- [Figures of five-phase injection](../verification/figures-five-phase.md): two papers, runs of the chip.

Short scripts in `docs/gallery` draw the theory. `make site` runs them and shows each figure beside its script.

## All images

Commands stand without `.venv/bin/` before them.

"""


def pages(root: Path = ROOT) -> list[Path]:
    """README and docs, this page left out."""
    found = [Path("README.md"), *(path.relative_to(root) for path in sorted((root / "docs").rglob("*.md")))]
    return [path for path in found if path != PAGE]


def uses(root: Path = ROOT) -> dict[Path, tuple[Path, str]]:
    """Image -> the first page that shows it, and the words that stand for it there; of a figure, its title."""
    found: dict[Path, tuple[Path, str]] = {}
    for page in pages(root):
        text = (root / page).read_text(encoding="utf-8")
        titles = {number: title for title, number in HEADING.findall(text)}
        for words, target, source, alternative in SHOWN.findall(text):
            image = normal(page.parent / (target or source))
            number = (words or alternative).removeprefix("Figure ")
            found.setdefault(image, (page, titles.get(number, words or alternative)))
    return found


def command_of(name: str, words: str) -> str | None:
    """The command that makes an image, by its name below the images and the words that stand for it; None: unknown."""
    family, _, file = name.rpartition("/")
    if file.startswith("fig-") and (match := re.match(r"Figure (\S+): ", words)):
        return f"fluxverify figures {family} {match[1]}"
    return next((command for pattern, command in COMMANDS.items() if fnmatch(name, pattern)), None)


def images(root: Path = ROOT) -> list[Path]:
    """All images of the docs."""
    return sorted(path.relative_to(root) for path in (root / IMAGES).rglob("*") if path.suffix in SUFFIXES)


def page(root: Path = ROOT) -> str:
    """The page; an image without a command, or that no page shows, is refused by name."""
    shown = uses(root)
    lines, wrong = ["| image | command | shown on |", "|---|---|---|"], []
    for image in images(root):
        name = image.relative_to(IMAGES).as_posix()
        twin = image.with_name(image.name.replace("-dark.", "-light."))
        where, words = shown.get(image) or shown.get(twin) or (None, "")
        command = command_of(name, words)
        if command is None:
            wrong.append(f"{image}: no command makes it; add one to COMMANDS")
            continue
        if image != twin or name.startswith("badge-") or where is None:
            continue
        label = words.replace("|", r"\|")
        link = f"../{where.relative_to('docs').as_posix()}" if where.is_relative_to("docs") else f"../../{where}"
        lines.append(f"| ![{label}](../images/{name}) | `{command}` | [{where.stem}]({link}) |")
    if wrong:
        raise SystemExit("\n".join(f"error: {text}" for text in wrong))
    return HEAD + "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page, or with `--check` only compare it."""
    return generated.command(arguments, "fluxverify.docs.gallery", __doc__, lambda: {ROOT / PAGE: page()})


if __name__ == "__main__":
    sys.exit(main())
