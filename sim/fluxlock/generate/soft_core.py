# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The soft core: VexRiscv of the package, fetching from a tightly coupled memory instead of an instruction cache.

The RAM of the chip answers in one clock, so a cache in front of it only costs time: a line that misses takes eleven
clocks, and the control step is larger than the package's 4 KiB. `derive` takes the cache out of the generated Verilog
and brings its place to ports of the core:

    instructionMemory_EN    read; without it the data stay
    instructionMemory_ADR   word address
    instructionMemory_DAT   data, one clock later
    instructionMemory_ERR   with the data: nothing there, the core takes an access fault

Accesses to registers are never bursts. A port beside the data bus shows the low bits of their address before they pass
the burst counter, which would stand in the longest way of the chip:

    dBusWishbone_WORD       low bits of the command's word address, from a register; dBusWishbone_ADR differs in a burst

The package's `VexRiscv_Debug.v` is the same core with a debug bus. Its instruction cache also takes the debugger's
instructions, so what replaces the cache does too. The plain core gets the ports of the bus, where nothing answers: both
cores are the module VexRiscv, and the file in the list decides.
"""

from __future__ import annotations

import re
from pathlib import Path

from fluxlock.base.paths import GENERATED, package_dir
from fluxlock.base.writable import write_whole

PORTS = """\
  output              instructionMemory_EN,
  output     [29:0]   instructionMemory_ADR,
  input      [31:0]   instructionMemory_DAT,
  input               instructionMemory_ERR,
"""

# Stage 0 addresses, stage 1 has the data, stage 2 (decode) registers them; never a miss, a refill or a halt.
FETCH = """\
  reg        [31:0]   instructionMemory_decodeData;
  reg                 instructionMemory_decodeError;
  assign instructionMemory_EN = (! IBusCachedPlugin_cache_io_cpu_fetch_isStuck);
  assign instructionMemory_ADR = IBusCachedPlugin_iBusRsp_stages_0_input_payload[31 : 2];
  assign IBusCachedPlugin_cache_io_cpu_prefetch_haltIt = 1'b0;
  assign IBusCachedPlugin_cache_io_cpu_fetch_data = instructionMemory_DAT;
  assign IBusCachedPlugin_cache_io_cpu_fetch_physicalAddress = IBusCachedPlugin_mmuBus_rsp_physicalAddress;
  assign IBusCachedPlugin_cache_io_cpu_decode_physicalAddress = 32'h0;
  assign IBusCachedPlugin_cache_io_cpu_decode_data = instructionMemory_decodeData;
  assign IBusCachedPlugin_cache_io_cpu_decode_cacheMiss = 1'b0;
  assign IBusCachedPlugin_cache_io_cpu_decode_error = instructionMemory_decodeError;
  assign IBusCachedPlugin_cache_io_cpu_decode_mmuRefilling = 1'b0;
  assign IBusCachedPlugin_cache_io_cpu_decode_mmuException = 1'b0;
  assign IBusCachedPlugin_cache_io_mem_cmd_valid = 1'b0;
  assign IBusCachedPlugin_cache_io_mem_cmd_payload_address = 32'h0;
  assign IBusCachedPlugin_cache_io_mem_cmd_payload_size = 3'b000;
  always @(posedge clk) begin
    if(! IBusCachedPlugin_cache_io_cpu_decode_isStuck) begin
      instructionMemory_decodeData <= instructionMemory_DAT;
      instructionMemory_decodeError <= instructionMemory_ERR;
    end
"""
FETCH_END = "  end\n"

# A debugger's instruction takes the place of the one that was read, as in the cache of that core.
INJECTION = """\
    if(switch_Fetcher_l362 != 3'b000) begin
      instructionMemory_decodeData <= IBusCachedPlugin_injectionPort_payload;
    end
"""
INJECTED = r"\(switch_Fetcher_l362 +\), //i\n[^\n]*\(IBusCachedPlugin_injectionPort_payload +\), //i\n.*?"

DEBUG_PORTS = """\
  input               debug_bus_cmd_valid,
  output              debug_bus_cmd_ready,
  input               debug_bus_cmd_payload_wr,
  input      [7:0]    debug_bus_cmd_payload_address,
  input      [31:0]   debug_bus_cmd_payload_data,
  output     [31:0]   debug_bus_rsp_data,
  output              debug_resetOut,
  input               debugReset,
"""
NO_DEBUG = """\
  assign debug_bus_cmd_ready = 1'b0;
  assign debug_bus_rsp_data = 32'h0;
  assign debug_resetOut = 1'b0;
"""

COMMAND_PORT = "  output     [2:0]    dBusWishbone_WORD,\n"
COMMAND = "  assign dBusWishbone_WORD = dBus_cmd_payload_address[4 : 2];\n"


def _changes(debug: bool) -> tuple[tuple[str, str], ...]:
    """Pattern and what takes its place; each occurs exactly once."""
    before = "debug_resetOut" if debug else "externalInterruptArray"
    injected, injection = (INJECTED, INJECTION) if debug else ("", "")
    ports, bus = (PORTS, "") if debug else (DEBUG_PORTS + PORTS, NO_DEBUG)
    return (
        (rf"(?m)(?<={before},\n)(?=  output reg          iBusWishbone_CYC,$)", ports),
        (
            rf"(?ms)^  InstructionCache IBusCachedPlugin_cache \(\n.*?{injected}^  \);\n",
            bus + FETCH + injection + FETCH_END,
        ),
        (r"(?m)^(?=  output     \[29:0\]   dBusWishbone_ADR,$)", COMMAND_PORT),
        (r"(?m)^(?=  assign dBusWishbone_ADR = )", COMMAND),
        (r"(?ms)^module InstructionCache \(\n.*?^endmodule\n", ""),
    )


CORE = GENERATED / "VexRiscv.v"
DEBUG_CORE = GENERATED / "VexRiscv_Debug.v"  # in its place


class SoftCoreError(RuntimeError):
    """The package's Verilog is not the one that the changes were written for."""


def derive(verilog: str, debug: bool = False) -> str:
    """The core without its instruction cache, with the address of its data commands.

    debug: it is the core that has the debug bus. The other gets its ports.
    """
    for pattern, replacement in _changes(debug):
        verilog, count = re.subn(pattern, replacement, verilog)
        if count != 1:
            raise SoftCoreError(f"VexRiscv of the package: {count} matches of {pattern!r} instead of one")
    return verilog


def soft_core(debug: bool = False) -> Path:
    """`build/generated/VexRiscv.v`, written when the package's core or the changes to it are new.

    debug: `VexRiscv_Debug.v` beside it, the module of the same name with the debug bus.
    """
    core = DEBUG_CORE if debug else CORE
    source = package_dir("pythondata_cpu_vexriscv") / "verilog" / core.name
    text = derive(source.read_text(encoding="utf-8"), debug)
    if not core.exists() or core.read_text(encoding="utf-8") != text:
        core.parent.mkdir(parents=True, exist_ok=True)
        write_whole(core, text)
    return core
