# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Test of the wiring on a board, by CAN and by its console: the twin with the firmware's node, or behind a port."""

from __future__ import annotations

import itertools
import json
from typing import Any

import can
import pytest

from fluxlock.can import sdo
from fluxlock.config import Scenario
from fluxlock.firmware import build_canopen_library
from fluxlock.native.drive import STEP_US
from fluxlock.native.node import HostNode
from fluxlock.native.play import PIN
from fluxlock.native.vector_chip import VectorChip
from fluxlock.native.vector_run import vector_chip_of
from fluxlock.wiring import reach
from fluxlock.wiring.measure import lead, on_board, on_bus, on_twin
from fluxlock.wiring.reach import WiringError
from tests.can.served import on_a_bus
from tests.wiring.test_wiring import FILE, command, wired

NODE = 9
CHANNELS = itertools.count()
LINE_S = 5e-3  # simulated for each line of the console


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loaded machine may be slow."""
    monkeypatch.setattr(sdo, "SDO_S", 60.0)


class VectorDrive:
    """The twin with its node, a millisecond a step."""

    def __init__(self, scenario: Scenario) -> None:
        self.chip = vector_chip_of(scenario, 3, build_canopen_library())
        self.node = HostNode(self.chip.fw.lib, NODE)
        self.node.memory = bytes(len(self.node.memory))
        self.node.boot(0)
        self.now_us = 0

    def step(self) -> None:
        """Motor and firmware for a millisecond, then the node."""
        self.chip.advance(round(1e-6 * STEP_US / self.chip.timing.period_s))
        self.now_us += STEP_US
        self.node.step(self.now_us)


@pytest.mark.parametrize("keys", [{}, {"current_order": "BCA", "current_inverted": ["C"]}, {"voltage_order": "ACB"}])
def test_over_can(keys: dict[str, Any]) -> None:
    """The node gives the findings that the console gives, and what was set before is set again.

    Verifies: WIRE-06
    """
    scenario = wired(**keys)
    expected = on_twin(scenario, 3)
    drive = VectorDrive(scenario)
    drive.step()
    before = [drive.node.value(f"setting_{setting}") for setting in reach.SETTINGS]
    with on_a_bus(drive) as name:
        interface, _, channel = name.partition(":")
        measured = on_bus(scenario, can.Bus(interface=interface, channel=channel), NODE)
    drive.step()
    after = [drive.node.value(f"setting_{setting}") for setting in reach.SETTINGS]
    assert (measured.fault, measured.wiring, measured.findings) == (expected.fault, expected.wiring, expected.findings)
    assert measured.passed == (not keys)
    assert measured.current_a == pytest.approx(expected.current_a, abs=0.1 * expected.current_a.max())
    assert measured.voltage_v == pytest.approx(expected.voltage_v, abs=0.1 * expected.voltage_v.max())
    assert before == after
    assert drive.chip.fw.state == ("fault" if keys else "ready")


def test_command_over_can(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 1 and the finding in one line; a node that does not answer, in one line too.

    Verifies: WIRE-06
    """
    scenario = wired(current_order="ACB")
    with on_a_bus(VectorDrive(scenario)) as name:
        words = (str(FILE), "--can", name, "--json", "--set")
        assert command(monkeypatch, *words, f"can={{node_id={NODE}}}") == 1
        said = capsys.readouterr()
        assert json.loads(said.out)["current_order"] == "ACB"
        assert "failed: current sensors of B and C are swapped" in said.err
        monkeypatch.setattr(sdo, "SDO_S", 0.1)
        assert command(monkeypatch, *words, "can={node_id=3}") == 1
        assert "failed: node 3 does not answer" in capsys.readouterr().err


def test_a_node_with_a_fault_is_not_tested() -> None:
    """The drive must be ready: its fault is named.

    Verifies: WIRE-06
    """
    scenario = wired()
    drive = VectorDrive(scenario)
    for step in range(20):
        if step == 10:
            drive.chip.trip(PIN)
        drive.step()
    with on_a_bus(drive) as name:
        interface, _, channel = name.partition(":")
        with pytest.raises(WiringError, match="stopped with the fault fault_pin: a gate driver"):
            on_bus(scenario, can.Bus(interface=interface, channel=channel), NODE)


class ConsolePort:
    """A serial port behind which the twin goes on a little with every line."""

    def __init__(self, chip: VectorChip) -> None:
        self.chip, self._sent = chip, b""

    def write(self, data: bytes) -> None:
        """Lines for the console."""
        for line in data.decode().split("\n"):
            self.chip.advance(round(LINE_S / self.chip.timing.period_s))
            if line:
                self._sent += "".join(f"{reply}\r\n" for reply in self.chip.fw.command(line)).encode()

    def read(self, count: int, timeout_s: float) -> bytes:
        """What it has answered."""
        data, self._sent = self._sent[:count], self._sent[count:]
        return data


@pytest.mark.parametrize("order", ["ABC", "CAB"])
def test_at_a_serial_port(order: str) -> None:
    """Findings as on the twin; settings and target are left as before.

    Verifies: WIRE-06
    """
    scenario = wired(current_order=order)
    chip = vector_chip_of(scenario, 3)
    chip.advance(round(5e-3 / chip.timing.period_s))
    for line in ("set speed_rpm 4000", "set catch 1"):
        chip.fw.command(line)
    measured = on_board(scenario, ConsolePort(chip))
    assert measured.wiring.current_order == order
    assert measured.passed == (order == "ABC")
    replies = [chip.fw.command(f"get {name}")[0] for name in ("speed_rpm", "catch", "check_wiring")]
    assert replies == ["speed_rpm 4000", "catch 1", "check_wiring off"]


class EnabledNode:
    """An SDO server whose operation somebody has enabled; counts what is written."""

    def __init__(self) -> None:
        self.written = 0

    def upload(self, index: int, subindex: int) -> bytes:
        """The statusword, or 0."""
        return bytes([reach.ENABLED if (index, subindex) == (0x6041, 0) else 0, 0])

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Nothing is to be written."""
        self.written += 1


def test_a_running_drive_is_left_alone() -> None:
    """It is refused, by console and by node, and nothing is sent that stops or changes it.

    Verifies: WIRE-06
    """
    asked: list[str] = []

    def ask(line: str) -> list[str]:
        asked.append(line)
        return ["state running", "ok"]

    with pytest.raises(WiringError, match="is in state running: it must be ready"):
        lead(reach.ByConsole(ask), lambda _: None)
    assert [line for line in asked if not line.startswith("get ")] == []
    node = EnabledNode()
    with pytest.raises(WiringError, match="a master has enabled"):
        lead(reach.BySdo(sdo.Objects(node, NODE), wired()), lambda _: None)
    assert node.written == 0
