# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Long sets of closed-loop runs with limits: `make regression` writes `build/regression.json`."""

from fluxlock.regression.case import CASES, Case, Row, case
from fluxlock.regression.runner import Runner, run_cases

__all__ = ["CASES", "Case", "Row", "Runner", "case", "run_cases"]
