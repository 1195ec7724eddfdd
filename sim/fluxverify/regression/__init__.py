# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Long sets of closed-loop runs with limits: `make regression` writes `build/regression.json`."""
