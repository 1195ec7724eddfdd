// UART, 8 data bits, no parity, 1 stop bit, with a FIFO in each direction.
//
// Bytes written to a full transmit FIFO and received into a full receive FIFO are dropped and counted; counters
// saturate. rx_event_o: a byte entered the receive FIFO. tx_event_o: the transmit FIFO has just become empty, so that
// a whole FIFO may be written. The receiver's pin passes a synchroniser.
`default_nettype none
module fl_uart #(
    parameter int unsigned Depth = 16
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
    output logic [7:0] rx_overrun_o,
    output logic [7:0] rx_frame_error_o,

    output logic rx_event_o,
    output logic tx_event_o
);

  function automatic logic [7:0] count_up(logic [7:0] count);
    return (count == '1) ? count : count + 1'b1;
  endfunction

  logic tx_full, tx_fifo_valid, tx_take, tx_fifo_valid_q;
  logic [7:0] tx_fifo_data;
  logic rx_sync, rx_valid, rx_frame_error, rx_full;
  logic [7:0] rx_data;

  fl_fifo #(
      .Width(8),
      .Depth(Depth)
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

  fl_fifo #(
      .Width(8),
      .Depth(Depth)
  ) u_rx_fifo (
      .clk_i,
      .rst_i,
      .push_i (rx_valid),
      .data_i (rx_data),
      .full_o (rx_full),
      .pop_i  (rx_pop_i),
      .data_o (rx_data_o),
      .valid_o(rx_valid_o)
  );

  assign rx_event_o = rx_valid && !rx_full;

  always_ff @(posedge clk_i) begin
    tx_fifo_valid_q <= tx_fifo_valid;
    if (tx_push_i && tx_full) tx_dropped_o <= count_up(tx_dropped_o);
    if (rx_valid && rx_full) rx_overrun_o <= count_up(rx_overrun_o);
    if (rx_frame_error) rx_frame_error_o <= count_up(rx_frame_error_o);
    if (rst_i) begin
      tx_fifo_valid_q  <= 1'b0;
      tx_dropped_o     <= '0;
      rx_overrun_o     <= '0;
      rx_frame_error_o <= '0;
    end
  end

endmodule
`default_nettype wire
