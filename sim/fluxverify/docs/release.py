# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Whether the generated pages are those of this tree: `python -m fluxverify.docs.release`, `make release-check`.

Each page names the hashes of the chip, the firmware and the plant that its results were made from, for the whole page
or for each entry. Between releases a page may be older than the tree; it says so by these names. For a release it may
not: the check lists every entry with other hashes, or without any, and the command that makes it anew.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.sources import PARTS, UNKNOWN, named, source_hashes, sources_text

ALL, RTL = tuple(PARTS), ("chip",)
# Page -> parts that each of its places names, and the command that makes it anew.
PAGES = {
    "docs/verification/regression.md": (ALL, "make regression, python -m fluxverify.docs.regression"),
    "docs/verification/figures-six-step.md": (ALL, "fluxverify figures six-step, python -m fluxverify.docs.figures"),
    "docs/verification/figures-blac.md": (ALL, "fluxverify figures blac, python -m fluxverify.docs.figures"),
    "docs/verification/figures-five-phase.md": (
        ALL,
        "fluxverify figures five-phase, python -m fluxverify.docs.figures",
    ),
    "docs/verification/campaign.md": (ALL, "make campaign"),
    "docs/verification/mutation.md": (RTL, "make mutation"),
    "docs/verification/coverage.md": (ALL, "make coverage"),
    "docs/reference/synthesis.md": (RTL, "make synth; make synth ONLY=blocks"),
}


def stale(text: str, tree: Mapping[str, str], parts: Sequence[str] = ALL) -> tuple[int, dict[str, str]]:
    """How many places of a page name their sources, and of those that are not of this tree: name -> why.

    A place is a row of a table, named by its first cell, or what stands below a heading, named by it.
    """
    places, found = 0, {}
    heading = "whole page"
    for line in text.splitlines():
        if match := re.match(r"#{2,} (.+)", line):
            heading = match[1]
        hashes = named(line)
        if not hashes and UNKNOWN not in line:
            continue
        places += 1
        label = line.split("|")[1].strip() if line.startswith("|") else heading
        if not hashes:
            found[label] = UNKNOWN
        elif silent := [part for part in parts if part not in hashes]:
            found[label] = f"names no {' and '.join(silent)}"
        elif other := [part for part in parts if hashes[part] != tree[part]]:
            found[label] = f"other {' and '.join(other)}"
    return places, found


def page_problems(name: str, text: str, tree: Mapping[str, str], parts: Sequence[str] = ALL) -> list[str]:
    """Lines on what of a page is not of this tree."""
    places, found = stale(text, tree, parts)
    if not places:
        return [f"{name}: names no sources"]
    lines = []
    for why in dict.fromkeys(found.values()):
        labels = [label for label, reason in found.items() if reason == why]
        lines.append(f"{name}: {why}: {', '.join(labels)}")
    return lines


def main(root: Path = ROOT) -> int:
    """Print what is stale; exit code 1 if anything is."""
    tree = source_hashes(root=root)
    refused = 0
    for name, (parts, command) in PAGES.items():
        path = root / name
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        if problems := page_problems(name, text, tree, parts):
            refused += 1
            print(*problems, f"  anew: {command}", sep="\n")
    print(f"{len(PAGES) - refused} of {len(PAGES)} generated pages are of this tree: {sources_text(tree)}")
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main())
