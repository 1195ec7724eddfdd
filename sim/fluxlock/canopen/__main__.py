# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Write what is made from the object dictionary: `python -m fluxlock.canopen [--node N]`.

The EDS, the DBC of a node and the Python accessors go to `build/canopen`, the tables to docs/reference/objects.md.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fluxlock import generated
from fluxlock.base.paths import BUILD
from fluxlock.base.writable import check_folder, guarded
from fluxlock.canopen.accessors import accessors
from fluxlock.canopen.dbc import dbc
from fluxlock.canopen.dictionary import load_dictionary
from fluxlock.canopen.eds import eds
from fluxlock.canopen.page import PAGE, page_text

OUT = BUILD / "canopen"
NODE = 1


def write_files(folder: Path, node: int) -> list[Path]:
    """EDS, DBC and accessors for a node-ID."""
    dictionary = load_dictionary()
    check_folder(folder)
    texts = {
        "fluxlock.eds": eds(dictionary),
        f"fluxlock-{node}.dbc": dbc(dictionary, node),
        "fluxlock_objects.py": accessors(dictionary),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


def node_id(text: str) -> int:
    """Of the command line."""
    if not text.isdecimal() or not 1 <= int(text) <= 127:
        raise argparse.ArgumentTypeError(f"{text} is no node-ID, permitted 1 to 127")
    return int(text)


def main(arguments: list[str] | None = None) -> int:
    """Write the files; with `--check` only compare the page: exit code 1 if it is out of date."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--node", type=node_id, default=NODE, metavar="1..127", help="node-ID")
    generated.add_check(parser)
    options = parser.parse_args(arguments)
    code = generated.renew({PAGE: page_text(load_dictionary())}, "fluxlock.canopen", options.check)
    if options.check:
        return code
    for path in write_files(OUT, options.node):
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
