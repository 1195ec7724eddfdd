# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Switching edges of a real board: from an oscilloscope record to the table `[sensing.edge]`."""
