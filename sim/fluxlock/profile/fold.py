# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Walk a trace of the core with a stack of calls and interrupts, and count the clocks of every context.

An instruction costs the clocks since the one before it left the core: what a jump, a load or a bus access makes others
wait is counted where they wait. The trace (`core_row_t` of `sim/native/cosim.h`) holds every instruction that left the
core; the sum of all contexts is the traced time, clock for clock.

A context is a node of a tree: the names of all callers and of all functions inlined there. A call is a
jump that keeps its way back in ra or t0. A return jumps to an address that a call has kept. An interrupt begins at the
trap entry and ends with `mret`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fluxlock.base.paths import BUILD, content_hash
from fluxlock.profile.elf import Program

ROW = np.dtype([("cycle", "<i8"), ("pc", "<u4"), ("count", "<u4")])
VISIT = np.dtype([("chain", "<i4"), ("depth", "<i4"), ("begin", "<i8"), ("end", "<i8"), ("own", "<i8")])
ROOT_NODE = 0
TRAP_ENTRY = "trap_entry"
DEEPEST = 256  # calls within each other; a trace of this firmware has fewer
NODES = 1 << 18
MRET = 0x30200073
JAL, JALR = 0x6F, 0x67
LINKS = (1, 5)  # ra, t0
OF_INTERRUPT = -1  # in place of a return address
# Of the tree parent, names, clocks; visits; traced clocks; node at the asked clock.
Walked: TypeAlias = tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int64], NDArray[np.int64], int, int]


@dataclass(frozen=True)
class Folded:
    """Clocks per context. `parent`, `chain`: the tree, node 0 is its root and has no names.

    visits: one per finished interrupt: chain of its handler, interrupts it ran in, clock before its first instruction,
    clock of its last one, clocks of its own without those of interrupts within it. cycles: traced clocks. at: the node
    at the asked clock, or -1.
    """

    program: Program
    parent: NDArray[np.int32]
    chain: NDArray[np.int32]
    clocks: NDArray[np.int64]
    visits: NDArray[Any]
    cycles: int
    at: int

    def path(self, node: int) -> tuple[str, ...]:
        """Names of a context, outermost first."""
        found: tuple[str, ...] = ()
        while node != ROOT_NODE:
            found = (*self.program.chains[self.chain[node]], *found)
            node = int(self.parent[node])
        return found

    def stacks(self) -> dict[tuple[str, ...], int]:
        """Clocks of every context with any, by its names."""
        found: dict[tuple[str, ...], int] = {}
        for node in np.flatnonzero(self.clocks):
            path = self.path(int(node))
            found[path] = found.get(path, 0) + int(self.clocks[node])
        return found

    def handler(self, visit: np.void) -> str:
        """Name of the C function that an interrupt has called."""
        return str(self.program.chains[visit["chain"]][0])


def fold(trace: Path, program: Program, span: tuple[int, int] | None = None, at: int = -1) -> Folded:
    """Fold a trace file; span: count only clocks after the first and up to the second, at: a clock to find."""
    rows = np.fromfile(trace, ROW)
    low, high = span if span is not None else (-1, np.iinfo(np.int64).max)
    entry = np.uint32(program.symbols[TRAP_ENTRY])
    parent, chain, clocks, visits, cycles, node = _kernel()(
        rows["cycle"], rows["pc"], rows["count"], program.code, program.chain, entry, low, high, at
    )
    table = np.zeros(len(visits), VISIT)
    for n, name in enumerate(VISIT.names or ()):
        table[name] = visits[:, n]
    return Folded(program, parent, chain, clocks, table, int(cycles), int(node))


@cache
def _kernel() -> Callable[..., Walked]:
    numba: Any = importlib.import_module("numba")
    folder = BUILD / "profile" / content_hash([Path(__file__)])
    folder.mkdir(parents=True, exist_ok=True)
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        child = numba.njit(cache=True)(_child)
        walk: Callable[..., Walked] = numba.njit(cache=True)(
            FunctionType(_walk.__code__, {**globals(), "_child": child})
        )
        return walk
    finally:
        numba.config.CACHE_DIR = before


def _child(
    table: NDArray[np.int32], parent: NDArray[np.int32], chain: NDArray[np.int32], count: int, node: int, names: int
) -> int:
    """The node below `node` with these names; a new one is number `count`. table: hash of (node, names)."""
    size = len(table)
    slot = (node * 40503 + names * 2654435761) % size
    while table[slot] >= 0:
        found = table[slot]
        if parent[found] == node and chain[found] == names:
            return int(found)
        slot = (slot + 1) % size
    table[slot] = count
    parent[count] = node
    chain[count] = names
    return count


def _walk(
    cycles: NDArray[np.int64],
    places: NDArray[np.uint32],
    counts: NDArray[np.uint32],
    code: NDArray[np.uint32],
    chains: NDArray[np.int32],
    entry: int,
    low: int,
    high: int,
    at: int,
) -> Walked:
    """All of `fold` that touches every instruction; compiled."""
    table = np.full(4 * NODES, -1, np.int32)
    parent, chain, clocks = np.zeros(NODES, np.int32), np.full(NODES, -1, np.int32), np.zeros(NODES, np.int64)
    nodes = 1
    visits = np.zeros((len(cycles) // 8 + 16, 5), np.int64)
    seen = 0
    # Frames: context of the caller, return address; of interrupts also what came before, begin, own clocks, handler.
    frames = np.zeros((DEEPEST, 6), np.int64)
    depth, interrupts, node = 0, 0, 0
    top = -1  # frame of the innermost interrupt
    total, found = 0, -1
    before, clock = -1, cycles[0] - 1 if len(cycles) else 0
    for row in range(len(cycles)):
        place = int(places[row])
        moved = before >= 0 and place != before + 4
        while moved or (before >= 0 and code[before >> 2] == MRET):
            word = int(code[before >> 2])
            if word == MRET:
                if top < 0:  # the trace has begun within it
                    depth, node, before = 0, 0, -1
                    break
                depth = top
                visits[seen, 0], visits[seen, 1] = frames[top, 5], interrupts - 1
                visits[seen, 2], visits[seen, 3], visits[seen, 4] = frames[top, 3], clock, frames[top, 4]
                seen += 1
                interrupts -= 1
                node, before = int(frames[top, 0]), int(frames[top, 2])
                top -= 1
                while top >= 0 and frames[top, 1] != OF_INTERRUPT:
                    top -= 1
                moved = before >= 0 and place != before + 4
                continue
            if place == entry:
                frames[depth, 0], frames[depth, 1], frames[depth, 2] = node, OF_INTERRUPT, before
                frames[depth, 3], frames[depth, 4], frames[depth, 5] = clock, 0, chains[entry >> 2]
                top, node = depth, 0
                depth += 1
                interrupts += 1
            else:
                opcode, rd, rs1 = word & 0x7F, word >> 7 & 31, word >> 15 & 31
                if opcode in (JAL, JALR) and rd in LINKS:
                    if top == depth - 1 and top >= 0:
                        frames[top, 5] = chains[place >> 2]
                    frames[depth, 0], frames[depth, 1] = node, before + 4
                    node = _child(table, parent, chain, nodes, node, chains[before >> 2])
                    nodes = max(nodes, node + 1)
                    depth += 1
                elif opcode == JALR and rs1 in LINKS:
                    k = depth - 1
                    while k > top and frames[k, 1] != place:
                        k -= 1
                    if k > top:
                        depth, node = k, int(frames[k, 0])
            break
        for k in range(int(counts[row])):
            now = cycles[row] + k
            cost, clock = now - clock, now
            if top >= 0:
                frames[top, 4] += cost
            if low < now <= high:
                leaf = _child(table, parent, chain, nodes, node, chains[(place >> 2) + k])
                nodes = max(nodes, leaf + 1)
                clocks[leaf] += cost
                total += cost
                if clock - cost < at <= clock:
                    found = leaf
        before = place + 4 * (int(counts[row]) - 1)
        if depth >= DEEPEST - 1 or nodes >= NODES - 2 or seen >= len(visits) - 1:
            raise OverflowError("calls of the trace do not return")
    return parent[:nodes], chain[:nodes], clocks[:nodes], visits[:seen], total, found
