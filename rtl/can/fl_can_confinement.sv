// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// CAN fault confinement (ISO 11898-1): error counters and the states error active, error passive, bus-off.
//
// Transmit counter: +8, -1, bus-off from 256. Receive counter: +1, +8, saturates at 255; -1, from above 127 to 119.
// Error passive: a counter above 127. Bus-off ends, with both counters 0, after 128 runs of eleven recessive bits counted
// while recover_i. frozen_i: events do nothing. Latency: 2 clocks.
`default_nettype none
module fl_can_confinement
  import fl_can_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input can_count_t count_i,
    input logic       frozen_i,
    input logic       recover_i,

    output logic [7:0] tec_o,  // what it was before in bus-off
    output logic [7:0] rec_o,
    output logic       warning_o,  // a counter has reached 96
    output logic       passive_o,
    output logic       bus_off_o
);

  logic [7:0] tec_q, rec_q;
  logic [6:0] quiet_q;
  logic bus_off_q;
  can_count_t count_q;

  always_ff @(posedge clk_i) begin
    count_q         <= count_i;
    count_q.quiet11 <= count_i.quiet11 && bus_off_q;
    if (rst_i) count_q <= '0;
  end

  always_ff @(posedge clk_i) begin
    if (bus_off_q) begin
      if (count_q.quiet11 && recover_i) begin
        quiet_q <= quiet_q + 7'd1;
        if (quiet_q == '1) begin
          bus_off_q <= 1'b0;
          tec_q     <= '0;
          rec_q     <= '0;
        end
      end
    end else if (!frozen_i) begin
      quiet_q <= '0;
      if (count_q.tx_add8) begin
        if (tec_q >= 8'd248) bus_off_q <= 1'b1;
        else tec_q <= tec_q + 8'd8;
      end
      if (count_q.tx_less1 && tec_q != '0) tec_q <= tec_q - 8'd1;
      if (count_q.rx_add1 && rec_q != '1) rec_q <= rec_q + 8'd1;
      if (count_q.rx_add8) rec_q <= (rec_q > 8'd247) ? '1 : rec_q + 8'd8;
      if (count_q.rx_less1 && rec_q != '0) rec_q <= rec_q[7] ? 8'd119 : rec_q - 8'd1;
    end
    if (rst_i) begin
      tec_q     <= '0;
      rec_q     <= '0;
      quiet_q   <= '0;
      bus_off_q <= 1'b0;
    end
  end

  assign tec_o     = tec_q;
  assign rec_o     = rec_q;
  assign warning_o = bus_off_q || tec_q >= 8'd96 || rec_q >= 8'd96;
  assign passive_o = tec_q[7] || rec_q[7];
  assign bus_off_o = bus_off_q;

endmodule
`default_nettype wire
