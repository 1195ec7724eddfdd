"""Pages of the figures for the documentation: `python -m fluxlock.docs.figures` after `fluxlock figures FAMILY`."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from fluxlock.figures.command import DOCUMENT, of_family
from fluxlock.figures.figure import FAMILIES, PRINTED
from fluxlock.paths import BUILD, ROOT
from fluxlock.regression.origin import common_origin, origin_text

FOLDER = BUILD / "figures"
PAGES = ROOT / "docs" / "verification"
IMAGES = ROOT / "docs" / "images"

HEADS = {
    "six-step": """# Figures of the six-step thesis

Lei Yang, *Novel Sensorless Control of Permanent Magnet Brushless Machines for High Speed Application*, 2020, chapters 2
to 6, by figure number: what was printed, what is measured here, and why they differ. Drawn from runs of the chip with
its plant, or from the [analysis functions](../theory/six-step-analysis.md) where the figure is theory; experiments and
simulations of the thesis are both answered by the chip unless a condition says otherwise. Angles are electrical, from
the plant's true angle. What our copy of the thesis lacks (axes of plots, some tables) is marked as not legible.

```
.venv/bin/fluxlock figures six-step                 # all; 2.11 or 2: a figure, a chapter; --quick: short runs
.venv/bin/python -m fluxlock.docs.figures           # this page and its images from the result
```
""",
    "blac": """# Figures of vector control at a low sampling ratio

Lei Yang, *Novel Sensorless Control of Permanent Magnet Brushless Machines for High Speed Application*, 2020, chapter 7,
by figure number: what was printed, what is found here, and why they differ. The curves are those of the
[exact discrete model](../theory/vector.md); a figure says whether a run of the chip stands beside them. The thesis
prints its curves without numbers but for figure 7.7. Angles are electrical, errors are estimate less truth.

```
.venv/bin/fluxlock figures blac                     # all; 7.4: a figure
.venv/bin/python -m fluxlock.docs.figures           # this page and its images from the result
```
""",
    "five-phase": """# Figures of five-phase injection

B. Tian, Q.-T. An, M. Molinas, IEEE Access 2019 (`tian`), and K. Yu, Z. Wang, L. Li, Energies 2022 (`yu`), by figure
number: what was printed, what is found here, and why they differ. Drawn from runs of the chip with five phases and its
plant unless a condition says otherwise; experiments and simulations of the papers are both answered by the chip. Angles
are electrical, errors are estimate less truth; Yu prints the opposite sign. Methods and closed forms:
[theory](../theory/five-phase.md). The figures left out are block diagrams, test rigs, and finite elements.

```
.venv/bin/fluxlock figures five-phase               # all; tian, yu.9: a paper, a figure; --quick: short runs
.venv/bin/python -m fluxlock.docs.figures           # this page and its images from the result
```
""",
}


def _cell(text: str) -> str:
    return text.replace("|", "\\|") or " "


def page(document: dict[str, Any]) -> str:
    """The page: a section a figure with condition, image and table."""
    family = document["family"]
    kind = "short runs" if document["quick"] else "full length"
    common = common_origin(document["figures"])
    lines = [HEADS[family]]
    lines.append(
        f"{common}, {kind}.\n" if common else f"{kind.capitalize()}; revision and seed stand at each figure.\n"
    )
    drawn = {part["figure"] for part in document["figures"]}
    missing = [entry.number for entry in of_family(family) if entry.number not in drawn]
    lines += [f"Not on this page, the command draws them: {', '.join(missing)}.\n"] if missing else []
    for part in document["figures"]:
        lines.append(f"## Figure {part['figure']}: {part['title']}\n")
        lines += [] if common else [f"{origin_text(part)}.\n"]
        if part["failure"]:
            lines.append(f"Not drawn: {part['failure'].strip().splitlines()[-1]}\n")
            continue
        lines += [f"{part['condition']}\n", f"![Figure {part['figure']}](../images/{family}/{part['image']})\n"]
        lines += [f"| | {PRINTED[family]} | here | why |", "|---|---|---|---|"]
        reason = ""
        for row in part["table"]:
            again = "as above" if row["why"] and row["why"] == reason else row["why"]
            reason = row["why"]
            cells = (row["quantity"], row["printed"], row["here"], again)
            lines.append("| " + " | ".join(_cell(text) for text in cells) + " |")
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def main(folder: Path = FOLDER, pages: Path = PAGES, images: Path = IMAGES) -> int:
    """Write the pages of all families that have been drawn and copy their images; exit code 1 without any."""
    documents = [folder / family / DOCUMENT for family in FAMILIES if (folder / family / DOCUMENT).exists()]
    if not documents:
        print(f"error: {folder} holds no {DOCUMENT}; run fluxlock figures", file=sys.stderr)
        return 1
    for path in documents:
        document = json.loads(path.read_text(encoding="utf-8"))
        target = images / document["family"]
        target.mkdir(parents=True, exist_ok=True)
        for part in document["figures"]:
            if part["image"]:
                shutil.copyfile(path.parent / part["image"], target / part["image"])
        name = pages / f"figures-{document['family']}.md"
        name.write_text(page(document), encoding="utf-8")
        print(f"written: {name}, images in {target}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
