// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// The whole chip with Boot, a flash and converters that show the middle of their range.
`default_nettype none
module fl_boot_soc #(
    parameter string Init     = "",
    parameter string BootInit = "boot.hex",
    parameter bit    Can      = 0,
    parameter bit    Vector   = 1,
    parameter int unsigned RamWords = 32768
) (
    input  logic       clk_i,
    input  logic       rst_i,
    input  logic       uart_rx_i,
    output logic       uart_tx_o,
    input  logic       can_rx_i,
    output logic       can_tx_o,
    input  logic       flash_power_i,
    output logic [5:0] gate_o
);

  localparam int unsigned Conversion = 40;  // clocks

  logic strobe, cs_n, sck, mosi, miso;
  logic [Conversion-1:0] converting_q;

  always_ff @(posedge clk_i) converting_q <= rst_i ? '0 : {converting_q[Conversion-2:0], strobe};

  fl_soc #(
      .Init    (Init),
      .Can     (Can),
      .Vector  (Vector),
      .RamWords(RamWords),
      .Boot    (1),
      .BootInit(BootInit)
  ) u_soc (
      .clk_i,
      .rst_i,
      .adc_strobe_o     (strobe),
      .adc_valid_i      (converting_q[Conversion-1]),
      .adc_code_i       ({9{12'h800}}),
      .gate_h_o         (),
      .gate_l_o         (),
      .gate_o,
      .brake_o          (),
      .driver_enable_o  (),
      .adc_fault_i      (1'b0),
      .clock_fault_i    (1'b0),
      .fault_pin_i      (1'b0),
      .hall_i           ('0),
      .encoder_i        ('0),
      .uart_rx_i,
      .uart_tx_o,
      .can_rx_i,
      .can_tx_o,
      .spi_cs_no        (cs_n),
      .spi_sck_o        (sck),
      .spi_mosi_o       (mosi),
      .spi_miso_i       (miso),
      .debug_valid_i    (1'b0),
      .debug_ready_o    (),
      .debug_we_i       (1'b0),
      .debug_adr_i      ('0),
      .debug_wdat_i     ('0),
      .debug_rdat_o     (),
      .trc_valid_o      (),
      .trc_now_o        (),
      .trc_zc_valid_o   (),
      .trc_zc_late_o    (),
      .trc_zc_sector_o  (),
      .trc_zc_time_o    (),
      .trc_comm_valid_o (),
      .trc_sector_o     (),
      .trc_comm_sched_o (),
      .trc_update_o     (),
      .trc_trip_o       (),
      .trc_trip_cause_o (),
      .trc_angle_valid_o(),
      .trc_angle_o      ()
  );

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
