# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Joins Verilated RTL, firmware and plant. `block` runs block tests, `chip` builds the chip, `run` runs scenarios."""
