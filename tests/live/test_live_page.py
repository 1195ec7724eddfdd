# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command, its process and the page in a browser."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect, sync_playwright
from typer.testing import CliRunner

from fluxlock.cli import app
from fluxlock.config import ConfigError, load_scenario
from fluxlock.cosim.outcome import finished
from fluxlock.cosim.run import run_scenario
from fluxlock.firmware.binding import names
from fluxlock.firmware.host import one_at_a_time
from fluxlock.live import cli
from fluxlock.live.server import PAGE
from fluxlock.live.traces import COMPARATORS, GATES
from fluxlock.native.player import player
from tests.first_start.benches import TwinBoard, warm
from tests.flash.board_terminal import BoardTerminal, behind_a_terminal

SCENARIO = "scenarios/own-spindle.toml"
CONVERSION = "inverter.sensing.conversion_s=0.68e-6"  # of the boards
SPINNING = "scenarios/spinning.toml"
SLOWER_RPM, LOWER_RPM = 45_000, 50_500.0  # target of the slider, and speed on the way to it
INJECTION = "scenarios/vector/ipm-injection.toml"
BROWSERS = ("chromium-headless-shell", "chromium", "google-chrome")
START_MS, CHANGE_MS = 600_000, 120_000  # no limits of speed: what never comes
# Of dist/ in the package uplot 1.6.32 of the npm registry, whose sha512 begins with KIMVnG68zvu5XXUbC4LQEPnhwOxBuLyW.
VENDORED = {
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}


def browser_path() -> str | None:
    """A Chromium of this machine."""
    return next((path for name in BROWSERS if (path := shutil.which(name)) is not None), None)


@contextlib.contextmanager
def running(folder: Path, *source: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """The command on a free port; its address, and its process. source: in place of SCENARIO."""
    command = [sys.executable, "-m", "fluxlock", "live", *(source or (SCENARIO,)), "--port", "0", "--out", str(folder)]

    def hear() -> None:
        """A test that runs in the background of a shell has been told to ignore Ctrl-C."""
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    pipe = subprocess.PIPE
    errors = folder / "errors.txt"
    with (
        errors.open("w") as told,
        subprocess.Popen(
            command, stdout=pipe, stderr=told, text=True, start_new_session=True, preexec_fn=hear
        ) as process,
    ):
        assert process.stdout is not None
        try:
            yield process.stdout.readline().removeprefix("page: ").strip(), process
        finally:
            process.send_signal(signal.SIGINT)
            code = process.wait(300)
    assert code == 130, "Ctrl-C ends it"
    assert "Traceback" not in errors.read_text(encoding="utf-8")


def children(pid: int) -> list[int]:
    """Processes below one, with the source of the twin among them."""
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [int(child) for child in found if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    """A page of a browser that takes no error in silence."""
    path = browser_path()
    if path is None:
        pytest.skip("no Chromium here: apt install chromium-headless-shell")
    errors: list[str] = []
    with sync_playwright() as playwright, playwright.chromium.launch(executable_path=path, args=["--no-sandbox"]) as b:
        made = b.new_context(viewport={"width": 1400, "height": 900}).new_page()
        made.context.set_default_timeout(CHANGE_MS)
        made.on("pageerror", lambda error: errors.append(str(error)))
        yield made
    assert errors == []


def wait_for(page: Page, element: str, text: str, within_ms: float = CHANGE_MS) -> None:
    """Until an element of the page shows a text."""
    expect(page.locator(f"#{element}")).to_contain_text(text, timeout=within_ms)


def until(page: Page, condition: str) -> None:
    """Until an expression is true; asked from outside, since the page's policy permits no code made of text."""
    end_s = time.monotonic() + CHANGE_MS / 1000
    while not page.evaluate(condition):
        assert time.monotonic() < end_s, condition
        page.wait_for_timeout(100)


def test_page(page: Page, tmp_path: Path) -> None:
    """A play in the browser: run, load, speed, an open phase, its fault by name, export; the export repeats the fault.

    Then the source dies and a second viewer comes: both are told, a button begins it anew; a reload shows the journal.

    Verifies: LIVE-01, LIVE-04, LIVE-08
    """
    with running(tmp_path) as (address, process):
        page.goto(address)
        wait_for(page, "state", "running", START_MS)
        until(page, "document.querySelectorAll('#plots .uplot').length >= 5")
        assert page.locator("#traces input:checked").count() >= 12
        page.fill("#set-accel_rpm_s", "40000")
        page.dispatch_event("#set-accel_rpm_s", "change")
        wait_for(page, "said", "set accel_rpm_s 40000 ok")
        page.evaluate("at('speed').value = 12000; at('speed').onchange()")
        wait_for(page, "said", "set speed_rpm 12000 ok")
        page.select_option("#trigger", "angle_error_deg")
        page.select_option("#edge", "size")
        page.click("text=Open phase A")
        wait_for(page, "state", "fault")
        fault = page.inner_text("#fault")
        failed = page.locator("#states [data-failed='1']")
        expect(failed).to_have_attribute("data-state", re.compile("running|starting"))
        wait_for(page, "reason", fault)
        wait_for(page, "size-ab", "A")
        page.click("text=Dead core")
        wait_for(page, "said", "Dead core: the native program has no dead_core")
        wait_for(page, "triggered", "at ")
        page.click("#export")
        wait_for(page, "files", "my-play.toml")
        until(page, "fluxlockDrawn.count > 5")

        for strange in (
            "document.querySelectorAll('#traces input').forEach((box) => { box.checked = true; }); layout()",
            "at('trigger').value = 'ia'; at('level').value = '1e300'; at('trigger').onchange()",
            "at('level').value = ''; at('trigger').onchange()",
        ):
            page.evaluate(f"{strange}; drawn.count = 0")
            until(page, "drawn.count > 3")
        page.evaluate("at('set-speed_rpm').value = ''; at('set-speed_rpm').onchange()")
        wait_for(page, "said", "a value is a number such as 12.5, or a word")

        page.reload()
        wait_for(page, "said", "set speed_rpm 12000 ok")
        second = page.context.new_page()
        second.goto(address)
        wait_for(second, "viewers", "2 viewers")
        (source,) = children(process.pid)
        os.kill(source, signal.SIGKILL)
        for viewer in (page, second):
            wait_for(viewer, "banner", "The source has died: its process ended with signal 9")
        second.click("#again")
        page.locator("#banner").wait_for(state="hidden", timeout=START_MS)
        wait_for(page, "state", "running", START_MS)
    scenario = load_scenario(tmp_path / "my-play.toml")
    outcome = finished(player(scenario, scenario.seed).run(), scenario)
    assert outcome.result["fault"] == fault and outcome.verdict.passed, outcome.verdict.lines
    wait_for(page, "banner", "The connection is lost")


def test_first_start_page(page: Page, tmp_path: Path) -> None:
    """A first start at a board behind a terminal, in the browser: a yes to each question, the turns, plots, a reload.

    Verifies: FST-06, FST-04, LIVE-01
    """
    scenario = load_scenario(SCENARIO, [CONVERSION])
    warm(scenario)
    board = BoardTerminal(TwinBoard(scenario), around=one_at_a_time)
    with behind_a_terminal(board.serve) as port:
        source = (SCENARIO, "--set", CONVERSION, "--first-start", "--board", str(port))
        with running(tmp_path, *source) as (address, _):
            page.goto(address)
            for step in ("wiring", "identify", "first turn"):
                wait_for(page, "question", "go on?", START_MS)
                expect(page.locator("#steps .now")).to_contain_text(step)
                page.click("#yes")
                expect(page.locator("#question")).not_to_have_text("go on?")
            wait_for(page, "question", "did the shaft turn the way that you want?", START_MS)
            page.reload()
            wait_for(page, "question", "did the shaft turn")
            page.click("#yes")
            wait_for(page, "question", "go on?")
            page.click("#yes")
            wait_for(page, "question", "ok: the machine is wired, measured, turns", START_MS)
            assert page.locator("#steps .passed").count() == 4
            until(
                page, "[...document.querySelectorAll('#plotted img')].filter((i) => i.naturalWidth > 500).length === 2"
            )
            assert page.locator("#plots .uplot").count() >= 2
            page.screenshot(path=tmp_path / "first-start.png")
            page.click("#anew")
            wait_for(page, "question", "go on?")
    assert board.lines[-4] == "stop now"


def test_chip_page(page: Page, tmp_path: Path) -> None:
    """The chip in the browser: it runs, a slider slows it down, an open phase ends in its fault, as its export does.

    Lanes of gates and comparators are there, and the load of the core. A trigger meets the angle error that follows.

    Verifies: LIVE-13, LIVE-15, LIVE-18
    """
    with running(tmp_path, SPINNING, "--chip") as (address, _):
        page.goto(address)
        wait_for(page, "name", "spinning — chip", START_MS)
        wait_for(page, "state", "running", START_MS)
        wait_for(page, "load-core", "core ")
        lanes = page.evaluate("panels.find((panel) => panel.unit === 'level').names")
        assert lanes == [*GATES[:6], *COMPARATORS]
        newest = "panels.find((p) => p.names.includes('speed_rpm')).plot.data[1].at(-1)"
        before = page.evaluate(newest)
        page.evaluate(f"at('speed').value = {SLOWER_RPM}; at('speed').onchange()")
        wait_for(page, "said", f"set speed_rpm {SLOWER_RPM} ok")
        assert before > LOWER_RPM + 500.0
        until(page, f"{newest} < {LOWER_RPM}")
        page.select_option("#trigger", "angle_error_deg")
        page.select_option("#edge", "size")
        page.click("text=Open phase A")
        wait_for(page, "state", "fault")
        fault = page.inner_text("#fault")
        wait_for(page, "triggered", "at ")
        page.click("#export")
        wait_for(page, "files", "fluxlock run ")
    scenario = load_scenario(tmp_path / "my-play.toml")
    outcome = finished(run_scenario(scenario, tmp_path / "run", scenario.seed), scenario)
    assert outcome.result["fault"] == fault and outcome.verdict.passed, outcome.verdict.lines


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["my-none.toml"], "my-none.toml: file not found"),
        ([INJECTION, "--set", "inverter.sensing.divider_gain=[1, 1.1, 1]"], "dividers are equal"),
        ([SCENARIO, "--host", "no.such.host.invalid"], "--host: no.such.host.invalid"),
        ([SCENARIO, "--token", "a b"], "--token: must have 8 to 64"),
        ([SCENARIO, "--set", "drive.nothing=1"], "--set: drive.nothing: unknown key"),
    ],
)
def test_bad_input(arguments: list[str], text: str) -> None:
    """Each is one line that names the option or file.

    Verifies: LIVE-09
    """
    result = CliRunner().invoke(app, ["live", *arguments])
    assert isinstance(result.exception, ConfigError) and text in str(result.exception)


def test_port_in_use() -> None:
    """Another program has the port: the line says what to do.

    Verifies: LIVE-09
    """
    with cli.listening("127.0.0.1", 0) as taken, pytest.raises(ConfigError, match="--port 0 takes a free one"):
        cli.listening("127.0.0.1", taken.getsockname()[1])


def test_missing_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra: what is missing, and how to get it.

    Verifies: LIVE-09
    """
    monkeypatch.setattr(cli, "find_spec", lambda name: None if name == "uvicorn" else object())
    result = CliRunner().invoke(app, ["live", SCENARIO])
    assert isinstance(result.exception, ConfigError)
    assert re.search(r"needs uvicorn: .*fluxlock\[live\]", str(result.exception))


def test_vendored() -> None:
    """The plotting library is that of the registry's package, unchanged, and the page asks no other host for anything.

    Verifies: LIVE-02
    """
    for name, digest in VENDORED.items():
        assert hashlib.sha256((PAGE / "vendor" / name).read_bytes()).hexdigest() == digest
    for name in ("index.html", "live.js", "pictures.js", "lines.js", "live.css"):
        text = (PAGE / name).read_text(encoding="utf-8")
        assert "//" not in re.sub(r"^\s*//.*$|  //.*$", "", text, flags=re.MULTILINE)


def test_the_graph_has_every_state_of_the_drive() -> None:
    """A state that the page could not draw would end its drawing.

    Verifies: LIVE-07
    """
    (nodes,) = re.findall(
        r"^const NODES = (\{.*\});$", (PAGE / "pictures.js").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert re.findall(r"(\w+): \[", nodes) == list(names("drive_state_t"))
