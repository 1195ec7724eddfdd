# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Single bits that flip, and how a fault becomes actions of a run."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

from fluxlock.clock import CLOCK_HZ
from fluxlock.cosim.broken_code import call, entry, idle_place, rewrite
from fluxlock.cosim.plan import Action
from fluxlock.generate.memory import BLOCK_ADDRESS
from fluxverify.campaign.grid import ANY, PARAMETERS, SETTINGS, UPSET_S, Fault

# An upset that makes sample sets come every 83 us instead of every us: nobody would see an over-current meanwhile.
SAMPLE_PERIOD = Fault(
    "sample period upset",
    ((0.0, "register", {"name": "u_sense__DOT__u_regs__DOT__field_storage_period_cycles", "bit_share": 12.5 / 16}),),
    frozenset({"no_samples"}),
    must_stop=True,
    span_s=UPSET_S,
)

# Registers are drawn evenly by name, memory by address: image, state, stack, and the block that boot has checked.
UPSET_BYTES = BLOCK_ADDRESS + 0x400
# What fl_settings_lock watches, as fields of the safety block.
SETTINGS_FIELDS = (
    "guard_safe_state", "dead_time_cycles", "trip_enable_source", "watchdog_cycles", "sample_age_cycles",
    "current_limit_phase_lsb", "current_limit_dc_lsb", "voltage_limit_over_lsb", "voltage_limit_under_lsb",
    "brake_enable", "brake_level_on_lsb", "brake_level_off_lsb", "brake_time_cycles",
)  # fmt: skip


def upsets(rng: random.Random, registers: int, words: int, settings: int) -> list[Fault]:
    """Single bits that flip: in a register, in the memory, in a locked setting."""
    found = []
    for number in range(registers):
        at = {"share": rng.random(), "bit_share": rng.random()}
        found.append(Fault(f"register upset {number}", ((0.0, "register", at),), ANY, span_s=UPSET_S))
    for number in range(words):
        place = {"address": 4 * rng.randrange(0x80 // 4, UPSET_BYTES // 4), "bit": rng.randrange(32)}
        found.append(Fault(f"memory upset {number}", ((0.0, "memory", place),), ANY, span_s=UPSET_S))
    for number in range(settings):
        field = {"name": f"u_safety__DOT__u_regs__DOT__field_storage_{rng.choice(SETTINGS_FIELDS)}"}
        change = (0.0, "register", field | {"bit_share": rng.random()})
        found.append(Fault(f"settings upset {number}", (change,), SETTINGS, must_stop=True, span_s=UPSET_S))
    return found


def parameter_upsets(rng: random.Random, count: int, block_bytes: int) -> list[Fault]:
    """Single bits of the parameter block that have flipped before the program looks at it."""
    found = []
    for number in range(count):
        place = {"address": BLOCK_ADDRESS + 4 * rng.randrange(block_bytes // 4), "bit": rng.randrange(32)}
        change = (0.0, "memory", place)
        found.append(Fault(f"parameter upset {number}", (change,), PARAMETERS, must_stop=True, span_s=UPSET_S))
    return found


def actions_of(fault: Fault, at_cycle: int, registers: Sequence[str], image: Path) -> tuple[Action, ...]:
    """The fault's changes at a moment.

    registers: the chip's, by which an upset's name becomes its share of all. image: of the firmware, by which a
    function becomes an address.
    """
    actions: list[Action] = []
    for at_s, kind, arguments in fault.changes:
        told = dict(arguments)
        if kind == "code":
            function = str(told["function"])
            at = (entry(image, function) if function else idle_place(image)) + int(str(told["offset"]))
            word = told["word"] if isinstance(told["word"], int) else call(image, at, str(told["word"]))
            actions += rewrite(image, at, word, at_cycle + round(at_s * CLOCK_HZ))
            continue
        if "name" in told:
            wanted = str(told.pop("name"))
            (number,) = (n for n, name in enumerate(registers) if name.endswith(wanted))
            told["share"] = (number + 0.5) / len(registers)
        actions.append(Action(at_cycle + round(at_s * CLOCK_HZ), kind, told))
    return tuple(actions)
