# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fixtures of the CANopen tests."""

from __future__ import annotations

import pytest

from tests.canopen.node_bench import NodeBench


@pytest.fixture
def bench() -> NodeBench:
    """A node in pre-operational, its drive ready."""
    found = NodeBench()
    assert found.until("disabled", 0.1)
    found.frames.clear()
    return found
