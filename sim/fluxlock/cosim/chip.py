# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Verilate the whole chip with the native-clock main, once a set of sources and options."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cocotb_tools.config

from fluxlock.base.paths import BUILD, ROOT, RTL, content_hash, tool_environment
from fluxlock.base.writable import file_lock
from fluxlock.cosim.block import WAIVERS, object_cache
from fluxlock.cosim.upsets import write_upset_table
from fluxlock.file_lists import chip_files
from fluxlock.generate.memory import BLOCK_ADDRESS, CAN_SETUP_ADDRESS, PUBLISHED_ADDRESS, RAM_WORDS, TELEMETRY_ADDRESS
from fluxlock.generate.registers import generate_registers
from fluxlock.generate.soft_core import CORE, DEBUG_CORE, soft_core

TOP = "fl_soc"
BOARD_TOP = "fl_board_bench"  # the chip on a board
NATIVE = ROOT / "sim" / "native"
CPU_HOST = NATIVE / "fl_cpu.sv"  # in place of the core
CPU_HOST_ACCESS = NATIVE / "cpu_host.vlt"
CORE_PROBE = NATIVE / "core_probe.vlt"  # how the simulator's main sees the core
BOARD_BENCH = NATIVE / f"{BOARD_TOP}.sv"
BOARD_SOURCES = tuple(f"fl_{name}.sv" for name in ("pll_reset", "adc_serial", "adc_fault", "board"))
OSCILLATOR_KHZ = 38_750  # of a board, as fl_board takes it
BOARD_RESET_CYCLES = 16  # of 65536: what a scenario says at once is heard
BOARD_CODE_CYCLES = 1  # from the hold of a board's converters to the codes at the bench, which sends them bit by bit
FOR_FIRMWARE = ("reg_*", "critical_*", "trap_enable", "cpu_*")  # what cpu_host.h defines
FST = NATIVE / "fst"  # headers that stand in for zlib's and LZ4's
PHASES = 3
PATHS = ("six-step", "vector")
SLOW = "Vtop_slow"  # source of what runs once
CONSTANTS = "cosim_chip.h"  # of this chip, for the simulator's main alone: Verilator's runtime serves every chip
# The code of a clock is one row of statements longer than the instruction cache: shorter is faster, -O3 loses a tenth.
OPT = ("OPT_FAST=-O2", "OPT_GLOBAL=-O1")
# With waves, for a debugger or on a board: runs are shorter than their compile.
OPT_BRIEF = ("OPT_FAST=-O1", "OPT_GLOBAL=-O1")
WORDS = {
    "PUBLISHED": PUBLISHED_ADDRESS,
    "BLOCK": BLOCK_ADDRESS,
    "CAN_SETUP": CAN_SETUP_ADDRESS,
    "TELEMETRY": TELEMETRY_ADDRESS,
}  # of the memory, that the simulator's main knows
SIGNAL = 'public_flat_rd -module "{}" -var "{}"\n'
# That decide what the chip is made of.
SCRIPTS = (Path(__file__), *(Path(__file__).with_name(f"{name}.py") for name in ("upsets", "registers")))


@dataclass(frozen=True)
class Chip:
    """A built simulator: executable, hash of everything that went into it, methods whose paths it has.

    board: the chip is on a board, `BOARD_TOP`.
    """

    executable: Path
    key: str
    waves: bool
    phases: int = PHASES
    injection: bool = False
    paths: tuple[str, ...] = PATHS
    board: bool = False

    @property
    def top(self) -> str:
        """Module at the top of the simulated design."""
        return BOARD_TOP if self.board else TOP


def rtl_sources(native: bool = False) -> list[Path]:
    """All synthesizable sources of the chip in compile order, as `rtl/fl_soc.f` names them.

    native: without the core, with what stands in its place when the firmware runs in the simulator's process.
    """
    files = chip_files()
    soft_core(debug=any(path.name == DEBUG_CORE.name for path in files))
    if native:
        files = [path for path in files if path.name not in (CPU_HOST.name, CORE.name, DEBUG_CORE.name)]
        files.append(CPU_HOST)
    return files


def _run(command: list[str], log: Path, env: dict[str, str]) -> None:
    with log.open("a") as out:
        out.write(" ".join(command) + "\n")
        out.flush()
        # A group of its own: whoever interrupts the build takes make's compilers with it.
        process = subprocess.Popen(command, env=env, stdout=out, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            process.wait()
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            raise
    if process.returncode:
        lines = log.read_text().splitlines()
        shown = [line for line in lines if "rror" in line][:20] or lines[-20:]
        raise RuntimeError(f"building the chip failed; from {log}:\n" + "\n".join(shown))


def compiler_words(env: Mapping[str, str]) -> list[str]:
    """Words for make: Verilator's rules set compiler and linker, so that the environment's CXX alone has no effect."""
    return [f"{name}={env['CXX']}" for name in ("CXX", "LINK") if env.get("CXX")]


def _slow_source(folder: Path) -> None:
    """One source for all that runs once at the start, compiled beside what runs in every clock and not optimized."""
    names = sorted(path.name for path in folder.glob("Vtop*__Slow.cpp"))
    includes = "".join(f'#include "{name}"\n' for name in names)
    (folder / f"{SLOW}.cpp").write_text(f"#pragma GCC optimize (0)\n{includes}")


def _signal_access(folder: Path, signals: tuple[str, ...]) -> Path:
    """What lets cocotb see signals of the inside."""
    lines = (SIGNAL.format(*signal.rsplit(".", 1)) for signal in signals)
    path = folder / "signals.vlt"
    path.write_text("".join(("`verilator_config\n", *lines)))
    return path


def _constants(folder: Path, phases: int, native: bool, probe: bool, board: bool) -> None:
    """What the simulator's main knows of this chip."""
    chip = "__DOT__".join((BOARD_TOP, "u_board", "u_soc") if board else (TOP,))
    values: dict[str, int | str] = {"MEMORY": f"{chip}__DOT__u_cpu__DOT__u_ram__DOT__mem"}
    values |= {"CHANNELS": 2 * phases + 3, "MEMORY_WORDS": RAM_WORDS}
    values |= {f"{name}_WORD": address // 4 for name, address in WORDS.items()}
    lines = [f"#define COSIM_{name} {value}" for name, value in values.items()]
    lines += ["#define COSIM_CPU_HOST"] if native else []
    lines += ["#define COSIM_CORE_PROBE"] if probe else []
    lines += ["#define COSIM_BOARD", f"#define COSIM_OSCILLATOR_KHZ {OSCILLATOR_KHZ}"] if board else []
    (folder / CONSTANTS).write_text("\n".join([*lines, ""]))


def build_chip(
    waves: bool = False,
    jobs: int | None = None,
    phases: int = PHASES,
    injection: bool = False,
    can: bool = False,
    native: bool = False,
    gate_polarity: int = 0,
    method: str | None = None,
    probe: bool = False,
    signals: tuple[str, ...] = (),
    board: bool = False,
) -> Chip:
    """Build the chip's simulator below `build/chip`; does nothing when nothing it is made of has changed.

    phases: 3, or 5 without the six-step path. injection, can: with injection path, CAN controller, at a cost in time of
    every run. native: without the core, for a firmware of this machine.
    gate_polarity: bit 0, 1: upper, lower gate pins are active low. waves: also able to write an FST, somewhat slower.
    probe: debugger and profile see the core; slower, with the same bits.
    signals: `module.variable`, with * in the variable: cocotb sees these too, beside the pins; each costs some speed.
    method: "six-step" or "vector": without the path of the other one, with the same bits and faster; None: with both.
    board: on a board, with its oscillator and serial converters, and the paths of both methods; slower.
    """
    generate_registers()
    method = method if phases == PHASES and not board else None
    paths = (method,) if method else PATHS if phases == PHASES else ("vector",)
    top, sources = TOP, rtl_sources(native)
    if board:
        top, sources = BOARD_TOP, [*sources, *(RTL / "board" / name for name in BOARD_SOURCES), BOARD_BENCH]
    scopes = [NATIVE / "public.vlt", *([NATIVE / "waves.vlt"] if waves else []), *([CPU_HOST_ACCESS] if native else [])]
    scopes += [CORE_PROBE] if probe else []
    env = {**tool_environment(), "OBJCACHE": object_cache()}
    inputs = [*sources, WAIVERS, *scopes, *NATIVE.glob("c*"), *(FST.glob("*.h") if waves else ()), *SCRIPTS]
    build = (phases, injection, can, native, gate_polarity, waves, method, probe, signals, board)
    key = content_hash(inputs, RAM_WORDS, *build, env.get("CXX", ""))
    folder = BUILD / "chip" / content_hash([], key, ROOT)
    chip = Chip(folder / TOP, key, waves, phases, injection, paths, board)
    made = {"key": key, "phases": phases, "injection": injection, "native": native, "waves": waves, "method": method}
    with file_lock(folder.with_suffix(".lock")):
        if (folder / ".done").exists():
            return chip
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        log = folder / "build.log"
        libs = cocotb_tools.config.libs_dir
        exported = " ".join(
            f"-Wl,--export-dynamic-symbol={name}" for name in ("cosim_*", *(FOR_FIRMWARE if native else ()))
        )
        if signals:
            scopes.append(_signal_access(folder, signals))
        trace = ["--trace-fst", "--trace-structs", "--no-trace-top", "--no-trace-params", "-CFLAGS", f"-I{FST}"]
        command = [
            "verilator", "-cc", "--exe", "-Mdir", str(folder), "--top-module", top, "--prefix", "Vtop", "-o", TOP,
            f"-GPhases={phases}", f"-GInjection={int(injection)}", f"-GCan={int(can)}",
            *([f"-GSixStep={int(method == 'six-step')}", f"-GVector={int(method == 'vector')}"] if method else []),
            *([f"-GResetCycles={BOARD_RESET_CYCLES}", f"-GOscKhz={OSCILLATOR_KHZ}"] if board else []),
            f"-GHighActiveLow={gate_polarity & 1}", f"-GLowActiveLow={gate_polarity >> 1}",
            "--vpi", "--timescale", "1ns/1ns", "-O3", "--flatten", "--public-ignore",
            "--x-assign", "fast", "--x-initial", "fast",
            "--output-split", "0", "-Wno-fatal",
            "-CFLAGS", "-march=native",
            "-LDFLAGS", f"-Wl,-rpath,{libs} -L{libs} -lcocotbvpi_verilator {exported}",
            *(trace if waves else []),
            str(NATIVE / "cosim_main.cpp"), str(WAIVERS), *map(str, scopes), *map(str, sources),
        ]  # fmt: skip
        _run(command, log, env)
        write_upset_table(folder)
        _slow_source(folder)
        _constants(folder, phases, native, probe, board)
        brief = waves or native or probe or board
        count = str(jobs or min(os.cpu_count() or 1, 4))
        make = ["make", "-j", count, "-C", str(folder), "-f", "Vtop.mk", f"VM_GLOBAL_SLOW={SLOW}"]
        make += ["VM_CLASSES_SLOW=", "VM_SUPPORT_SLOW=", *(OPT_BRIEF if brief else OPT), *compiler_words(env)]
        if waves:  # LDLIBS: Verilator's, without zlib and LZ4
            make += ["LDLIBS=$(VM_USER_LDLIBS) $(CFG_LDLIBS_THREADS)"]
        _run(make, log, env)
        (folder / ".done").write_text(json.dumps(made))
    return chip
