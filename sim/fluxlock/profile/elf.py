# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Names for addresses: symbols and inlined functions of an image's ELF file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from elftools.dwarf.compileunit import CompileUnit
from elftools.dwarf.descriptions import describe_form_class
from elftools.dwarf.die import DIE
from elftools.dwarf.ranges import BaseAddressEntry, RangeEntry
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection
from numpy.typing import NDArray

from fluxlock.generate.memory import RAM_WORDS

UNKNOWN = "unknown"


@dataclass(frozen=True)
class Program:
    """Code of an image, a word per address; `chain`: for each word, the number of its names in `chains`.

    The names of a word are those of the function that holds it and of the functions inlined there, outermost first.
    """

    code: NDArray[np.uint32]
    chain: NDArray[np.int32]
    chains: tuple[tuple[str, ...], ...]
    symbols: dict[str, int]


def read_program(path: Path) -> Program:
    """Read an ELF file of the toolchain."""
    with path.open("rb") as file:
        elf = ELFFile(file)
        code = np.zeros(RAM_WORDS, np.uint32)
        for segment in elf.iter_segments("PT_LOAD"):
            data = segment.data()
            words = np.frombuffer(data[: len(data) // 4 * 4], "<u4")
            at = segment["p_paddr"] // 4
            code[at : at + len(words)] = words
        names: list[tuple[str, ...]] = [(UNKNOWN,)] * RAM_WORDS
        symbols = _symbols(elf, names)
        if elf.has_dwarf_info():
            for unit in elf.get_dwarf_info().iter_CUs():
                _name(unit.get_top_DIE(), (), names)
    chains = tuple(dict.fromkeys(names))
    number = {chain: n for n, chain in enumerate(chains)}
    return Program(code, np.array([number[name] for name in names], np.int32), chains, symbols)


def _symbols(elf: ELFFile, names: list[tuple[str, ...]]) -> dict[str, int]:
    """Global symbols and functions of the code, which also name all up to the next one."""
    found = {}
    table = elf.get_section_by_name(".symtab")
    assert isinstance(table, SymbolTableSection)  # no image is stripped
    for symbol in table.iter_symbols():
        section = symbol["st_shndx"]
        if not isinstance(section, int) or elf.get_section(section).name != ".text":
            continue
        if symbol["st_info"]["type"] == "STT_FUNC" or symbol["st_info"]["bind"] == "STB_GLOBAL":
            found[symbol.name] = symbol["st_value"]
    places = sorted((address, name) for name, address in found.items())
    for (address, name), (end, _) in zip(places, [*places[1:], (4 * RAM_WORDS, "")], strict=True):
        names[address // 4 : end // 4] = [(name,)] * (end // 4 - address // 4)
    return found


def _name(die: DIE, outer: tuple[str, ...], names: list[tuple[str, ...]]) -> None:
    """Give the words of a function and of all that is inlined into it their names, the inner ones last."""
    chain = outer
    if die.tag in ("DW_TAG_subprogram", "DW_TAG_inlined_subroutine"):
        chain = (*outer, _origin_name(die))
        for begin, end in _ranges(die):
            names[begin // 4 : end // 4] = [chain] * (end // 4 - begin // 4)
    for child in die.iter_children():
        _name(child, chain, names)


def _origin_name(die: DIE) -> str:
    while "DW_AT_name" not in die.attributes and "DW_AT_abstract_origin" in die.attributes:
        die = die.get_DIE_from_attribute("DW_AT_abstract_origin")
    name = die.attributes.get("DW_AT_name")
    return name.value.decode() if name else UNKNOWN


def _ranges(die: DIE) -> list[tuple[int, int]]:
    """Addresses from..to of an entry; none of a function that exists inlined only."""
    attributes = die.attributes
    if "DW_AT_low_pc" in attributes and "DW_AT_high_pc" in attributes:
        low, high = attributes["DW_AT_low_pc"].value, attributes["DW_AT_high_pc"]
        return [(low, high.value if describe_form_class(high.form) == "address" else low + high.value)]
    if "DW_AT_ranges" not in attributes:
        return []
    lists = die.dwarfinfo.range_lists()
    assert lists is not None and isinstance(die.cu, CompileUnit)
    offset = attributes["DW_AT_ranges"].value
    if die.cu.header["version"] >= 5:
        entries = lists.get_range_list_at_offset(offset, cu=die.cu)
        return _spans(entries, die)
    return _spans(lists.get_range_list_at_offset(offset), die)


def _spans(entries: Iterable[BaseAddressEntry | RangeEntry], die: DIE) -> list[tuple[int, int]]:
    top = die.cu.get_top_DIE().attributes
    base = top["DW_AT_low_pc"].value if "DW_AT_low_pc" in top else 0
    found = []
    for entry in entries:
        if isinstance(entry, BaseAddressEntry):
            base = entry.base_address
            continue
        shift = 0 if getattr(entry, "is_absolute", False) else base
        found.append((entry.begin_offset + shift, entry.end_offset + shift))
    return found
