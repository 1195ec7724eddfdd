# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

# The loader's entry, at BOOT_ROM after every reset: its stack is the firmware's, it has no data to set up. An exception
# ends in a loop, with all gates off as they are after a reset.
#include "ram.h"

  .globl _boot_rom, _boot_bytes
  .set _boot_rom, BOOT_ROM
  .set _boot_bytes, BOOT_BYTES

  .section .start, "ax"
  .globl _start
_start:
  li sp, RAM_PARAMETER_BLOCK
  la a0, stopped
  csrw mtvec, a0
  call boot_main
  .balign 4
stopped:
  j stopped
