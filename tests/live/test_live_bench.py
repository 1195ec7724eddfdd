# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The measurement of the page's redraws; its limit is for a machine with nothing else to do."""

from __future__ import annotations

import pytest

from fluxverify import live_bench

PICTURES = 20


def test_redraw() -> None:
    """Twelve traces of 50 000 points are drawn again and again; the processor time is part of the time.

    Verifies: LIVE-16
    """
    if live_bench.browser_path() is None:
        pytest.skip("no Chromium here: apt install chromium-headless-shell")
    times, mean_ms = live_bench.redraw_ms(PICTURES)
    assert len(times) >= PICTURES and min(times) > 0.0 and mean_ms > 0.0


def test_no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a browser the command says which ones it looks for."""
    monkeypatch.setattr(live_bench, "browser_path", lambda: None)
    with pytest.raises(live_bench.NoBrowserError, match="chromium-headless-shell"), live_bench.opened("http://x/"):
        pass
