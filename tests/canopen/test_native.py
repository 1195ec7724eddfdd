# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock native`: bus, console, pace, and what it refuses."""

from __future__ import annotations

import re
import struct
import subprocess
import sys
import time
from pathlib import Path

import can
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.can.can_bus import open_bus
from fluxlock.config import ConfigError, load_scenario
from fluxlock.native.averaged_motor import M_CONSTANT, M_COULOMB, M_FAN, M_P, M_VISCOUS
from fluxlock.native.drive import drive_of_scenario
from fluxlock.native.node import Frame
from fluxlock.native.program import MemoryFile, verdict_of
from fluxlock.native.recorder import Recorder
from fluxlock.native.serve import FRAMES_A_STEP, serve
from fluxlock.results.verdict import Verdict
from tests.canopen.node_bench import NODE, NodeBench

DEMO = ROOT / "scenarios" / "demo.toml"
HERE = (str(DEMO), "--can", "virtual:any", "--speed", "0")


def command(*words: str, console: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "fluxlock", "native", *words],
        input=console,
        capture_output=True,
        text=True,
        check=False,
    )


def test_runs_with_its_console() -> None:
    """A scenario's drive runs for a simulated time; lines on stdin reach its console.

    Verifies: CO-18
    """
    done = command(*HERE, "--seconds", "0.05", "--node", "7", console="get speed_rpm\nget vdc_v\n")
    assert done.returncode == 0, done.stderr
    first, *replies, verdict, why, last = done.stdout.splitlines()
    assert first.startswith("node 7 on virtual:any, process ")
    assert replies[0] == "speed_rpm 0"
    assert verdict == "ok: no speed to judge" and why == "  speed at the end not judged: no speed was asked for"
    assert last.startswith("0.050 s simulated in ")


def test_refused_line_fails() -> None:
    """A line that the drive refuses: exit code 1 and a line that says which and why.

    Verifies: FRONT-35
    """
    done = command(*HERE, "--seconds", "0.05", console="get no_such\n")
    assert done.returncode == 1
    failed = [text for text in done.stderr.splitlines() if text.startswith("failed: ")]
    assert len(failed) == 1 and re.match(
        r'failed: console at 0\.\d+ s: "get no_such" was rejected: unknown name', failed[0]
    )


def lightly_loaded(seconds: float, *settings: str) -> Verdict:
    """Motor-I with a fan of 0.1 mN*m, told at 20 ms to go to 8 000 r/min."""
    light = ("load.fan_torque_nm=0.0001", "drive.accel_rpm_per_s=150000", *settings)
    scenario = load_scenario(DEMO, light)
    drive = drive_of_scenario(scenario, NODE)
    recorder = Recorder(drive)
    while drive.now_us < 1e6 * seconds:
        recorder.note()
        for line in ("set speed_rpm 8000", "start") if drive.now_us == 20_000 else ():
            recorder.answered(line, drive.chip.fw.command(line))
        drive.step()
    return verdict_of(recorder, scenario)


def test_judges_itself() -> None:
    """A start that is not over; a speed that the least duty holds above its target; and with its remedy.

    Verifies: FRONT-35
    """
    early = lightly_loaded(0.05)
    assert re.match(r"the drive ended in starting, since 0\.02\d s: .* see drive\.start$", early.lines[0]), early
    fast = lightly_loaded(1.0, "drive.sync_rect=false")
    assert not fast.passed and len(fast.lines) == 1
    assert re.match(r"\d+\.\d r/min for 8000 r/min at the end \(\+.*: limit duty_min active", fast.lines[0]), fast
    for remedy in ((), ("drive.sync_rect=true",)):
        held = lightly_loaded(1.0, *remedy)
        assert held.passed and re.match(r"\d+\.\d r/min for 8000 r/min at the end", held.lines[0]), held


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("vcan0", "--can: vcan0: must be INTERFACE:CHANNEL"),
        ("virtual:", "--can: virtual:: must be INTERFACE:CHANNEL"),
        ("carrier-pigeon:1", "--can: carrier-pigeon:1: carrier-pigeon is no interface of python-can"),
        ("udp_multicast:10.0.0.1", "--can: udp_multicast:10.0.0.1: 10.0.0.1 is no multicast address"),
        ("udp_multicast:pigeon", "--can: udp_multicast:pigeon: pigeon is no multicast address"),
        (
            "socketcan:no_such_can0",
            "--can: socketcan:no_such_can0: (this kernel has no CAN|there is no such interface)",
        ),
    ],
)
def test_no_such_bus(name: str, text: str) -> None:
    """A bus that is not to be had is an error of the option, with what to do.

    Verifies: CO-18
    """
    with pytest.raises(ConfigError, match=text):
        open_bus(name)


def test_no_such_drive() -> None:
    """What the averaged motor is not is refused by its key.

    Verifies: CO-18
    """
    with pytest.raises(ConfigError, match=r"drive\.method: without --play the motor"):
        drive_of_scenario(load_scenario(ROOT / "scenarios" / "vector" / "encoder.toml"), NODE)


def test_memory_file(tmp_path: Path) -> None:
    """What is stored by 0x1010 is in the file at once and holds in the next program; another file is refused.

    Verifies: CO-18
    """
    path = tmp_path / "drive.bin"
    bench = NodeBench()
    file = MemoryFile(path, bench.drive)
    empty = path.read_bytes()
    bench.write("velocity_window", 77)
    bench.write("store_parameters_save_all", 0x65766173)
    file.keep()
    assert path.read_bytes() == bench.node.memory != empty
    again = NodeBench()
    assert again.read("velocity_window") == 300
    MemoryFile(path, again.drive)
    assert again.read("velocity_window") == 77
    path.write_bytes(b"other")
    with pytest.raises(ConfigError, match=r"--memory: .*: is no memory of this drive: 5 bytes"):
        MemoryFile(path, again.drive)
    assert [p.name for p in tmp_path.iterdir()] == ["drive.bin"]


def test_acknowledged_is_durable(tmp_path: Path) -> None:
    """A program that is killed as soon as it has answered a save has left it in the file.

    Verifies: CO-15
    """
    path, channel = tmp_path / "drive.bin", "239.74.163.91"
    words = ("native", str(DEMO), "--can", f"udp_multicast:{channel}", "--memory", str(path))
    with can.Bus(interface="udp_multicast", channel=channel) as bus:
        process = subprocess.Popen([sys.executable, "-m", "fluxlock", *words], stdout=subprocess.DEVNULL)
        try:
            answer, asked = None, 0.0
            end = time.monotonic() + 120.0
            while answer is None and time.monotonic() < end:
                if time.monotonic() - asked > 1.0:
                    asked = time.monotonic()
                    data = struct.pack("<BHB4s", 0x23, 0x1010, 1, b"save")
                    bus.send(can.Message(arbitration_id=0x601, data=data, is_extended_id=False))
                message = bus.recv(0.2)
                if message is not None and message.arbitration_id == 0x581:
                    answer = message.data[0]
        finally:
            process.kill()
            process.wait()
    assert answer == 0x60
    memory = path.read_bytes()
    assert [memory[at : at + 4] for at in (0, len(memory) // 2)] == [b"FLXO", b"FLXO"]


def test_memory_file_in_a_new_folder(tmp_path: Path) -> None:
    """The folder of the file is made with it; a folder in its place is refused.

    Verifies: CO-18
    """
    bench = NodeBench()
    MemoryFile(tmp_path / "of" / "mine" / "drive.bin", bench.drive)
    assert (tmp_path / "of" / "mine" / "drive.bin").is_file()
    with pytest.raises(ConfigError, match=r"--memory: .*: is a folder; name a file"):
        MemoryFile(tmp_path / "of", bench.drive)


def test_same_drive_as_the_scenario() -> None:
    """Motor, limits and load are those of the scenario.

    Verifies: CO-18
    """
    scenario = load_scenario(ROOT / "scenarios" / "own-pump.toml")
    drive = drive_of_scenario(scenario, NODE)
    assert drive.chip.model.m[M_P] == scenario.motor.pole_pairs
    assert drive.node.value("max_motor_speed") == round(scenario.motor.max_speed_rpm)
    assert drive.node.value("rated_current") == round(1000 * scenario.current_limit_a)
    assert drive.node.value("profile_acceleration") == round(scenario.accel_rpm_per_s)
    for rpm in (1_000.0, scenario.motor.max_speed_rpm):
        omega = rpm / 9.549296585513721
        fan, viscous, other = (float(drive.chip.model.m[k].sum()) for k in (M_FAN, M_VISCOUS, [M_COULOMB, M_CONSTANT]))
        total = fan * omega**2 + viscous * omega + other
        assert total == pytest.approx(scenario.shaft_load.torque_nm(rpm))


def test_pace_and_room() -> None:
    """The clock sets the pace; of a flood no more is taken in a millisecond than a bus can carry, and nothing is lost.

    Verifies: CO-18
    """
    bench = NodeBench()
    request = can.Message(arbitration_id=0x600 + NODE, data=bytes.fromhex("4041600000000000"), is_extended_id=False)
    requests = 12 * FRAMES_A_STEP
    with open_bus("virtual:pace") as bus, can.Bus(interface="virtual", channel="pace") as peer:

        def answers_after(steps: int) -> int:
            left = iter([False] * steps + [True])
            serve(bench.drive, bus, left.__next__, speed=0.5)
            found = [m.arbitration_id for m in iter(lambda: peer.recv(0), None)]
            return found.count(0x580 + NODE)

        for _ in range(requests):
            peer.send(request)
        begin = time.monotonic()
        first = answers_after(6)
        rest = answers_after(34)
        assert time.monotonic() - begin > 0.07
    assert first <= 6 * FRAMES_A_STEP
    assert first + rest == requests
    assert bench.now_us == 40_000


def test_refused_frames_stay_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames of CAN FD and error frames do not reach the node; extended ones are told apart.

    Verifies: CO-18
    """
    bench = NodeBench()
    seen: list[Frame] = []
    monkeypatch.setattr(bench.node, "receive", seen.append)
    with open_bus("virtual:kinds") as bus, can.Bus(interface="virtual", channel="kinds") as peer:
        for keys in ({"is_fd": True}, {"is_error_frame": True}, {}, {"is_remote_frame": True, "dlc": 0}):
            peer.send(can.Message(arbitration_id=5, is_extended_id=not keys, **keys))
        for _ in range(2):
            serve(bench.drive, bus, iter((False, True)).__next__, None)
    assert seen == [Frame(5, b"", 1), Frame(5, b"", 2)]
