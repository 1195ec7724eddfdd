# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Matrix of requirements and what verifies them: `python -m fluxverify.docs.matrix`.

Requirements are lines `- ID: text` in docs/verification/requirements.d/*.md (further lines of one indented). What
verifies them says so with a line `Verifies: ID, ID`:

- a test that pytest or cocotb collects, in its docstring;
- a property of a proof, in a comment directly above it (the labelled properties below it, up to another line); the
  proof (`*_f.sv`) counts only if a task of a `.sby` reads it;
- a case of the regression, in the docstring of its function.

A `Verifies:` that stands elsewhere is an error: nothing runs there. `docs/verification/places.txt` records every test,
property, task, case and row of the regression's record with what it verifies. One that has gone fails by name, until
`--accept` writes the file without it; the diff then shows what was given up.
"""

from __future__ import annotations

import argparse
import ast
import fnmatch
import json
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fluxlock import generated
from fluxlock.base.paths import ROOT
from fluxverify.check import tasks

ID = r"[A-Z][A-Z0-9]*-\d+[a-z]?"
REQUIREMENT = re.compile(rf"^- ({ID}):\s+(.+)$")
DECLARATION = re.compile(r"^\W*Verifies:\s*(.*\S)\s*$")
PROPERTY = re.compile(r"\b([a-z]_\w+)\s*:\s*(?:assert|cover)\b")

VERIFICATION = Path("docs", "verification")
TEST_FOLDERS = ("tests", "cocotb_tests")
PROOF_FOLDER = "cocotb_tests"  # a proof stands beside the tests of its block
PROOF_TEST = "tests/formal/test_safety_proofs.py::test_proof"  # runs every task of every .sby
CASE_FOLDER = Path("sim", "fluxverify", "regression")
ROW = re.compile(r"^\| ([^ |]+/[^ |]+) \|", re.MULTILINE)

Places = dict[str, tuple[str, ...]]  # what can verify -> what it does verify


@dataclass(frozen=True)
class Requirement:
    """One requirement and the file that states it."""

    id: str
    text: str
    part: str


def read_requirements(folder: Path) -> tuple[list[Requirement], list[str]]:
    """All requirements in the order of files and lines, and what is wrong with them."""
    found: list[Requirement] = []
    problems: list[str] = []
    for path in sorted(folder.glob("*.md")):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            match = REQUIREMENT.match(line)
            if match:
                if any(r.id == match[1] for r in found):
                    problems.append(f"{path.name}:{number}: {match[1]} is stated twice")
                else:
                    found.append(Requirement(match[1], match[2].strip(), path.stem))
            elif found and found[-1].part == path.stem and re.match(r"^\s+\S", line):
                found[-1] = Requirement(found[-1].id, f"{found[-1].text} {line.strip()}", path.stem)
            elif line.startswith("- "):
                problems.append(f"{path.name}:{number}: not of the form `- ID: text`")
    return found, problems


def _ids(text: str) -> tuple[str, ...]:
    return tuple(part.strip(" .") for part in text.split(",") if part.strip(" ."))


def _declared(text: str) -> tuple[str, ...]:
    """IDs of every `Verifies:` line; a line that ends with a comma goes on in the next one."""
    found: tuple[str, ...] = ()
    lines = iter(text.splitlines())
    for line in lines:
        match = DECLARATION.match(line)
        if match:
            named = match[1]
            while named.endswith(","):
                named += " " + next(lines, "").strip(" /*#")
            found += _ids(named)
    return found


def _functions(tree: ast.Module) -> Iterator[tuple[str, ast.AST, str]]:
    """Name, node and docstring of every function and class, and of the module (name empty)."""
    yield "", tree, ast.get_docstring(tree) or ""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node, ast.get_docstring(node) or ""


def _decorators(node: ast.AST) -> list[str]:
    return [ast.unparse(decorator) for decorator in getattr(node, "decorator_list", [])]


def _runs_itself(tree: ast.Module) -> bool:
    """Whether a test of the module gives the module to the simulator."""
    return any(
        isinstance(node, ast.FunctionDef)
        and node.name.startswith("test_")
        and any(isinstance(inner, ast.Name) and inner.id == "__name__" for inner in ast.walk(node))
        for node in tree.body
    )


def read_tests(root: Path, files: Iterable[Path] = ()) -> tuple[Places, list[str]]:
    """Tests that pytest (`test_*` in `test_*.py`) and cocotb (decorated, in a module that runs itself) collect.

    files: those to read, default all.
    """
    places: Places = {}
    problems = []
    for path in files or (p for folder in TEST_FOLDERS for p in sorted((root / folder).rglob("*.py"))):
        tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
        file = path.relative_to(root).as_posix()
        collected = path.name.startswith("test_")
        itself = collected and _runs_itself(tree)
        for name, node, text in _functions(tree):
            ids, place = _declared(text), f"{file}::{name}" if name else file
            decorators = _decorators(node)
            simulated = any(d.startswith(("cocotb.test", "cocotb.parametrize", "drive_test")) for d in decorators)
            if (collected and node in tree.body and name.startswith("test_") and not simulated) or (
                simulated and itself and not any("skip=True" in d for d in decorators)
            ):
                if place in places:
                    problems.append(f"{place}: two tests of this name, the first is never run")
                places[place] = ids
            elif ids:
                problems.append(f"{place}: says what it verifies, but no run collects it as a test")
    return places, problems


def read_proofs(root: Path) -> tuple[Places, list[str]]:
    """Tasks of the proofs, and the labelled properties of the files that they read."""
    places: Places = {}
    problems = []
    read: set[Path] = set()
    for path in sorted((root / PROOF_FOLDER).rglob("*.sby")):
        text = path.read_text(encoding="utf-8")
        names = tasks(text)
        places |= {f"{path.relative_to(root).as_posix()}:{task}": () for task in names}
        if names:
            read |= {(path.parent / line).resolve() for line in text.partition("[files]")[2].split()}
        if DECLARATION.search(text):
            problems.append(f"{path.relative_to(root)}: a task verifies what its properties do; name it there")
    for path in sorted((root / PROOF_FOLDER).rglob("*_f.sv")):
        file = path.relative_to(root).as_posix()
        lines = path.read_text(encoding="utf-8").splitlines()
        claimed: tuple[str, ...] = ()
        unused = 0  # line of a claim that no property has followed yet
        for number, line in enumerate(lines, 1):
            if match := DECLARATION.match(line):
                claimed, unused = _ids(match[1]), number
                continue
            found = PROPERTY.search(line)
            if found and path.resolve() in read:
                places[f"{file}:{found[1]}"] = claimed
            if found:
                unused = 0
            else:
                claimed = ()
            if unused:
                problems.append(f"{file}:{unused}: no labelled property stands below this line")
                unused = 0
        if path.resolve() not in read:
            problems.append(f"{file}: no task of a .sby reads this proof")
    return places, problems


def read_cases(root: Path) -> tuple[Places, list[str]]:
    """Cases of the regression, and the rows that its record and its page hold and that belong to one of them."""
    places: Places = {}
    problems = []
    for path in sorted((root / CASE_FOLDER).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
        used: set[str] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "case" and node.args:
                places[f"case {_pattern(node.args[0])}"] = ()
        for name, node, text in _functions(tree):
            for d in getattr(node, "decorator_list", []):
                if isinstance(d, ast.Call) and isinstance(d.func, ast.Name) and d.func.id == "case":
                    places[f"case {_pattern(d.args[0])}"] = _declared(text)
                    used.add(name)
            if _declared(text) and name not in used:
                problems.append(f"{path.relative_to(root)}::{name}: says what it verifies, but is no case")
    cases = [place.removeprefix("case ") for place in places]
    record, page = root / VERIFICATION / "record.json", root / VERIFICATION / "regression.md"
    shown = set(ROW.findall(page.read_text(encoding="utf-8"))) if page.exists() else set()
    recorded = set(json.loads(record.read_text(encoding="utf-8"))["rows"]) if record.exists() else set()
    for row in sorted(recorded | shown):
        if not any(fnmatch.fnmatch(row, wanted) for case in cases for wanted in (case, f"{case}/*")):
            problems.append(f"row {row}: no case of the regression makes it")
        elif row not in recorded:
            problems.append(f"row {row}: stands in regression.md but not in record.json")
        elif row not in shown:
            problems.append(f"row {row}: stands in record.json but not in regression.md")
        else:
            places[f"row {row}"] = ()
    return places, problems


def _pattern(node: ast.expr) -> str:
    """Text of a string, `*` for what a run fills in."""
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "*" for part in node.values)
    return str(node.value) if isinstance(node, ast.Constant) else "*"


def read_places(root: Path) -> tuple[Places, list[str]]:
    """All that can verify something in a checkout, with what it verifies; and claims where nothing runs."""
    places: Places = {}
    problems: list[str] = []
    for read in (read_tests, read_proofs, read_cases):
        found, wrong = read(root)
        places |= found
        problems += wrong
    if any(".sby:" in place for place in places) and PROOF_TEST not in places:
        problems.append(f"{PROOF_TEST}: gone, so that no proof is run")
    return places, problems


def check_claims(requirements: list[Requirement], places: Places) -> list[str]:
    """IDs that no requirement has."""
    known = {r.id for r in requirements}
    return [
        f"{place}: verifies {i}, which is no requirement"
        for place, ids in places.items()
        for i in ids
        if i not in known
    ]


def places_text(places: Places) -> str:
    """`places.txt`: a line per place in the order of their names, with what it verifies behind ` = `."""
    return "".join(f"{place}{' = ' if ids else ''}{', '.join(ids)}\n" for place, ids in sorted(places.items()))


def recorded_places(text: str) -> Places:
    """Inverse of `places_text`."""
    pairs = (line.partition(" = ") for line in text.splitlines())
    return {place: _ids(ids) for place, _, ids in pairs if place}


def lost(recorded: Places, places: Places) -> list[str]:
    """What the record holds and the checkout does not, a line each."""
    lines = []
    for place, ids in recorded.items():
        if place not in places:
            lines.append(f"{place}: gone" + (f"; it verified {', '.join(ids)}" if ids else ""))
        elif gone := [i for i in ids if i not in places[place]]:
            lines.append(f"{place}: verifies {', '.join(gone)} no more")
    return lines


def matrix_page(requirements: list[Requirement], places: Places) -> str:
    """The page: one table a part, then what nothing verifies yet."""
    tests: dict[str, list[str]] = {r.id: [] for r in requirements}
    for place, ids in places.items():
        for identifier in dict.fromkeys(ids):
            tests[identifier].append(place)
    open_ids = [r for r in requirements if not tests[r.id]]
    lines = [
        "# Requirements and tests",
        "",
        "Generated by `python -m fluxverify.docs.matrix`; do not edit. Requirements: `requirements.d/`.",
        "",
        f"{len(requirements)} requirements, {len(requirements) - len(open_ids)} verified by tests or proofs.",
        "",
    ]
    for part in dict.fromkeys(r.part for r in requirements):
        lines += [f"## {part}", "", "| id | requirement | verified by |", "|---|---|---|"]
        for r in requirements:
            if r.part == part:
                verified = "<br>".join(f"`{place}`" for place in tests[r.id])
                text = r.text.replace("|", "\\|")
                lines.append(f"| {r.id} | {text} | {verified or '**nothing**'} |")
        lines.append("")
    if open_ids:
        lines += ["## Not verified", "", *(f"- {r.id}: {r.text}" for r in open_ids), ""]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Write matrix and places, or with `--check` only compare them; exit code 1 if something is wrong or gone."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    generated.add_check(parser)
    parser.add_argument("--accept", action="store_true", help="give up the places that have gone")
    parser.add_argument("--strict", action="store_true", help="fail if a requirement is not verified")
    parser.add_argument("--root", type=Path, default=ROOT, help="checkout to read")
    options = parser.parse_args(arguments)
    folder: Path = options.root / VERIFICATION
    requirements, problems = read_requirements(folder / "requirements.d")
    places, wrong = read_places(options.root)
    problems += wrong + check_claims(requirements, places)
    if problems:
        print("\n".join(problems), file=sys.stderr)
        return 1
    written = {folder / "matrix.md": matrix_page(requirements, places), folder / "places.txt": places_text(places)}
    before = folder / "places.txt"
    given_up = lost(recorded_places(before.read_text(encoding="utf-8")), places) if before.exists() else []
    if given_up and not options.accept:
        print(*given_up, "on purpose? then: python -m fluxverify.docs.matrix --accept", sep="\n", file=sys.stderr)
        return 1
    if generated.renew(written, "fluxverify.docs.matrix", options.check, options.root):
        return 1
    named = {i for ids in places.values() for i in ids}
    missing = [r.id for r in requirements if r.id not in named]
    listed = f": {', '.join(missing)}" if missing else ""
    print(f"{len(requirements)} requirements, {len(missing)} not verified{listed}")
    return 1 if options.strict and missing else 0


if __name__ == "__main__":
    sys.exit(main())
