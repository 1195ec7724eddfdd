// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Watchdog of the control step: gates may stay on only while the firmware counts its steps aloud.
//
// While enable_i is high, the control step reports its number, one more than the last one, at least once in cfg_cycles_i
// clocks. A handler that hangs reports nothing, one that goes round in itself reports the same number again: both raise
// the fault. The number counts modulo 256; while enable_i is low any number is taken as the last one.
//
// Input: feed_i pulse with step_i. cfg_cycles_i = 0: off, no fault and the numbers do not count.
// Latency: wrong_o is high in the clock after the wrong number; expired_o is high from cfg_cycles_i clocks after the last
// right number, or after enable_i rose, on. Both hold while enable_i is high and end in the clock after it has fallen.
// Asserted: no fault without enable_i in the clock before. Proved for all inputs: cocotb_tests/safety/fl_watchdog.sby.
`default_nettype none
module fl_watchdog #(
    parameter int unsigned Width = 24  // bits of the period
) (
    input  logic             clk_i,
    input  logic             rst_i,
    input  logic             enable_i,      // the guard's enable bit
    input  logic [Width-1:0] cfg_cycles_i,  // clocks, 0: off
    input  logic             feed_i,        // pulse
    input  logic [      7:0] step_i,        // with feed_i
    output logic             expired_o,
    output logic             wrong_o
);

  if (Width == 0) begin : gen_illegal
    $fatal(1, "fl_watchdog: Width must be at least 1 (%m)");
  end

  logic [7:0] last_q;
  logic [Width-1:0] wait_q;  // clocks since the last right number
  logic running, right;

  assign running = enable_i && cfg_cycles_i != '0;
  assign right   = feed_i && step_i == last_q + 8'd1;

  always_ff @(posedge clk_i) begin
    expired_o <= running && (expired_o || wait_q >= cfg_cycles_i - Width'(1));
    wrong_o   <= running && (wrong_o || (feed_i && !right));
    if (feed_i) last_q <= step_i;
    if (!running || right) wait_q <= '0;
    else if (wait_q != '1) wait_q <= wait_q + Width'(1);
    if (rst_i) begin
      expired_o <= 1'b0;
      wrong_o   <= 1'b0;
      last_q    <= '0;
      wait_q    <= '0;
    end
  end

  logic ran_q;
  always_ff @(posedge clk_i) begin
    ran_q <= running && !rst_i;
    if (!rst_i) begin
      assert (ran_q || !(expired_o || wrong_o))
      else $error("fl_watchdog: fault of a watchdog that does not run");
    end
  end

endmodule
`default_nettype wire
