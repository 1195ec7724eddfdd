# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures of Yang's thesis (2020), chapter 7: vector control at a low sampling ratio."""

from fluxverify.figures.blac import controllers, observer

__all__ = ["controllers", "observer"]
