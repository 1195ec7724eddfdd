// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Stands in for the chip in the test of fl_board: trips, guard and enable of the drivers as on the chip, a strobe every 50
// clocks, which are the PWM period too, and gates that want to be on. Inputs command it:
//   Hall 0      clears trips and enables the gates
//   Hall 1      asks for a conversion too early
//   UART        high: no conversions
//   encoder 0   brake
//   Hall 2, encoder 2, 1: what the gates do
//     0 upper A, lower B   1 all lower ones (precharge)   2 align: A chops against B and C   3 six-step, chopping
//     4 vector: all legs chop   5 lower ones chop (braking)   6 as 0, and a trip shorts the machine
// trc_comm_valid_o shows its reset.
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
    output logic                     driver_enable_o,
    input  logic                     adc_fault_i,
    input  logic                     clock_fault_i,
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
    input  logic                     debug_valid_i,
    output logic                     debug_ready_o,
    input  logic                     debug_we_i,
    input  logic      [         7:0] debug_adr_i,
    input  logic      [        31:0] debug_wdat_i,
    output logic      [        31:0] debug_rdat_o,
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

  assign debug_ready_o = 1'b0;
  assign debug_rdat_o  = '0;

  logic [5:0] count_q;
  logic started_q;  // the converters' frame after reset is over
  logic trip, short, enable_q;
  trip_t event_cause;

  always_ff @(posedge clk_i) begin
    count_q  <= (rst_i || count_q == 6'd49) ? '0 : count_q + 6'd1;
    started_q <= !rst_i && (started_q || count_q == 6'd49);
    enable_q <= !rst_i && !trip && (enable_q || hall_i[0]);
  end
  logic [2:0] pattern, req_h, req_l;
  logic [9:0] time_q;
  logic [2:0] sector;
  assign pattern = {hall_i[2], encoder_i[2:1]};
  assign sector  = (time_q[9:7] > 3'd5) ? time_q[9:7] - 3'd6 : time_q[9:7];
  always_ff @(posedge clk_i) time_q <= rst_i ? '0 : time_q + 10'd1;
  always_comb begin
    req_h = 3'b001;
    req_l = 3'b010;
    unique case (pattern)
      3'd1: {req_h, req_l} = {3'b000, 3'b111};
      3'd2: {req_h, req_l} = {2'b00, count_q < 6'd25, 2'b11, count_q >= 6'd30};
      3'd3: begin
        req_h = (count_q < 6'd30) ? 3'b001 << (sector >> 1) : 3'b000;
        req_l = 3'b001 << ((sector == 3'd0 || sector == 3'd5) ? 1 : (sector < 3'd3) ? 2 : 0);
      end
      3'd4: begin
        req_h = {count_q < 6'd10, count_q < 6'd20, count_q < 6'd35};
        req_l = ~req_h;
      end
      3'd5: {req_h, req_l} = {3'b000, {3{count_q < 6'd25}}};
      default: ;
    endcase
  end
  assign adc_strobe_o = started_q && !uart_rx_i && (count_q == 6'd10 || (hall_i[1] && count_q == 6'd20));

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
      .deadline_i     (adc_fault_i || clock_fault_i),
      .guard_enable_i (enable_q),
      .cfg_enable_i   (8'h84),
      .cfg_phase_lsb_i('1),
      .cfg_dc_lsb_i   ('1),
      .cfg_over_lsb_i ('1),
      .cfg_under_lsb_i('0),
      .cfg_short_i    (pattern == 3'd6),
      .never_i        (adc_fault_i || clock_fault_i),
      .clear_i        (hall_i[0]),
      .trip_o         (trip),
      .short_o        (short),
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
      .short_i          (short),
      .req_h_i          (Phases'(req_h)),
      .req_l_i          (Phases'(req_l)),
      .gate_h_o,
      .gate_l_o,
      .gate_o
  );

  fl_driver_enable u_driver_enable (
      .clk_i,
      .rst_i,
      .permit_i(short || (enable_q && !trip)),
      .toggle_o(driver_enable_o)
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
