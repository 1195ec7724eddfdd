// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// A level that an asynchronous input clears without a clock, and that comes back with the clock.
//
// ok_o falls as soon as clear_i is high, however short, whether clk_i runs or not. It rises with clock edge Stages after
// clear_i has fallen, counting from the first edge with ok_i high; an edge with ok_i low starts no count, and lowers ok_o
// Stages edges later.
// With two stages or more ok_o may be used in the clock domain: the first one may be metastable when clear_i ends, the
// last one is not. Its fall is asynchronous: what takes it in the domain bears that, or is cleared by it too.
//
// These flip-flops and fl_pll_reset's are the only ones with an asynchronous control.
// Asserted: nothing; its properties hold without a clock, which an assertion needs.
`default_nettype none
module fl_async_clear #(
    parameter int unsigned Stages = 2
) (
    input  logic clk_i,
    input  logic clear_i,  // asynchronous
    input  logic ok_i,
    output logic ok_o
);

  if (Stages == 0) begin : gen_illegal
    $fatal(1, "fl_async_clear: Stages must be at least 1 (%m)");
  end

  (* async_reg = "true" *) logic [Stages-1:0] stage_q = '0;

  always_ff @(posedge clk_i or posedge clear_i) begin
    if (clear_i) stage_q <= '0;
    else stage_q <= Stages'({stage_q, ok_i});
  end

  assign ok_o = stage_q[Stages-1];

endmodule
`default_nettype wire
