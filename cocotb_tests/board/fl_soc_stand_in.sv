// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Stands in for the chip in the test of fl_board: trips and guard as on the chip, a strobe every 50 clocks, and gates
// that want to be on. The Hall inputs command it: 0 clears trips and enables the gates, 1 asks for a conversion too
// early. trc_comm_valid_o shows its reset.
`default_nettype none
module fl_soc
  import fl_pkg::*;
#(
    parameter  int unsigned Phases        = 3,
    parameter  bit          Vector        = 1'b1,
    parameter  bit          Injection     = 1'b0,
    parameter  bit          Can           = 1'b0,
    parameter  int unsigned RamWords      = 32768,
    parameter  string       Init          = "",
    parameter  bit          Boot          = 0,
    parameter  string       BootInit      = "",
    parameter  bit          HighActiveLow = 0,
    parameter  bit          LowActiveLow  = 0,
    localparam int unsigned Channels      = 2 * Phases + 3
) (
    input  logic                     clk_i,
    input  logic                     rst_i,
    output logic                     adc_strobe_o,
    input  logic                     adc_valid_i,
    input  adc_code_t [Channels-1:0] adc_code_i,
    output logic      [  Phases-1:0] gate_h_o,
    output logic      [  Phases-1:0] gate_l_o,
    output logic      [2*Phases-1:0] gate_o,
    output logic                     brake_o,
    input  logic                     adc_fault_i,
    input  logic                     fault_pin_i,
    input  logic      [         2:0] hall_i,
    input  logic      [         2:0] encoder_i,
    input  logic                     uart_rx_i,
    output logic                     uart_tx_o,
    input  logic                     can_rx_i,
    output logic                     can_tx_o,
    output logic                     spi_cs_no,
    output logic                     spi_sck_o,
    output logic                     spi_mosi_o,
    input  logic                     spi_miso_i,
    output logic                     trc_valid_o,
    output stamp_t                   trc_now_o,
    output logic                     trc_zc_valid_o,
    output logic                     trc_zc_late_o,
    output sector_t                  trc_zc_sector_o,
    output stamp_t                   trc_zc_time_o,
    output logic                     trc_comm_valid_o,
    output sector_t                  trc_sector_o,
    output stamp_t                   trc_comm_sched_o,
    output logic                     trc_update_o,
    output logic                     trc_trip_o,
    output trip_t                    trc_trip_cause_o,
    output logic                     trc_angle_valid_o,
    output logic      [        31:0] trc_angle_o
);

  logic [5:0] count_q;
  logic started_q;  // the converters' frame after reset is over
  logic trip, enable_q;
  trip_t event_cause;

  always_ff @(posedge clk_i) begin
    count_q  <= (rst_i || count_q == 6'd49) ? '0 : count_q + 6'd1;
    started_q <= !rst_i && (started_q || count_q == 6'd49);
    enable_q <= !rst_i && !trip && (enable_q || hall_i[0]);
  end
  assign adc_strobe_o = started_q && (count_q == 6'd10 || (hall_i[1] && count_q == 6'd20));

  fl_trip #(
      .Phases(Phases)
  ) u_trip (
      .clk_i,
      .rst_i,
      .now_i          ('0),
      .adc_valid_i,
      .adc_code_i,
      .fault_pin_i,
      .lost_i         (1'b0),
      .software_i     (1'b0),
      .deadline_i     (adc_fault_i),
      .guard_enable_i (enable_q),
      .cfg_enable_i   (8'h84),
      .cfg_phase_lsb_i('1),
      .cfg_dc_lsb_i   ('1),
      .cfg_over_lsb_i ('1),
      .cfg_under_lsb_i('0),
      .cfg_short_i    (1'b0),
      .never_i        (1'b0),
      .clear_i        (hall_i[0]),
      .trip_o         (trip),
      .short_o        (),
      .event_o        (trc_trip_o),
      .event_cause_o  (event_cause),
      .latched_o      (),
      .present_o      (),
      .first_o        (),
      .count_o        (),
      .log_index_i    ('0),
      .log_stamp_o    (),
      .log_cause_o    (),
      .log_valid_o    (),
      .log_phase_o    (),
      .log_code_o     ()
  );

  fl_gate_guard #(
      .Phases       (Phases),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow)
  ) u_guard (
      .clk_i,
      .rst_i,
      .enable_i         (enable_q),
      .dead_time_i      (10'd5),
      .trip_i           (trip),
      .short_i          (1'b0),
      .req_h_i          (Phases'(1)),
      .req_l_i          (Phases'(2)),
      .gate_h_o,
      .gate_l_o,
      .gate_o
  );

  assign brake_o           = encoder_i[0];
  assign uart_tx_o         = uart_rx_i;
  assign can_tx_o          = can_rx_i;
  assign spi_cs_no         = 1'b1;
  assign spi_sck_o         = 1'b0;
  assign spi_mosi_o        = spi_miso_i;
  assign trc_trip_cause_o  = event_cause;
  assign trc_comm_valid_o  = rst_i;
  assign trc_valid_o       = 1'b0;
  assign trc_now_o         = '0;
  assign trc_zc_valid_o    = 1'b0;
  assign trc_zc_late_o     = 1'b0;
  assign trc_zc_sector_o   = '0;
  assign trc_zc_time_o     = '0;
  assign trc_sector_o      = '0;
  assign trc_comm_sched_o  = '0;
  assign trc_update_o      = 1'b0;
  assign trc_angle_valid_o = 1'b0;
  assign trc_angle_o       = {29'd0, encoder_i};

endmodule
`default_nettype wire
