# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Where the clocks of the soft core go: a trace of retired instructions, folded by function and interrupt.

`elf` reads names from the image's ELF file. `fold` walks the trace with a stack of calls. `flame` draws. `command` runs
a scenario and prints the tables.
"""
