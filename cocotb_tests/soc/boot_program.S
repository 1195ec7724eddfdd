# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

# Stands in for the firmware behind the loader: writes "running" to the UART, then stays in a loop. Its first instruction is
# at the reset vector, 0x80.
  .option norelax
  .section .start, "ax"
  .globl _start
_start:
  li s0, 0x80003000      # UART
  la s1, text
1:
  lbu a0, 0(s1)
  beqz a0, 3f
2:
  lw a1, 12(s0)
  andi a1, a1, 1         # FIFO takes a byte
  beqz a1, 2b
  sw a0, 4(s0)
  addi s1, s1, 1
  j 1b
3:
  j 3b
text:
  .asciz "running\n"
  .balign 4
filler:
  .rept 150
  .word 0x13579BDF
  .endr
