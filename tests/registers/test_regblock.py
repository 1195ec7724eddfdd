# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Register blocks after the rework that lets them rest: a variable a field, nothing missed."""

from __future__ import annotations

import re

import pytest

from fluxlock.base.paths import REGISTER_BLOCKS
from fluxlock.generate.regblock import gate_with_request
from fluxlock.generate.registers import generate_registers


@pytest.mark.parametrize("block", REGISTER_BLOCKS)
def test_every_field_is_a_variable(block: str) -> None:
    """Each field is declared once, reset once and written; no structure holds them, no loop is left."""
    text = (generate_registers() / f"fl_{block}_regs.sv").read_text()
    declared = re.findall(r"^    logic (?:\[\d+:0\] )?(field_storage_\w+);$", text, re.MULTILINE)
    resets = re.findall(r"if\(rst\) begin\n +(field_storage_\w+) <= ", text)
    assert declared
    assert sorted(declared) == sorted(resets)
    assert set(declared) == set(re.findall(r"\bfield_storage\w*", text))
    for name in declared:
        assert text.count(f"{name} <= ") == 2, f"{name}: reset and one write expected"
    assert not re.search(r"\bi0\b", text)


def test_an_array_of_registers_keeps_its_order() -> None:
    """Element i of an array is element i of the output and has the address of register i."""
    text = (generate_registers() / "fl_foc_regs.sv").read_text()
    for i in range(4):
        name = f"field_storage_gain_{i}_mantissa"
        assert f"assign hwif_out.gain[{i}].mantissa.value = {name};" in text
        assert re.search(rf"decoded_req_is_wr & decoded_reg_strb\.gain\[{i}\]\) {name} <= ", text)
        assert f"decoded_reg_strb.gain[{i}] = cpuif_req_masked & (cpuif_addr == 9'h50 + (9)'({i}) * 9'h4)" in text


@pytest.mark.parametrize("block", REGISTER_BLOCKS)
def test_read_data_are_a_choice_among_different_addresses(block: str) -> None:
    """One case, every readable register in it once: none hides another, as order would decide among equal addresses."""
    text = (generate_registers() / f"fl_{block}_regs.sv").read_text()
    body = text[text.index("case (rd_mux_addr)") : text.index("endcase")]
    found = re.findall(r"^ +\d+'h(\w+)(?: \+ \(\d+\)'\((\d+)\) \* \d+'h(\w+))?: begin$", body, re.MULTILINE)
    addresses = [int(base, 16) + int(index or 0) * int(step or "0", 16) for base, index, step in found]
    assert addresses
    assert len(addresses) == len(set(addresses)) == body.count("begin")
    assert text.count("rd_mux_addr") == 3, "declared, assigned, asked once"


def test_other_output_of_the_generator_is_refused() -> None:
    """Text without the places to rework is an error that says so, not a block that silently stays as it was."""
    with pytest.raises(ValueError, match="register generator's output has changed"):
        gate_with_request("module fl_x_regs;\nendmodule\n")
