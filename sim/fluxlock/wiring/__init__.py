# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Test of the wiring before the first turn: measured by the firmware (`sw/drive/wiring.c`), named here."""
