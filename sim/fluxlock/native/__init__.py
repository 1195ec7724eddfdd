# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware as a program of this machine: the C sources on an averaged motor, faster than real time."""

import os

from fluxlock.base.paths import BUILD

# Before numba is imported: where it keeps compiled code.
os.environ.setdefault("NUMBA_CACHE_DIR", str(BUILD / "firmware" / "numba"))
