// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// CAN 2.0B controller (ISO 11898-1): bit timing, protocol, fault confinement, three transmit buffers, eight acceptance
// filters, receive FIFO of 32 frames with time stamps.
//
// Settings (timing, listen, loopback) are taken while enable_i is low. The pin tx_o comes from a flip-flop and is recessive
// while disabled, in bus-off, listening, looping back, and in reset; one clock after a change to any of these.
// listen_i: acknowledges nothing, sends nothing; its own dominant levels reach only itself; counters stay.
// loopback_i: receives what it sends, the bus neither sees nor disturbs it.
// Latency of the pins: rx_i to the bit timing 2 clocks, from there 2 clocks to tx_o. sent_o and the error counters follow the
// bit that moves them by 2 clocks. timing_i must be there a clock before enable_i rises.
`default_nettype none
module fl_can
  import fl_can_pkg::*;
#(
    localparam int unsigned Buffers = 3,
    localparam int unsigned Filters = 8
) (
    input logic clk_i,
    input logic rst_i,

    input logic [31:0] now_i,  // clocks

    input  logic rx_i,  // asynchronous
    output logic tx_o,

    input logic                      enable_i,
    input logic                      listen_i,
    input logic                      loopback_i,
    input logic                      recover_i,  // bus-off may end
    input can_timing_t               timing_i,
    input can_filter_t [Filters-1:0] filter_i,

    input  logic       [Buffers-1:0] put_i,
    input  can_frame_t               put_frame_i,
    input  logic       [        1:0] put_priority_i,
    input  logic       [Buffers-1:0] abort_i,
    output logic       [Buffers-1:0] pending_o,
    output logic       [Buffers-1:0] sent_o,
    output logic       [Buffers-1:0] aborted_o,
    output logic       [Buffers-1:0] refused_o,

    input  logic             rx_pop_i,
    output logic             rx_valid_o,
    output can_entry_t       rx_entry_o,
    output logic             rx_event_o,
    output logic             rx_overrun_o,
    output logic       [7:0] rx_lost_count_o,

    output can_error_e       error_o,    // with the bit that shows it, for one clock
    output logic       [7:0] tec_o,
    output logic       [7:0] rec_o,
    output logic             warning_o,
    output logic             passive_o,
    output logic             bus_off_o
);

  // Settings.
  logic enable_q, listen_q, loopback_q, silent;
  can_timing_t timing_q;

  always_ff @(posedge clk_i) begin
    enable_q <= enable_i;
    if (!enable_q) begin
      listen_q   <= listen_i;
      loopback_q <= loopback_i;
      timing_q   <= timing_i;
    end
    if (rst_i) begin
      enable_q   <= 1'b0;
      listen_q   <= 1'b0;
      loopback_q <= 1'b0;
      timing_q   <= '0;
    end
  end

  // Pins.
  logic rx_sync, rx_line, tx_next, tx_line, tx_q;

  fl_sync #(
      .ResetValue(1'b1)
  ) u_sync (
      .clk_i,
      .rst_i,
      .async_i(rx_i),
      .sync_o (rx_sync)
  );

  assign silent  = !enable_i || !enable_q || listen_q || loopback_q || bus_off_o;
  assign rx_line = loopback_q ? tx_line : rx_sync && (tx_line || !listen_q);

  always_ff @(posedge clk_i) begin
    tx_q <= tx_next || silent || rst_i;
  end

  assign tx_o = tx_q;

  // Protocol.
  logic sample, sampled, tx_bit, hard, sof, valid;
  logic request, tx_start, tx_sent, tx_stop, tx_sent_q, tx_stop_q;
  can_frame_t tx_frame, rx_frame;
  can_count_t count;
  logic [31:0] stamp_q;

  fl_can_bit_timing u_bit_timing (
      .clk_i,
      .rst_i,
      .enable_i(enable_q),
      .timing_i(timing_q),
      .rx_i    (rx_line),
      .hard_i  (hard),
      .tx_i    (tx_bit),
      .tx_next_o(tx_next),
      .tx_o    (tx_line),
      .start_o (),
      .sample_o(sample),
      .bit_o   (sampled)
  );

  fl_can_bsp u_bsp (
      .clk_i,
      .rst_i,
      .enable_i    (enable_q),
      .loopback_i  (loopback_q),
      .sample_i    (sample),
      .bit_i       (sampled),
      .tx_o        (tx_bit),
      .hard_o      (hard),
      .passive_i   (passive_o),
      .bus_off_i   (bus_off_o),
      .tx_request_i(request && !listen_q),
      .tx_frame_i  (tx_frame),
      .tx_start_o  (tx_start),
      .tx_sent_o   (tx_sent),
      .tx_stop_o   (tx_stop),
      .sof_o       (sof),
      .rx_valid_o  (valid),
      .rx_frame_o  (rx_frame),
      .error_o,
      .count_o     (count)
  );

  fl_can_confinement u_confinement (
      .clk_i,
      .rst_i,
      .count_i  (count),
      .frozen_i (listen_q),
      .recover_i,
      .tec_o,
      .rec_o,
      .warning_o,
      .passive_o,
      .bus_off_o
  );

  always_ff @(posedge clk_i) begin
    if (sof) stamp_q <= now_i;
    // The next start of frame is bits away: the end of a frame may reach the buffers a clock later.
    tx_sent_q <= tx_sent;
    tx_stop_q <= tx_stop;
    if (rst_i) begin
      stamp_q   <= '0;
      tx_sent_q <= 1'b0;
      tx_stop_q <= 1'b0;
    end
  end

  // Frames.
  fl_can_tx #(
      .Buffers(Buffers)
  ) u_tx (
      .clk_i,
      .rst_i,
      .enable_i (enable_q),
      .put_i,
      .put_frame_i,
      .put_priority_i,
      .abort_i,
      .pending_o,
      .sent_o,
      .aborted_o,
      .refused_o,
      .request_o(request),
      .frame_o  (tx_frame),
      .start_i  (tx_start),
      .sent_i   (tx_sent_q),
      .stop_i   (tx_stop_q)
  );

  fl_can_rx #(
      .Filters(Filters)
  ) u_rx (
      .clk_i,
      .rst_i,
      .filter_i,
      .valid_i     (valid),
      .frame_i     (rx_frame),
      .stamp_i     (stamp_q),
      .pop_i       (rx_pop_i),
      .valid_o     (rx_valid_o),
      .entry_o     (rx_entry_o),
      .event_o     (rx_event_o),
      .overrun_o   (rx_overrun_o),
      .lost_count_o(rx_lost_count_o)
  );

endmodule
`default_nettype wire
