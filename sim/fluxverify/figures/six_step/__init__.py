# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures of Yang's thesis (2020), chapters 2 to 6. Scenarios: scenarios/six-step and its folder figures."""

from fluxverify.figures.six_step import chapter_2, chapter_3, chapter_4, chapter_5, chapter_6

__all__ = ["chapter_2", "chapter_3", "chapter_4", "chapter_5", "chapter_6"]
