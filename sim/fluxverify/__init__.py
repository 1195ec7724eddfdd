# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How Fluxlock verifies itself: long sets, faults, figures, mutants, coverage, checks of the tree, generated pages.

Knows `fluxlock`, which does not know it. Its command is `fluxverify`; the rest is called by `make`.
"""
