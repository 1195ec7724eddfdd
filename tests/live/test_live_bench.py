# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The measurement of the page's redraws; its limit is for a machine with nothing else to do."""

from __future__ import annotations

import pytest

from fluxverify import live_bench

PICTURES = 60


def test_redraw() -> None:
    """Twelve traces of 50 000 points: a picture costs less processor time than the limit of its redraw.

    The time itself depends on what else the machine does, so the command has its limit, `live_bench redraw`.

    Verifies: LIVE-16
    """
    if live_bench.browser_path() is None:
        pytest.skip("no Chromium here: apt install chromium-headless-shell")
    times, mean_ms = live_bench.redraw_ms(PICTURES)
    assert len(times) >= PICTURES and min(times) > 0.0
    assert 0.0 < mean_ms <= live_bench.REDRAW_MOST_MS


def test_no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a browser the command says which ones it looks for."""
    monkeypatch.setattr(live_bench, "browser_path", lambda: None)
    with pytest.raises(live_bench.NoBrowserError, match="chromium-headless-shell"), live_bench.opened("http://x/"):
        pass
