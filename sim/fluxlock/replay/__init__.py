# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A log of a drive put into the twin: `table` reads it, `fit` finds the machine, `cli` is the command."""
