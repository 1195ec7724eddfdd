// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Incremental encoder: tracks A and B, index Z, glitch filter, quadrature decoder, position in the mechanical turn.
//
// Quarters 0, 1, 2, 3 of a line show A = 1 1 0 0 and B = 0 1 1 0: A leads B at positive speed. Each pin passes a
// synchroniser; a level counts when it has lasted cfg_filter_i clocks. The position counts quarters, 0..cfg_last_i, and
// goes round. Both tracks changing at once is no step of a rotor: the position stays, invalid_o counts.
// Z is high in quarter 0 of the turn: while it is in a quarter 0 with cfg_index_i, the position there is 0. indexed_o: it
// has been so since reset; from then on a Z at another position counts in strayed_o. The counters wrap.
// For 512 clocks after reset the pins only set the quarter.
// Latency: pin to position_o cfg_filter_i (at least 1) + Latency clocks. Tracks closer than cfg_filter_i are one change.
`default_nettype none
module fl_encoder #(
    localparam int unsigned Latency = 3  // and the filter
) (
    input logic        clk_i,
    input logic        rst_i,
    input logic [ 2:0] encoder_i,     // pins Z, B, A, asynchronous
    input logic [ 7:0] cfg_filter_i,  // clocks, 0 counts as 1
    input logic [17:0] cfg_last_i,    // quarters a turn less 1; lines * 4 - 1
    input logic        cfg_index_i,   // Z sets the position

    output logic [17:0] position_o,  // quarters
    output logic        indexed_o,
    output logic        backward_o,  // direction of the last step
    output logic [ 2:0] raw_o,       // pins before the filter
    output logic [ 2:0] level_o,     // and after it
    output logic [15:0] invalid_o,
    output logic [15:0] strayed_o
);

  // Filters.
  logic [2:0] pin, level_q;
  logic [2:0][7:0] differs_q;  // clocks for which a pin has differed from its level
  logic [9:0] reset_count_q;
  logic ready;

  assign ready = reset_count_q[9];

  for (genvar i = 0; i < 3; i++) begin : g_pin
    fl_sync u_sync (
        .clk_i,
        .rst_i,
        .async_i(encoder_i[i]),
        .sync_o (pin[i])
    );

    always_ff @(posedge clk_i) begin
      differs_q[i] <= (pin[i] == level_q[i]) ? '0 : differs_q[i] + 8'd1;
      if (pin[i] != level_q[i] && (!ready || cfg_filter_i <= 8'd1 || differs_q[i] >= cfg_filter_i - 8'd1)) begin
        level_q[i]   <= pin[i];
        differs_q[i] <= '0;
      end
      if (rst_i) begin
        level_q[i]   <= 1'b0;
        differs_q[i] <= '0;
      end
    end
  end

  // Steps.
  logic [1:0] quarter, quarter_q, step;
  logic [17:0] here, position_d, position_q;
  logic z_q, at_index, indexed_q, backward_q;
  logic [15:0] invalid_q, strayed_q;

  assign quarter  = {!level_q[0], level_q[0] == level_q[1]};
  assign step     = quarter - quarter_q;
  assign at_index = cfg_index_i && ready && z_q && quarter_q == 2'd0;
  assign here     = at_index ? '0 : position_q;

  always_comb begin
    position_d = here;
    if (ready && step == 2'd1) position_d = (here >= cfg_last_i) ? '0 : here + 18'd1;
    if (ready && step == 2'd3) position_d = (here == '0) ? cfg_last_i : here - 18'd1;
  end

  always_ff @(posedge clk_i) begin
    if (!ready) reset_count_q <= reset_count_q + 10'd1;
    quarter_q  <= quarter;
    z_q        <= level_q[2];
    position_q <= position_d;
    if (ready && step[0]) backward_q <= step[1];
    if (ready && step == 2'd2) invalid_q <= invalid_q + 16'd1;
    if (at_index) begin
      indexed_q <= 1'b1;
      if (indexed_q && position_q != '0) strayed_q <= strayed_q + 16'd1;
    end
    if (rst_i) begin
      reset_count_q <= '0;
      quarter_q     <= '0;
      z_q           <= 1'b0;
      position_q    <= '0;
      indexed_q     <= 1'b0;
      backward_q    <= 1'b0;
      invalid_q     <= '0;
      strayed_q     <= '0;
    end
  end

  assign position_o = position_q;
  assign indexed_o  = indexed_q;
  assign backward_o = backward_q;
  assign raw_o      = pin;
  assign level_o    = level_q;
  assign invalid_o  = invalid_q;
  assign strayed_o  = strayed_q;

endmodule
`default_nettype wire
