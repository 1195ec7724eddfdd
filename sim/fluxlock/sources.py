# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What results are made from: one hash each of chip, firmware and plant, from the sources alone, nothing is built.

The hash of a part is made of the paths and the Git blob hashes of its files. A working tree without Git and any
revision in Git therefore give the same hash for the same files, and a page that names a revision can get its hashes
later.
Versions of tools and of the soft core are those of `uv.lock`; scenario and motor files are named by each result.
"""

from __future__ import annotations

import functools
import hashlib
import re
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path

from fluxlock.base.paths import ROOT

DIGITS = 12
PARTS = {
    "chip": ("rtl",),
    "firmware": ("sw", "sim/fluxlock/firmware"),
    "plant": ("sim/fluxlock/plant", "sim/fluxlock/cosim", "sim/fluxlock/config", "sim/native"),
}
UNKNOWN = "sources not recorded"
NAMED = re.compile(rf"\b({'|'.join(PARTS)}) `([0-9a-f]{{{DIGITS}}})`")

Hashes = dict[str, str]  # of each part


def _combined(blobs: Iterable[tuple[str, str]]) -> str:
    """Hash of (path, blob hash) pairs."""
    text = "".join(f"{path} {blob}\n" for path, blob in sorted(blobs))
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def _blob(path: Path) -> str:
    data = path.read_bytes()
    return hashlib.sha1(b"blob %d\0" % len(data) + data, usedforsecurity=False).hexdigest()


def source_hashes(parts: Iterable[str] = PARTS, root: Path = ROOT) -> Hashes:
    """Hashes of the working tree."""
    found = {}
    for part in parts:
        files = [path for folder in PARTS[part] for path in (root / folder).rglob("*") if path.is_file()]
        kept = [path for path in files if "__pycache__" not in path.parts and not path.name.startswith(".")]
        found[part] = _combined((path.relative_to(root).as_posix(), _blob(path)) for path in kept)
    return found


@functools.cache
def hashes_of_revision(revision: str, root: Path = ROOT) -> Hashes | None:
    """Hashes of a revision in Git; None if it is none, has changes of its own (`-dirty`) or is not in this clone."""
    if not re.fullmatch(r"[0-9a-f]{7,40}", revision):
        return None
    found = {}
    for part, folders in PARTS.items():
        command = ["git", "-C", str(root), "ls-tree", "-r", "-z", revision, "--", *folders]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=20)
        except (OSError, subprocess.SubprocessError):
            return None
        entries = [line.split("\t") for line in done.stdout.split("\0") if line]
        found[part] = _combined(
            (path, head.split()[2]) for head, path in entries if not Path(path).name.startswith(".")
        )
    return found


def sources_text(hashes: Mapping[str, str] | None) -> str:
    """How every generated page names what it was made from, and how `named` reads it."""
    return ", ".join(f"{part} `{value}`" for part, value in hashes.items()) if hashes else UNKNOWN


def named(line: str) -> Hashes:
    """Hashes that a line of a page names."""
    return dict(NAMED.findall(line))
