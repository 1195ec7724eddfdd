# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures of the source theses from our own runs: `fluxlock figures FAMILY` draws them and writes a table to each."""

from fluxlock.figures.figure import FIGURES, Drawing, Entry, figure

__all__ = ["FIGURES", "Drawing", "Entry", "figure"]
