# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Memory map of the soft core. The RTL's default size is held to RAM_WORDS by a test, the C headers are generated."""

RAM_WORDS = 32768
RAM_BYTES = 4 * RAM_WORDS
# The data cache is direct-mapped. What a control step touches has lines of its own there: parameter block from 0, the
# drive's state, telemetry, and below 0x1000 the stack. What of the block lies in the lines of the state is read once,
# at boot: parameters of the injection.
CACHE_BYTES = 4096
STATE_OFFSET = 0x400
TELEMETRY_OFFSET = 0xC00
# From the top down: telemetry, parameter block, stack.
BLOCK_ADDRESS = RAM_BYTES - CACHE_BYTES
CAN_SETUP_BYTES = 8  # node-ID and kbit/s of the CANopen node after power-up, below the telemetry
BLOCK_MAX_BYTES = TELEMETRY_OFFSET - CAN_SETUP_BYTES
CAN_SETUP_ADDRESS = BLOCK_ADDRESS + BLOCK_MAX_BYTES
TELEMETRY_ADDRESS = BLOCK_ADDRESS + TELEMETRY_OFFSET
PUBLISHED_ADDRESS = TELEMETRY_ADDRESS + 8  # what the published angle has beyond the frame's, for the simulator's log
# What is left at the end talks to sw/images/fuzz_main.c.
FUZZ_ADDRESS = RAM_BYTES - 16
# Why the firmware restarted last (sw/app/crash.h): neither the start code nor the telemetry touches it.
CRASH_ADDRESS = FUZZ_ADDRESS - 32
TELEMETRY_MAX_BYTES = CRASH_ADDRESS - TELEMETRY_ADDRESS
STACK_BYTES = 4096
STACK_ADDRESS = BLOCK_ADDRESS - STACK_BYTES
STACK_PAINT = 0x57ACCA57  # what the start code leaves in the whole stack
# What a program of sw/images/bench reads.
TABLE_ADDRESS = 0x18000
TABLE_END = BLOCK_ADDRESS - STACK_BYTES
# The loader's ROM behind the RAM, in a chip with Boot (rtl/soc/fl_cpu.sv). Its stack is the firmware's.
BOOT_ADDRESS = RAM_BYTES
BOOT_BYTES = 4096
# In the SPI flash, above the bitstream. Image: its header in a page of its own, then the bytes for address 0 on.
FLASH_IMAGE = 0x380000
FLASH_PAGE_BYTES = 256
FLASH_SECTOR_BYTES = 4096
FLASH_BLOCK = FLASH_IMAGE + RAM_BYTES  # parameter block
FLASH_CAN_SETUP = FLASH_BLOCK + TELEMETRY_OFFSET  # node-ID, kbit/s, CRC-32 of the two; behind the longest block
FLASH_END = FLASH_BLOCK + FLASH_SECTOR_BYTES
FLASH_STORE = FLASH_END  # two sectors that the firmware writes: stored objects of the CANopen node


def image_end(ram_words: int = RAM_WORDS) -> int:
    """First byte address that image and state must not reach.

    That of the stack; where the RAM is smaller than its window, the end of the banks before the smallest one, which is
    the window's end (rtl/soc/fl_cpu.sv). ram_words: a multiple of 2048 above half of RAM_WORDS.
    """
    if not RAM_WORDS // 2 < ram_words <= RAM_WORDS or ram_words % 2048:
        raise ValueError(f"a RAM of {ram_words} words")
    if ram_words == RAM_WORDS:
        return BLOCK_ADDRESS - STACK_BYTES
    smallest_bank = ram_words & -ram_words
    return 4 * (ram_words - smallest_bank)


def c_header() -> str:
    """The generated `ram.h`, for C and assembler."""
    return f"""// Generated from sim/fluxlock/generate/memory.py. Do not edit.
#ifndef FL_RAM_H
#define FL_RAM_H

#define RAM_PARAMETER_BLOCK 0x{BLOCK_ADDRESS:X}
#define RAM_TELEMETRY 0x{TELEMETRY_ADDRESS:X}
#define RAM_PUBLISHED 0x{PUBLISHED_ADDRESS:X}
#define RAM_CAN_SETUP 0x{CAN_SETUP_ADDRESS:X}
#define RAM_FUZZ 0x{FUZZ_ADDRESS:X}
#define RAM_CRASH 0x{CRASH_ADDRESS:X}
#define RAM_STACK 0x{STACK_ADDRESS:X}
#define STACK_PAINT 0x{STACK_PAINT:X}
#define RAM_TABLE 0x{TABLE_ADDRESS:X}
#define STACK_BYTES {STACK_BYTES}
#define STATE_OFFSET 0x{STATE_OFFSET:X}
#define TELEMETRY_OFFSET 0x{TELEMETRY_OFFSET:X}
#define RAM_BYTES 0x{RAM_BYTES:X}
#define RAM_IMAGE_END 0x{image_end():X}
#define BOOT_ROM 0x{BOOT_ADDRESS:X}
#define BOOT_BYTES {BOOT_BYTES}
#define FLASH_IMAGE 0x{FLASH_IMAGE:X}
#define FLASH_BLOCK 0x{FLASH_BLOCK:X}
#define FLASH_CAN_SETUP 0x{FLASH_CAN_SETUP:X}
#define FLASH_END 0x{FLASH_END:X}
#define FLASH_STORE 0x{FLASH_STORE:X}
#define FLASH_PAGE_BYTES {FLASH_PAGE_BYTES}
#define FLASH_SECTOR_BYTES {FLASH_SECTOR_BYTES}
#define PARAMETER_BLOCK_MAX_BYTES {BLOCK_MAX_BYTES}

#endif
"""
