# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The flat binary of an ELF file against symbols that the linker placed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from fluxlock.firmware.toolchain import TARGET_FLAGS, flat_binary

SOURCE = """
.section .text.first, "ax"
.word 0x11111111, 0x22222222
.section .data.second, "aw"
.word 0x33333333
.section .bss.third, "aw", @nobits
.space 64
"""
SCRIPT = """
MEMORY { rom (rx) : ORIGIN = 0x100, LENGTH = 0x100
         ram (rwx) : ORIGIN = 0x8000, LENGTH = 0x100 }
SECTIONS {
  .text : { KEEP(*(.text.first)) } > rom
  .data 0x8000 : AT(0x110) { KEEP(*(.data.second)) } > ram
  .bss : { KEEP(*(.bss.third)) } > ram
}
"""


def test_load_addresses_and_gaps(tmp_path: Path) -> None:
    """Sections lie where they are loaded, not where they run; a gap is 0; what is only reserved is left out.

    Verifies: FW-01
    """
    source, script, elf = tmp_path / "a.S", tmp_path / "a.ld", tmp_path / "a.elf"
    source.write_text(SOURCE)
    script.write_text(SCRIPT)
    command = [sys.executable, "-m", "ziglang", "cc", *TARGET_FLAGS, str(source), "-T", str(script), "-o", str(elf)]
    subprocess.run(command, check=True)
    assert flat_binary(elf).hex() == "1111111122222222" + 16 * "0" + "33333333"
