# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures of the source theses from our own runs: `fluxverify figures FAMILY` draws them and writes a table to each."""

from fluxverify.figures.figure import FIGURES, Drawing, Entry, figure

__all__ = ["FIGURES", "Drawing", "Entry", "figure"]
