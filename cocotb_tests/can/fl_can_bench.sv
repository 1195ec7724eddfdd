// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Two controllers with one set of frame lines; a strobe each. Frames on either as they are taken from the FIFO.
`default_nettype none
module fl_can_bench
  import fl_can_pkg::*;
(
    input  logic              clk_i,
    input  logic              rst_i,
    input  logic        [1:0] rx_i,
    output logic        [1:0] tx_o,
    input  logic        [1:0] enable_i,
    input  logic        [1:0] listen_i,
    input  logic        [1:0] loopback_i,
    input  can_timing_t       timing_i,
    input  can_filter_t [7:0] filter_i,
    input  logic        [5:0] put_i,
    input  can_frame_t        put_frame_i,
    input  logic        [1:0] put_priority_i,
    input  logic        [5:0] abort_i,
    output logic        [5:0] pending_o,
    output logic        [5:0] sent_o,
    output logic        [5:0] aborted_o,
    output logic        [5:0] refused_o,
    input  logic        [1:0] rx_pop_i,
    output logic        [1:0] rx_valid_o,
    output can_entry_t  [1:0] rx_entry_o,
    output logic        [1:0] rx_event_o,
    output logic        [1:0] rx_overrun_o,
    output logic   [1:0][7:0] rx_lost_count_o,
    output logic   [1:0][2:0] error_o,
    output logic  [1:0][15:0] counts_o,  // receive above transmit counter
    output logic   [1:0][2:0] state_o    // bus-off, passive, warning
);
  logic [31:0] now_q;
  always_ff @(posedge clk_i) now_q <= rst_i ? '0 : now_q + 32'd1;

  for (genvar x = 0; x < 2; x++) begin : g_can
    can_error_e error;
    assign error_o[x] = error;
    fl_can u_can (
        .clk_i,
        .rst_i,
        .now_i          (now_q),
        .rx_i           (rx_i[x]),
        .tx_o           (tx_o[x]),
        .enable_i       (enable_i[x]),
        .listen_i       (listen_i[x]),
        .loopback_i     (loopback_i[x]),
        .recover_i      (1'b1),
        .timing_i,
        .filter_i,
        .put_i          (put_i[3*x+:3]),
        .put_frame_i,
        .put_priority_i,
        .abort_i        (abort_i[3*x+:3]),
        .pending_o      (pending_o[3*x+:3]),
        .sent_o         (sent_o[3*x+:3]),
        .aborted_o      (aborted_o[3*x+:3]),
        .refused_o      (refused_o[3*x+:3]),
        .rx_pop_i       (rx_pop_i[x]),
        .rx_valid_o     (rx_valid_o[x]),
        .rx_entry_o     (rx_entry_o[x]),
        .rx_event_o     (rx_event_o[x]),
        .rx_overrun_o   (rx_overrun_o[x]),
        .rx_lost_count_o(rx_lost_count_o[x]),
        .error_o        (error),
        .tec_o          (counts_o[x][7:0]),
        .rec_o          (counts_o[x][15:8]),
        .warning_o      (state_o[x][0]),
        .passive_o      (state_o[x][1]),
        .bus_off_o      (state_o[x][2])
    );
  end

endmodule
`default_nettype wire
