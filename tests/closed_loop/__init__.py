# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Whole-chip tests: RTL, firmware on the soft core, and plant. They judge physics."""
