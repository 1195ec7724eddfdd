# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Registers that upsets are drawn from: those that are in a netlist, whatever the Verilated model calls them."""

from __future__ import annotations

from pathlib import Path

from fluxlock.base.paths import RTL
from fluxlock.cosim.chip import build_chip
from fluxlock.cosim.registers import helper_places, modules
from fluxlock.cosim.upsets import read_upset_table, registers_of

INNER = """
module fl_inner #(parameter int unsigned N = 1) (input logic clk_i, a_i, output logic b_o, c_o, d_o);
  logic b_d, seen_q, used_q, was_q; // c_o <= 1
  assign b_d = a_i && used_q;
  assign d_o = b_d;
  always_ff @(posedge clk_i) begin
    b_o <= b_d;
    c_o <= a_i;
    used_q <= a_i;
    seen_q[N] <= a_i;
    if (!a_i) was_q <= 1'b0;
    assert (!was_q || a_i)
    else $error("was_q; used_q");
    assert (!(seen_q[N] && used_q));
  end
endmodule
"""
OUTER = """
module fl_soc (input logic clk_i, a_i, output logic c_o);
  logic b;
  for (genvar i = 0; i < 2; i++) begin : g_all
    fl_inner #(
        .N(int'(i))
    ) u_inner (
        .clk_i,
        .a_i(a_i),
        .b_o(b),
        .c_o,
        .d_o()
    );
  end
  fl_inner u_other (.clk_i, .a_i, .b_o(hwif.b), .c_o(c), .d_o(d));
endmodule
"""
HEADER = """
    CData/*0:0*/ fl_soc__DOT__b;
    CData/*0:0*/ fl_soc__DOT__c;
    CData/*0:0*/ fl_soc__DOT__d;
    SData/*8:0*/ fl_soc__DOT____Vcellout__u_other__b_o;
    CData/*0:0*/ fl_soc__DOT__g_all__BRA__1__KET____DOT__u_inner__DOT__b_d;
    CData/*0:0*/ fl_soc__DOT__g_all__BRA__1__KET____DOT__u_inner__DOT__was_q;
    CData/*1:0*/ fl_soc__DOT__g_all__BRA__1__KET____DOT__u_inner__DOT__seen_q;
    VlWide<3>/*71:0*/ fl_soc__DOT__g_all__BRA__1__KET____DOT__u_inner__DOT__used_q;
    CData/*3:0*/ fl_soc__DOT__u_regs__DOT__field_storage_control;
    VlUnpacked<IData/*31:0*/, 32> fl_soc__DOT__u_ram__DOT__mem_q;
"""
# What only assertions of the safety blocks look at, and what their other registers outside them drive.
HELPERS = {"enabled_q", "shorted_q", "tripped_q", "was_locked_q", "held_q", "ran_q", "permitted_q"}
OUTPUTS = {"locked", "changed", "expired", "wrong", "brake_overload"}


def test_from_text(tmp_path: Path) -> None:
    """Outputs are found by port or net, helpers of assertions are left out, arrays and combinational nets too.

    Verifies: CAMP-06
    """
    files = [tmp_path / "fl_inner.sv", tmp_path / "fl_soc.sv"]
    for file, text in zip(files, (INNER, OUTER), strict=True):
        file.write_text(text)
    assert registers_of(HEADER, files) == {
        "fl_soc__DOT____Vcellout__u_other__b_o": 9,
        "fl_soc__DOT__b": 1,
        "fl_soc__DOT__c": 1,
        "fl_soc__DOT__g_all__BRA__1__KET____DOT__u_inner__DOT__used_q": 72,
        "fl_soc__DOT__u_regs__DOT__field_storage_control": 4,
    }


def test_of_the_chip() -> None:
    """The chip's table holds the outputs of the safety blocks, not the helpers of their assertions.

    Verifies: CAMP-06
    """
    assert {place[-1] for place in helper_places(modules(RTL.glob("*/*.sv")), "fl_soc")} == HELPERS
    table = read_upset_table(build_chip(can=True).executable.parent)
    safety = {name.rpartition("__DOT__")[2] for name in table if name.startswith("fl_soc__DOT__u_safety__DOT__")}
    assert safety >= OUTPUTS and not HELPERS & safety
    assert len(table) > 900 and sum(table.values()) > 15_000
