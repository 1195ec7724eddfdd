// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Lock of the settings that protection rests on: once the key has been there they hold until reset, and are watched.
//
// locked_o rises in the clock after key_i was Key, and only a reset ends it; whoever owns the registers refuses writes
// while it is high. From then on the parity of settings_i is compared with what it was when the lock closed: a single
// bit that changes in them, by an upset or a broken lock, raises changed_o in the next clock, for as long as it differs.
//
// Latency: 1 clock. Asserted: locked_o does not fall without a reset. Proved: cocotb_tests/safety/fl_settings_lock.sby.
`default_nettype none
module fl_settings_lock #(
    parameter int unsigned Width = 32,
    parameter logic [15:0] Key   = 16'h10CC
) (
    input  logic             clk_i,
    input  logic             rst_i,
    input  logic [     15:0] key_i,
    input  logic [Width-1:0] settings_i,
    output logic             locked_o,
    output logic             changed_o
);

  if (Width == 0) begin : gen_illegal
    $fatal(1, "fl_settings_lock: Width must be at least 1 (%m)");
  end

  logic parity_q;
  always_ff @(posedge clk_i) begin
    if (key_i == Key) locked_o <= 1'b1;
    if (!locked_o) parity_q <= ^settings_i;
    changed_o <= locked_o && (^settings_i) != parity_q;
    if (rst_i) begin
      locked_o  <= 1'b0;
      changed_o <= 1'b0;
    end
  end

  logic was_locked_q;
  always_ff @(posedge clk_i) begin
    was_locked_q <= locked_o && !rst_i;
    if (!rst_i) begin
      assert (!was_locked_q || locked_o)
      else $error("fl_settings_lock: opened without a reset");
    end
  end

endmodule
`default_nettype wire
