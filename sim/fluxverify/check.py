# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What is worth a few minutes before a commit: `python -m fluxverify.check [--since REVISION] [--jobs N] [--list]`.

Lint, the units that any change may break, whatever else goes with the files that have changed, and a short closed loop.
Changed is what differs from where HEAD left the trunk (`--since`: from another revision), unless it is as it was when
this command was last content. A green end is none of `make test`, which runs everything.

- A source or bench of a block: the block tests and proofs whose text names it, or names a bench that does.
- A module of `sim/*/X`, a test or a helper of `tests/X`: the tests of `tests/X`, but those that run a chip.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Collection, Iterable
from pathlib import PurePosixPath

from fluxlock.base.paths import BUILD, ROOT

GREEN = BUILD / "check.json"  # hashes of the files that differed from the trunk when all was well
TRUNK = "origin/main"
UNITS = ("tests/config", "tests/firmware", "tests/registers")
LOOP = "tests/closed_loop/test_timing.py::test_commutation_latency_is_constant_and_duty_changes_at_the_update"
# What a test that runs a chip or a synthesis calls; the long ones are left to `make test`.
LONG = re.compile(
    r"\b(build_chip|chip_of|run_chip|run_on_bus|run_drive|run_scenario|fuzz\(|Runner\(|run_plan|synthesize)\b"
)
CHIPS = {"campaign", "closed_loop", "coverage", "drive", "formal", "mutation"}  # folders of such tests
EVERYWHERE = ("rtl/pkg/",)  # in every block


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout


def changed_files(since: str | None) -> list[str]:
    """Paths that differ from a revision, default from where HEAD left the trunk, or are new."""
    if since is None:
        known = subprocess.run(
            ["git", "rev-parse", "-q", "--verify", TRUNK], cwd=ROOT, capture_output=True, check=False
        )
        since = _git("merge-base", "HEAD", TRUNK).strip() if known.returncode == 0 else "HEAD"
    found = _git("diff", "--name-only", since, "--") + _git("ls-files", "--others", "--exclude-standard")
    return sorted(set(found.splitlines()))


def _hash(name: str) -> str:
    path = ROOT / name
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "gone"


def not_green(changed: Iterable[str]) -> list[str]:
    """Those that are not as they were when the command was last content."""
    green = json.loads(GREEN.read_text(encoding="utf-8")) if GREEN.exists() else {}
    return [name for name in changed if green.get(name) != _hash(name)]


def _word(path: PurePosixPath) -> str:
    """By which other files name one: its stem, of a bench in Python with its package."""
    return f"{path.parent.name}.{path.stem}" if path.suffix == ".py" else path.stem


def _naming(words: Collection[str], texts: dict[str, str]) -> set[str]:
    """Files whose text has one of the words, or the word of a file that does, and so on."""
    found: set[str] = set()
    left = set(words)
    while left:
        pattern = re.compile(rf"\b({'|'.join(map(re.escape, sorted(left)))})\b")
        new = {name for name, text in texts.items() if name not in found and pattern.search(text)}
        found |= new
        left = {_word(PurePosixPath(name)) for name in new}
    return found


def selection(changed: Collection[str], texts: dict[str, str]) -> list[str]:
    """What pytest is to run for the changed files, units and closed loop besides.

    texts: of all files of `cocotb_tests` and `tests` that end in .py or .sby, by path.
    """
    paths = [PurePosixPath(name) for name in changed]
    blocks = [p for p in paths if p.parts[0] in ("rtl", "cocotb_tests")]
    everywhere = any(name.startswith(EVERYWHERE) for name in changed)
    benches = {name: text for name, text in texts.items() if name.startswith("cocotb_tests/")}
    named = _naming({_word(p) for p in blocks}, benches) if blocks else set()
    hit = {name for name in benches if everywhere or name in named or name in changed}
    chosen = {name for name in hit if PurePosixPath(name).name.startswith("test_")}
    proofs = {name for name in hit if name.endswith(".sby")}
    proof = "tests/formal/test_safety_proofs.py::test_proof"
    chosen |= {f"{proof}[{PurePosixPath(name).stem}-{task}]" for name in proofs for task in tasks(texts[name])}
    packages = {p.parts[2] for p in paths if p.parts[0] == "sim" and len(p.parts) > 3}
    packages |= {p.parts[1] for p in paths if p.parts[0] == "tests" and len(p.parts) > 2}
    for package in packages - CHIPS:
        mine = [name for name in texts if re.fullmatch(rf"tests/{package}/(\w+/)*test_\w+\.py", name)]
        chosen |= {name for name in mine if not LONG.search(texts[name])}
    return sorted(name for name in chosen if not name.startswith(tuple(f"{unit}/" for unit in UNITS)))


def tasks(sby: str) -> list[str]:
    """Tasks of a proof: what stands in that section, whatever comment comes before it."""
    return sby.partition("[tasks]\n")[2].partition("[options]")[0].split()


def read_texts() -> dict[str, str]:
    """Texts of tests, benches and proofs, by path."""
    kinds = {".py", ".sby"}
    files = [
        path for folder in ("cocotb_tests", "tests") for path in (ROOT / folder).rglob("*") if path.suffix in kinds
    ]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in files}


def main() -> int:
    """Command line of this module."""
    parser = argparse.ArgumentParser(description="Lint, units, what has changed, a short closed loop.")
    parser.add_argument("--since", help=f"revision to compare with (default: where HEAD left {TRUNK})")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="side by side (default: %(default)s)")
    parser.add_argument("--list", action="store_true", help="only say what would be run")
    options = parser.parse_args()
    try:
        changed = changed_files(options.since)
    except (OSError, subprocess.CalledProcessError) as error:
        said = (getattr(error, "stderr", None) or str(error)).strip().splitlines()[-1]
        print(f"error: git cannot tell what has changed: {said}; name a revision with --since", file=sys.stderr)
        return 2
    left = not_green(changed)
    chosen = selection(left, read_texts())
    print(f"{len(left)} changed files ask for {len(chosen)} of the tests besides the units")
    for name in chosen:
        print(f"  {name}")
    if options.list:
        return 0
    before = {name: _hash(name) for name in changed}
    lint = [sys.executable, "-m", "fluxverify.lint", "--jobs", str(options.jobs)]
    if subprocess.run(lint, cwd=ROOT, check=False).returncode:
        return 1
    tests = [sys.executable, "-m", "pytest", "-q", "-n", str(options.jobs), "--dist", "worksteal"]
    done = subprocess.run([*tests, LOOP, *chosen, *UNITS], cwd=ROOT, check=False)
    if done.returncode == 0:
        GREEN.parent.mkdir(parents=True, exist_ok=True)
        GREEN.write_text(json.dumps(before, indent=0) + "\n", encoding="utf-8")
    return int(done.returncode != 0)


if __name__ == "__main__":
    sys.exit(main())
