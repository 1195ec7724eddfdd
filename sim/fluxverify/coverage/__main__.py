# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of RTL, C and Python: `python -m fluxverify.coverage [FOLDER...]`.

Results in build/coverage: report.md, coverage.json, pages of C and Python in c and python. Without FOLDER the page
docs/verification/coverage.md is written too; with it only the RTL is measured, by the block tests of these folders.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Sequence

from fluxlock.base.paths import ROOT
from fluxlock.sources import source_hashes
from fluxverify.coverage import rtl, software
from fluxverify.coverage.report import details, page
from fluxverify.coverage.rtl import FOLDER

WHOLE_CHIP = "drive"  # its tests run the chip of the closed loop, which counts nothing
PAGE = ROOT / "docs" / "verification" / "coverage.md"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, write the report; exit code 1 if a test fails or a reason is missing or stale."""
    there = sorted(p.parent.name for p in (ROOT / "cocotb_tests").glob("*/__init__.py") if p.parent.name != WHOLE_CHIP)
    parser = argparse.ArgumentParser(prog="python -m fluxverify.coverage", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="*", metavar="FOLDER", help=f"RTL only, of {', '.join(there)}")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--report", action="store_true", help="no tests: from the counters of the last run")
    options = parser.parse_args(arguments)
    if unknown := [folder for folder in options.folders if folder not in there]:
        parser.error(f"FOLDER must be of {', '.join(there)}, not {', '.join(unknown)}")
    whole = not options.folders
    if not options.report:
        shutil.rmtree(FOLDER, ignore_errors=True)
        sources = source_hashes()  # before the tests: the checkout may change while they last
        if rtl.run_tests(options.folders or there, options.jobs):
            print("error: tests failed", file=sys.stderr)
            return 1
        if whole and not software.run_tests(options.jobs):
            return 1
    stored = FOLDER / "sources.json"
    if not options.report:
        stored.write_text(json.dumps(sources), encoding="utf-8")
    files = rtl.read_files()
    c, python = (software.read_c(), software.read_python()) if whole else ({}, {})
    explained, problems = rtl.explain(files, rtl.read_reasons())
    made_from = json.loads(stored.read_text(encoding="utf-8")) if stored.exists() else None
    text = page(files, c, python, explained, rtl.FOLDERS.read_text(encoding="utf-8").split(), made_from)
    results = {"rtl": files, "c": c, "python": python}
    (FOLDER / "coverage.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    (FOLDER / "report.md").write_text(text + details(files, c, python), encoding="utf-8")
    if whole and not problems:
        PAGE.write_text(text, encoding="utf-8")
    print(f"written: {FOLDER / 'report.md'}")
    for problem in problems:
        print(f"error: {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
