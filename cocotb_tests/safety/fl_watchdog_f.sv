// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the watchdog for all inputs and every period, which may change in any clock: without a right number for the
// period it has expired, a number that does not follow the last one is wrong in the next clock, both hold while it runs,
// and a handler that repeats one number cannot hold it off.
//
// The time without a right number is counted here too, with more bits than a period has. The invariants tie the block's
// count and last number to the monitors, so that induction closes at once, however long the period is.
`default_nettype none
module fl_watchdog_f (
    input logic        clk_i,
    input logic        rst_i,
    input logic        enable_i,
    input logic [23:0] cfg_cycles_i,
    input logic        feed_i,
    input logic [ 7:0] step_i
);

  logic expired, wrong;
  fl_watchdog dut (
      .clk_i,
      .rst_i,
      .enable_i,
      .cfg_cycles_i,
      .feed_i,
      .step_i,
      .expired_o(expired),
      .wrong_o  (wrong)
  );

  logic first = 1'b1;
  logic ran_q, expired_q, wrong_q, fed_q, due_q;
  logic [7:0] told_q, told_before_q;
  logic [31:0] quiet_q;  // clocks before this one, in a row: running, no right number; saturates
  logic running, right;
  assign running = enable_i && cfg_cycles_i != '0 && !rst_i;
  assign right   = feed_i && step_i == told_q + 8'd1;

  always_ff @(posedge clk_i) begin
    first     <= 1'b0;
    ran_q     <= running;
    expired_q <= expired;
    wrong_q   <= wrong;
    fed_q     <= feed_i;
    if (rst_i) told_q <= '0;
    else if (feed_i) told_q <= step_i;
    told_before_q <= told_q;
    if (!running || right) quiet_q <= '0;
    else if (quiet_q != '1) quiet_q <= quiet_q + 32'd1;
    // Every clock of the period but its last one: a right number in that one comes too late.
    due_q <= quiet_q + 32'd1 >= {8'b0, cfg_cycles_i};
  end

  always_comb begin
    if (first) assume (rst_i);
    else begin
      // Verifies: SAFE-13
      a_stopped : assert (ran_q || !(expired || wrong));
      if (ran_q) begin
        // Verifies: SAFE-13
        a_expires : assert (expired == (expired_q || due_q));
        a_holds : assert ((!expired_q || expired) && (!wrong_q || wrong));
        a_repeated : assert (!fed_q || told_q != told_before_q || wrong);
        a_wrong : assert (wrong_q || wrong == (fed_q && told_q != told_before_q + 8'd1));
      end

      // Invariants.
      // Verifies: SAFE-13
      a_last : assert (dut.last_q == told_q);
      assert ({8'b0, dut.wait_q} == (quiet_q < 32'hFF_FFFF ? quiet_q : 32'hFF_FFFF));
    end
  end

endmodule
`default_nettype wire
