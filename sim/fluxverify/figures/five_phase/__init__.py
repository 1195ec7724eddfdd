# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Figures of Tian 2019 and Yu 2022: five-phase machines by square-wave injection."""

from fluxverify.figures.five_phase import tian, tian_dynamic, yu, yu_loaded

__all__ = ["tian", "tian_dynamic", "yu", "yu_loaded"]
