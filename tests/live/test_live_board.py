# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A board on the page: here the firmware as a program, behind a pseudo-terminal."""

from __future__ import annotations

import math
import os
import pty
import select
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock.can import sdo
from fluxlock.can.sdo import NodeError
from fluxlock.cli import app
from fluxlock.config import ConfigError, load_scenario
from fluxlock.flash import board_console
from fluxlock.live import messages, node_console
from fluxlock.live.board import Board, BoardPlan, core_load
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import NAMES
from fluxlock.native.drive import drive_of_scenario
from fluxlock.native.player import player
from tests.can.served import on_a_bus
from tests.flash.board_terminal import behind_a_terminal

SPINDLE = "scenarios/own-spindle.toml"
STEP_S = 0.02  # simulated for each line


@contextmanager
def spindle_behind_a_terminal() -> Iterator[Path]:
    """A drive that answers on a terminal, and goes on a little with every line."""
    play = player(load_scenario(SPINDLE), 1, 0.5)
    play.advance(0.01)

    def serve(host: int, over: threading.Event) -> None:
        text = b""
        while not over.is_set():
            if not select.select([host], [], [], 0.02)[0]:
                continue
            data = os.read(host, 4096)
            text += data
            *lines, text = text.split(b"\n")
            for line in filter(None, (line.strip() for line in lines)):
                play.advance(play.now + STEP_S)
                play.take()
                replies = play.firmware.command(line.decode())
                os.write(host, "".join(f"{reply}\r\n" for reply in replies).encode())

    with behind_a_terminal(serve) as port:
        yield port


def test_a_board_is_led_by_its_console() -> None:
    """Values become traces and settings; start and speed go to the console; what a wire needs is refused.

    Verifies: LIVE-11
    """
    scenario = load_scenario(SPINDLE)
    with spindle_behind_a_terminal() as port:
        source = Board(BoardPlan(port, scenario))
        told = source.hello()
        assert {entry["name"] for entry in told["settings"]} >= {"speed_rpm", "accel_rpm_s", "current_limit_a"}
        assert all(entry["order"] is None and entry["why"] for entry in told["faults"])
        source.act(messages.Set(kind="set", name="accel_rpm_s", value="40000"))
        source.act(messages.Set(kind="set", name="speed_rpm", value="9000"))
        source.act(messages.Drive(kind="drive", do="start"))
        assert [entry["answer"] for entry in source.said] == ["ok"] * 3
        for _ in range(60):
            source.advance(0.01)
            if source.status()["state"] == "running":
                break
        times, rows = source.take()
        status = source.status()
        assert status["state"] == "running" and status["target_rpm"] == 9000
        assert rows.shape == (len(NAMES), times.size) and (times[1:] > times[:-1]).all()
        assert rows[NAMES.index("target_rpm"), -1] == 9000 and rows[NAMES.index("vdc"), -1] > 1.0
        for action in (
            messages.LoadFactor(kind="load", factor=2.0),
            messages.Supply(kind="supply", volt=1.0),
            messages.Set(kind="set", name="no_such", value="1"),
        ):
            with pytest.raises(RefusedError, match=r"^[^\n]+$"):
                source.act(action)
        with pytest.raises(RefusedError, match="exports plays"):
            source.export("my-play")


def test_load_of_the_core() -> None:
    """From two readings of `idle`, also across the end of their 32 bits; unknown without two.

    Verifies: LIVE-15
    """
    assert core_load("1000 5000", "4000 10000") == pytest.approx(40.0)
    assert core_load(f"{2**32 - 1000} {2**32 - 2000}", "1000 2000") == pytest.approx(50.0)
    for before, now in (("", "1 2"), ("1 2", ""), ("1 2", "1 2"), ("1", "2")):
        assert math.isnan(core_load(before, now))


def test_a_silent_board_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """A port behind which nobody answers ends the source with one line.

    Verifies: LIVE-11
    """
    monkeypatch.setattr(board_console, "REPLY_S", 0.1)
    host, end = pty.openpty()
    with pytest.raises(board_console.SilentError, match="is the drive on"):
        Board(BoardPlan(Path(os.ttyname(end)), load_scenario(SPINDLE)))
    os.close(end)
    os.close(host)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([SPINDLE, "--board", "my-none"], "--board: my-none: is not a serial port"),
        ([SPINDLE, "--board", "/dev/null"], "--board: /dev/null: is not a serial port"),
        (["docs", "--board", "/dev/null"], "goes with the scenario"),
    ],
)
def test_bad_board(arguments: list[str], text: str) -> None:
    """Each is one line that names the option.

    Verifies: LIVE-09, LIVE-11
    """
    result = CliRunner().invoke(app, ["live", *arguments])
    assert isinstance(result.exception, ConfigError) and text in str(result.exception)


CAN = "scenarios/can.toml"
SETTING_NAMES = {"commutation", "balance", "carrier_hz"}


def shown_until(source: Board, condition: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Look until the status is so."""
    end_s = time.monotonic() + 60.0
    while not condition(status := source.status()):
        assert time.monotonic() < end_s, status
        source.advance(0.01)
    return status


def test_a_board_is_led_by_its_node() -> None:
    """Over CAN: start, speed and settings by SDO, values become traces; what is no object is refused by name.

    Verifies: LIVE-11
    """
    scenario = load_scenario(CAN)
    assert scenario.can is not None
    with on_a_bus(drive_of_scenario(scenario, scenario.can.node_id)) as bus:
        source = Board(BoardPlan(None, scenario, bus))
        try:
            assert {entry["name"] for entry in source.hello()["settings"]} >= SETTING_NAMES
            shown_until(source, lambda status: status["state"] == "ready")
            for name, value in (("speed_rpm", "20000"), ("balance", "both"), ("current_limit_a", "1")):
                source.act(messages.Set(kind="set", name=name, value=value))
            answers = [entry["answer"] for entry in source.said]
            assert answers[:2] == ["ok", "ok"]
            assert answers[2].startswith("error: current_limit_a is no object of the node")
            source.act(messages.Drive(kind="drive", do="start"))
            status = shown_until(source, lambda status: abs(status["speed_rpm"] - 20_000) < 200)
            assert status["state"] == "operation enabled" and status["target_rpm"] == 20_000
            assert status["values"]["balance"] == "both" and status["supply_v"] == pytest.approx(25.0, abs=0.5)
            _, rows = source.take()
            assert np.nanmax(rows[NAMES.index("motor_a")]) > 1.0
            source.act(messages.Drive(kind="drive", do="reverse"))
            shown_until(source, lambda status: abs(status["speed_rpm"] + 20_000) < 200)
            source.act(messages.Drive(kind="drive", do="stop"))
            shown_until(source, lambda status: status["state"] == "ready")
            assert Board(BoardPlan(None, scenario, bus)).status()["target_rpm"] == -20_000
        finally:
            source.end()


def test_a_node_that_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page hears why, in one line.

    Verifies: LIVE-11
    """
    monkeypatch.setattr(sdo, "SDO_S", 0.05)
    with can.Bus(interface="virtual", channel="empty"), pytest.raises(NodeError, match="node 5 does not answer"):
        Board(BoardPlan(None, load_scenario(CAN), "virtual:empty"))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([SPINDLE, "--can", "virtual:x"], "can: with node-ID and bit rate"),
        ([CAN, "--can", "vcan0"], "must be INTERFACE:CHANNEL"),
        ([CAN, "--can", "virtual:x", "--chip"], "leave out --board, --chip, --first-start"),
    ],
)
def test_refused_on_a_bus(arguments: list[str], text: str) -> None:
    """Before the page is there.

    Verifies: LIVE-11
    """
    result = CliRunner().invoke(app, ["live", *arguments])
    assert isinstance(result.exception, ConfigError) and text in str(result.exception)


class Refusing:
    """Objects of a node that refuses them from some time on, as one of another firmware would from the begin."""

    def __init__(self) -> None:
        self.refuses = False

    def has(self, name: str) -> bool:
        """All."""
        return True

    def number(self, name: str) -> int:
        """Nothing, until it refuses."""
        if self.refuses:
            raise sdo.AbortedError(f"node 5 refuses {name}")
        return 0


def test_what_a_node_refuses_to_tell() -> None:
    """It is no empty status: the source ends and says why.

    Verifies: LIVE-11
    """
    objects = Refusing()
    console = node_console.NodeConsole(objects, vector=False)  # type: ignore[arg-type]  # in the objects' place
    assert "state init" in console.ask("get")
    objects.refuses = True
    with pytest.raises(NodeError, match="refuses"):
        console.ask("get")
