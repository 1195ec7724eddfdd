# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What ten loads after one start cost by `Drive.branch`, and what as many runs from power-up.

`python -m fluxverify.branch_bench` prints both, and whether the ends are the same bits.
A motor starts from standstill, gets its load, and runs on. Both ways are one simulation, by processor time of its
copies. Three of the ten loads get a run of their own, whose mean stands for ten. An end is compared by everything that
it leaves: log, waveforms, state of the plant.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.base.writable import guarded
from fluxlock.drive import Bench, Drive, drive_test

SCENARIO = ROOT / "scenarios" / "demo.toml"
RPM = 20_000
LOADS_NM = tuple(0.0005 * n for n in range(10))
SPAN_S = 0.02
ALONE = (0, 4, 9)  # of the loads: those with a run from power-up
BRANCHED, STRAIGHT = Path("branched.json"), Path("straight.jsonl")


def digest(drive: Drive) -> str:
    """Of log, waveforms, events and state of a run so far."""
    data = drive.data()
    found = hashlib.sha256(data.log.tobytes())
    for part in (data.records, data.plant_events, drive.plant.state):
        found.update(part.tobytes())
    return found.hexdigest()


async def end(drive: Drive, load_nm: float) -> str:
    """What an end does; its digest."""
    drive.load(constant_nm=load_nm)
    await drive.run(SPAN_S)
    return digest(drive)


def spent_s() -> float:
    """Processor time of this copy and of those that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@drive_test()
async def branched(drive: Drive) -> None:
    """One start, ten ends."""
    begin = spent_s()
    await drive.start(RPM)
    branch = drive.branch(LOADS_NM)
    for each in branch:
        each.keep(await end(drive, each.value))
    BRANCHED.write_text(json.dumps({"cpu_s": spent_s() - begin, "ends": branch.kept}))


def straight(name: str, load_nm: float) -> object:
    """A run from power-up to one end, as a test of that name."""

    async def run(drive: Drive) -> None:
        begin = spent_s()
        await drive.start(RPM)
        found = await end(drive, load_nm)
        with STRAIGHT.open("a") as file:
            file.write(json.dumps({"cpu_s": spent_s() - begin, "end": found}) + "\n")

    return drive_test(name=name)(run)


globals().update({(name := f"straight_{n}"): straight(name, LOADS_NM[n]) for n in ALONE})


def main() -> int:
    """Print both times, their ratio, and whether the ends are the same bits."""
    bench = Bench(SCENARIO)
    (bench.folder / STRAIGHT).unlink(missing_ok=True)
    bench.test("fluxverify.branch_bench")
    one = json.loads((bench.folder / BRANCHED).read_text())
    runs = [json.loads(line) for line in (bench.folder / STRAIGHT).read_text().splitlines()]
    alone_s = sum(run["cpu_s"] for run in runs) / len(runs)
    times = len(LOADS_NM) * alone_s / one["cpu_s"]
    same = [one["ends"][n] for n in ALONE] == [run["end"] for run in runs]
    print(f"{len(LOADS_NM)} loads by branch: {one['cpu_s']:.1f} s of processor time; one run alone: {alone_s:.1f} s")
    said = "the same bits" if same else "OTHER BITS"
    print(f"{times:.1f} times cheaper than {len(LOADS_NM)} runs; {said} in {len(ALONE)} ends")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(guarded(main))
