// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Types and constants that every Fluxlock block shares.
//
// Angles, signs and number formats: docs/reference/conventions.md. Sector index 0..5 = I..VI
// (A+B-, A+C-, B+C-, B+A-, C+A-, C+B-). Voltages and currents after correction are signed 18 bit,
// 2^17 = full scale of the converter channel. Time stamps are 32-bit clock counts, wrap-safe when subtracted.
package fl_pkg;

  localparam int unsigned AdcWidth = 12;
  localparam int unsigned SampleWidth = 18;
  localparam int unsigned TimeWidth = 32;

  typedef logic [AdcWidth-1:0] adc_code_t;
  typedef logic signed [SampleWidth-1:0] sample_t;
  typedef logic [TimeWidth-1:0] stamp_t;  // clocks
  typedef logic [2:0] sector_t;  // 0..5 = I..VI

  // What the sequencer asks of one leg. "Pwm" legs switch with the carrier's pulse.
  typedef enum logic [2:0] {
    LegOff     = 3'd0,  // both switches off
    LegHigh    = 3'd1,  // upper switch on
    LegLow     = 3'd2,  // lower switch on
    LegPwmHigh = 3'd3,  // upper switch on while the pulse is on
    LegPwmLow  = 3'd4   // lower switch on while the pulse is on
  } leg_cmd_e;

  typedef enum logic [1:0] {
    SeqOff     = 2'd0,
    SeqManual  = 2'd1,
    SeqSixStep = 2'd2
  } seq_mode_e;

  typedef enum logic [1:0] {
    CommRsc = 2'd0,  // wait for the next carrier start
    CommNsc = 2'd1,  // at once, carrier runs on
    CommCsc = 2'd2   // at once, carrier restarts
  } comm_alignment_e;

  typedef enum logic [1:0] {
    ChopOnPwm   = 2'd0,
    ChopHPwmLOn = 2'd1,
    ChopPwmOn   = 2'd2,
    ChopHOnLPwm = 2'd3
  } chop_pattern_e;

  typedef enum logic [1:0] {
    TimerOff    = 2'd0,
    TimerForced = 2'd1,
    TimerZcd    = 2'd2,
    TimerHall   = 2'd3
  } comm_mode_e;

  typedef enum logic [1:0] {
    ZcFirst        = 2'd0,
    ZcInterpolated = 2'd1,
    ZcAveraged     = 2'd2
  } zc_method_e;

  typedef enum logic [1:0] {
    ZcTerminal  = 2'd0,
    ZcStarPoint = 2'd1,
    ZcMean      = 2'd2
  } zc_source_e;

  typedef enum logic [1:0] {
    SchedOff        = 2'd0,
    SchedContinuous = 2'd1,
    SchedCarrier    = 2'd2,
    SchedOnce       = 2'd3
  } sched_mode_e;

  // PWM state latched with a sample: what the gates did when the converter held its input.
  typedef struct packed {
    logic        on;        // the pulse was on and both conducting switches' gates were on
    sector_t     sector;    // sector applied to the gates
    logic [15:0] age;       // clocks since the last change of any gate, saturating
    logic [15:0] comm_age;  // clocks since the last applied commutation, saturating
  } pwm_state_t;

  // Trip sources, in the bit order of the safety registers.
  localparam int unsigned TripSources = 8;
  typedef struct packed {
    logic deadline;       // bit 7
    logic software;       // bit 6
    logic under_voltage;  // bit 5
    logic over_voltage;   // bit 4
    logic lost_lock;      // bit 3
    logic fault_pin;      // bit 2
    logic dc_current;     // bit 1
    logic phase_current;  // bit 0
  } trip_t;

  // Clocks from the commutation timer's comm_valid_o (registered) to the change of the gate pins under
  // CSC and NSC: sequencer and carrier register, guard register.
  localparam int unsigned CommToGateCycles = 2;
  // Clocks from the compare of now_i with the scheduled instant to the gate pins; the timer fires this much earlier.
  localparam int unsigned CommLatencyCycles = CommToGateCycles + 1;

  // Phase that is open in a sector.
  function automatic logic [1:0] floating_phase(sector_t sector);
    unique case (sector)
      3'd0, 3'd3: return 2'd2;
      3'd1, 3'd4: return 2'd1;
      default:    return 2'd0;
    endcase
  endfunction

  // Sector that drives the other way at the same position.
  function automatic sector_t opposite_sector(sector_t sector);
    return (sector >= 3'd3) ? sector - 3'd3 : sector + 3'd3;
  endfunction

  // The sector after this one in the direction of rotation.
  function automatic sector_t sector_after(sector_t sector, logic reverse);
    if (reverse) return (sector == 3'd0) ? 3'd5 : sector - 3'd1;
    else return (sector >= 3'd5) ? 3'd0 : sector + 3'd1;
  endfunction

  // Address width that holds n values, at least 1.
  function automatic int unsigned idx_width(int unsigned n);
    return (n > 1) ? unsigned'($clog2(n)) : 32'd1;
  endfunction

  // Saturate a signed 32-bit value to a sample.
  function automatic sample_t sat_sample(logic signed [31:0] x);
    return (x[31:17] == {15{x[31]}}) ? x[17:0] : {x[31], {17{!x[31]}}};
  endfunction

  // Digit of a division or root by 8: the last of eight falling differences that is not below zero, and its number.
  typedef struct packed {
    logic [2:0]  digit;
    logic [31:0] difference;
  } digit8_t;

  function automatic digit8_t digit8(logic [7:0][31:0] difference);
    logic [7:0] fits;
    logic [3:0][31:0] of_pair;
    logic [1:0][31:0] of_half;
    digit8_t y;
    for (int unsigned k = 0; k < 8; k++) fits[k] = !difference[k][31];
    for (int unsigned k = 0; k < 4; k++) of_pair[k] = fits[2*k+1] ? difference[2*k+1] : difference[2*k];
    for (int unsigned k = 0; k < 2; k++) of_half[k] = fits[4*k+2] ? of_pair[2*k+1] : of_pair[2*k];
    y.difference = fits[4] ? of_half[1] : of_half[0];
    y.digit[2]   = fits[4];
    y.digit[1]   = fits[4] ? fits[6] : fits[2];
    y.digit[0]   = fits[4] ? (fits[6] ? fits[7] : fits[5]) : (fits[2] ? fits[3] : fits[1]);
    return y;
  endfunction

endpackage
