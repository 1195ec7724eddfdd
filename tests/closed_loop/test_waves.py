# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock run --waves`: an FST of the zoomed span, and the files with which viewers show it in groups."""

from __future__ import annotations

import itertools
import os
import random
import re
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import pywellen

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.cosim.chip import FST
from fluxlock.cosim.waves import GTKWAVE_FILE, SIX_STEP, SURFER_FILE, WAVE_FILE, groups
from fluxlock.headers import bind
from fluxlock.results.rundata import LogKind, RunData, load_trace

SCENARIO = ROOT / "scenarios" / "six-step" / "start.toml"
# The first carriers after the start command.
FROM_S, TO_S = 0.020, 0.021
CLOCK_NS = 20
SHIM_HEADER = """
unsigned long lz4(const char* src, char* dst, unsigned long size);
unsigned long deflate(const unsigned char* src, unsigned char* dst, unsigned long size);
unsigned long lz4_bound(unsigned long size);
unsigned long deflate_bound(unsigned long size);
"""
SHIM = """
extern "C" {
#include "shim.h"
}
#include "lz4.h"
#include "zlib.h"
unsigned long lz4(const char* src, char* dst, unsigned long size) {
    return LZ4_compress_default(src, dst, size, LZ4_compressBound(size));
}
unsigned long deflate(const unsigned char* src, unsigned char* dst, unsigned long size) {
    return compress2(dst, &size, src, size, 9), size;
}
unsigned long lz4_bound(unsigned long size) { return LZ4_compressBound(size); }
unsigned long deflate_bound(unsigned long size) { return compressBound(size); }
"""


def changes(fst: pywellen.Waveform, name: str) -> list[tuple[int, int]]:
    """Clock edge and new value; edge n is at (2n - 1) half periods."""
    rows = [((t + CLOCK_NS // 2) / CLOCK_NS, value) for t, value in fst[name].tv]
    return [(int(n), value) for n, value in rows if n == int(n)]


def check_gates(data: RunData, fst: pywellen.Waveform) -> None:
    """Every change of the gates in the span, at its clock edge."""
    first, last = (round(t * data.clock_hz) for t in (FROM_S, TO_S))
    logged = [(int(c), int(g)) for c, _, g, _ in data.rows(LogKind.GATES) if first < c <= last]
    assert len(logged) > 20
    start, *traced = changes(fst, "fl_soc.gate_o")
    assert start[0] == first
    assert traced == logged


def check_carrier(fst: pywellen.Waveform) -> None:
    """One count a clock from 0 to the last one, clock by clock through the whole span."""
    counts = changes(fst, f"fl_soc.{SIX_STEP}u_pwm.u_carrier.count_q")
    last_of = dict(changes(fst, f"fl_soc.{SIX_STEP}u_pwm.u_carrier.last_q"))
    assert len(counts) == round((TO_S - FROM_S) * 1e9 / CLOCK_NS) + 1
    last, starts = 0, 0
    for (n, before), (m, after) in itertools.pairwise(counts):
        last = last_of.get(n, last)
        assert m == n + 1
        assert after == before + 1 or (after == 0 and before == last), (n, before, after, last)
        starts += after == 0
    assert starts > 5


def check_names(folder: Path, fst: pywellen.Waveform) -> None:
    """What the viewers' files name is in the FST, in the width that they name; the core's inside is not."""
    width = {var.full_name: var.bitwidth for var in fst.all_vars()}
    surfer = re.findall(r"^variable_add (\S+)$", (folder / SURFER_FILE).read_text(), re.MULTILINE)
    assert len(surfer) == sum(map(len, groups(3, ["six-step"]).values())) and set(surfer) <= set(width)
    rows = re.findall(r"^fl_soc\.\S+$", (folder / GTKWAVE_FILE).read_text(), re.MULTILINE)
    ranges = [re.search(r"\[(\d+):0\]$", row) for row in rows]
    assert [width[name] for name in surfer] == [int(found[1]) + 1 if found else 1 for found in ranges]
    inside = re.compile(r"u_core|u_ram|u_regs")
    assert not [name for name in width if inside.search(name)]
    assert {name.split(".")[0] for name in width} == {"fl_soc"}


def test_waves() -> None:
    """A short run with waveforms; the FST is read by another library than the one that wrote it.

    Verifies: SYS-11
    """
    out = BUILD / "closed_loop" / "waves"
    shutil.rmtree(out, ignore_errors=True)
    options = [f"duration_s={TO_S}", "window=[]", f"record.zoom_from_s={FROM_S}", f"record.zoom_to_s={TO_S}"]
    options.append('accept=[{what="end_state",why="cut off in its start"}]')
    command = [sys.executable, "-m", "fluxlock.cli", "run", str(SCENARIO), "--waves", "--out", str(out)]
    for option in options:
        command += ["--set", option]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert f"simulator/{WAVE_FILE}" in done.stdout
    fst = pywellen.Waveform(str(out / "simulator" / WAVE_FILE))
    check_gates(load_trace(out / "trace.npz"), fst)
    check_carrier(fst)
    check_names(out / "simulator", fst)


def test_groups_of_the_chip() -> None:
    """A view names nothing of a path that the chip lacks, and as many gates as the chip has.

    Verifies: SYS-11
    """
    for phases, paths, absent in ((3, ["vector"], SIX_STEP), (5, ["vector"], SIX_STEP), (3, ["six-step"], "g_vector")):
        rows = [row for shown in groups(phases, paths).values() for row in shown]
        assert not [row for row in rows if absent in row]
        assert f"b gate_o[{2 * phases - 1}:0]" in rows and f"b req_h[{phases - 1}:0]" in rows


def _lz4_block(data: bytes) -> bytes:
    """Decoder of the LZ4 block format."""
    out, i = bytearray(), 0

    def length(n: int) -> int:
        nonlocal i
        more = n == 15
        while more:
            more = data[i] == 255
            n += data[i]
            i += 1
        return n

    while True:
        token = data[i]
        i += 1
        n = length(token >> 4)
        out += data[i : i + n]
        i += n
        if i == len(data):
            return bytes(out)
        distance = int.from_bytes(data[i : i + 2], "little")
        i += 2
        for _ in range(length(token & 15) + 4):
            out.append(out[-distance])


def test_compression(tmp_path: Path) -> None:
    """The stand-ins for LZ4 and zlib write valid streams within their bounds, from empty to beyond LZ4's window."""
    header, source, library = (tmp_path / f"shim.{kind}" for kind in ("h", "cpp", "so"))
    header.write_text(SHIM_HEADER)
    source.write_text(SHIM)
    compiler = os.environ.get("CXX", "c++")
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", f"-I{FST}", source, "-o", library], check=True)
    types = bind([header], tmp_path, tmp_path)
    lib = types.dlopen(str(library))
    rng = random.Random(1)
    for size in (*range(40), 255, 256, 257, 258, 259, 274, 517, 4000, 150_000):
        for alphabet in (1, 2, 20, 256):
            data = bytes(rng.choices(range(alphabet), k=size))
            data += data[: size // 2]
            for name, decoder in (("lz4", _lz4_block), ("deflate", zlib.decompress)):
                bound = getattr(lib, f"{name}_bound")(len(data))
                packed = bytearray(bound + 1)
                written = getattr(lib, name)(data, types.from_buffer(packed), len(data))
                assert written <= bound
                assert decoder(bytes(packed[:written])) == data, (name, size, alphabet)
    assert lib.deflate(bytes(100_000), types.from_buffer(bytearray(200_000)), 100_000) < 1000
