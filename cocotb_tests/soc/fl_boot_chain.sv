// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// The part of a chip with Boot that the loader uses: core, RAM and ROM, bus, system registers, UART, SPI, with a flash;
// with Can the CAN controller.
`default_nettype none
module fl_boot_chain
  import fl_pkg::*;
  import fl_map_pkg::*;
#(
    parameter string BootInit = "boot.hex",
    parameter bit    Can      = 0
) (
    input  logic clk_i,
    input  logic rst_i,
    input  logic uart_rx_i,
    output logic uart_tx_o,
    input  logic can_rx_i,
    output logic can_tx_o,
    input  logic flash_power_i
);

  logic io_stb, io_we, io_ack;
  logic [29:0] io_adr;
  logic [31:0] io_wdat, io_rdat;
  logic [3:0] io_sel;
  fl_bus_pkg::bus_req_t req;
  logic [Blocks-1:0] stb;
  logic [Blocks-1:0][31:0] rdat;
  logic cs_n, sck, mosi, miso;
  stamp_t now;

  always_ff @(posedge clk_i) now <= rst_i ? '0 : now + 32'd1;

  fl_cpu #(
      .Init    (""),
      .Boot    (1),
      .BootInit(BootInit)
  ) u_cpu (
      .clk_i,
      .rst_i,
      .irq_current_i (1'b0),
      .irq_control_i (1'b0),
      .irq_deferred_i(1'b0),
      .io_stb_o      (io_stb),
      .io_we_o       (io_we),
      .io_adr_o      (io_adr),
      .io_wdat_o     (io_wdat),
      .io_sel_o      (io_sel),
      .io_ack_i      (io_ack),
      .io_rdat_i     (io_rdat),
      .debug_valid_i (1'b0),
      .debug_ready_o (),
      .debug_we_i    (1'b0),
      .debug_adr_i   ('0),
      .debug_wdat_i  ('0),
      .debug_rdat_o  ()
  );

  fl_interconnect #(
      .Blocks      (Blocks),
      .AddressWidth(AddressWidth)
  ) u_interconnect (
      .clk_i,
      .rst_i,
      .stb_i (io_stb),
      .we_i  (io_we),
      .adr_i (io_adr),
      .wdat_i(io_wdat),
      .sel_i (io_sel),
      .ack_o (io_ack),
      .rdat_o(io_rdat),
      .req_o (req),
      .stb_o (stb),
      .rdat_i(rdat)
  );

  fl_sys_wb u_sys (
      .clk_i,
      .rst_i,
      .req_i (req),
      .stb_i (stb[Sys]),
      .rdat_o(rdat[Sys]),
      .now_i (now)
  );

  fl_uart_wb u_uart (
      .clk_i,
      .rst_i,
      .req_i     (req),
      .stb_i     (stb[Uart]),
      .rdat_o    (rdat[Uart]),
      .rx_i      (uart_rx_i),
      .tx_o      (uart_tx_o),
      .rx_event_o(),
      .tx_event_o()
  );

  fl_spi_wb u_spi (
      .clk_i,
      .rst_i,
      .req_i (req),
      .stb_i (stb[Spi]),
      .rdat_o(rdat[Spi]),
      .cs_no (cs_n),
      .sck_o (sck),
      .mosi_o(mosi),
      .miso_i(miso)
  );

  if (Can) begin : g_can
    fl_can_wb u_can (
        .clk_i,
        .rst_i,
        .req_i  (req),
        .stb_i  (stb[CanBus]),
        .rdat_o (rdat[CanBus]),
        .now_i  (now),
        .rx_i   (can_rx_i),
        .tx_o   (can_tx_o),
        .event_o()
    );
  end else begin : g_no_can
    assign can_tx_o     = 1'b1;
    assign rdat[CanBus] = '0;
  end

  for (genvar i = 0; i < Blocks; i++) begin : g_absent
    if (i != 32'(Sys) && i != 32'(Uart) && i != 32'(Spi) && i != 32'(CanBus)) begin : g_zero
      assign rdat[i] = '0;
    end
  end

  fl_spi_flash_model u_flash (
      .clk_i,
      .power_i(flash_power_i),
      .cs_ni  (cs_n),
      .sck_i  (sck),
      .mosi_i (mosi),
      .miso_o (miso)
  );

endmodule
`default_nettype wire
