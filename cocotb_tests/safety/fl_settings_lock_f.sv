// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the lock for all inputs: it closes in the clock after the key and with nothing else, opens with a reset only,
// and tells any single bit that differs from the settings at the closing, and no difference where there is none.
`default_nettype none
module fl_settings_lock_f #(
    parameter int unsigned Width = 8
) (
    input logic             clk_i,
    input logic             rst_i,
    input logic [     15:0] key_i,
    input logic [Width-1:0] settings_i
);

  logic locked, changed;
  fl_settings_lock #(
      .Width(Width)
  ) dut (
      .clk_i,
      .rst_i,
      .key_i,
      .settings_i,
      .locked_o (locked),
      .changed_o(changed)
  );

  logic first = 1'b1;
  logic rst_q, key_q, locked_q;
  logic [Width-1:0] kept_q, settings_q;  // of the clock in which the lock closed; of the last clock
  always_ff @(posedge clk_i) begin
    first      <= 1'b0;
    rst_q      <= rst_i;
    key_q      <= key_i == 16'h10CC;
    locked_q   <= locked;
    settings_q <= settings_i;
    if (!locked) kept_q <= settings_i;
  end

  logic [Width-1:0] flipped;
  assign flipped = kept_q ^ settings_q;

  always_comb begin
    if (first) assume (rst_i);
    else begin
      // Verifies: SAFE-14
      a_reset : assert (!rst_q || (!locked && !changed));
      if (!rst_q) begin
        // Verifies: SAFE-14
        a_closes : assert (locked == (locked_q || key_q));
        if (locked_q) assert (dut.parity_q == (^kept_q));
        // Verifies: SAFE-15
        a_same : assert (!locked_q || flipped != '0 || !changed);
        a_single : assert (!locked_q || flipped == '0 || (flipped & (flipped - 1'b1)) != '0 || changed);
        a_open : assert (locked_q || !changed);
      end
    end
  end

endmodule
`default_nettype wire
