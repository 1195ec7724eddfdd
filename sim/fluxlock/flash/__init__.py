# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Firmware and parameter block through the loader into the SPI flash of a board."""
