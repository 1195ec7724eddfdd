# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

# Start code of the test program: stack, cleared bss (the memory survives a reset).
  .section .start, "ax"
  .globl _start
_start:
  li sp, 0x1F000
  la a0, _bss
  la a1, _ebss
0:
  sw zero, 0(a0)
  addi a0, a0, 4
  bltu a0, a1, 0b
  call main
1:
  j 1b

# Trap of a call that leads to nowhere: the call returns the cause.
  .align 2
  .globl return_cause
return_cause:
  csrr a0, mcause
  csrw mepc, ra
  mret
