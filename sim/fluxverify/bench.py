# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Speed of the closed loop against a bare simulation of the same chip: `make bench` writes `build/bench.json`.

One run measures both sides: the demo scenario with plant and Python, its converter codes recorded; then the same
executable without Python and plant, fed with the recorded codes. A third replay is of the chip with the paths of both
methods, each edge of the clock as Verilator does it. All are timed over the same clock cycles (the demo's window
`steady`), and their gate logs must be identical.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.base.writable import EXIT_BAD_INPUT, check_file, guarded
from fluxlock.config import ConfigError, load_scenario
from fluxlock.cosim.chip import build_chip
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.plan import RAW_FILE, RECORDING_FILE, SessionPlan
from fluxlock.cosim.run import chip_of, prepare
from fluxlock.generate.registers import check_build
from fluxlock.results.rundata import LogKind

WINDOW = "steady"


def replay(
    plan: SessionPlan, executable: Path, cycles: int, begin: int, plain: bool = False
) -> tuple[dict[str, Any], np.ndarray[Any, Any]]:
    """Run the recorded inputs of `plan` without Python; return the timing and the gate log [cycle, gates].

    plain: with Verilator's own evaluation at both edges of every clock.
    """
    gates = plan.folder / "replay-gates.bin"
    command = [str(executable), "--replay", str(plan.folder / RECORDING_FILE), "--cycles", str(cycles),
               "--from", str(begin), "--conversion", str(plan.conversion_cycles),
               "--bit-time", str(plan.bit_cycles), "--gates", str(gates), "--plain", str(int(plain))]  # fmt: skip
    done = subprocess.run(command, cwd=plan.folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"replay failed with code {done.returncode}: {done.stdout}{done.stderr}")
    timing: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return timing, np.fromfile(gates, np.int64).reshape(-1, 2)


def measure(repeat: int = 2) -> dict[str, Any]:
    """Measure closed loop and replay `repeat` times in turn; return the numbers of the median ratio's pair."""
    scenario = load_scenario(ROOT / "scenarios" / "demo.toml")
    window = next(w for w in scenario.window if w.name == WINDOW)
    folder = BUILD / "bench"
    chip, whole = chip_of(scenario), build_chip()
    pairs: list[dict[str, Any]] = []
    identical = True
    for index in range(repeat):
        print(f"bench: closed loop and replay, {index + 1} of {repeat}", flush=True)
        base = prepare(scenario, folder, scenario.seed, recording=True)
        begin, end = (round(t * base.clock_hz) for t in (window.from_s, window.to_s))
        plan = prepare(scenario, folder, scenario.seed, recording=True, marks=(begin, end), stop_cycle=end)
        meta = run_plan(plan, chip)
        if meta["fault"]:
            raise RuntimeError(meta["fault"])
        first, last = meta["marks"][str(begin)], meta["marks"][str(end)]
        closed_s, python_s, events = (y - x for x, y in zip(first, last, strict=True))
        timing, gates = replay(plan, chip.executable, end, begin)
        whole_timing, whole_gates = replay(plan, whole.executable, end, begin, plain=True)
        with np.load(folder / RAW_FILE) as raw:
            log = raw["log"]
        closed_gates = log[log[:, 1] == LogKind.GATES][:, [0, 2]]
        closed_gates = closed_gates[closed_gates[:, 0] <= end]
        identical &= bool(np.array_equal(closed_gates, gates) and np.array_equal(closed_gates, whole_gates))
        cycles = end - begin
        pairs.append(
            {
                "closed_loop_cycles_per_s": cycles / closed_s,
                "bare_cycles_per_s": cycles / timing["cpu_s"],
                "ratio": timing["cpu_s"] / closed_s,
                "whole_chip_cycles_per_s": cycles / whole_timing["cpu_s"],
                "times_as_fast": whole_timing["cpu_s"] / timing["cpu_s"],
                # Where the time of the closed loop goes: the model alone, Python's wake-ups, the rest is the plant.
                "time_s": {
                    "closed_loop": closed_s,
                    "model": timing["cpu_s"],
                    "python": python_s,
                    "plant": closed_s - timing["cpu_s"] - python_s,
                },
                "plant_events": events,
                "gate_changes": len(gates),
            }
        )
    pairs.sort(key=lambda p: p["ratio"])
    return {
        **pairs[len(pairs) // 2],
        "gate_log_identical": identical,
        "timed_cycles": cycles,
        "runs": pairs,
        "realtime_factor": pairs[len(pairs) // 2]["closed_loop_cycles_per_s"] / plan.clock_hz,
        "window": WINDOW,
        "machine": {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()},
    }


def main() -> int:
    """Write `build/bench.json` and print it; fail if the two gate logs differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=2, help="pairs of runs (default 2)")
    options = parser.parse_args()
    path = BUILD / "bench.json"
    try:
        check_build()
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    check_file(path)
    result = measure(options.repeat)
    path.write_text(json.dumps(result, indent=2) + "\n")
    print(f"closed loop {result['closed_loop_cycles_per_s'] / 1e6:.2f} Mcycle/s, "
          f"bare {result['bare_cycles_per_s'] / 1e6:.2f} Mcycle/s, ratio {result['ratio']:.2f}, "
          f"{result['times_as_fast']:.2f} times as fast as the whole chip, "
          f"gate logs {'identical' if result['gate_log_identical'] else 'DIFFER'}: {path}")  # fmt: skip
    return 0 if result["gate_log_identical"] else 1


if __name__ == "__main__":
    sys.exit(guarded(main))
