// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the encoder's decoder for all inputs: the position stays in the turn and moves by at most one quarter a clock,
// by one exactly when one track has changed; both tracks at once are counted and move nothing; without Z nothing else does.
`default_nettype none
module fl_encoder_f (
    input logic        clk_i,
    input logic        rst_i,
    input logic [ 2:0] encoder_i,
    input logic [ 7:0] cfg_filter_i,
    input logic [17:0] cfg_last_i,
    input logic        cfg_index_i
);

  logic [17:0] position_o;
  logic indexed_o, backward_o;
  logic [2:0] raw_o, level_o;
  logic [15:0] invalid_o, strayed_o;

  fl_encoder dut (.*);

  logic first = 1'b1;
  logic ready_q, index_q;
  logic [2:0] level_q, level2_q;  // of the last clock and of the one before
  logic [17:0] position_q, last_q, forward, back;
  logic [15:0] invalid_q;
  logic a_changed, b_changed;

  assign forward   = (position_q == cfg_last_i) ? '0 : position_q + 18'd1;
  assign back      = (position_q == '0) ? cfg_last_i : position_q - 18'd1;
  assign a_changed = level_q[0] != level2_q[0];
  assign b_changed = level_q[1] != level2_q[1];

  always_ff @(posedge clk_i) begin
    first      <= 1'b0;
    ready_q    <= dut.ready && !rst_i;
    index_q    <= cfg_index_i;
    level_q    <= level_o;
    level2_q   <= level_q;
    position_q <= position_o;
    invalid_q  <= invalid_o;
    last_q     <= cfg_last_i;
  end

  always_comb begin
    // Whole lines, the same all the time.
    assume (cfg_last_i[1:0] == 2'd3);
    assume (first || cfg_last_i == last_q);
    if (first)
      assume (rst_i);
      else begin
        // Verifies: ENC-04
        a_in_the_turn : assert (position_o <= cfg_last_i);
        if (ready_q) begin
          assert (dut.quarter_q == {!level_q[0], level_q[0] == level_q[1]});
          assert (dut.z_q == level_q[2]);
          // Z of the clock before last, seen in the quarter of then.
          if (!(index_q && level2_q[2] && level2_q[0] && !level2_q[1])) begin
            // Verifies: ENC-04
            if (a_changed && b_changed) a_lost_step_counts : assert (invalid_o == 16'(invalid_q + 16'd1));
            else a_good_step_does_not : assert (invalid_o == invalid_q);
            if (a_changed == b_changed) a_still : assert (position_o == position_q);
            else a_one_quarter : assert (position_o == ((a_changed ^ level_q[0] ^ level_q[1]) ? back : forward));
          end
        end
      end
  end

endmodule
`default_nettype wire
