# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""candump, cansend and cangen against the chip on a real SocketCAN interface.

Not collected by name: test_socketcan.py and `make test-socketcan` run this file where vcan0 is.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cantools

from fluxlock.base.paths import ROOT
from fluxlock.canopen.dbc import dbc
from fluxlock.canopen.dictionary import load_dictionary
from tests.canopen.node_bench import NODE

CHANNEL = os.environ.get("FLUXLOCK_SOCKETCAN", "vcan0")
PATIENCE_S = 600.0
GENERATED = 40
LINE = re.compile(r"\(\d+\.\d+\) +(\w+) ([0-9A-F]+)#(R?)([0-9A-F]*)")


class Dump:
    """What candump has seen."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def frames(self) -> list[tuple[int, bytes]]:
        """Standard data frames, identifier and data."""
        found = LINE.findall(self.path.read_text())
        return [(int(i, 16), bytes.fromhex(d)) for _, i, remote, d in found if len(i) == 3 and not remote]

    def wait(self, can_id: int, begin: bytes, count: int = 1) -> bytes:
        """Data of the frame of this count with an identifier whose data begin so."""
        end = time.monotonic() + PATIENCE_S
        while True:
            found = [data for i, data in self.frames() if i == can_id and data.startswith(begin)]
            if len(found) >= count:
                return found[count - 1]
            assert time.monotonic() < end, f"{can_id:03X}#{begin.hex()} did not come"
            time.sleep(0.05)


@contextmanager
def candump(path: Path) -> Iterator[Dump]:
    """Candump into a file."""
    with path.open("w") as out:
        process = subprocess.Popen(["candump", "-L", CHANNEL], stdout=out)
        try:
            yield Dump(path)
        finally:
            process.terminate()
            process.wait()


def cansend(frame: str) -> None:
    subprocess.run(["cansend", CHANNEL, frame], check=True)


def test_can_utils(tmp_path: Path) -> None:
    """SDO by cansend, random frames by cangen, seen by candump and taken by the chip; the DBC decodes its frames."""
    words = ["--can", f"socketcan:{CHANNEL}", "--seconds", "0.12", "--out", str(tmp_path / "run")]
    command = [sys.executable, "-m", "fluxlock", "can", str(ROOT / "scenarios" / "can.toml"), *words]
    with candump(tmp_path / "dump") as dump:
        time.sleep(0.5)
        run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        dump.wait(0x700 + NODE, b"\0")
        asked, state = 0, 0
        while state != 0x40:  # switch on disabled; until the drive has measured its offsets it is not ready
            asked += 1
            cansend(f"{0x600 + NODE:03X}#4041600000000000")
            status = dump.wait(0x580 + NODE, bytes.fromhex("4B416000"), asked)
            state = int.from_bytes(status[4:6], "little") & 0x6F
            assert state & 0x2F == 0
        cansend(f"000#01{NODE:02X}")
        dump.wait(0x380 + NODE, b"")
        subprocess.run(["cangen", CHANNEL, "-g", "5", "-n", str(GENERATED), "-I", "6A0", "-L", "8"], check=True)
        cansend(f"{0x600 + NODE:03X}#2B40600006000000")
        dump.wait(0x580 + NODE, bytes.fromhex("60406000"))
        out, _ = run.communicate(timeout=PATIENCE_S)
        assert run.returncode == 0
        frames = dump.frames()
    to_chip = 2 + asked + GENERATED
    assert f" from the chip, {to_chip} to it" in out
    database = cantools.database.load_string(dbc(load_dictionary(), NODE), "dbc")
    own = {0x580, 0x80, 0x180, 0x280, 0x380, 0x480, 0x700}
    mine = [(i, data) for i, data in frames if i - NODE in own]
    for i, data in mine:
        database.decode_message(i, data)
    assert f"frames: {len(mine)} from the chip" in out
