# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What nextpnr's report and log say about timing and routing."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

PAD = "<async>"
PAD_CELL = "$tr_io"  # end of the name of a pad's cell, its port before it
Path = dict[str, Any]


def fmax_mhz(report: dict[str, Any]) -> float | None:
    """Highest frequency of the slowest clock; None where no way goes from flip-flop to flip-flop."""
    return min((float(clock["achieved"]) for clock in report["fmax"].values()), default=None)


def placed_fmax_mhz(log: str) -> float | None:
    """Estimate after placement, of the slowest clock: what is known when routing does not end."""
    last: dict[str, float] = {}
    for clock, mhz in re.findall(r"Max frequency for clock\s+'([^']+)':\s+([\d.]+) MHz", log):
        last[clock] = float(mhz)
    return min(last.values(), default=None)


def overused_wires(log: str) -> int | None:
    """Wires of the last round of router2 that two nets wanted."""
    found = re.findall(r"overused=(\d+)", log)
    return int(found[-1]) if found else None


def _delay(path: Path) -> float:
    return sum(float(step["delay"]) for step in path["path"])


def slowest_path(report: dict[str, Any]) -> Path | None:
    """The slowest way from flip-flop to flip-flop of one clock."""
    inside = [
        path
        for path in report["critical_paths"]
        if path["from"].startswith("posedge") and path["from"].split()[-1] == path["to"].split()[-1]
    ]
    return max(inside, key=_delay, default=None)


def _source(step: dict[str, Any]) -> str:
    """Line of our RTL that a net comes from."""
    ours = [source.split(".sv:")[0] + ".sv:" + source.split(".sv:")[1].split(".")[0]
            for source in step.get("sources", []) if ".sv:" in source]  # fmt: skip
    return f" ({ours[0]})" if ours else ""


def path_steps(path: Path) -> list[str]:
    """Start, every net with a way of its own, and end of a path, with the time at each."""
    steps, at = [], 0.0
    for step in path["path"]:
        at += float(step["delay"])
        if step["type"] in ("clk-to-q", "setup"):
            steps.append(f"{at:6.2f} ns  {step['to']['cell']} ({step['type']})")
        elif step["type"] == "routing" and float(step["delay"]) > 0.0:
            steps.append(f"{at:6.2f} ns  {step['net']}{_source(step)}")
    return steps


def path_summary(path: Path) -> str:
    """Delay of a path, split into logic and routing."""
    routing = sum(float(step["delay"]) for step in path["path"] if step["type"] == "routing")
    total = _delay(path)
    return f"{total:.2f} ns, {total - routing:.2f} ns of it logic and {routing:.2f} ns routing"


def critical_path(report: dict[str, Any]) -> list[str]:
    """The slowest way inside, a summary and its steps; empty if there is none."""
    path = slowest_path(report)
    return [path_summary(path), *path_steps(path)] if path else []


def asynchronous_pads(constraints: str) -> set[str]:
    """Ports whose ways do not count: `BLOCK PATH FROM PORT` and `TO PORT` of an LPF file, which nextpnr ignores."""
    return set(re.findall(r'^BLOCK PATH (?:FROM|TO) PORT "([^"]+)";', constraints, re.MULTILINE))


@dataclass(frozen=True)
class PadDelays:
    """Ways at the pads, ns, without pad and clock tree."""

    to_pad: float  # longest from a flip-flop to a pad
    from_pad: float  # longest from a pad to a flip-flop
    apart: float  # of the outputs whose edges go together: the longest less the shortest


def pad_delays(report: dict[str, Any], asynchronous: set[str], together: Collection[str] = ()) -> PadDelays:
    """Ways between flip-flops and pads. together: ports, all bits of which do not count for `to_pad` but for `apart`.

    `report` is a detailed one. Every input that has a limit leads straight to flip-flops; the asynchronous ones lead to
    synchronisers, some by logic: not counted, nor outputs that are named among them.
    """
    to_pad = from_pad = 0.0
    edges: list[float] = []
    for net in report["detailed_net_timings"]:
        port = net["driver"].removesuffix(PAD_CELL)
        if net["event"] == PAD and (port == net["driver"] or port in asynchronous):
            continue
        for end in net["endpoints"]:
            if (net["event"] == PAD) == (end["event"] == PAD):
                continue
            delays = [float(delay) for delay in end["delay"]]
            target = end["cell"].removesuffix(PAD_CELL)
            if net["event"] == PAD:
                from_pad = max(from_pad, *delays)
            elif target == end["cell"] or target in asynchronous:
                continue
            elif target.split("[")[0] in together:
                edges += delays
            else:
                to_pad = max(to_pad, *delays)
    return PadDelays(to_pad, from_pad, max(edges, default=0.0) - min(edges, default=0.0))
