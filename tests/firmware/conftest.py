# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fixtures of the firmware tests."""

from __future__ import annotations

import ctypes

import pytest

from fluxlock.firmware.control_library import control_library


@pytest.fixture(scope="module")
def lib() -> ctypes.CDLL:
    """The host library with the prototypes of the pure functions."""
    return control_library()
