// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// What all boards share: reset, guard of the clock, serial converters with their faults, the chip, indicators.
//
// Reset is held for ResetCycles clocks after configuration, after the PLL has locked and after the button is released
// (1.3 ms: converters and gate drivers are up). The gate pins are off in their polarity meanwhile, and the brake. Gate
// drivers need their own pull resistors, to off, for the time before configuration. Faults of the converters are a trip of
// their own: gates off 2 clock edges after the frame that shows them.
//
// What turns the gate pins off without clk_i:
//   locked_i falls       at once, and a reset follows, also when clk_i stands still until the lock is back
//   clk_i wrong          the monitor in the oscillator's domain, until a reset: 64 clocks of clk_i take fewer than
//                        BeatLeast or more than BeatMost clocks of osc_i. Stopped: after BeatMost + 3 clocks of osc_i.
//   osc_i wrong          the monitor in the domain of clk_i, until a reset (this one needs clk_i)
//   fault_pin_i high     at once, by logic alone; a pulse, however short, also trips the chip
//   rst_q high           at once, by logic alone: the edge that begins a reset may be the last one of clk_i
// All but the fault pin turn off the brake too. A wrong clock is the trip "clock" of a chip that still runs.
// driver_enable_o toggles while the chip permits the gates and none of these is there; a pin that stands is no enable.
// fl_pll_reset resets a PLL without lock, by pll_rst_o.
//
// Two clock domains: clk_i, and osc_i for one monitor and fl_pll_reset. Between them go levels, each through fl_sync or
// fl_async_clear: both beats, rst_q (hold_i of the monitors), bad_o, locked_i.
//
// led_o: 0 chip runs (not in reset, clocks good), 1 gate driver fault now, 2 a converter channel was bad since reset, 3 a
// conversion was missed since reset.
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
    parameter  int unsigned OscKhz        = 38_750,          // of osc_i
    parameter  int unsigned OscPercent    = 15,              // its tolerance, either way
    localparam int unsigned ClockKhz      = 50_000,
    localparam int unsigned Channels      = 2 * Phases + 3
) (
    input  logic clk_i,      // 50 MHz
    input  logic osc_i,      // on-chip oscillator
    input  logic locked_i,   // asynchronous: the PLL has its lock
    output logic pll_rst_o,
    input  logic button_i,   // asynchronous: reset

    output logic                adc_cs_no,
    output logic                adc_sclk_o,
    input  logic [Channels-1:0] adc_sdata_i,

    output logic [Phases-1:0] gate_h_o,
    output logic [Phases-1:0] gate_l_o,
    output logic              brake_o,          // brake chopper, active high
    output logic              driver_enable_o,  // toggles: drivers enabled
    input  logic              fault_pin_i,      // asynchronous
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

  // Clocks of one domain in Beat clocks of the other, at both ends of the tolerance, and one for the synchroniser.
  localparam int unsigned Beat = 64;
  localparam int unsigned BeatLeast = Beat * OscKhz * (100 - OscPercent) / (100 * ClockKhz) - 1;
  localparam int unsigned BeatMost = (Beat * OscKhz * (100 + OscPercent) - 1) / (100 * ClockKhz) + 2;
  localparam int unsigned OscLeast = Beat * ClockKhz * 100 / (OscKhz * (100 + OscPercent)) - 1;
  localparam int unsigned OscMost = (Beat * ClockKhz * 100 - 1) / (OscKhz * (100 - OscPercent)) + 2;

  // Registers with a value from configuration: they make the reset.
  logic [19:0] reset_count_q = '0;
  logic reset_released_q = 1'b0;
  logic rst_q = 1'b1;
  logic button, locked, hold;

  fl_sync u_button (
      .clk_i,
      .rst_i  (1'b0),
      .async_i(button_i),
      .sync_o (button)
  );
  // A loss of the lock that begins and ends while the clock stands still is not missed.
  fl_async_clear #(
      .Stages(2)
  ) u_locked (
      .clk_i,
      .clear_i(!locked_i),
      .ok_i   (1'b1),
      .ok_o   (locked)
  );
  assign hold = button || !locked;

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

  fl_pll_reset u_pll_reset (
      .clk_i(osc_i),
      .locked_i,
      .rst_o(pll_rst_o)
  );

  // Each clock watches the other.
  logic clk_beat, osc_beat, clk_bad, osc_bad, clk_bad_synced;
  fl_clock_monitor #(
      .BeatCycles (Beat),
      .LeastCycles(BeatLeast),
      .MostCycles (BeatMost)
  ) u_clk_monitor (
      .clk_i (osc_i),
      .hold_i(rst_q),
      .beat_i(clk_beat),
      .beat_o(osc_beat),
      .bad_o (clk_bad)
  );
  fl_clock_monitor #(
      .BeatCycles (Beat),
      .LeastCycles(OscLeast),
      .MostCycles (OscMost)
  ) u_osc_monitor (
      .clk_i,
      .hold_i(rst_q),
      .beat_i(osc_beat),
      .beat_o(clk_beat),
      .bad_o (osc_bad)
  );
  fl_sync u_clk_bad (
      .clk_i,
      .rst_i  (rst_q),
      .async_i(clk_bad),
      .sync_o (clk_bad_synced)
  );

  // Both fall without a clock. clocks_ok: no reset, no clock that is wrong. gates_ok: no fault pin either.
  logic clocks_wrong, clocks_ok, pin_ok, gates_ok, runs, pins_on;
  assign clocks_wrong = !locked_i || clk_bad || osc_bad;
  fl_async_clear #(
      .Stages(1)
  ) u_clocks_ok (
      .clk_i,
      .clear_i(clocks_wrong),
      .ok_i   (locked && !rst_q),
      .ok_o   (clocks_ok)
  );
  // Long enough for the chip's synchroniser and guard: its trip is there when the pulse of a fault pin is over.
  fl_async_clear #(
      .Stages(4)
  ) u_pin_ok (
      .clk_i,
      .clear_i(fault_pin_i),
      .ok_i   (1'b1),
      .ok_o   (pin_ok)
  );
  fl_async_clear #(
      .Stages(1)
  ) u_gates_ok (
      .clk_i,
      .clear_i(clocks_wrong || fault_pin_i),
      .ok_i   (locked && !rst_q && pin_ok),
      .ok_o   (gates_ok)
  );
  // rst_q as it is, too: the two above fall at its next clock edge, and a clock that stops before that one goes unwatched.
  assign runs    = clocks_ok && locked_i && !rst_q;
  assign pins_on = gates_ok && locked_i && !rst_q && !fault_pin_i;

  logic adc_strobe, adc_valid, adc_missed, adc_fault;
  adc_code_t [Channels-1:0] adc_code;
  logic [Channels-1:0] adc_bad;
  logic [Phases-1:0] gate_h, gate_l;
  logic brake, driver_enable;
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
      .driver_enable_o  (driver_enable),
      .adc_fault_i      (adc_fault),
      .clock_fault_i    (clk_bad_synced || osc_bad),
      .fault_pin_i      (!pin_ok),
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

  // No flip-flop in between: without a clock none would turn a gate off.
  assign gate_h_o        = HighActiveLow ? gate_h | {Phases{!pins_on}} : gate_h & {Phases{pins_on}};
  assign gate_l_o        = LowActiveLow ? gate_l | {Phases{!pins_on}} : gate_l & {Phases{pins_on}};
  assign brake_o         = brake && runs;
  assign driver_enable_o = driver_enable && pins_on;

  assign led_o = {adc_seen, fault_pin_i, runs};

endmodule
`default_nettype wire
