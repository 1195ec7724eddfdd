# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fields of the chip's registers by their names in the register reference, read without the bus."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from fluxlock.cosim.native import Native
from fluxlock.firmware.host import register_offsets

# Storage of a field in the Verilated model: instance of the block, then register, index in an array and field in a row.
_STORAGE = re.compile(r"__DOT__u_([a-z0-9_]+)__DOT__u_regs__DOT__field_storage_(\w+)$")


def field_name(storage: str, registers: Iterable[str]) -> str | None:
    """`pwm.period.cycles`, `comm.hall_offset[0].interval_q16` of a name of the model; None if it stores no field.

    registers: `block.register` of the whole chip.
    """
    found = _STORAGE.search(storage)
    if found is None:
        return None
    block, rest = found.groups()
    here = [name.split(".")[1] for name in registers if name.startswith(f"{block}.")]
    owner = max((name for name in here if rest.startswith(f"{name}_")), key=len, default=None)
    if owner is None:
        return None
    element = re.fullmatch(r"(\d+)_(\w+)", rest[len(owner) + 1 :])
    return (
        f"{block}.{owner}[{element[1]}].{element[2]}"
        if element
        else f"{block}.{rest.replace(owner + '_', owner + '.', 1)}"
    )


class Registers(Mapping[str, int]):
    """Values of fields that the chip stores, `block.register.field`, as they are between two clocks.

    In it: what software writes, and bits that hardware sets. Not in it: what a block makes in the moment of a read (its
    signals are handles, see `signals` of `run_tests`), and what the simulator has merged with something else.
    """

    def __init__(self, native: Native) -> None:
        self._native = native
        self._numbers: dict[str, int] = {}

    def _all(self) -> dict[str, int]:
        if not self._numbers:
            registers = register_offsets()
            names = (field_name(name, registers) for name, _ in self._native.upset_names())
            self._numbers = {name: number for number, name in enumerate(names) if name is not None}
        return self._numbers

    def __getitem__(self, name: str) -> int:
        found = self._all()
        if name not in found:
            block = name.split(".")[0]
            there = ", ".join(other for other in found if other.startswith(f"{block}."))
            blocks = ", ".join(sorted({other.split(".")[0] for other in found}))
            said = f"of that block there are: {there}" if there else f"blocks with stored fields: {blocks}"
            raise KeyError(f"no stored field {name!r}; {said}")
        return self._native.register_value(found[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())
