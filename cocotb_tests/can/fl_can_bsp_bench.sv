// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Bit stream processor with fault confinement, a sampled bit every four clocks; what is compared in one word.
`default_nettype none
module fl_can_bsp_bench
  import fl_can_pkg::*;
(
    input  logic       clk_i,
    input  logic       rst_i,
    input  logic       loopback_i,
    input  logic       recover_i,
    input  logic       bit_i,
    input  logic       tx_request_i,
    input  can_frame_t tx_frame_i,
    output can_frame_t rx_frame_o,
    output logic [31:0] view_o
);
  logic [1:0] phase_q;
  logic sample, tx, hard, warning, passive, bus_off, tx_start, tx_sent, tx_stop, sof, rx_valid;
  logic sent_q, valid_q;
  logic [7:0] tec, rec;
  can_error_e error, error_q;
  can_count_t count;

  assign sample = phase_q == 2'd3;

  fl_can_bsp u_bsp (
      .clk_i,
      .rst_i,
      .enable_i  (1'b1),
      .loopback_i,
      .sample_i  (sample),
      .bit_i,
      .tx_o      (tx),
      .hard_o    (hard),
      .passive_i (passive),
      .bus_off_i (bus_off),
      .tx_request_i,
      .tx_frame_i,
      .tx_start_o(tx_start),
      .tx_sent_o (tx_sent),
      .tx_stop_o (tx_stop),
      .sof_o     (sof),
      .rx_valid_o(rx_valid),
      .rx_frame_o,
      .error_o   (error),
      .count_o   (count)
  );

  fl_can_confinement u_confinement (
      .clk_i,
      .rst_i,
      .count_i  (count),
      .frozen_i (1'b0),
      .recover_i,
      .tec_o    (tec),
      .rec_o    (rec),
      .warning_o(warning),
      .passive_o(passive),
      .bus_off_o(bus_off)
  );

  always_ff @(posedge clk_i) begin
    phase_q <= rst_i ? '0 : phase_q + 2'd1;
    if (sample) {sent_q, valid_q, error_q} <= {tx_sent, rx_valid, error};
    if (rst_i) {sent_q, valid_q, error_q} <= {1'b0, 1'b0, CanNone};
  end

  assign view_o = {6'd0, warning, sent_q, valid_q, error_q, tec, rec, bus_off, passive, hard, tx};

endmodule
`default_nettype wire
