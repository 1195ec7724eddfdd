# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Files of the tree that a command generates: written, or with `--check` compared."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fluxlock.base.paths import ROOT


class SourceError(ValueError):
    """A table of the sources contradicts itself, or the C beside it."""


def add_check(parser: argparse.ArgumentParser) -> None:
    """The option `--check`."""
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a file is out of date")


def renew(texts: Mapping[Path, str], module: str, check: bool, root: Path = ROOT) -> int:
    """Write the files that are out of date. check: name them instead; exit code 1 then.

    module: what writes them, for the message. root: of the tree, for the names in the message.
    """
    stale = [path for path, text in texts.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    for path in stale:
        if check:
            print(f"error: {path.relative_to(root)}: out of date, run python -m {module}", file=sys.stderr)
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(texts[path], encoding="utf-8")
    return int(check and bool(stale))


def command(
    arguments: Sequence[str] | None, module: str, description: str | None, texts: Callable[[], Mapping[Path, str]]
) -> int:
    """Command line of a module that only writes or compares its files; its exit code."""
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=description)
    add_check(parser)
    check: bool = parser.parse_args(arguments).check
    return renew(texts(), module, check)
