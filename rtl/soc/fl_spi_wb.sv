// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// SPI master with its registers.
`default_nettype none
module fl_spi_wb
  import fl_bus_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    output logic cs_no,
    output logic sck_o,
    output logic mosi_o,
    input  logic miso_i
);

  fl_spi_regs_pkg::fl_spi_regs__in_t hwif_in;
  fl_spi_regs_pkg::fl_spi_regs__out_t hwif_out;
  logic start_q, busy;

  // The written byte is in its register one clock after the write.
  always_ff @(posedge clk_i) begin
    start_q <= hwif_out.tx.data.swmod;
    cs_no   <= !hwif_out.control.select.value;
    if (rst_i) begin
      start_q <= 1'b0;
      cs_no   <= 1'b1;
    end
  end

  assign hwif_in.rx.busy.next = busy || start_q;

  fl_spi u_spi (
      .clk_i,
      .rst_i,
      .cfg_half_cycles_i(hwif_out.control.half_cycles.value),
      .start_i          (start_q),
      .data_i           (hwif_out.tx.data.value),
      .busy_o           (busy),
      .data_o           (hwif_in.rx.data.next),
      .sck_o,
      .mosi_o,
      .miso_i
  );

  fl_spi_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_spi_regs_pkg::FL_SPI_REGS_MIN_ADDR_WIDTH-1:0]),
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
