# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Pages of the figures for the documentation: `python -m fluxverify.docs.figures` after `fluxverify figures FAMILY`.

A page keeps the sections of figures that were not drawn anew, each with its own revision. `--against REVISION` prints a
table of the values that differ from the pages of a revision instead, with the causes that `figure-causes.toml` gives.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from fluxlock.base.paths import BUILD, ROOT
from fluxverify.docs import figure_page
from fluxverify.figures.command import DOCUMENT, SCHEMA_VERSION, of_family
from fluxverify.figures.figure import FAMILIES, PRINTED
from fluxverify.regression.origin import common_origin, origin_text

FOLDER = BUILD / "figures"
PAGES = ROOT / "docs" / "verification"
IMAGES = ROOT / "docs" / "images"
CAUSES = PAGES / "figure-causes.toml"
EXIT_BAD_INPUT = 2

HEADS = {
    "six-step": """# Figures of the six-step thesis

Lei Yang, *Novel Sensorless Control of Permanent Magnet Brushless Machines for High Speed Application*, 2020, chapters 2
to 6, by figure number: what was printed, what is measured here, and why they differ. Drawn from runs of the chip with
its plant, or from the [analysis functions](../theory/six-step-analysis.md) where the figure is theory; experiments and
simulations of the thesis are both answered by the chip unless a condition says otherwise. Angles are electrical, from
the plant's true angle. What our copy of the thesis lacks (axes of plots, some tables) is marked as not legible.

```
.venv/bin/fluxverify figures six-step                 # all; 2.11 or 2: a figure, a chapter; --quick: short runs
.venv/bin/python -m fluxverify.docs.figures           # this page and its images from the result
```
""",
    "blac": """# Figures of vector control at a low sampling ratio

Lei Yang, *Novel Sensorless Control of Permanent Magnet Brushless Machines for High Speed Application*, 2020, chapter 7,
by figure number: what was printed, what is found here, and why they differ. The curves are those of the
[exact discrete model](../theory/vector.md); a figure says whether a run of the chip stands beside them. The thesis
prints its curves without numbers but for figure 7.7. Angles are electrical, errors are estimate less truth.

```
.venv/bin/fluxverify figures blac                     # all; 7.4: a figure
.venv/bin/python -m fluxverify.docs.figures           # this page and its images from the result
```
""",
    "five-phase": """# Figures of five-phase injection

B. Tian, Q.-T. An, M. Molinas, IEEE Access 2019 (`tian`), and K. Yu, Z. Wang, L. Li, Energies 2022 (`yu`), by figure
number: what was printed, what is found here, and why they differ. Drawn from runs of the chip with five phases and its
plant unless a condition says otherwise; experiments and simulations of the papers are both answered by the chip. Angles
are electrical, errors are estimate less truth; Yu prints the opposite sign. Methods and closed forms:
[theory](../theory/five-phase.md). The figures left out are block diagrams, test rigs, and finite elements.

```
.venv/bin/fluxverify figures five-phase               # all; tian, yu.9: a paper, a figure; --quick: short runs
.venv/bin/python -m fluxverify.docs.figures           # this page and its images from the result
```
""",
}


def _cell(text: str) -> str:
    return text.replace("|", "\\|") or " "


def reason(row: dict[str, Any]) -> str:
    """What the last column says of a row."""
    if row["printed"] == "":
        return ". ".join(part for part in ("not printed", row["why"]) if part)
    if row["agrees"]:
        return ". ".join(part for part in ("agrees", row["why"]) if part)
    return str(row["why"])


def lacking(document: dict[str, Any]) -> Iterator[str]:
    """Rows of a document, by name, that differ from what was printed and do not say why, or whose speed."""
    for part in document["figures"]:
        for row in part["table"]:
            name = f"{document['family']} {part['figure']}, {row['quantity']}"
            if not row.get("speed"):
                yield f"{name}: does not say who sets the speed"
            elif not reason(row):
                yield f"{name}: {row['here']} instead of {row['printed']}, without a reason"


def section(part: dict[str, Any], family: str, common: str | None) -> str:
    """A figure: condition, image and table; its revision unless all have the same one."""
    lines = [f"## Figure {part['figure']}: {part['title']}\n"]
    lines += [] if common else [f"{origin_text(part)}.\n"]
    if part["failure"]:
        return "\n".join([*lines, f"Not drawn: {part['failure'].strip().splitlines()[-1]}\n"])
    lines += [f"{part['condition']}\n", f"![Figure {part['figure']}](../images/{family}/{part['image']})\n"]
    lines += [f"| | {PRINTED[family]} | here | speed | why |", "|---|---|---|---|---|"]
    before = ""
    for row in part["table"]:
        why = reason(row)
        again = "as above" if row["why"] and why == before else why
        before = why
        cells = (row["quantity"], row["printed"], row["here"], row["speed"], again)
        lines.append("| " + " | ".join(_cell(text) for text in cells) + " |")
    return "\n".join(lines) + "\n"


def page(document: dict[str, Any], before: str = "") -> str:
    """The page: a section a figure; of figures that the document lacks, those of the page before."""
    family, numbers = document["family"], [entry.number for entry in of_family(document["family"])]
    drawn = {part["figure"]: part for part in document["figures"]}
    old = {} if document["quick"] else figure_page.sections(before)
    old = {number: text for number, text in old.items() if number in numbers and number not in drawn}
    common = None if old else common_origin(document["figures"])
    kind = "short runs" if document["quick"] else "full length"
    lines = [HEADS[family]]
    lines.append(
        f"{common}, {kind}.\n" if common else f"{kind.capitalize()}; revision and seed stand at each figure.\n"
    )
    missing = [number for number in numbers if number not in drawn and number not in old]
    lines += [f"Not on this page, the command draws them: {', '.join(missing)}.\n"] if missing else []
    for number in numbers:
        if number in drawn:
            lines.append(section(drawn[number], family, common))
        elif number in old:
            lines.append(old[number])
    return "\n".join(lines).rstrip() + "\n"


def write_pages(folder: Path = FOLDER, pages: Path = PAGES, images: Path = IMAGES) -> int:
    """Write the pages of all families that have been drawn and copy their images; exit code 1 without any.

    A family with a row that lacks its reason is named and left as it was, exit code 1.
    """
    documents = [folder / family / DOCUMENT for family in FAMILIES if (folder / family / DOCUMENT).exists()]
    if not documents:
        print(f"error: {folder} holds no {DOCUMENT}; run fluxverify figures", file=sys.stderr)
        return 1
    failed = False
    for path in documents:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document.get("schema") != SCHEMA_VERSION:
            print(f"error: {path}: of another version; run fluxverify figures {path.parent.name}", file=sys.stderr)
            failed = True
            continue
        faults = list(lacking(document))
        for fault in faults:
            print(f"error: {fault}", file=sys.stderr)
        if faults:
            failed = True
            continue
        target = images / document["family"]
        target.mkdir(parents=True, exist_ok=True)
        for part in document["figures"]:
            if part["image"]:
                shutil.copyfile(path.parent / part["image"], target / part["image"])
        name = pages / page_name(document["family"])
        before = name.read_text(encoding="utf-8") if name.exists() else ""
        name.write_text(page(document, before), encoding="utf-8")
        print(f"written: {name}, images in {target}")
    return int(failed)


def page_name(family: str) -> str:
    """File of a family's page."""
    return f"figures-{family}.md"


def compare(revision: str, pages: Path = PAGES, causes: Path = CAUSES) -> int:
    """Print what changed since a revision as a table in Markdown.

    Exit code 1 if a change has no cause, 2 if the revision has no such pages.
    """
    given = tomllib.loads(causes.read_text(encoding="utf-8")) if causes.exists() else {}
    print(f"| figure | quantity | {revision} | now | cause |\n|---|---|---|---|---|")
    without = []
    for family in FAMILIES:
        path = pages / page_name(family)
        before = _page_of(revision, path)
        if before is None:
            print(f"error: --against: {revision} has no {path.name}; name a revision that has", file=sys.stderr)
            return EXIT_BAD_INPUT
        for change in figure_page.changes(before, path.read_text(encoding="utf-8")):
            why = figure_page.cause(given.get(family, {}), change)
            cells = (
                f"{family} {change.figure}",
                change.quantity,
                change.before or "–",
                change.now or "–",
                why or "not given",
            )
            print("| " + " | ".join(_cell(text) for text in cells) + " |")
            without += [] if why else [f"{family} {change.figure}, {change.quantity}"]
    for name in without:
        print(f"error: {name}: changed, and {causes.name} gives no cause", file=sys.stderr)
    return int(bool(without))


def _page_of(revision: str, path: Path) -> str | None:
    """A page as a revision has it."""
    if not re.fullmatch(r"[\w./~^@-]+", revision) or revision.startswith("-"):
        return None
    name = f"{revision}:{path.relative_to(ROOT).as_posix()}"
    done = subprocess.run(["git", "-C", str(ROOT), "show", name], capture_output=True, text=True, check=False)
    return done.stdout if done.returncode == 0 else None


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pages, or compare them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", metavar="REVISION", help="print what changed since, instead of writing pages")
    chosen = parser.parse_args(arguments)
    return compare(chosen.against) if chosen.against else write_pages()


if __name__ == "__main__":
    sys.exit(main())
