// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Makes one fault level for the protection out of what can go wrong with the converters.
//
// cause_o, bit 0: a channel of the last frame was bad; bit 1: a conversion was asked for and not made (its sample would
// carry the wrong time). Both hold until a frame without a bad channel. fault_o = any cause. Frames that stay away are the
// chip's to see (fl_safety_wb).
//
// Latency: one clock from valid_i or missed_i to fault_o.
// seen_o: causes since reset, for indicators.
`default_nettype none
module fl_adc_fault #(
    parameter int unsigned Channels = 9
) (
    input logic clk_i,
    input logic rst_i,

    input  logic                valid_i,
    input  logic [Channels-1:0] bad_i,     // with valid_i
    input  logic                missed_i,
    output logic                fault_o,
    output logic [         1:0] cause_o,
    output logic [         1:0] seen_o
);

  logic bad_q, missed_q;
  logic [1:0] seen_q;

  always_ff @(posedge clk_i) begin
    if (valid_i) bad_q <= bad_i != '0;
    missed_q <= missed_i || (missed_q && !(valid_i && bad_i == '0));
    seen_q   <= seen_q | cause_o;
    if (rst_i) begin
      bad_q    <= 1'b0;
      missed_q <= 1'b0;
      seen_q   <= '0;
    end
  end

  assign cause_o = {missed_q, bad_q};
  assign fault_o = cause_o != '0;
  assign seen_o  = seen_q;

endmodule
`default_nettype wire
