# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Theory of the three methods as functions, beside what the chip does. Knows neither the simulator nor the firmware."""
