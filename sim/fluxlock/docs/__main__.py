# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Write every generated page of the documentation: `python -m fluxlock.docs`."""

from __future__ import annotations

import sys

from fluxlock.canopen import __main__ as objects
from fluxlock.config import schema
from fluxlock.docs import diagram, gallery, hierarchy, matrix, parameters, readme


def main() -> int:
    """Input files, parameters, object dictionary, README, requirement matrix; exit code 1 if one of them fails."""
    schema.PAGE.write_text(schema.page(), encoding="utf-8")
    diagram.main()
    hierarchy.main([])
    return max(parameters.main([]), objects.main([]), readme.main([]), gallery.main([]), matrix.main([]))


if __name__ == "__main__":
    sys.exit(main())
