# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The CANopen node in the chip's firmware, on the simulator's bus."""

from __future__ import annotations

import os
import random
from pathlib import Path

import numpy as np

from fluxlock.can.frame import Frame
from fluxlock.canopen.dictionary import load_dictionary
from fluxlock.clock import CLOCK_HZ
from fluxlock.generate.memory import STACK_BYTES
from fluxlock.results.metrics import Analysis
from fluxlock.results.rundata import LogKind
from tests.canopen.chip_bench import CAN, NODE, SPINNING, Flood, Listener, Talker, run_chip
from tests.canopen.test_fuzz import nonsense

# The longest instruction: an interrupt waits for the one that the main loop is in.
DIVISION_CYCLES = 35
FUZZ = int(os.environ.get("FLUXLOCK_CAN_FUZZ", "500"))  # frames
NATIVE_FRAMES = 500
EVERY = 25  # frames between two commands of the flood
SLOW_SEED = 4249966300
LATENCY_US = 1000  # from a command's frame to its answer
# Entry of the control interrupt where the main loop divides twice in a row, which is its longest time without a look at
# interrupts: 103 clocks of the trap, and what it misses in the cache.
ENTRY_MAX_CYCLES = 110 + 2 * DIVISION_CYCLES


def test_control_is_undisturbed(tmp_path: Path) -> None:
    """With the node in the main loop no control tick is missed or entered too late, and the motor commutates as well.

    A rotor is caught and driven up; the bus carries the boot-up frame. Boots differ in length, so do the phases of the
    ticks against the rotor: commutations are judged by the plant's angle.

    Verifies: CO-21
    """
    without, _ = run_chip(tmp_path / "without", SPINNING, 0.1)
    with_node, frames = run_chip(tmp_path / "with", (*SPINNING, CAN), 0.1, Listener())
    assert frames == [[0x705, "00"]]
    assert len(without.rows(LogKind.COMMUTATION)) > 200
    for run in (without, with_node):
        print(run.isr)
    entry, step = ([run.isr[name] for run in (without, with_node)] for name in ("control_entry", "control"))
    # The latest one of a run is where its divisions happened to fall: both keep the bound.
    assert max(run["max"] for run in entry) <= ENTRY_MAX_CYCLES
    assert entry[1]["mean"] <= entry[0]["mean"]
    assert step[1]["mean"] < 1.02 * step[0]["mean"]
    assert with_node.overruns == without.overruns == 0
    # The last one may lie behind the last record of the angle.
    late_deg = [Analysis(run).commutations.error_deg[100:-1] for run in (without, with_node)]
    for found in (np.mean, np.std):
        values = [float(found(errors)) for errors in late_deg]
        print(f"commutation error, {found.__name__}: {values[0]:.3f}, with the node {values[1]:.3f} deg")
        assert abs(values[0] - values[1]) < 0.03


def refused_frames(rng: random.Random, count: int) -> list[Frame]:
    """Frames that the node must refuse or pass over."""
    dictionary = load_dictionary()
    drawn = [nonsense(rng, dictionary) for _ in range(count)]
    return [
        Frame(f.id, bool(f.flags & 1), bool(f.flags & 2), len(f.data), b"" if f.flags & 2 else f.data) for f in drawn
    ]


def load_of_core(lines: list[str], clocks: float) -> float:
    """Share of the time that the main loop did not idle, from the replies to two `get idle`, so many clocks apart."""
    idle = [int(line.split()[1]) for line in lines if line.startswith("idle ")]
    return 1.0 - ((idle[1] - idle[0]) & 0xFFFFFFFF) / clocks


def test_full_bus(tmp_path: Path) -> None:
    """Frames that must be refused, back to back at 1 Mbit/s, while the motor runs at 60 000 r/min and gets commands.

    No fault, no control update missed, none entered much later, the delay of commutations unchanged, the stack within
    its reserve; prints latencies, load and stack.

    Verifies: CO-25
    """
    seed = random.SystemRandom().getrandbits(32)
    print(f"seed {seed}")
    frames = refused_frames(random.Random(seed), FUZZ)
    # Always among them: a span in which a command once waited for 1040 us.
    frames[175:225] = refused_frames(random.Random(SLOW_SEED), 225)[175:]
    begin_s, end_s = 0.15, 0.15 + FUZZ * 180e-6
    span_s = FUZZ * 60e-6 - 0.01  # over which the load of the core is measured, within the flood
    console = [(begin_s - 0.02, "get idle"), (begin_s - 0.002, "get idle"), (begin_s + 0.01, "get idle")]
    # The long list at the end holds up nothing either.
    console += [(begin_s + 0.01 + span_s, "get idle"), (begin_s + 0.012 + span_s, "get")]
    events = ", ".join(f'{{at_s={at_s:.4f}, command="{line}"}}' for at_s, line in console)
    duration = f"duration_s={max(end_s, 1.6):.3f}"
    start = ("initial.speed_rpm=60000", "drive.sync_rect=true", "window=[]", "expect=[]", f"event=[{events}]", duration)
    flood = Flood(frames, round(begin_s * CLOCK_HZ), 60_000, every=EVERY)
    data, seen = run_chip(tmp_path, (CAN, *start), end_s, flood, batch_cycles=1_000)
    first, last = seen["span"]
    assert last, "the flood did not end"
    lines = data.uart
    idle = [line for line in lines if line.startswith("idle ")]
    quiet_load = load_of_core(idle[:2], 0.018 * CLOCK_HZ)
    flood_load = load_of_core(idle[2:4], span_s * CLOCK_HZ)
    latency_us = np.array(seen["latency"]) / CLOCK_HZ * 1e6
    print(f"{FUZZ / (last - first) * CLOCK_HZ:.0f} frames/s, {seen['refused']} refusals of {seen['answers']} answers")
    print(f"command latency, us: mean {latency_us.mean():.0f}, max {latency_us.max():.0f}, of {len(latency_us)}")
    print(f"load of the core: quiet {quiet_load:.3f}, full bus {flood_load:.3f}")
    print(data.isr)
    print(f"stack: {seen['stack_bytes']} of {STACK_BYTES} bytes")
    assert seen["stack_bytes"] <= STACK_BYTES
    assert seen["dry"] == 0
    assert seen["refused"] > FUZZ // 4
    assert len(latency_us) == seen["commands"] == FUZZ // EVERY
    assert not [text for text in seen["emergencies"] if text.startswith("1081")], "frames lost"
    assert data.overruns == 0
    assert [line for line in lines if line.startswith("state ")][-1] == "state running"
    assert "now none" in lines
    updates = data.rows(LogKind.UPDATE)[:, 0]
    assert set(np.diff(updates)) == {5000}
    assert data.cycles - updates[-1] <= 5000, "a run that its peer ends is over with its log"
    assert data.records["t_cycle"][-1] <= data.cycles
    assert data.isr["control_entry"]["max"] <= ENTRY_MAX_CYCLES
    commutations = data.rows(LogKind.COMMUTATION)
    delay = commutations[:, 0] - commutations[:, 3]
    before = commutations[:, 0] < first
    before[:200] = False
    during = (commutations[:, 0] >= first) & (commutations[:, 0] < last)
    assert set(delay[during]) <= set(delay[before])
    assert during.sum() > 100
    speed = data.records["omega_e"][data.records["t_cycle"] > first] * 30 / np.pi / data.pole_pairs
    print(f"speed, r/min: {speed.min():.0f} to {speed.max():.0f}")
    assert speed.min() > 59_500
    assert speed.max() < 60_500
    assert latency_us.max() < LATENCY_US


def test_without_the_core(tmp_path: Path) -> None:
    """The same C in the simulator's process on the chip's bus: refused frames back to back and commands between them.

    As many answers, refusals and commands as with the core, none lost; the motor holds its speed.

    Verifies: CO-29
    """
    seed = random.SystemRandom().getrandbits(32)
    print(f"seed {seed}")
    overrides = (CAN, "initial.speed_rpm=60000", "drive.sync_rect=true", "window=[]", "expect=[]", "event=[]")
    runs = {}
    for native in (False, True):
        flood = Flood(refused_frames(random.Random(seed), NATIVE_FRAMES), round(0.1 * CLOCK_HZ), 60_000, every=50)
        seconds = 0.1 + NATIVE_FRAMES * 180e-6
        runs[native] = run_chip(tmp_path / str(native), overrides, seconds, flood, batch_cycles=1_000, native=native)
        data, seen = runs[native]
        print(seen)
        assert seen["span"][1], "the flood did not end"
        assert len(seen["latency"]) == seen["commands"] == NATIVE_FRAMES // 50
        assert not [text for text in seen["emergencies"] if text.startswith("1081")], "frames lost"
        assert data.overruns == 0
        assert set(np.diff(data.rows(LogKind.UPDATE)[:, 0])) == {5000}
        speed = data.records["omega_e"][data.records["t_cycle"] > seen["span"][0]] * 30 / np.pi / data.pole_pairs
        print(f"speed, r/min: {speed.min():.0f} to {speed.max():.0f}")
        assert speed.min() > 59_500 and speed.max() < 60_500
    core, bus = (runs[native][1] for native in (False, True))
    assert (bus["answers"], bus["refused"]) == (core["answers"], core["refused"])
    assert max(bus["latency"]) <= max(core["latency"])


def test_vector_image(tmp_path: Path) -> None:
    """The image with vector control boots its node too, and tells the modes it has; no tick is missed.

    Verifies: CO-21
    """
    modes = Frame(0x600 + NODE, dlc=8, data=bytes.fromhex("4002650000000000"))
    overrides = (CAN, "window=[]", "expect=[]", "event=[]")
    data, frames = run_chip(tmp_path, overrides, 0.02, Talker(queue=[modes]), scenario="vector/start.toml")
    assert frames == [[0x705, "00"], [0x585, "4302650004010000"]]
    assert data.overruns == 0
    assert "state ready" in data.uart
    assert "now none" in data.uart
