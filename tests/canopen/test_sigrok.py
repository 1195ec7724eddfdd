# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The decoder of sigrok, which is not ours, on the pin that a run of the chip has recorded."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fluxlock.can.frame import Frame
from fluxlock.results.rundata import LogKind
from tests.canopen.chip_bench import CAN, NODE, Talker, run_chip, sdo

SECONDS = 0.02
FRAMES = 60
STEPS = 2  # of 10 ns a clock
DOWNSAMPLE = 10  # ten samples a bit at 1 Mbit/s

pytestmark = pytest.mark.skipif(shutil.which("sigrok-cli") is None, reason="needs sigrok-cli: apt install sigrok-cli")


def write_vcd(path: Path, rows: NDArray[np.int64]) -> None:
    """The level of the bus at the chip's receive pin, one signal; sigrok cuts files off that have wider ones."""
    head = "$timescale 10 ns $end\n$scope module chip $end\n$var wire 1 ! can_rx $end\n$upscope $end\n"
    lines, level = ["#0", "1!"], 1
    for cycle, _, pins, _ in rows:
        if pins >> 1 & 1 != level:
            level = pins >> 1 & 1
            lines += [f"#{STEPS * cycle}", f"{level}!"]
    lines += [f"#{round(STEPS * SECONDS * 50e6)}", f"{level}!"]
    path.write_text(head + "$enddefinitions $end\n" + "\n".join(lines) + "\n")


def decoded(path: Path) -> tuple[list[tuple[int, bytes]], list[str]]:
    """Identifier and data of the frames in a recording, and the decoder's warnings."""
    options = ["-i", str(path), "-I", f"vcd:downsample={DOWNSAMPLE}"]
    decoder = ["-P", "can:can_rx=can_rx:nominal_bitrate=1000000", "-A", "can=id:full-id:data:eof:warnings"]
    text = subprocess.run(["sigrok-cli", *options, *decoder], capture_output=True, text=True, check=True).stdout
    frames: list[tuple[int, bytes]] = []
    warnings: list[str] = []
    identifier, data = -1, b""
    for line in text.splitlines():
        found = re.match(r"can-1: (Identifier|Full Identifier|Data byte \d+|End of frame)(?:: .*?0x([0-9a-f]+))?", line)
        if found is None:
            warnings.append(line)
        elif found[1].endswith("Identifier"):
            identifier = int(found[2], 16)
        elif found[1].startswith("Data"):
            data += bytes([int(found[2], 16)])
        else:
            frames.append((identifier, data))
            identifier, data = -1, b""
    return frames, warnings


def test_recorded_pin(tmp_path: Path) -> None:
    """Every frame on the bus, of the chip and of others, standard and extended, is decoded once, without a warning.

    Verifies: CO-27
    """
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    queue = [sdo(0x2011, 0, k, 2) if k % 3 == 0 else Frame.draw(rng) for k in range(FRAMES)]
    # Data frames of up to eight bytes. The decoder warns of identifiers that begin with seven recessive bits; the node
    # obeys those below its own.
    queue = [f for f in queue if not f.rtr and f.dlc <= 8 and (f.ext or f.id > 0x580 + NODE)]
    queue = [f for f in queue if f.id >> (22 if f.ext else 4) != 0x7F]
    sent = list(queue)
    run, heard = run_chip(tmp_path, (CAN, "window=[]", "expect=[]"), SECONDS, Talker(queue=queue), log_can=True)
    write_vcd(tmp_path / "pin.vcd", run.rows(LogKind.CAN))
    frames, warnings = decoded(tmp_path / "pin.vcd")
    assert not warnings
    answers = [(i, bytes.fromhex(data)) for i, data in heard]
    assert len(answers) > len(sent) // 4
    assert len(sent) > FRAMES // 2
    assert Counter(frames) == Counter([(f.id, f.data) for f in sent] + answers)
