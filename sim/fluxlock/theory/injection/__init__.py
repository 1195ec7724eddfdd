# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Theory of square-wave injection: demodulators, loop and polarity search on a machine model."""
