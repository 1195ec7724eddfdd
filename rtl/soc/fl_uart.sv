// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// UART, 8 data bits, no parity, 1 stop bit, with a FIFO in each direction.
//
// Bytes written to a full transmit FIFO and received into a full receive FIFO are dropped and counted; counters saturate.
// tx_event_o: the transmit FIFO has just become empty, so that a whole FIFO may be written. rx_event_o: a word entered the
// receive FIFO. The receiver's pin passes a synchroniser.
//
// A word of the receive FIFO is a byte (rx_valid_o), or a mark (rx_lost_o): bytes were lost here, by a full FIFO or a wrong
// stop bit. A mark enters as soon as there is room; bytes that come before it has entered are lost too and belong to it.
// rx_data_o of a mark: bits 6..0 the lines that ended among the lost bytes, saturates; bit 7: bytes are lost after the last
// of these ends. CR or LF ends a line. Blanks (space, tab) alone are no line, and blanks before a line may be lost unmarked.
// A byte with a wrong stop bit counts as none of these.
`default_nettype none
module fl_uart #(
    parameter int unsigned RxDepth = 128,
    parameter int unsigned TxDepth = 16
) (
    input logic clk_i,
    input logic rst_i,

    input  logic rx_i,  // asynchronous
    output logic tx_o,

    input logic [15:0] cfg_bit_cycles_i,

    input  logic       tx_push_i,
    input  logic [7:0] tx_data_i,
    output logic       tx_ready_o,
    output logic       tx_idle_o,
    output logic [7:0] tx_dropped_o,

    input  logic       rx_pop_i,
    output logic [7:0] rx_data_o,
    output logic       rx_valid_o,
    output logic       rx_lost_o,
    output logic [7:0] rx_overrun_o,
    output logic [7:0] rx_frame_error_o,

    output logic rx_event_o,
    output logic tx_event_o
);

  function automatic logic [7:0] count_up(logic [7:0] count);
    return (count == '1) ? count : count + 1'b1;
  endfunction

  localparam logic [7:0] LineFeed = 8'h0A;
  localparam logic [7:0] CarriageReturn = 8'h0D;
  localparam logic [7:0] Space = 8'h20;
  localparam logic [7:0] Tab = 8'h09;

  typedef struct packed {
    logic       lost;
    logic [7:0] data;
  } rx_word_t;

  logic tx_full, tx_fifo_valid, tx_take, tx_fifo_valid_q;
  logic [7:0] tx_fifo_data;
  logic rx_sync, rx_valid, rx_frame_error, rx_full, rx_fifo_valid;
  logic [7:0] rx_data;
  logic rx_end, rx_blank, rx_mark, rx_drop, rx_push;
  logic lost_q, after_end_q;  // a mark waits; nothing but blanks since the end of a line
  logic [6:0] ends_q;
  rx_word_t rx_word, rx_fifo_word;

  fl_fifo #(
      .Width(8),
      .Depth(TxDepth)
  ) u_tx_fifo (
      .clk_i,
      .rst_i,
      .push_i (tx_push_i),
      .data_i (tx_data_i),
      .full_o (tx_full),
      .pop_i  (tx_take),
      .data_o (tx_fifo_data),
      .valid_o(tx_fifo_valid)
  );

  fl_uart_tx u_tx (
      .clk_i,
      .rst_i,
      .bit_cycles_i(cfg_bit_cycles_i),
      .valid_i     (tx_fifo_valid),
      .data_i      (tx_fifo_data),
      .ready_o     (tx_take),
      .tx_o
  );

  assign tx_ready_o = !tx_full;
  assign tx_idle_o  = tx_take && !tx_fifo_valid;
  assign tx_event_o = tx_fifo_valid_q && !tx_fifo_valid;

  fl_sync #(
      .ResetValue(1'b1)
  ) u_sync (
      .clk_i,
      .rst_i,
      .async_i(rx_i),
      .sync_o (rx_sync)
  );

  fl_uart_rx u_rx (
      .clk_i,
      .rst_i,
      .bit_cycles_i (cfg_bit_cycles_i),
      .rx_i         (rx_sync),
      .valid_o      (rx_valid),
      .data_o       (rx_data),
      .frame_error_o(rx_frame_error)
  );

  assign rx_end   = rx_data == LineFeed || rx_data == CarriageReturn;
  assign rx_blank = rx_data == Space || rx_data == Tab;
  assign rx_mark  = lost_q && !rx_full;
  assign rx_drop  = rx_valid && (rx_full || lost_q);
  assign rx_push  = rx_mark || (rx_valid && !rx_full);
  assign rx_word  = rx_mark ? '{lost: 1'b1, data: {!after_end_q, ends_q}} : '{lost: 1'b0, data: rx_data};

  fl_fifo #(
      .Width($bits(rx_word_t)),
      .Depth(RxDepth),
      .Block(1'b1)
  ) u_rx_fifo (
      .clk_i,
      .rst_i,
      .push_i (rx_push),
      .data_i (rx_word),
      .full_o (rx_full),
      .pop_i  (rx_pop_i),
      .data_o (rx_fifo_word),
      .valid_o(rx_fifo_valid)
  );

  assign rx_data_o  = rx_fifo_word.data;
  assign rx_valid_o = rx_fifo_valid && !rx_fifo_word.lost;
  assign rx_lost_o  = rx_fifo_valid && rx_fifo_word.lost;

  always_ff @(posedge clk_i) begin
    if (rx_mark) begin
      lost_q <= 1'b0;
      ends_q <= '0;
    end
    if (rx_drop) begin
      lost_q <= 1'b1;
      if (rx_end && !after_end_q) begin
        if (rx_mark) ends_q <= 7'd1;
        else if (ends_q != '1) ends_q <= ends_q + 1'b1;
      end
    end
    if (rx_valid) after_end_q <= rx_end || (after_end_q && rx_blank);
    if (rx_frame_error) begin
      lost_q      <= 1'b1;
      after_end_q <= 1'b0;
    end
    if (rst_i) begin
      lost_q      <= 1'b0;
      after_end_q <= 1'b1;
      ends_q      <= '0;
    end
  end

  always_ff @(posedge clk_i) begin
    tx_fifo_valid_q <= tx_fifo_valid;
    // The word is at the output one clock later: whoever takes the event finds it.
    rx_event_o      <= rx_push;
    if (tx_push_i && tx_full) tx_dropped_o <= count_up(tx_dropped_o);
    if (rx_drop) rx_overrun_o <= count_up(rx_overrun_o);
    if (rx_frame_error) rx_frame_error_o <= count_up(rx_frame_error_o);
    if (rst_i) begin
      tx_fifo_valid_q  <= 1'b0;
      rx_event_o       <= 1'b0;
      tx_dropped_o     <= '0;
      rx_overrun_o     <= '0;
      rx_frame_error_o <= '0;
    end
  end

endmodule
`default_nettype wire
