# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The page of `fluxlock live` in a browser: how long a redraw takes, and whether memory stays flat.

    python -m fluxverify.live_bench redraw
    python -m fluxverify.live_bench soak --minutes 30

`redraw` shows 12 traces of 50 000 points each, all new for every picture. `soak` shows the twin in real time and counts
what is missing of ten pictures per second.
"""

from __future__ import annotations

import asyncio
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import typer
import uvicorn

from fluxlock.config import load_scenario
from fluxlock.live.cli import listening
from fluxlock.live.link import Link
from fluxlock.live.server import Server, application
from fluxlock.live.traces import CAPACITY, NAMES, Ring

BROWSERS = ("chromium-headless-shell", "chromium", "google-chrome")
TRACES, POINTS = 12, 50_000
REDRAW_MOST_MS = 50.0
PERIOD_S = 1e-4  # of the rows
SHOWN_S = PERIOD_S * POINTS
GROWTH_MOST = 0.1  # of the memory, from the first third of a soak to the last
DROPPED_MOST = 0.01  # of the frames, of which ten are due per second
FRAME_S = 0.1
LOOK_S = 5.0
MIB = 2**20
START_MS = 600_000.0

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False)


class NoBrowserError(typer.BadParameter):
    """There is nothing to show the page in."""


def browser_path() -> str | None:
    """A Chromium of this machine."""
    return next((found for name in BROWSERS if (found := shutil.which(name)) is not None), None)


class Filled(Link):
    """A source without a process: rows that are there, and new ones with every look at them."""

    def __init__(self) -> None:
        super().__init__(Path(), 1, 1.0, lambda _: None)
        rng = np.random.default_rng(1)
        self._noise = rng.standard_normal((len(NAMES), 1000)).astype(np.float32)
        self._count = 0
        self.ring = Ring()
        for _ in range(2 * POINTS // 1000):
            self.more()
        self.hello = {"kind": "hello", "name": "redraw", "source": "recording", "settings": [], "faults": []}
        self.hello |= {"without": []}

    def more(self) -> None:
        """0.1 s of rows."""
        self.ring.append((np.arange(1000) + self._count) * PERIOD_S, self._noise)
        self._count += 1000

    def begin(self) -> None:
        """Nothing runs."""

    def end(self) -> None:
        """Nothing runs."""

    def order(self, message: object) -> bool:
        """Nothing takes it."""
        return False


@contextmanager
def served(link: Link, server: Server) -> Iterator[str]:
    """Serve the page from a thread; its address."""
    listener = listening("127.0.0.1", 0)
    running = uvicorn.Server(uvicorn.Config(application(server, link, ["127.0.0.1"]), log_level="warning"))
    thread = threading.Thread(target=lambda: asyncio.run(running.serve([listener])), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/"
    finally:
        running.should_exit = True
        thread.join(10.0)


@contextmanager
def opened(address: str) -> Iterator[Any]:
    """The page in a browser of this machine."""
    from playwright.sync_api import sync_playwright

    path = browser_path()
    if path is None:
        raise NoBrowserError(f"no browser here: install one of {', '.join(BROWSERS)}")
    with sync_playwright() as play, play.chromium.launch(executable_path=path, args=["--no-sandbox"]) as browser:
        page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
        page.goto(address)
        yield page


def redraw_ms(pictures: int) -> tuple[list[float], float]:
    """Times of redraws, ms, of a page that shows 12 traces of 50 000 points, and the mean processor time of one, ms.

    Times go from the answer to the frame that is painted. The processor time is that of all processes of the browser.
    """
    link = Filled()
    with TemporaryDirectory() as folder, served(link, Server(Path(folder))) as address, opened(address) as page:
        page.locator("#traces input").first.wait_for(state="attached")
        page.evaluate(
            f"""() => {{
              [...document.querySelectorAll('#traces input')].forEach((box, k) => {{ box.checked = k < {TRACES}; }});
              at('span').append(new Option('bench', '{SHOWN_S}'));
              at('span').value = '{SHOWN_S}';
              layout();
              drawn.count = 0;
              drawn.times.length = 0;
            }}"""
        )
        session = page.context.browser.new_browser_cdp_session()
        before = busy_s(session)
        while page.evaluate("drawn.count") < pictures:
            link.more()
            page.wait_for_timeout(20)
        found: list[float] = page.evaluate("drawn.times")
        mean_ms = 1e3 * (busy_s(session) - before) / len(found)
    return found, mean_ms


def busy_s(session: Any) -> float:  # noqa: ANN401  # playwright is no part of what a user installs
    """Processor time of all processes of the browser so far."""
    return float(sum(entry["cpuTime"] for entry in session.send("SystemInfo.getProcessInfo")["processInfo"]))


@app.command()
def redraw(pictures: Annotated[int, typer.Option(min=20, max=500, help="That are drawn.")] = 200) -> None:
    """Time from an answer to the painted picture; exit code 1 where the 95th percentile is above 50 ms."""
    times, mean_ms = redraw_ms(pictures)
    p50, p95 = (float(np.percentile(times, share)) for share in (50, 95))
    print(f"{TRACES} traces of {POINTS} points, {len(times)} redraws: p50 {p50:.1f} ms, p95 {p95:.1f} ms")
    print(f"processor time of the browser for each: {mean_ms:.1f} ms")
    raise typer.Exit(p95 > REDRAW_MOST_MS)


def memory_bytes(pid: int | None) -> int:
    """Resident memory of a process."""
    text = Path(f"/proc/{'self' if pid is None else pid}/status").read_text(encoding="ascii")
    return int(text.partition("VmRSS:")[2].split()[0]) * 1024


@app.command()
def soak(
    minutes: Annotated[float, typer.Option(min=0.2, max=600.0, help="Time for which the twin runs.")] = 3.0,
    scenario: Annotated[Path, typer.Option(help="Whose twin runs.")] = Path("scenarios/vector/start.toml"),
) -> None:
    """Memory and dropped frames while the twin runs; exit code 1 above a tenth of growth or 1 % of the frames."""
    server = Server(Path())
    link = Link(load_scenario(scenario), 1, 1.0, server.tell)
    for _ in range(2):  # the memory for rows is there from the begin
        link.ring.append(np.zeros(CAPACITY // 2), np.zeros((len(NAMES), CAPACITY // 2), np.float32))
    link.ring.clear()
    rows: list[tuple[float, float, float]] = []
    lost: list[int] = []  # frames dropped until each look
    with served(link, server) as address, opened(address) as page:
        page.locator("#traces input").first.wait_for(state="attached", timeout=START_MS)
        page.wait_for_timeout(1000 * LOOK_S)  # the page lays itself out
        page.evaluate("drawn.count = drawn.dropped = 0")
        begin = time.monotonic()
        while time.monotonic() < begin + 60.0 * minutes:
            page.wait_for_timeout(1000 * LOOK_S)
            heap = float(page.evaluate("performance.memory.usedJSHeapSize"))
            lost.append(int(page.evaluate("drawn.dropped")))
            rows.append((memory_bytes(None) / MIB, memory_bytes(link.process_id) / MIB, heap / MIB))
        drawn, dropped = (int(page.evaluate(f"drawn.{name}")) for name in ("count", "dropped"))
        frames, status = round((time.monotonic() - begin) / FRAME_S), link.status
    table = np.array(rows)
    third = max(1, len(table) // 3)
    first, last = (np.median(part, axis=0) for part in (table[:third], table[-third:]))
    print(f"{minutes:g} min, {drawn} pictures, twin at {status['t_s']:.0f} s, reached x {status['reached']:.2f}")
    looks = np.diff(lost, prepend=0) / (LOOK_S / FRAME_S)
    print(f"dropped: {dropped} of {frames} frames, {100.0 * dropped / frames:.2f} %")
    print(f"dropped in a look of {LOOK_S:g} s: median {np.median(looks):.0%}, at most {looks.max():.0%}")
    for name, was, now in zip(("server", "source", "page's heap"), first, last, strict=True):
        print(f"{name}: {was:.0f} MiB in the first third, {now:.0f} MiB in the last")
    raise typer.Exit(bool((last > (1.0 + GROWTH_MOST) * first).any()) or dropped > DROPPED_MOST * frames)


if __name__ == "__main__":
    app()
