# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fixtures of the firmware tests."""

from __future__ import annotations

import pytest

from fluxlock.firmware.binding import open_library
from fluxlock.headers import CData


@pytest.fixture(scope="module")
def lib() -> CData:
    """The functions of the host library."""
    return open_library()
