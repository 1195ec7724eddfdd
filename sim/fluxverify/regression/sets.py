# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""All sets of cases: importing this registers them and puts them in order, whichever of them was imported before."""

from fluxverify.regression import five_phase, images, shipped, six_step, vector
from fluxverify.regression.case import CASES

__all__ = ["CASES", "five_phase", "images", "shipped", "six_step", "vector"]

FAMILIES = ("six-step", "five-phase", "vector")


def _order(name: str) -> tuple[int, str]:
    return FAMILIES.index(name.partition("/")[0]), name


_registered = dict(CASES)
CASES.clear()
CASES.update((name, _registered[name]) for name in sorted(_registered, key=_order))
