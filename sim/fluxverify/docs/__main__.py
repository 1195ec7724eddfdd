# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Write every generated page of the documentation: `python -m fluxverify.docs`."""

from __future__ import annotations

import sys

from fluxlock.canopen import __main__ as objects
from fluxlock.config import schema
from fluxlock.interface import __main__ as console
from fluxverify.docs import diagram, gallery, hierarchy, library, matrix, parameters, readme


def main() -> int:
    """Input files, parameters, console, object dictionary, README, requirement matrix; exit code 1 if one fails."""
    diagram.main()
    codes = [
        *(schema.main([]), hierarchy.main([]), parameters.main([]), console.main([]), objects.main([])),
        *(library.main([]), readme.main([]), gallery.main([]), matrix.main([])),
    ]
    return max(codes)


if __name__ == "__main__":
    sys.exit(main())
