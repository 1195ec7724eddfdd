# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The first start of a machine on a bench: wiring, measurement, first turn, step of the speed (docs/board.md)."""
