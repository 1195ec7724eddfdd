# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

# Reset vector 0x80 of the core: below it nothing is fetched, so the trap entry lives after the start code. The firmware
# also comes here by itself, to start anew (hal/cpu.h). The stack is painted, to show how deep it has been.
#include "ram.h"

#define MSTATUS_MIE 8

#ifndef IMAGE_LIMIT  // of a chip with less RAM
#define IMAGE_LIMIT RAM_IMAGE_END
#endif

  .globl _stack_top, _image_limit
  .set _stack_top, RAM_PARAMETER_BLOCK
  .set _image_limit, IMAGE_LIMIT
  .globl _state_offset, _telemetry_offset
  .set _state_offset, STATE_OFFSET
  .set _telemetry_offset, TELEMETRY_OFFSET

  .section .start, "ax"
  .globl _start
_start:
  csrci mstatus, MSTATUS_MIE
  csrw mie, zero
  la sp, _stack_top
  li a0, RAM_STACK
  li a1, STACK_PAINT
0:
  sw a1, 0(a0)
  addi a0, a0, 4
  bltu a0, sp, 0b
  la a0, _bss
  la a1, _ebss
1:
  bgeu a0, a1, 2f
  sw zero, 0(a0)
  addi a0, a0, 4
  j 1b
2:
  la a0, trap_entry
  csrw mtvec, a0
  call main
3:
  j 3b
