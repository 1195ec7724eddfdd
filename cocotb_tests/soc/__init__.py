# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Block tests of the chip's bus, timer, interrupts, UART, capture buffer, memory and of the chip itself."""
