# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Hashes of chip, firmware and plant on the generated pages, and the check that refuses pages of another tree."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.sources import PARTS, UNKNOWN, hashes_of_revision, named, source_hashes, sources_text
from fluxverify.docs.release import PAGES, main, page_problems, stale
from fluxverify.regression.origin import origin, origin_text

TREE = {"chip": "aaaaaaaaaaaa", "firmware": "bbbbbbbbbbbb", "plant": "cccccccccccc"}
OLD = {**TREE, "firmware": "000000000000"}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A checkout with a file in each folder of the parts, committed."""
    for folders in PARTS.values():
        for folder in folders:
            (tmp_path / folder).mkdir(parents=True)
            (tmp_path / folder / "a.txt").write_text(f"{folder}\n")
    (tmp_path / "README").write_text("none of the parts\n")
    for command in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "first"]):
        identity = ["-c", "user.name=x", "-c", "user.email=x@x"]
        subprocess.run(["git", *identity, *command], cwd=tmp_path, check=True)
    return tmp_path


def head(root: Path) -> str:
    done = subprocess.run(["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_hashes(tree: Path) -> None:
    """Working tree and revision agree; a changed, renamed or new file changes its part alone, a cache nothing.

    Verifies: REC-04
    """
    first = source_hashes(root=tree)
    assert set(first) == set(PARTS) and len(set(first.values())) == len(PARTS)
    assert hashes_of_revision(head(tree), tree) == first
    (tree / "README").write_text("changed\n")
    (tree / "sw" / "__pycache__").mkdir()
    (tree / "sw" / "__pycache__" / "a.pyc").write_text("cache")
    assert source_hashes(root=tree) == first
    for change in (
        lambda: (tree / "rtl" / "a.txt").write_text("other\n"),
        lambda: (tree / "rtl" / "b.txt").write_text("new\n"),
        lambda: (tree / "rtl" / "b.txt").rename(tree / "rtl" / "c.txt"),
    ):
        before = source_hashes(root=tree)
        change()
        after = source_hashes(root=tree)
        assert [part for part in PARTS if before[part] != after[part]] == ["chip"]


@pytest.mark.parametrize("revision", ["", "unknown", "f" * 40, "-h", "--output=x"])
def test_no_revision(revision: str) -> None:
    """What is no revision of this clone has no hashes, and no page claims any.

    Verifies: REC-04
    """
    assert hashes_of_revision(revision) is None
    assert origin_text({"git_revision": revision, "seed": 1}).endswith(f"seed 1, {UNKNOWN}")


def test_results_carry_hashes(tree: Path) -> None:
    """A result is made with the hashes of its tree; its page names them as the check reads them.

    Verifies: REC-04
    """
    made = origin(3)
    assert made["sources"] == source_hashes()
    assert named(origin_text(made)) == made["sources"]
    assert named(sources_text({"chip": TREE["chip"]})) == {"chip": TREE["chip"]}


PAGE = f"""# Page

## whole

Revision 1a2b, seed 1, {sources_text(TREE)}.

## old

Revision 1a2b, seed 1, {sources_text(OLD)}.

## table

| name | value | made from |
|---|---|---|
| one | 1 | {sources_text(TREE)} |
| two | 2 | {sources_text({**TREE, "chip": "0123456789ab", "plant": "0123456789ab"})} |
| part | 2 | {sources_text({"chip": "aaaaaaaaaaaa"})} |
| three | 3 | {UNKNOWN} |
"""


def test_stale_places() -> None:
    """Places with other hashes or without any are named, with the part that differs.

    Verifies: REC-04
    """
    assert stale(PAGE, TREE) == (
        6,
        {
            "old": "other firmware",
            "two": "other chip and plant",
            "part": "names no firmware and plant",
            "three": UNKNOWN,
        },
    )
    assert stale(PAGE, TREE, ["chip"]) == (6, {"two": "other chip", "three": UNKNOWN})
    assert page_problems("p.md", PAGE, TREE) == [
        "p.md: other firmware: old",
        "p.md: other chip and plant: two",
        "p.md: names no firmware and plant: part",
        f"p.md: {UNKNOWN}: three",
    ]
    assert page_problems("p.md", "# Page\n\nno word\n", TREE) == ["p.md: names no sources"]
    assert page_problems("p.md", f"# Page\n\nMade from {sources_text(TREE)}.\n", TREE) == []


def test_release_check(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command passes with pages of the tree, and fails when one of them is stale, silent or missing.

    Verifies: REC-04
    """
    fresh = f"Made from {sources_text(source_hashes(root=tree))}.\n"
    for name in PAGES:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).write_text(fresh)
    assert main(tree) == 0
    for name in PAGES:
        for wrong in (fresh.replace("chip", "chips"), f"{UNKNOWN}\n", "no word\n", None):
            (tree / name).unlink() if wrong is None else (tree / name).write_text(wrong)
            capsys.readouterr()
            assert main(tree) == 1
            assert capsys.readouterr().out.startswith(f"{name}: ")
        (tree / name).write_text(fresh)
    (tree / "rtl" / "a.txt").write_text("changed\n")
    capsys.readouterr()
    assert main(tree) == 1
    assert capsys.readouterr().out.count("other chip: whole page") == len(PAGES)


def test_pages_of_this_checkout() -> None:
    """Every generated page names its sources, or says that they were not recorded.

    Verifies: REC-04
    """
    for name in PAGES:
        assert stale((ROOT / name).read_text(encoding="utf-8"), source_hashes())[0] > 0, name
