# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

# One trap entry. Saves what a C function may change; of the handlers that are interrupted themselves also mepc, mstatus
# and mie. An exception can only come from broken code: it opens the gates, and trap_exception has the stack for itself.
#define MCAUSE_SOFTWARE 3
#define MCAUSE_EXTERNAL 11
#define MIE_EXTERNAL 0x800
#define MIE_CONTROL 0x880
#define MIE_ALL 0x888
#define MSTATUS_MIE 8
#define CSR_EXTERNAL_MASK 0xBC0
#define SAFETY_GUARD 0x80008000

  .section .text.hot.trap, "ax"
  .align 4
  .globl trap_entry
trap_entry:
  addi sp, sp, -80
  sw ra, 0(sp)
  sw t0, 4(sp)
  sw t1, 8(sp)
  sw t2, 12(sp)
  sw a0, 16(sp)
  sw a1, 20(sp)
  sw a2, 24(sp)
  sw a3, 28(sp)
  sw a4, 32(sp)
  sw a5, 36(sp)
  sw a6, 40(sp)
  sw a7, 44(sp)
  sw t3, 48(sp)
  sw t4, 52(sp)
  sw t5, 56(sp)
  sw t6, 60(sp)
  csrr a0, mcause
  bgez a0, exception
  andi a0, a0, 15
  li a1, MCAUSE_SOFTWARE
  beq a0, a1, current
  csrr a2, mepc
  csrr a3, mstatus
  csrr a4, mie
  sw a2, 64(sp)
  sw a3, 68(sp)
  sw a4, 72(sp)
  li a1, MCAUSE_EXTERNAL
  beq a0, a1, deferred
  li a2, MIE_CONTROL
  csrc mie, a2
  csrsi mstatus, MSTATUS_MIE
  call trap_control

back:
  csrci mstatus, MSTATUS_MIE
  lw a2, 64(sp)
  lw a3, 68(sp)
  lw a4, 72(sp)
  csrw mepc, a2
  csrw mstatus, a3
  csrw mie, a4

restore:
  lw ra, 0(sp)
  lw t0, 4(sp)
  lw t1, 8(sp)
  lw t2, 12(sp)
  lw a0, 16(sp)
  lw a1, 20(sp)
  lw a2, 24(sp)
  lw a3, 28(sp)
  lw a4, 32(sp)
  lw a5, 36(sp)
  lw a6, 40(sp)
  lw a7, 44(sp)
  lw t3, 48(sp)
  lw t4, 52(sp)
  lw t5, 56(sp)
  lw t6, 60(sp)
  addi sp, sp, 80
  mret

deferred:
  li a2, MIE_EXTERNAL
  csrc mie, a2
  csrsi mstatus, MSTATUS_MIE
  call trap_deferred
  j back

current:
  call trap_current
  j restore

exception:
  li a0, SAFETY_GUARD
  sw zero, 0(a0)
  csrr a0, mcause
  csrr a1, mepc
  csrr a2, mtval
  la sp, _stack_top
  j trap_exception

  .weak trap_exception
trap_exception:
  j trap_exception

  .globl trap_enable
trap_enable:
  li a0, 1
  csrw CSR_EXTERNAL_MASK, a0
  li a0, MIE_ALL
  csrs mie, a0
  csrsi mstatus, MSTATUS_MIE
  ret
