# One trap entry. Saves what a C function may change plus mepc and mstatus, because the deferred handler is
# interrupted itself. An exception stops the core with the gates opened: it can only come from broken code.
#define MCAUSE_TIMER 7
#define MCAUSE_EXTERNAL 11
#define MIE_EXTERNAL 0x800
#define MIE_BOTH 0x880
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
  li a1, MCAUSE_EXTERNAL
  beq a0, a1, deferred
  call trap_control
  j restore

deferred:
  csrr a0, mepc
  csrr a1, mstatus
  sw a0, 64(sp)
  sw a1, 68(sp)
  li a2, MIE_EXTERNAL
  csrc mie, a2
  csrsi mstatus, MSTATUS_MIE
  call trap_deferred
  csrci mstatus, MSTATUS_MIE
  li a2, MIE_EXTERNAL
  csrs mie, a2
  lw a0, 64(sp)
  lw a1, 68(sp)
  csrw mepc, a0
  csrw mstatus, a1

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

exception:
  li a0, SAFETY_GUARD
  sw zero, 0(a0)
1:
  j 1b

  .globl trap_enable
trap_enable:
  li a0, 1
  csrw CSR_EXTERNAL_MASK, a0
  li a0, MIE_BOTH
  csrs mie, a0
  csrsi mstatus, MSTATUS_MIE
  ret
