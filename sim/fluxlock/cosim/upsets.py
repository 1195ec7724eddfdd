"""The chip's registers as the simulator main can flip them: a table made from the Verilated model's header."""

from __future__ import annotations

import re
from pathlib import Path

HEADER = "Vtop___024root.h"
TABLE = "upsets.inc"
# One scalar or vector of the flattened model: storage, highest bit, name.
_MEMBER = re.compile(r"^\s*(?:CData|SData|IData|QData|VlWide<\d+>)/\*(\d+):0\*/ (fl_soc__DOT__\w+);", re.MULTILINE)
# Names that are registers: ours end so, those of the register blocks and of the soft core's pipeline begin so.
_REGISTER = re.compile(r"(_q|__field_storage_\w+|__(decode_to_execute|execute_to_memory|memory_to_writeBack)_\w+)$")


def write_upset_table(folder: Path) -> None:
    """Write the table beside the model's header, for `cosim_main.cpp`."""
    members = _MEMBER.findall((folder / HEADER).read_text())
    lines = [f"UPSET({name}, {int(top) + 1})" for top, name in members if _REGISTER.search(name)]
    (folder / TABLE).write_text("\n".join(sorted(set(lines))) + "\n")
