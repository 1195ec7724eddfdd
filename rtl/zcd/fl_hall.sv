// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Hall sensors: three inputs, glitch filter, sector, edges with the time at which they happened.
//
// code = {C, B, A} behind two flip-flops each. A code counts when it has been stable for cfg_filter_i clocks; its edge
// happened when that began, so the stamp is this clock less filter and synchronisers: the clock in which the
// pin changed. Bouncing puts the edge at the last bounce.
//
// cfg_map_i names the sector to drive for positive speed, 0..5 = I..VI, above 5: invalid code. For negative speed
// (reverse_i, live) it is sector + 3 modulo 6. A valid code that is not the last valid one is an edge: valid_o pulses;
// time_o, backward_o (position counts down) and single_o (a neighbour of the last valid code: exactly one edge) come with
// it and stay; sector_o is that of the last valid code. phase_o[sector_o] is the time from the last crossing
// to the edge, saturating, all ones until there is one and where the last edge was no single one.
//
// invalid_o counts changes to an invalid code, skipped_o edges that are no single ones (after the first); they wrap.
// Settings act at once; a new map acts on the next code. Latency: pin to valid_o cfg_filter_i (at least 1) + Latency clocks.
`default_nettype none
module fl_hall
  import fl_pkg::*;
#(
    localparam int unsigned Latency = 3  // and the filter
) (
    input logic               clk_i,
    input logic               rst_i,
    input stamp_t             now_i,
    input logic   [ 2:0]      hall_i,        // pins, asynchronous
    input logic   [15:0]      cfg_filter_i,  // clocks, 0 counts as 1
    input logic   [ 7:0][2:0] cfg_map_i,     // sector of a code
    input logic               reverse_i,
    input logic               zc_valid_i,
    input stamp_t             zc_time_i,

    output logic                 valid_o,
    output logic                 invalid_event_o,  // pulse
    output stamp_t               time_o,
    output sector_t              position_o,       // sector for positive speed
    output sector_t              sector_o,         // sector to drive
    output logic                 backward_o,
    output logic                 single_o,
    output logic                 ok_o,             // the present code is valid
    output logic                 moved_o,          // there was an edge
    output logic    [ 2:0]       code_o,
    output logic    [ 2:0]       raw_o,
    output logic    [15:0]       edges_o,
    output logic    [ 7:0]       invalid_o,
    output logic    [ 7:0]       skipped_o,
    output logic    [ 5:0][23:0] phase_o           // clocks
);

  logic [2:0] pin, pin_q;

  for (genvar i = 0; i < 3; i++) begin : g_pin
    fl_sync u_sync (
        .clk_i,
        .rst_i,
        .async_i(hall_i[i]),
        .sync_o (pin[i])
    );
  end

  // Filter: clocks for which the pins have shown the same code.
  logic [15:0] stable_q;
  logic changed, accept, settled_q;  // settled: the present code has been looked at
  logic [2:0] started_q;  // the pins have come through since the reset
  logic [2:0] code_q;

  assign changed = pin != pin_q;
  assign accept  = started_q[2] && !changed && !settled_q && (stable_q >= cfg_filter_i || cfg_filter_i <= 16'd1);

  // Decode.
  logic seen_q, have_position_q, ok_q, is_valid, new_code;
  sector_t position_d, position_q;  // sector for positive speed
  logic forward_step, backward_step;

  assign position_d    = cfg_map_i[pin_q];
  assign is_valid      = position_d < 3'd6;
  assign new_code      = !seen_q || pin_q != code_q;
  assign forward_step  = have_position_q && position_d == sector_after(position_q, 1'b0);
  assign backward_step = have_position_q && position_q == sector_after(position_d, 1'b0);

  // Phase against the last crossing.
  stamp_t zc_time_q, distance;
  logic have_zc_q;
  assign distance = time_o - zc_time_q;

  always_ff @(posedge clk_i) begin
    pin_q           <= pin;
    started_q       <= {started_q[1:0], 1'b1};
    valid_o         <= 1'b0;
    invalid_event_o <= 1'b0;
    if (changed) begin
      stable_q  <= 16'd1;
      settled_q <= 1'b0;
    end else if (stable_q != '1) begin
      stable_q <= stable_q + 16'd1;
    end
    if (accept) begin
      settled_q <= 1'b1;
      seen_q    <= 1'b1;
      code_q    <= pin_q;
      ok_q      <= is_valid;
      if (!is_valid && new_code) begin
        invalid_event_o <= 1'b1;
        invalid_o       <= invalid_o + 8'd1;
      end
      if (is_valid && (!have_position_q || position_d != position_q)) begin
        valid_o         <= 1'b1;
        have_position_q <= 1'b1;
        position_q      <= position_d;
        // stable_q is 1 three clocks after the pin changed.
        time_o          <= now_i - stamp_t'(stable_q) - stamp_t'(Latency - 1);
        backward_o      <= backward_step;
        single_o        <= forward_step || backward_step;
        edges_o         <= edges_o + 16'd1;
        moved_o         <= moved_o || have_position_q;
        if (have_position_q && !forward_step && !backward_step) skipped_o <= skipped_o + 8'd1;
      end
    end
    if (zc_valid_i) begin
      zc_time_q <= zc_time_i;
      have_zc_q <= 1'b1;
    end
    if (valid_o) begin
      phase_o[sector_o] <= (single_o && have_zc_q && distance[31:24] == '0) ? distance[23:0] : '1;
    end
    if (rst_i) begin
      pin_q           <= '0;
      stable_q        <= '0;
      settled_q       <= 1'b0;
      started_q       <= '0;
      seen_q          <= 1'b0;
      code_q          <= '0;
      ok_q            <= 1'b0;
      have_position_q <= 1'b0;
      position_q      <= '0;
      have_zc_q       <= 1'b0;
      valid_o         <= 1'b0;
      invalid_event_o <= 1'b0;
      time_o          <= '0;
      backward_o      <= 1'b0;
      single_o        <= 1'b0;
      moved_o         <= 1'b0;
      edges_o         <= '0;
      invalid_o       <= '0;
      skipped_o       <= '0;
      phase_o         <= '1;
    end
  end

  assign position_o = position_q;
  assign sector_o   = reverse_i ? opposite_sector(position_q) : position_q;
  assign ok_o       = ok_q;
  assign code_o     = code_q;
  assign raw_o      = pin;

endmodule
`default_nettype wire
