// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A board with its converters, for closed loops: fl_board behind the ports by which the simulator's main knows the chip.
//
// adc_strobe_o   the converters hold their inputs: cs_no fell. Their codes must stand at adc_code_i 4 clocks later.
// rst_i          the button
//
// The converters answer as the AD7276: two zeros, the code, two zeros, each bit a clock after a falling edge of the serial
// clock; lines are high between frames. They run by clk_i: it stands when they have no serial clock.
`default_nettype none
module fl_board_bench
  import fl_pkg::*;
#(
    parameter  int unsigned Phases        = 3,
    parameter  bit          Injection     = 0,
    parameter  bit          Can           = 0,
    parameter  bit          HighActiveLow = 0,
    parameter  bit          LowActiveLow  = 0,
    parameter  int unsigned ResetCycles   = 16,
    parameter  int unsigned OscKhz        = 38_750,
    localparam int unsigned Channels      = 2 * Phases + 3
) (
    input logic clk_i,
    input logic osc_i,
    input logic rst_i,
    input logic locked_i,

    output logic                     adc_strobe_o,
    input  adc_code_t [Channels-1:0] adc_code_i,

    output logic [Phases-1:0] gate_h_o,
    output logic [Phases-1:0] gate_l_o,
    output logic              brake_o,
    output logic              driver_enable_o,
    input  logic              fault_pin_i,
    input  logic [       2:0] hall_i,
    input  logic [       2:0] encoder_i,

    input  logic uart_rx_i,
    output logic uart_tx_o,
    input  logic can_rx_i,
    output logic can_tx_o,
    input  logic spi_miso_i,

    output logic           trc_valid_o,
    output stamp_t         trc_now_o,
    output logic           trc_zc_valid_o,
    output logic           trc_zc_late_o,
    output sector_t        trc_zc_sector_o,
    output stamp_t         trc_zc_time_o,
    output logic           trc_comm_valid_o,
    output sector_t        trc_sector_o,
    output stamp_t         trc_comm_sched_o,
    output logic           trc_update_o,
    output logic           trc_trip_o,
    output trip_t          trc_trip_cause_o,
    output logic           trc_angle_valid_o,
    output logic    [31:0] trc_angle_o
);

  logic cs_n, sclk;
  logic [Channels-1:0] sdata;

  fl_board #(
      .Phases       (Phases),
      .Injection    (Injection),
      .Can          (Can),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow),
      .ResetCycles  (ResetCycles),
      .OscKhz       (OscKhz)
  ) u_board (
      .clk_i,
      .osc_i,
      .locked_i,
      .pll_rst_o  (),
      .button_i   (rst_i),
      .adc_cs_no  (cs_n),
      .adc_sclk_o (sclk),
      .adc_sdata_i(sdata),
      .gate_h_o,
      .gate_l_o,
      .brake_o,
      .driver_enable_o,
      .fault_pin_i,
      .hall_i,
      .encoder_i,
      .uart_rx_i,
      .uart_tx_o,
      .can_rx_i,
      .can_tx_o,
      .spi_cs_no  (),
      .spi_sck_o  (),
      .spi_mosi_o (),
      .spi_miso_i,
      .led_o      ()
  );

  logic cs_n_q = 1'b1;
  logic sclk_q = 1'b1;
  logic [3:0] bit_q = '0;  // that the converters put out
  logic [3:0] place;  // of it in the code

  assign adc_strobe_o = cs_n_q && !cs_n;
  assign place        = 4'd13 - bit_q;

  always_ff @(posedge clk_i) begin
    cs_n_q <= cs_n;
    sclk_q <= sclk;
    if (cs_n) bit_q <= '0;
    else if (sclk_q && !sclk) bit_q <= bit_q + 4'd1;
  end

  for (genvar i = 0; i < Channels; i++) begin : gen_converter
    assign sdata[i] = cs_n || (bit_q >= 4'd2 && bit_q <= 4'd13 && adc_code_i[i][place]);
  end

  assign trc_valid_o       = u_board.u_soc.trc_valid_o;
  assign trc_now_o         = u_board.u_soc.trc_now_o;
  assign trc_zc_valid_o    = u_board.u_soc.trc_zc_valid_o;
  assign trc_zc_late_o     = u_board.u_soc.trc_zc_late_o;
  assign trc_zc_sector_o   = u_board.u_soc.trc_zc_sector_o;
  assign trc_zc_time_o     = u_board.u_soc.trc_zc_time_o;
  assign trc_comm_valid_o  = u_board.u_soc.trc_comm_valid_o;
  assign trc_sector_o      = u_board.u_soc.trc_sector_o;
  assign trc_comm_sched_o  = u_board.u_soc.trc_comm_sched_o;
  assign trc_update_o      = u_board.u_soc.trc_update_o;
  assign trc_trip_o        = u_board.u_soc.trc_trip_o;
  assign trc_trip_cause_o  = u_board.u_soc.trc_trip_cause_o;
  assign trc_angle_valid_o = u_board.u_soc.trc_angle_valid_o;
  assign trc_angle_o       = u_board.u_soc.trc_angle_o;

endmodule
`default_nettype wire
