# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""All tests, of `tests` and of `cocotb_tests`: processor time of each, and the longest files first."""

pytest_plugins = ["tests.times"]
