// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// UART with its registers.
`default_nettype none
module fl_uart_wb
  import fl_bus_pkg::*;
#(
    parameter int unsigned RxDepth = 128,
    parameter int unsigned TxDepth = 16
) (
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input logic rx_i,  // asynchronous
    output logic tx_o,
    output logic rx_event_o,
    output logic tx_event_o
);

  fl_uart_regs_pkg::fl_uart_regs__in_t  hwif_in;
  fl_uart_regs_pkg::fl_uart_regs__out_t hwif_out;
  logic tx_push_q, rx_valid, rx_lost;

  // The written byte is in its register one clock after the write.
  always_ff @(posedge clk_i) begin
    tx_push_q <= hwif_out.tx.data.swmod;
    if (rst_i) tx_push_q <= 1'b0;
  end

  assign hwif_in.rx.valid.next        = rx_valid;
  assign hwif_in.rx.lost.next         = rx_lost;
  assign hwif_in.status.rx_valid.next = rx_valid || rx_lost;

  fl_uart #(
      .RxDepth(RxDepth),
      .TxDepth(TxDepth)
  ) u_uart (
      .clk_i,
      .rst_i,
      .rx_i,
      .tx_o,
      .cfg_bit_cycles_i(hwif_out.bit_time.cycles.value),
      .tx_push_i       (tx_push_q),
      .tx_data_i       (hwif_out.tx.data.value),
      .tx_ready_o      (hwif_in.status.tx_ready.next),
      .tx_idle_o       (hwif_in.status.tx_idle.next),
      .tx_dropped_o    (hwif_in.status.tx_dropped.next),
      .rx_pop_i        (hwif_out.rx.data.swacc && !req_i.we),
      .rx_data_o       (hwif_in.rx.data.next),
      .rx_valid_o      (rx_valid),
      .rx_lost_o       (rx_lost),
      .rx_overrun_o    (hwif_in.status.rx_overrun.next),
      .rx_frame_error_o(hwif_in.status.rx_frame_error.next),
      .rx_event_o,
      .tx_event_o
  );

  fl_uart_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_uart_regs_pkg::FL_UART_REGS_MIN_ADDR_WIDTH-1:0]),
      .wb_odat (req_i.wdat),
      .wb_sel  (req_i.sel),
      .wb_ack  (),
      .wb_err  (),
      .wb_idat (rdat_o),
      .hwif_in,
      .hwif_out
  );

endmodule
`default_nettype wire
