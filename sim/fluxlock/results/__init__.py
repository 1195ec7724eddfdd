# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""From run data to metrics, plots and reports. Knows neither the simulator nor the plant."""
