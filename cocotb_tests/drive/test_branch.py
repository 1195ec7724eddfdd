# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Branches of a run: their ends are those of runs that were never copied, bit for bit."""

from __future__ import annotations

import hashlib
from pathlib import Path

from fluxlock.base.paths import ROOT
from fluxlock.drive import Bench, BranchError, Drive, DriveError, drive_test

SCENARIO = ROOT / "scenarios" / "campaign" / "six-step.toml"
LOADS_NM = (0.0, 0.004, 0.008)
SPAN_S = 0.004


def digest(drive: Drive) -> str:
    """Of everything that the run has left: log, waveforms, the plant's state, what the console has said."""
    data = drive.data()
    found = hashlib.sha256(data.log.tobytes())
    for part in (data.records, data.plant_events, drive.plant.state):
        found.update(part.tobytes())
    found.update("\n".join(data.uart).encode())
    return found.hexdigest()


async def end(drive: Drive, load_nm: float) -> str:
    """What each end does."""
    drive.load(constant_nm=load_nm)
    await drive.run(SPAN_S)
    await drive.get("speed_rpm")
    return f"{load_nm} {digest(drive)} {drive.speed_rpm!r} {drive.time_s!r}\n"


async def begin(drive: Drive) -> None:
    await drive.start(60_000)


@drive_test()
async def ends_and_the_run_itself(drive: Drive) -> None:
    """Ends differ by their loads, and the run that was copied goes on as its own end does.

    Verifies: DRV-04
    """
    await begin(drive)
    branch = drive.branch(LOADS_NM, jobs=2)
    for each in branch:
        each.keep(await end(drive, each.value))
    assert len(set(branch.kept)) == len(LOADS_NM)
    speeds = [float(str(line).split()[2]) for line in branch.kept]
    assert speeds == sorted(speeds, reverse=True), "more load, less speed"
    assert await end(drive, LOADS_NM[1]) == branch.kept[1]
    Path("branched.txt").write_text("".join(map(str, branch.kept)))


@drive_test()
async def never_copied_0(drive: Drive) -> None:
    await begin(drive)
    Path("straight-0.txt").write_text(await end(drive, LOADS_NM[0]))


@drive_test()
async def never_copied_2(drive: Drive) -> None:
    await begin(drive)
    Path("straight-2.txt").write_text(await end(drive, LOADS_NM[2]))


@drive_test()
async def a_failing_end_has_its_name(drive: Drive) -> None:
    """Failed ends are named with their values and tracebacks, after all have run; so is one that leaves the loop.

    Verifies: DRV-05
    """
    branch = drive.branch(["good", "bad", "gone", "left", "kept"])
    text = ""
    try:
        for each in branch:
            await drive.run(1e-5)
            assert each.value != "bad", "this one"
            if each.value == "gone":
                raise SystemExit(3)
            if each.value == "left":
                return
            each.keep(each.number if each.value != "kept" else lambda: None)
    except BranchError as error:
        text = str(error)
    assert "4 of 5 ends failed" in text
    assert "end 1 ('bad')" in text and "AssertionError: this one" in text
    assert "end 2 ('gone')" in text
    assert "end 3 ('left')" in text and "left the loop" in text
    assert "end 4 ('kept')" in text and "pickle cannot carry it" in text
    assert branch.kept == [0, None, None, None, None]


@drive_test(expect_fail=True)
async def a_body_that_leaves_its_loop_fails(drive: Drive) -> None:
    """Not even the end of the test in the copy hides it.

    Verifies: DRV-05
    """
    for _ in drive.branch([1, 2]):
        break


async def short_start(drive: Drive) -> None:
    await drive.run(1e-4)
    runs.append("start")


runs: list[str] = []


@drive_test(after=short_start)
async def a_common_start_is_run_once(drive: Drive) -> None:
    """What one test does the next one does not see; a second drive in a simulation is refused.

    Verifies: DRV-07, DRV-08
    """
    assert runs == ["start"] and drive.time_s == 1e-4
    runs.append("first")
    await drive.run(1e-4)
    try:
        Drive(drive.dut)
    except DriveError as error:
        assert "make each test a drive_test" in str(error)
    else:
        raise AssertionError("two drives")


@drive_test(after=short_start)
async def and_serves_the_next_test(drive: Drive) -> None:
    """The second test has the same start.

    Verifies: DRV-08
    """
    assert runs == ["start"] and drive.time_s == 1e-4


async def bad_start(drive: Drive) -> None:
    await drive.run(1e-5)
    raise DriveError("no start")


@drive_test(after=bad_start, expect_fail=True)
async def a_start_that_fails_fails_its_tests(drive: Drive) -> None:
    """The test does not begin.

    Verifies: DRV-08
    """
    Path("began.txt").touch()


def test_branch() -> None:
    """Ends of a branch are those of simulations without one.

    Verifies: DRV-04
    """
    bench = Bench(SCENARIO)
    bench.test(__name__)
    assert not (bench.folder / "began.txt").exists()
    branched = (bench.folder / "branched.txt").read_text().splitlines()
    assert [branched[n] for n in (0, 2)] == [(bench.folder / f"straight-{n}.txt").read_text().strip() for n in (0, 2)]
