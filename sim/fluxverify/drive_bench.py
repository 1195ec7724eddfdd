# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a run costs that a cocotb test leads by `Drive`, against the same run of `fluxlock run`, in pairs.

`python -m fluxverify.drive_bench` prints the processor time of both, pair by pair, of the simulator's process with its
copies from start to end. The test looks at state and speed every millisecond. Both send the same lines at the same
clocks, so log, waveforms and events must be the same bits.
"""

from __future__ import annotations

import argparse
import hashlib
import resource
import statistics
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.base.writable import guarded
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.plan import RAW_FILE
from fluxlock.cosim.planned import FOR_NUMBA
from fluxlock.cosim.run import prepare
from fluxlock.drive import Bench, Drive, drive_test

SCENARIO = ROOT / "scenarios" / "spinning.toml"
SPAN_S = 0.2
PAIRS = 3
# A test's first line waits until the chip has booted.
EVENTS = 'event=[{at_s=0.012,speed_rpm=60_000},{at_s=0.013,command="start"}]'
END = Path("end.txt")  # of the test, in the simulation's folder: its digest
ARRAYS = ("log", "records", "plant_events")


def digest(arrays: Mapping[str, np.ndarray[Any, Any]], end: int) -> str:
    """Of log, waveforms and events before a clock."""
    found = hashlib.sha256()
    for name in ARRAYS:
        array = arrays[name]
        at = array[:, 0] if array.dtype.names is None else array["t_cycle"]
        found.update(array[at < end].tobytes())
    return found.hexdigest()


@drive_test()
async def led(drive: Drive) -> None:
    """The scenario's events, by the methods of `Drive`, and its end."""
    assert not any(name in sys.modules for name in FOR_NUMBA), "loads more than the command's run"
    for event in drive.scenario.event:
        await drive.until(event.at_s)
        if event.speed_rpm is not None:
            await drive.set("speed_rpm", round(event.speed_rpm))
        elif event.command is not None:
            await drive.console(event.command)
    end_s = drive.scenario.duration_s
    await drive.until(lambda: drive.state == "fault" or drive.speed_rpm < 0 or drive.time_s >= end_s, within_s=end_s)
    data = drive.data()
    found = digest({name: getattr(data, name) for name in ARRAYS}, drive.session.plan.duration_cycles)
    END.write_text(found)


def harness(bench: Bench) -> str:
    """The run as a command makes it; its digest."""
    plan = replace(prepare(bench.scenario, BUILD / "drive_bench", bench.seed), final_commands=())
    meta = run_plan(plan, bench.chip)
    if meta["fault"]:
        raise RuntimeError(meta["fault"])
    with np.load(plan.folder / RAW_FILE) as raw:
        return digest(raw, plan.duration_cycles)


def led_by_test(bench: Bench) -> str:
    """The same run, led by a test; its digest."""
    bench.test("fluxverify.drive_bench")
    return (bench.folder / END).read_text()


def spent_s(run: Callable[[Bench], str], bench: Bench) -> tuple[float, str]:
    """Processor time of the processes that a run starts, s, and its digest."""
    begin = resource.getrusage(resource.RUSAGE_CHILDREN)
    found = run(bench)
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    return end.ru_utime - begin.ru_utime + end.ru_stime - begin.ru_stime, found


def bench_of(span_s: float) -> Bench:
    """The scenario's chip, for a span."""
    return Bench(SCENARIO, f"duration_s={span_s}", EVENTS)


def main() -> int:
    """Print the pairs and the median of their ratios; fail if the bits differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=PAIRS, help=f"pairs of runs (default {PAIRS})")
    parser.add_argument("--span", type=float, default=SPAN_S, help=f"simulated time of a run, s (default {SPAN_S})")
    options = parser.parse_args()
    bench = bench_of(options.span)
    ratios, same = [], True
    for number in range(options.pairs):
        ways = (harness, led_by_test) if number % 2 == 0 else (led_by_test, harness)
        spent = {way: spent_s(way, bench) for way in ways}
        (harness_s, one), (test_s, other) = spent[harness], spent[led_by_test]
        ratios.append(test_s / harness_s)
        same &= one == other
        print(f"harness {harness_s:.2f} s, test {test_s:.2f} s of processor time: {ratios[-1]:.3f} times", flush=True)
    said = "the same bits" if same else "OTHER BITS"
    print(f"a test takes {statistics.median(ratios):.3f} times as long, median of {len(ratios)} pairs; {said}")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(guarded(main))
