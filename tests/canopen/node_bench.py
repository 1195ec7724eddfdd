# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A CANopen node on the drive of the host library, closed over the averaged motor; an SDO client of its own."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

from fluxlock.canopen.dictionary import Entry
from fluxlock.firmware import build_canopen_library
from fluxlock.native.drive import STEP_US, NativeDrive
from fluxlock.native.node import Frame
from tests.firmware import machines
from tests.firmware.firmware_bench import Bench

NODE = 5
# Synchronous rectification: it can brake.
DRIVE = machines.drive(accel_rpm_per_s=400_000.0, current_limit_a=22.5, sync_rect=True)
# State by the statusword's bits 0..3, 5, 6.
STATES = {
    0x00: "not ready",
    0x40: "disabled",
    0x21: "ready",
    0x23: "switched on",
    0x27: "enabled",
    0x07: "quick stop",
    0x0F: "fault reaction",
    0x08: "fault",
}


class Aborted(Exception):
    """The server has aborted; args[0] is the code."""


# Once a process: whether its sources have changed takes as long to see as a test.
library = cache(build_canopen_library)


class NodeBench:
    """Motor, drive and node. Time goes on with `run` only."""

    def __init__(self, **keys: Any) -> None:
        drive = keys.pop("drive", DRIVE)
        self.bench = Bench(drive=drive, library=library(), **keys)
        self.drive = NativeDrive(self.bench, NODE)
        self.node = self.drive.node
        self.frames: list[Frame] = []
        self.node.fail_memory(False)

    @property
    def now_us(self) -> int:
        """Simulated time."""
        return self.drive.now_us

    def send(self, can_id: int, data: bytes = b"", flags: int = 0) -> None:
        """A frame to the node; what it answers at once is collected."""
        self.node.receive(Frame(can_id, data, flags))
        self.collect()

    def collect(self) -> None:
        """Take what the node has sent."""
        self.frames += self.node.sent()

    def taken(self, can_id: int) -> list[bytes]:
        """Data of the frames with an ID since the last call."""
        found = [frame.data for frame in self.frames if frame.id == can_id]
        self.frames = [frame for frame in self.frames if frame.id != can_id]
        return found

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Motor, drive and node for a time or until a condition; true if it came."""
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.drive.step()
            self.collect()
            if until is not None and until():
                return True
        return until is None

    def idle(self, seconds: float) -> None:
        """Only the node's time: the drive does not move."""
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.drive.now_us += STEP_US
            self.node.step(self.now_us)
            self.collect()

    # SDO client.
    def exchange(self, data: bytes) -> bytes:
        """One request to the server and its one answer."""
        self.taken(0x580 + NODE)
        self.send(0x600 + NODE, data)
        (reply,) = self.taken(0x580 + NODE)
        if reply[0] == 0x80:
            raise Aborted(struct.unpack_from("<I", reply, 4)[0])
        return reply

    def upload(self, index: int, sub: int = 0) -> bytes:
        """Read an object."""
        reply = self.exchange(struct.pack("<BHB4x", 0x40, index, sub))
        assert struct.unpack_from("<HB", reply, 1) == (index, sub)
        if reply[0] & 2:
            return reply[4 : 8 - (reply[0] >> 2 & 3)]
        (length,) = struct.unpack_from("<I", reply, 4)
        data, toggle = b"", 0
        while True:
            reply = self.exchange(bytes([0x60 | toggle << 4, *bytes(7)]))
            assert reply[0] >> 4 == toggle
            data += reply[1 : 8 - (reply[0] >> 1 & 7)]
            if reply[0] & 1:
                assert len(data) == length
                return data
            toggle ^= 1

    def download(self, index: int, sub: int, data: bytes, segmented: bool = False, sized: bool = True) -> None:
        """Write an object."""
        if len(data) <= 4 and not segmented:
            command = 0x22 | (1 | (4 - len(data)) << 2 if sized else 0)
            reply = self.exchange(struct.pack("<BHB", command, index, sub) + data.ljust(4, b"\0"))
            assert reply == struct.pack("<BHB4x", 0x60, index, sub)
            return
        length = len(data) if sized else 0
        assert self.exchange(struct.pack("<BHBI", 0x20 | sized, index, sub, length))[0] == 0x60
        toggle, first = 0, True
        while data or first:
            part, data, first = data[:7], data[7:], False
            head = toggle << 4 | (7 - len(part)) << 1 | (not data)
            assert self.exchange(bytes([head]) + part.ljust(7, b"\0"))[0] == 0x20 | toggle << 4
            toggle ^= 1

    def entry(self, name: str) -> Entry:
        """Entry of the dictionary by its name."""
        return self.node.dictionary[name]

    def write(self, name: str, value: int) -> None:
        """Write a number by its name."""
        e = self.entry(name)
        self.download(e.index, e.sub, (value & (1 << 8 * e.bytes) - 1).to_bytes(e.bytes, "little"))

    def read(self, name: str) -> int:
        """Read a number by its name."""
        e = self.entry(name)
        return int.from_bytes(self.upload(e.index, e.sub), "little", signed=e.signed)

    # Drive profile.
    @property
    def state(self) -> str:
        """State by the statusword."""
        return STATES[self.node.value("statusword") & (0x6F if self.node.value("statusword") & 0x20 else 0x4F)]

    def nmt(self, command: int, node: int = NODE) -> None:
        """Network management."""
        self.send(0, bytes([command, node]))

    def enable(self, patient: bool = True) -> None:
        """From power-up to operation enabled, in NMT operational. patient: no limit to the master's silence."""
        assert self.run(0.1, lambda: self.state == "disabled"), self.state
        if patient:
            self.write("command_timeout_time", 0)
        self.nmt(1)
        for word, state in ((6, "ready"), (7, "switched on"), (15, "enabled")):
            self.write("controlword", word)
            self.idle(0.001)
            assert self.state == state

    def until(self, state: str, seconds: float = 1.0) -> bool:
        """Run until the profile is in a state."""
        return self.run(seconds, lambda: self.state == state)

    def turn(self, rpm: int, seconds: float = 3.0) -> None:
        """Enabled, turn the motor until it has reached a speed."""
        self.write("target_velocity", rpm)
        assert self.run(seconds, lambda: bool(self.node.value("statusword") & 0x400)), self.bench.fw.command("status")
