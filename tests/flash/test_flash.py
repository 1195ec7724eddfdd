# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The host's side of the loader: what it writes in which order, and its serial port.

The chip's side, with the same code on its line: cocotb_tests/soc/test_boot.py.
"""

from __future__ import annotations

import os
import pty
import re
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT, RTL
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError
from fluxlock.firmware import build_firmware
from fluxlock.flash import loader
from fluxlock.flash.command import CONVERSION_S, SPACING_S, flash
from fluxlock.flash.image import IMAGE_MAX_BYTES, Plan, pack_can_setup, pack_image, plan
from fluxlock.flash.loader import START, Loader, LoaderError, SerialLine, frame, read_frame
from fluxlock.flash.serial_port import SerialPort
from fluxlock.generate.memory import (
    BLOCK_MAX_BYTES,
    FLASH_BLOCK,
    FLASH_CAN_SETUP,
    FLASH_END,
    FLASH_IMAGE,
    FLASH_PAGE_BYTES,
    FLASH_SECTOR_BYTES,
    FLASH_STORE,
)

BLOCK = bytes(range(256)) * 3
CONVERSION = "inverter.sensing.conversion_s=0.68e-6"  # of the boards


class Deaf:
    """A port that nobody answers on; what was sent."""

    def __init__(self, answers: bytes = b"") -> None:
        self.sent, self.answers = b"", answers

    def write(self, data: bytes) -> None:
        self.sent += data

    def read(self, count: int, timeout_s: float) -> bytes:
        assert timeout_s > 0
        data, self.answers = self.answers[:count], self.answers[count:]
        return data


def test_header() -> None:
    """Words of the header by their meaning; lengths that the loader would refuse are refused here.

    Verifies: BOOT-04
    """
    code = bytes(range(256)) + b"\x01"
    image = pack_image(code, 3)
    magic, form, registers, phases, _, length, crc, header_crc = struct.unpack_from("<8I", image)
    assert (image[:4], form, registers, phases) == (b"FLXI", 1, 3, 3) and magic == 0x49584C46
    assert length == 260 and image[FLASH_PAGE_BYTES:] == code + bytes(3)
    assert crc == zlib.crc32(code + bytes(3)) and header_crc == zlib.crc32(image[:28])
    for wrong in (bytes(0x80), bytes(IMAGE_MAX_BYTES + 1)):
        with pytest.raises(ValueError, match="bytes"):
            pack_image(wrong, 3)


def test_plan() -> None:
    """Every byte is written once into an erased sector; headers are erased first and written last.

    Verifies: BOOT-04, BOOT-05
    """
    image = pack_image(bytes(range(251)) * 40, 3)
    steps = plan(image, BLOCK)
    assert steps.erase[:2] == [FLASH_BLOCK, FLASH_IMAGE]
    assert [address for address, _ in steps.write[-2:]] == [FLASH_BLOCK, FLASH_IMAGE]
    written: dict[int, int] = {}
    for address, data in steps.write:
        assert address % FLASH_PAGE_BYTES + len(data) <= FLASH_PAGE_BYTES
        assert not written.keys() & range(address, address + len(data))
        written |= dict(enumerate(data, address))
    assert written == dict(enumerate(image, FLASH_IMAGE)) | dict(enumerate(BLOCK, FLASH_BLOCK))
    assert {address // FLASH_SECTOR_BYTES * FLASH_SECTOR_BYTES for address in written} == set(steps.erase)
    largest = plan(pack_image(bytes(IMAGE_MAX_BYTES), 3), BLOCK)
    assert max(largest.erase) == FLASH_BLOCK == FLASH_END - FLASH_SECTOR_BYTES
    for wrong in (BLOCK[:16], bytes(3073)):
        with pytest.raises(ValueError, match="parameter block"):
            plan(image, wrong)


def test_plan_with_a_bus() -> None:
    """Node-ID and bit rate go into the sector of the block, behind the longest one; stored objects are not touched.

    Verifies: CO-28, BOOT-04
    """
    image, setup = pack_image(bytes(1000), 3), pack_can_setup(5, 1000)
    plain, with_bus = plan(image, BLOCK), plan(image, BLOCK, setup)
    assert with_bus.erase == plain.erase
    (added,) = (step for step in with_bus.write if step not in plain.write)
    assert added == (FLASH_CAN_SETUP, struct.pack("<3I", 5, 1000, zlib.crc32(struct.pack("<2I", 5, 1000))))
    assert FLASH_BLOCK + BLOCK_MAX_BYTES <= FLASH_CAN_SETUP and FLASH_CAN_SETUP % FLASH_PAGE_BYTES == 0
    assert with_bus.write[-2:] == plain.write[-2:]
    assert max(with_bus.erase) + FLASH_SECTOR_BYTES <= FLASH_STORE


def test_frames() -> None:
    """Text and broken frames are passed over; a loader that stays silent is an error, after three tries.

    Verifies: BOOT-04
    """
    good, broken = frame(4, b"abc"), bytearray(frame(4, b"abd"))
    broken[5] ^= 1
    assert good == b"\xa5\x04\x03\x00abc" + struct.pack("<I", zlib.crc32(b"\x04\x03\x00abc"))
    assert read_frame(Deaf(b"boot: text\r\n" + bytes(broken) + good), 1.0) == (4, b"abc")
    assert read_frame(Deaf(good[:-1]), 1.0) is None
    port = Deaf()
    with pytest.raises(LoaderError, match="stopped answering"):
        Loader(SerialLine(port)).check()
    assert port.sent == 3 * frame(4)
    with pytest.raises(LoaderError, match="reset the board"):
        Loader(SerialLine(port)).find(0.01)


class Late:
    """A line on which the answers of a loader that was held up come behind those of the commands after them."""

    def __init__(self, *answers: bytes) -> None:
        self.answers = [(0, answer) for answer in answers]
        self.asked: list[int] = []

    def send(self, code: int, payload: bytes) -> None:
        self.asked.append(code)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        return self.answers.pop(0) if self.answers else None

    def trouble(self) -> str:
        return ""


def test_a_late_answer_is_none_to_another_command() -> None:
    """A greeting that comes behind the order to start is passed over, not called an unknown answer.

    Verifies: BOOT-04
    """
    greeting, good = struct.pack("<2I", 1, 0xEF4016), struct.pack("<I", 0)
    line = Late(greeting, b"", greeting, good)
    assert Loader(line).start() == "good"
    assert line.asked == [START]


def test_serial_port() -> None:
    """All byte values pass a terminal of the system unchanged, both ways; a read ends in time.

    Verifies: BOOT-06
    """
    other, line = pty.openpty()
    every = bytes(range(256))
    with SerialPort(Path(os.ttyname(line))) as port:
        port.write(every)
        assert os.read(other, 256) == every
        os.write(other, every)
        assert port.read(256, 5.0) == every
        start = time.monotonic()
        assert port.read(1, 0.05) == b""
        assert 0.04 < time.monotonic() - start < 5.0
    os.close(other)
    os.close(line)


@pytest.mark.parametrize("name", ["demo", "can"])
def test_command_uploads(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """The image of the scenario, with its node and setup where it has a CAN bus.

    Verifies: BOOT-04, CO-28
    """
    plans: list[Plan] = []

    class Board:
        def __init__(self, _: object) -> None:
            pass

        def find(self, _: float) -> tuple[int, int]:
            return 1, 0xEF4016

        def upload(self, steps: Plan, _: object) -> None:
            plans.append(steps)

        def start(self) -> str:
            return "good"

    monkeypatch.setattr(loader, "Loader", Board)
    other, line = pty.openpty()
    scenario = ROOT / "scenarios" / f"{name}.toml"
    flash(scenario, Path(os.ttyname(line)))
    os.close(other)
    os.close(line)
    written = dict(plans[0].write)
    method = "six-step" if name == "can" else None
    image = pack_image(build_firmware(can_method=method).read_bytes(), 3)
    assert b"".join(written[address] for address in sorted(written) if address < FLASH_BLOCK) == image
    assert written.get(FLASH_CAN_SETUP) == (pack_can_setup(5, 1000) if name == "can" else None)


@pytest.mark.parametrize(
    ("port", "text"),
    [
        ("README.md", "is not a serial port that you may read and write"),
        ("/dev/null", "does not work as a serial port at 1 Mbaud: Inappropriate ioctl for device"),
        ("/dev/tty", "cannot be opened: No such device or address"),
    ],
)
def test_command_refuses(port: str, text: str) -> None:
    """A port that is none is named in one line, exit code 2: a file, a device that is no terminal, no terminal at all.

    Verifies: BOOT-06
    """
    command = [sys.executable, "-m", "fluxlock", "flash", "scenarios/demo.toml", "--port", port]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, start_new_session=True)
    assert (done.returncode, done.stderr) == (2, f"error: --port: {port}: {text}\n")


@pytest.mark.parametrize(
    ("scenario", "ram_kib", "text"),
    [
        ("demo", 64, "multiple of 8 from 72 to 128"),
        ("demo", 76, "multiple of 8 from 72 to 128"),
        ("vector/ipm-injection", 88, "injection"),
        ("five-phase/tian", 88, "five phases"),
        ("can", 72, "CAN bus need"),
    ],
)
def test_refused_ram(scenario: str, ram_kib: int, text: str) -> None:
    """A size that no chip has, and firmware that only the whole RAM holds.

    Verifies: BOOT-10
    """
    with pytest.raises(ConfigError, match=text) as caught:
        flash(ROOT / "scenarios" / f"{scenario}.toml", Path("/dev/null"), set_=[CONVERSION], ram_kib=ram_kib)
    assert [problem.file for problem in caught.value.problems] == ["--ram-kib"]


def test_firmware_too_large(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A firmware that reaches beyond the RAM that the chip has is refused by its name.

    Verifies: BOOT-10
    """
    monkeypatch.setattr("fluxlock.firmware.toolchain.image_end", lambda _: 0x8000)
    monkeypatch.setattr("fluxlock.cosim.run.BUILD", tmp_path)  # nothing is built yet
    with pytest.raises(ConfigError, match="fluxlock-vector-88k") as caught:
        flash(ROOT / "scenarios" / "vector" / "encoder.toml", Path("/dev/null"), set_=[CONVERSION], ram_kib=88)
    assert [problem.file for problem in caught.value.problems] == ["--ram-kib"]


@pytest.mark.parametrize(
    ("scenario", "set_", "keys"),
    [
        ("demo", ["inverter.sensing.sample_period_s=5e-7"], ["inverter.sensing.sample_period_s"]),
        ("vector/encoder", [], ["inverter.sensing.conversion_s"]),
        (
            "vector/encoder",
            ["inverter.sensing.sample_period_s=0.7e-6"],
            ["inverter.sensing.sample_period_s", "inverter.sensing.conversion_s"],
        ),
        ("vector/encoder", [CONVERSION], ["--port"]),
        ("demo", ["inverter.sensing.sample_period_s=0.72e-6"], ["--port"]),
        ("demo", ["inverter.dead_time_s=0"], ["inverter.dead_time_s"]),
        ("demo", ["drive.motor_error.flux=1.5"], ["drive.motor_error"]),
    ],
)
def test_refused_on_a_board(scenario: str, set_: list[str], keys: list[str]) -> None:
    """What the boards' converters do not keep up with, no dead time, and motor values that are wrong on purpose.

    Verifies: BOOT-11
    """
    path = ROOT / "scenarios" / f"{scenario}.toml"
    with pytest.raises(ConfigError) as caught:
        flash(path, set_=set_)
    assert [problem.file for problem in caught.value.problems] == keys


def test_converter_times() -> None:
    """What the command asks of samples is what the converter interface of the boards takes.

    Verifies: BOOT-11
    """
    board, block = ((RTL / "board" / f"fl_{name}.sv").read_text() for name in ("board", "adc_serial"))
    (frame_bits,) = map(int, re.findall(r"\.FrameBits *\((\d+)\)", board))
    (quiet_clocks,) = map(int, re.findall(r"QuietCycles = (\d+);", block))
    assert "FrameCycles = 2 * FrameBits + 2;" in block
    frame_clocks = 2 * frame_bits + 2
    assert round(CONVERSION_S * CLOCK_HZ, 6) == frame_clocks
    assert round(SPACING_S * CLOCK_HZ, 6) == frame_clocks + quiet_clocks


def test_image_for_less_ram() -> None:
    """Six-step operation alone fits into 64 KiB with its state; the whole image is another.

    Verifies: BOOT-10
    """
    small, whole = (
        build_firmware(method=method, ram_words=words) for method, words in (("six-step", 18432), (None, 32768))
    )
    assert small != whole
    assert small.stat().st_size < 64 * 1024 - 4096 < whole.stat().st_size
