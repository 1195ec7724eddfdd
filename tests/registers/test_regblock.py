"""Register blocks after the rework that lets them rest: a variable a field, nothing missed."""

from __future__ import annotations

import re

import pytest

from fluxlock.build import generate_registers
from fluxlock.paths import REGISTER_BLOCKS
from fluxlock.regblock import gate_with_request


@pytest.mark.parametrize("block", REGISTER_BLOCKS)
def test_every_field_is_a_variable(block: str) -> None:
    """Each field is declared once, reset once and written; no structure holds them, no loop is left."""
    text = (generate_registers() / f"fl_{block}_regs.sv").read_text()
    declared = re.findall(r"^    logic (?:\[\d+:0\] )?(field_storage_\w+);$", text, re.MULTILINE)
    resets = re.findall(r"if\(rst\) begin\n +(field_storage_\w+) <= ", text)
    assert declared
    assert sorted(declared) == sorted(resets)
    assert set(declared) == set(re.findall(r"\bfield_storage\w*", text))
    lanes = written_lanes(text)
    for name in declared:
        writes = 0 if name in lanes else 1
        assert text.count(f"{name} <= ") - lanes.get(name, []).count(None) == 1 + writes, f"{name}: reset and one write"
    assert not re.search(r"\bi0\b", text)


LANE = re.compile(
    r"if\(decoded_wr_biten\[(?P<enable>\d+)\]\) (?P<name>field_storage_\w+)(?:\[(?P<to>[\d:]+)\])? "
    r"<= decoded_wr_data\[(?P<high>\d+):(?P<low>\d+)\];"
)


def written_lanes(text: str) -> dict[str, list[str | None]]:
    """Parts of each field that are written under the enable of one byte lane; None: the whole field."""
    lanes: dict[str, list[str | None]] = {}
    for lane in LANE.finditer(text):
        lanes.setdefault(lane["name"], []).append(lane["to"])
    return lanes


@pytest.mark.parametrize("block", REGISTER_BLOCKS)
def test_a_write_takes_over_whole_lanes(block: str) -> None:
    """Every bit of a field is written once, from its place in the word, under the enable of its own byte."""
    text = (generate_registers() / f"fl_{block}_regs.sv").read_text()
    sizes = {
        name: int(high or 0) + 1
        for high, name in re.findall(r"^    logic (?:\[(\d+):0\] )?(field_storage_\w+);$", text, re.MULTILINE)
    }
    bits: dict[str, dict[int, int]] = {}  # field: bit of the field: bit of the word
    for lane in LANE.finditer(text):
        source = range(int(lane["low"]), int(lane["high"]) + 1)
        first = int((lane["to"] or "0:0").split(":")[1])
        assert int((lane["to"] or "0:0").split(":")[0]) - first + 1 == len(source)
        for i, bit in enumerate(source):
            assert bit // 8 == int(lane["enable"]) // 8
            assert bits.setdefault(lane["name"], {}).setdefault(first + i, bit) == bit
    assert bits or "& ~decoded_wr_biten" in text
    for name, places in bits.items():
        assert sorted(places) == list(range(sizes[name])), f"{name}: bits left out"
        assert len({bit - i for i, bit in places.items()}) == 1, f"{name}: not in order"


def test_an_array_of_registers_keeps_its_order() -> None:
    """Element i of an array is element i of the output and has the address of register i."""
    text = (generate_registers() / "fl_foc_regs.sv").read_text()
    for i in range(4):
        name = f"field_storage_gain_{i}_mantissa"
        assert f"assign hwif_out.gain[{i}].mantissa.value = {name};" in text
        assert re.search(
            rf"decoded_req_is_wr & decoded_reg_strb\.gain\[{i}\]\) begin if\(\S+\) {name}\[7:0\] <= ", text
        )
        assert f"decoded_reg_strb.gain[{i}] = cpuif_req_masked & (cpuif_addr == 9'h50 + (9)'({i}) * 9'h4)" in text


def test_other_output_of_the_generator_is_refused() -> None:
    """Text without the places to rework is an error that says so, not a block that silently stays as it was."""
    with pytest.raises(ValueError, match="register generator's output has changed"):
        gate_with_request("module fl_x_regs;\nendmodule\n")
