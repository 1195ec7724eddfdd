# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Images of the firmware and the bytes that each may have; docs/canopen.md has those with the node."""

from __future__ import annotations

import re

import pytest

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.firmware import build_commission, build_firmware
from fluxverify.regression.images import BUDGET_BYTES

TEXT_MAX_BYTES = 119_808  # link.ld
COMMISSION_BYTES = 20_480


@pytest.mark.parametrize(("phases", "method"), BUDGET_BYTES)
def test_image_is_within_its_budget(phases: int, method: str | None) -> None:
    """What grows beyond it needs a new budget, said in the page, or gives up something.

    Verifies: FW-96
    """
    size = build_firmware(BUILD / "firmware", phases, method).stat().st_size
    print(f"{size} of {BUDGET_BYTES[phases, method]} bytes")
    assert 0.9 * BUDGET_BYTES[phases, method] < size <= BUDGET_BYTES[phases, method] < TEXT_MAX_BYTES


def test_commissioning_program_is_small() -> None:
    """It loads fast over a serial line.

    Verifies: FW-96
    """
    assert build_commission().stat().st_size <= COMMISSION_BYTES


def test_page_has_the_budgets() -> None:
    """Those of the images with the node.

    Verifies: FW-96
    """
    page = (ROOT / "docs" / "canopen.md").read_text(encoding="utf-8")
    assert f"{TEXT_MAX_BYTES:,}".replace(",", " ") in page
    for method in ("six-step", "vector"):
        (shown,) = re.findall(rf"^\| {method} \|.*\| ([\d ]+) \|$", page, re.MULTILINE)
        assert int(shown.replace(" ", "")) == BUDGET_BYTES[3, method]
