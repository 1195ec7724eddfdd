// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the clock monitor for every beat and every hold: bad_o rises exactly when two toggles are fewer than
// LeastCycles clocks apart or none comes within MostCycles, and then stays until the hold. It is bad from configuration on.
//
// The clocks since the last toggle are counted here too, without the block's limits, from the levels at its pins two edges
// ago. The invariants tie the block's registers to these, so that induction closes.
`default_nettype none
module fl_clock_monitor_f #(
    parameter int unsigned LeastCycles = 3,
    parameter int unsigned MostCycles  = 6
) (
    input logic clk_i,
    input logic hold_i,
    input logic beat_i
);

  logic beat_o, bad_o;
  fl_clock_monitor #(
      .BeatCycles (4),
      .LeastCycles(LeastCycles),
      .MostCycles (MostCycles)
  ) dut (
      .*
  );

  // Levels that edges have seen, the newest in bit 0; old_q: edges since the beginning.
  logic [2:0] beats_q, holds_q;
  logic [1:0] old_q = '0;
  logic held_once_q = 1'b0;
  logic bad_q, beat_before_q, begun_q;
  logic [7:0] gap_q;  // edges since the last toggle or hold that acted, saturates
  logic [7:0] own_q = '0;  // edges since beat_o toggled
  logic toggle, hold, fast, slow;
  assign toggle = beats_q[1] != beats_q[2];
  assign hold   = holds_q[1];
  assign fast   = toggle && begun_q && gap_q + 8'd1 < 8'(LeastCycles);
  assign slow   = !toggle && gap_q + 8'd1 >= 8'(MostCycles);

  logic fast_q, slow_q, hold_q;
  always_ff @(posedge clk_i) begin
    beats_q <= {beats_q[1:0], beat_i};
    holds_q <= {holds_q[1:0], hold_i};
    if (old_q != '1) old_q <= old_q + 2'd1;
    bad_q  <= bad_o;
    fast_q <= fast && !hold;
    slow_q <= slow && !hold;
    hold_q <= hold;
    if (old_q >= 2'd2 && hold) held_once_q <= 1'b1;
    if (hold) begin
      gap_q   <= '0;
      begun_q <= 1'b0;
    end else begin
      gap_q   <= toggle ? '0 : (gap_q == '1) ? gap_q : gap_q + 8'd1;
      begun_q <= begun_q || toggle;
    end
    beat_before_q <= beat_o;
    own_q         <= (old_q == '0 || beat_o != beat_before_q) ? 8'd1 : own_q + 8'd1;
  end

  always_comb begin
    // Flip-flops without a value of their own are 0 after configuration.
    if (old_q == '0) assume (!dut.u_hold.meta_q && !dut.u_hold.sync_q);

    // Verifies: CLK-01
    a_configured : assert (held_once_q || bad_o);
    if (old_q == '1 && held_once_q) begin
      a_hold : assert (!hold_q || !bad_o);
      a_keeps : assert (!bad_q || hold_q || bad_o);
      a_fast : assert (!fast_q || bad_o);
      a_slow : assert (!slow_q || bad_o);
      a_good : assert (bad_q || fast_q || slow_q || !bad_o);
    end
    a_beat : assert (own_q <= 8'd4);
    a_beat_not_early : assert (old_q < 2'd2 || beat_o == beat_before_q || own_q == 8'd4);

    // Invariants.
    if (old_q == 2'd1) assert (!dut.hold);
    if (old_q >= 2'd1) assert (dut.u_beat.meta_q == beats_q[0] && dut.u_hold.meta_q == holds_q[0]);
    if (old_q >= 2'd2) assert (dut.beat == beats_q[1] && dut.hold == holds_q[1]);
    if (old_q >= 2'd3) assert (dut.beat_q == beats_q[2]);
    assert (!held_once_q || old_q == '1);
    if (held_once_q) begin
      assert (dut.begun_q == begun_q);
      assert (8'(dut.count_q) == (gap_q < 8'(MostCycles - 1) ? gap_q : 8'(MostCycles - 1)));
      assert (bad_o || gap_q <= 8'(MostCycles - 1));
    end
    if (old_q == '0) assert (dut.divider_q == '0 && bad_o);
    else begin
      assert (own_q == ((dut.divider_q[1:0] == 2'd0) ? 8'd4 : 8'(dut.divider_q[1:0])));
      assert ((beat_o != beat_before_q) == (dut.divider_q[1:0] == 2'd0));
    end
  end

endmodule
`default_nettype wire
