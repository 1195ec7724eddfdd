# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Clock of the chip that the simulator builds."""

CLOCK_HZ = 50e6
