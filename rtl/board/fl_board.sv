// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// What all boards share: reset, serial converters with their faults, the chip, indicators.
//
// Reset is held for ResetCycles clocks after configuration, after the PLL has locked and after the button is released
// (1.3 ms: converters and gate drivers are up). The gate pins are off in their polarity meanwhile, and the brake; they go
// off without a clock, too, as soon as locked_i falls. Gate drivers need their own pull resistors, to off, for the time
// before configuration. Faults of the converters are a trip of their own: gates off 2 clock edges after the frame that
// shows them.
//
// led_o: 0 chip runs (not in reset), 1 gate driver fault now, 2 a converter channel was bad since reset, 3 a conversion
// was missed since reset.
`default_nettype none
module fl_board
  import fl_pkg::*;
#(
    parameter  int unsigned Phases        = 3,
    parameter  bit          Vector        = 1'b1,
    parameter  bit          Injection     = 1'b0,
    parameter  bit          Can           = 1'b0,
    parameter  int unsigned RamWords      = 32768,           // of the core: fl_cpu
    parameter  string       Init          = "firmware.hex",
    parameter  bit          Boot          = 0,               // start from the SPI flash
    parameter  string       BootInit      = "boot.hex",
    parameter  bit          HighActiveLow = 1'b0,            // upper gate pins are active low
    parameter  bit          LowActiveLow  = 1'b0,            // lower gate pins
    parameter  int unsigned ResetCycles   = 65536,           // 2..2^20
    localparam int unsigned Channels      = 2 * Phases + 3
) (
    input logic clk_i,     // 50 MHz
    input logic locked_i,  // asynchronous: the clock is good
    input logic button_i,  // asynchronous: reset

    output logic                adc_cs_no,
    output logic                adc_sclk_o,
    input  logic [Channels-1:0] adc_sdata_i,

    output logic [Phases-1:0] gate_h_o,
    output logic [Phases-1:0] gate_l_o,
    output logic              brake_o,      // brake chopper, active high
    input  logic              fault_pin_i,
    input  logic [       2:0] hall_i,       // C, B, A
    input  logic [       2:0] encoder_i,    // Z, B, A

    input  logic uart_rx_i,
    output logic uart_tx_o,

    input  logic can_rx_i,
    output logic can_tx_o,  // 0 is dominant

    output logic spi_cs_no,
    output logic spi_sck_o,
    output logic spi_mosi_o,
    input  logic spi_miso_i,

    output logic [3:0] led_o
);

  if (ResetCycles < 2 || ResetCycles > 1 << 20) begin : gen_illegal
    $fatal(1, "fl_board: ResetCycles must be 2..2^20 (%m)");
  end

  // The only registers with a value from configuration: they make the reset.
  logic [19:0] reset_count_q;
  logic reset_released_q, rst_q, hold;

  initial begin
    reset_count_q    = '0;
    reset_released_q = 1'b0;
    rst_q            = 1'b1;
  end

  fl_sync #(
      .ResetValue(1'b1)
  ) u_hold (
      .clk_i,
      .rst_i  (1'b0),
      .async_i(button_i || !locked_i),
      .sync_o (hold)
  );

  always_ff @(posedge clk_i) begin
    if (hold) begin
      reset_count_q    <= '0;
      reset_released_q <= 1'b0;
    end else if (!reset_released_q) begin
      reset_count_q    <= reset_count_q + 1'b1;
      reset_released_q <= reset_count_q == 20'(ResetCycles - 1);
    end
    rst_q <= !reset_released_q;
  end

  logic adc_strobe, adc_valid, adc_missed, adc_fault;
  adc_code_t [Channels-1:0] adc_code;
  logic [Channels-1:0] adc_bad;
  logic [Phases-1:0] gate_h, gate_l;
  logic brake;
  logic [1:0] adc_seen;

  fl_adc_serial #(
      .Channels     (Channels),
      .FrameBits    (16),
      .ReleaseCycles(10)
  ) u_adc (
      .clk_i,
      .rst_i   (rst_q),
      .strobe_i(adc_strobe),
      .cs_no   (adc_cs_no),
      .sclk_o  (adc_sclk_o),
      .sdata_i (adc_sdata_i),
      .valid_o (adc_valid),
      .code_o  (adc_code),
      .bad_o   (adc_bad),
      .missed_o(adc_missed)
  );

  fl_adc_fault #(
      .Channels(Channels)
  ) u_adc_fault (
      .clk_i,
      .rst_i   (rst_q),
      .valid_i (adc_valid),
      .bad_i   (adc_bad),
      .missed_i(adc_missed),
      .fault_o (adc_fault),
      .cause_o (),
      .seen_o  (adc_seen)
  );

  fl_soc #(
      .Phases       (Phases),
      .Vector       (Vector),
      .Injection    (Injection),
      .Can          (Can),
      .RamWords     (RamWords),
      .Init         (Init),
      .Boot         (Boot),
      .BootInit     (BootInit),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow)
  ) u_soc (
      .clk_i,
      .rst_i            (rst_q),
      .adc_strobe_o     (adc_strobe),
      .adc_valid_i      (adc_valid),
      .adc_code_i       (adc_code),
      .gate_h_o         (gate_h),
      .gate_l_o         (gate_l),
      .gate_o           (),
      .brake_o          (brake),
      .adc_fault_i      (adc_fault),
      .fault_pin_i,
      .hall_i,
      .encoder_i,
      .uart_rx_i,
      .uart_tx_o,
      .can_rx_i,
      .can_tx_o,
      .spi_cs_no,
      .spi_sck_o,
      .spi_mosi_o,
      .spi_miso_i,
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

  // No flip-flop in between: without a clock none would turn a gate off.
  assign gate_h_o = HighActiveLow ? gate_h | {Phases{!locked_i}} : gate_h & {Phases{locked_i}};
  assign gate_l_o = LowActiveLow ? gate_l | {Phases{!locked_i}} : gate_l & {Phases{locked_i}};
  assign brake_o  = brake && locked_i;

  assign led_o = {adc_seen, fault_pin_i, !rst_q};

endmodule
`default_nettype wire
