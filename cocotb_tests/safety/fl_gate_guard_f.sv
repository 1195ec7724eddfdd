// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the gate guard for all inputs, with the dead time free to change in every clock, for every polarity of the pins
// (a task each). Gates are taken from the pins: on is the level that the polarity makes of it.
//
// Monitors of each leg know nothing of the guard's state: how long each gate has been off and which dead time held when
// it was last on. The invariants at the end only tie these monitors to the guard's registers, so that induction closes.
`default_nettype none
module fl_gate_guard_f #(
    parameter int unsigned Phases        = 3,
    parameter bit          HighActiveLow = 1'b0,
    parameter bit          LowActiveLow  = 1'b0
) (
    input logic              clk_i,
    input logic              rst_i,
    input logic              enable_i,
    input logic [       9:0] dead_time_i,
    input logic              trip_i,
    input logic              short_i,
    input logic [Phases-1:0] req_h_i,
    input logic [Phases-1:0] req_l_i
);

  logic [Phases-1:0] gate_h_o, gate_l_o;
  logic [2*Phases-1:0] gate_o;

  fl_gate_guard #(
      .Phases       (Phases),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow)
  ) dut (
      .*
  );

  // What a leg waits after a reset: the longest dead time.
  localparam logic [9:0] ResetWait = 10'd1023;

  logic first = 1'b1;
  logic rst_q, allowed_q, shorted_q, tripped_q;
  logic [Phases-1:0] req_h_q, req_l_q;
  always_ff @(posedge clk_i) begin
    first     <= 1'b0;
    rst_q     <= rst_i;
    allowed_q <= enable_i && !trip_i && !rst_i;
    shorted_q <= trip_i && short_i && !rst_i;
    tripped_q <= trip_i;
    req_h_q   <= req_h_i;
    req_l_q   <= req_l_i;
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        // Verifies: SAFE-03, SAFE-05
        a_reset_h : assert (!rst_q || gate_h_o == {Phases{HighActiveLow}});
        a_reset_l : assert (!rst_q || gate_l_o == {Phases{LowActiveLow}});
      end
  end

  for (genvar x = 0; x < Phases; x++) begin : gen_leg
    logic h, l, h_q, l_q;
    assign h = gate_h_o[x] ^ HighActiveLow;
    assign l = gate_l_o[x] ^ LowActiveLow;
    // Clocks that each gate has been off before this one, and the dead time that its last on-clock saw.
    logic [10:0] off_h, off_l;
    logic [9:0] need_h, need_l;
    always_ff @(posedge clk_i) begin
      h_q   <= h;
      l_q   <= l;
      off_h <= h ? '0 : (&off_h ? off_h : off_h + 11'd1);
      off_l <= l ? '0 : (&off_l ? off_l : off_l + 11'd1);
      if (h) need_h <= (dead_time_i < 10'd2) ? 10'd2 : dead_time_i;
      if (l) need_l <= (dead_time_i < 10'd2) ? 10'd2 : dead_time_i;
      if (rst_i) begin
        off_h  <= '0;
        off_l  <= '0;
        need_h <= ResetWait;
        need_l <= ResetWait;
      end
    end

    always_comb begin
      if (!first) begin
        // Verifies: SAFE-01
        a_never_both : assert (!(h && l));
        // Verifies: SAFE-02
        if (h && !h_q) a_gap_h : assert (off_l >= 11'(need_l));
        if (l && !l_q) a_gap_l : assert (off_h >= 11'(need_h));
        // Verifies: SAFE-03
        if (!allowed_q && !shorted_q) a_off : assert (!h && !l);
        if (tripped_q) a_trip_h : assert (!h);
        // Verifies: SAFE-04
        if (!req_h_q[x] || req_l_q[x]) a_off_h : assert (!h);
        if ((!req_l_q[x] || req_h_q[x]) && !shorted_q) a_off_l : assert (!l);
        // As soon as the dead time is over, not later (off_* already counts the clock in which it is on).
        // Verifies: SAFE-02
        if (allowed_q && req_h_q[x] && !req_l_q[x] && !l_q && off_l >= 11'(need_l)) a_on_h : assert (h);
        if (allowed_q && req_l_q[x] && !req_h_q[x] && !h_q && off_h >= 11'(need_h)) a_on_l : assert (l);
        // Verifies: SAFE-19
        if (shorted_q && !h_q && off_h >= 11'(need_h)) a_short_l : assert (l);
        // Verifies: SAFE-05
        a_told_h : assert (gate_o[2*x] == h);
        a_told_l : assert (gate_o[2*x+1] == l);

        // Invariants.
        if (h) assert (off_l >= 11'(need_l));
        if (l) assert (off_h >= 11'(need_h));
        if (!l && !dut.block_h_q[x]) assert (off_l >= 11'(need_l));
        if (!h && !dut.block_l_q[x]) assert (off_h >= 11'(need_h));
        if (!h && !l && dut.block_h_q[x]) assert (12'(off_l) + 12'(dut.wait_q[x]) >= 12'(need_l));
        if (!h && !l && dut.block_l_q[x]) assert (12'(off_h) + 12'(dut.wait_q[x]) >= 12'(need_h));
        if (!h && !l && dut.block_h_q[x] && dut.wait_q[x] != '0)
          assert (12'(off_l) + 12'(dut.wait_q[x]) == 12'(need_l));
        if (!h && !l && dut.block_l_q[x] && dut.wait_q[x] != '0)
          assert (12'(off_h) + 12'(dut.wait_q[x]) == 12'(need_h));
        if (h && dut.block_h_q[x]) assert (dut.wait_q[x] == '0);
        if (l && dut.block_l_q[x]) assert (dut.wait_q[x] == '0);
      end
    end
  end

endmodule
`default_nettype wire
