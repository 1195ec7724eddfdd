// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Trips: watches raw converter codes, the fault pin, the commutation timer, the leg carriers and the firmware. It latches
// and logs each cause, and turns the gates off through the guard.
//
// Causes (bit order of fl_pkg::trip_t): phase and DC over-current |code - 2048| > limit, fault pin, lost lock, over- and
// under-voltage of vdc, software, deadline.
// Formats: codes 12 bits unsigned, zero at 2048, as they come from the converter, before any correction. Limits in the
// same LSB. A cause of the codes stays present until the next sample set, the others as long as their input is high.
//
// trip_o is high while any enabled cause is latched or present. Latency to the gates, guard included:
//   fault pin     off at the third clock edge after the pin changed (two synchroniser stages, guard)
//   codes         2 clocks after adc_valid_i
//   other inputs  1 clock after they rise
//
// clear_i clears a latched cause only if that cause is absent (or not enabled) in that clock. Enables act at once. There
// is no second copy of them: whoever owns the register locks it.
//
// Short circuit: short_o beside trip_o asks the guard to turn the lower gates on, in place of open gates. It is high only
//   - with cfg_short_i,
//   - where the guard was enabled when the trip came,
//   - while no cause is latched or present that rules it out: phase or DC over-current, the fault pin, never_i.
// Such a cause opens the gates as fast as without a short circuit. They then stay off until clear_i has cleared every
// cause and the firmware has enabled the guard again.
//
// Log: an entry for every clock in which an enabled cause appears that is not yet latched. It holds the time stamp of that
// clock (the gates change one clock later), the new causes, and a code of the last sample set with its channel:
//   phase over-current     the phase with the largest |code - 2048|
//   DC over-current        idc (LogIdc)
//   over-, under-voltage   vdc (LogVdc)
//   any other cause        the phase with the largest |code - 2048|
// If several causes appear at once, the order of this table decides whose code is logged. An entry is readable 3 clocks
// later. Log outputs follow log_index_i by one clock.
// first_o: the causes that were present first since the last clear. A cause that is present at a clear is there anew.
// Asserted: trip_o holds until clear_i. No short_o with a cause that rules it out.
`default_nettype none
module fl_trip
  import fl_pkg::*;
#(
    parameter  int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3,  // v0.., i0.., vdc, idc, vsm
    localparam logic [2:0]  LogIdc   = 3'd6,
    localparam logic [2:0]  LogVdc   = 3'd7
) (
    input  logic                     clk_i,
    input  logic                     rst_i,
    input  stamp_t                   now_i,
    input  logic                     adc_valid_i,
    input  adc_code_t [Channels-1:0] adc_code_i,
    input  logic                     fault_pin_i,      // raw pin, active high
    input  logic                     lost_i,           // pulse
    input  logic                     software_i,       // pulse
    input  logic                     deadline_i,       // level: updates of the leg carriers without new compares
    input  logic                     guard_enable_i,
    input  trip_t                    cfg_enable_i,
    input  adc_code_t                cfg_phase_lsb_i,  // largest deviation from 2048
    input  adc_code_t                cfg_dc_lsb_i,     // largest deviation from 2048
    input  adc_code_t                cfg_over_lsb_i,   // largest vdc code
    input  adc_code_t                cfg_under_lsb_i,  // smallest vdc code
    input  logic                     cfg_short_i,      // 1: short circuit after a trip, 0: gates off
    input  logic                     never_i,          // level: no short circuit now
    input  logic                     clear_i,          // key matched
    output logic                     trip_o,           // gates off, to the guard; clears the guard's enable register
    output logic                     short_o,          // with trip_o: lower gates on, to the guard
    output logic                     event_o,          // pulse: event_cause_o was latched
    output trip_t                    event_cause_o,
    output trip_t                    latched_o,
    output trip_t                    present_o,        // causes present now, enabled or not
    output trip_t                    first_o,          // first causes since the last clear
    output logic      [         7:0] count_o,          // events, saturates
    input  logic      [         2:0] log_index_i,      // 0 = newest
    output stamp_t                   log_stamp_o,
    output trip_t                    log_cause_o,
    output logic                     log_valid_o,
    output logic      [         2:0] log_phase_o,      // phase, LogIdc or LogVdc
    output adc_code_t                log_code_o
);

  localparam int unsigned LogEntries = 8;
  localparam int unsigned ChannelVdc = 2 * Phases;
  localparam int unsigned ChannelIdc = 2 * Phases + 1;

  typedef struct packed {
    stamp_t stamp;
    trip_t cause;
    logic [2:0] phase;
    adc_code_t code;
  } log_entry_t;

  if (Phases < 1 || Phases > 32'(LogIdc)) begin : gen_illegal
    $fatal(1, "fl_trip: the log has numbers for 6 phases (%m)");
  end

  function automatic adc_code_t deviation(adc_code_t code);
    return code[AdcWidth-1] ? code - 12'd2048 : 12'd2048 - code;
  endfunction

  // True if any of the currents deviates by more than the limit.
  function automatic logic any_over(adc_code_t [Phases-1:0] codes, adc_code_t limit);
    any_over = 1'b0;
    for (int unsigned x = 0; x < Phases; x++) if (deviation(codes[x]) > limit) any_over = 1'b1;
  endfunction

  // Of the phases the one with the largest deviation, the first of equals. All pairs at once: a chain of compares would be
  // slow.
  function automatic log_entry_t make_entry(stamp_t stamp, trip_t cause, adc_code_t [Phases-1:0] codes,
                                            adc_code_t [Phases-1:0] deviations, adc_code_t vdc, adc_code_t idc);
    logic wins;
    make_entry = '{stamp: stamp, cause: cause, phase: 3'd0, code: '0};
    for (int unsigned x = 0; x < Phases; x++) begin
      wins = 1'b1;
      for (int unsigned y = 0; y < Phases; y++) begin
        if (deviations[y] > deviations[x] || (y < x && deviations[y] == deviations[x])) wins = 1'b0;
      end
      if (wins) begin
        make_entry.phase |= 3'(x);
        make_entry.code |= codes[x];
      end
    end
    if (!cause.phase_current && cause.dc_current) begin
      make_entry.phase = LogIdc;
      make_entry.code  = idc;
    end else if (!cause.phase_current && (cause.over_voltage || cause.under_voltage)) begin
      make_entry.phase = LogVdc;
      make_entry.code  = vdc;
    end
  endfunction

  // Causes of the codes.
  logic phase_over_q, dc_over_q, over_voltage_q, under_voltage_q;
  adc_code_t [Phases-1:0] current_q, deviation_q;
  adc_code_t vdc_q, idc_q;
  always_ff @(posedge clk_i) begin
    if (adc_valid_i) begin
      phase_over_q    <= any_over(adc_code_i[2*Phases-1:Phases], cfg_phase_lsb_i);
      dc_over_q       <= deviation(adc_code_i[ChannelIdc]) > cfg_dc_lsb_i;
      over_voltage_q  <= adc_code_i[ChannelVdc] > cfg_over_lsb_i;
      under_voltage_q <= adc_code_i[ChannelVdc] < cfg_under_lsb_i;
      current_q       <= adc_code_i[2*Phases-1:Phases];
      vdc_q           <= adc_code_i[ChannelVdc];
      idc_q           <= adc_code_i[ChannelIdc];
      for (int unsigned x = 0; x < Phases; x++) deviation_q[x] <= deviation(adc_code_i[Phases+x]);
    end
    if (rst_i) begin
      phase_over_q    <= 1'b0;
      dc_over_q       <= 1'b0;
      over_voltage_q  <= 1'b0;
      under_voltage_q <= 1'b0;
    end
  end

  logic fault_pin;
  fl_sync u_fault_sync (
      .clk_i,
      .rst_i,
      .async_i(fault_pin_i),
      .sync_o (fault_pin)
  );

  // Latching.
  trip_t present, active, causes, fresh, latched_d, latched_q, first_q, event_cause_q;
  logic event_q;
  logic [7:0] count_q;
  always_comb begin
    present.phase_current = phase_over_q;
    present.dc_current    = dc_over_q;
    present.fault_pin     = fault_pin;
    present.lost_lock     = lost_i;
    present.over_voltage  = over_voltage_q;
    present.under_voltage = under_voltage_q;
    present.software      = software_i;
    present.deadline      = deadline_i;
  end
  assign active    = present & cfg_enable_i;
  assign fresh     = active & ~latched_q;
  assign latched_d = (clear_i ? trip_t'('0) : latched_q) | active;
  assign causes    = latched_q | active;
  assign trip_o    = causes != '0;

  // Active short circuit. armed_q: the guard was enabled before the trip, and nothing has ruled a short out since.
  logic may_short, armed_q;
  assign may_short = cfg_short_i && !never_i && !causes.phase_current && !causes.dc_current && !causes.fault_pin;
  assign short_o   = trip_o && armed_q && may_short;
  always_ff @(posedge clk_i) armed_q <= !rst_i && may_short && (trip_o ? armed_q : guard_enable_i);

  // Log: the entry is put together one clock after the event.
  (* no_rw_check *) log_entry_t log_mem[LogEntries];
  logic [2:0] log_next_q;
  logic [3:0] log_used_q;
  stamp_t event_stamp_q;
  log_entry_t log_read_q;
  logic log_valid_q;

  always_ff @(posedge clk_i) begin
    latched_q <= latched_d;
    event_q   <= fresh != '0;
    if (fresh != '0) begin
      event_cause_q <= fresh;
      event_stamp_q <= now_i;
      if (count_q != '1) count_q <= count_q + 8'd1;
    end
    if (clear_i || latched_q == '0) first_q <= active;
    if (event_q) begin
      log_mem[log_next_q] <= make_entry(event_stamp_q, event_cause_q, current_q, deviation_q, vdc_q, idc_q);
      log_next_q          <= log_next_q + 3'd1;
      if (log_used_q < 4'(LogEntries)) log_used_q <= log_used_q + 4'd1;
    end
    log_read_q  <= log_mem[log_next_q-3'd1-log_index_i];
    log_valid_q <= {1'b0, log_index_i} < log_used_q;
    if (rst_i) begin
      latched_q   <= '0;
      event_q     <= 1'b0;
      count_q     <= '0;
      first_q     <= '0;
      log_next_q  <= '0;
      log_used_q  <= '0;
      log_valid_q <= 1'b0;
    end
  end

  assign event_o       = event_q;
  assign event_cause_o = event_cause_q;
  assign latched_o     = latched_q;
  assign present_o     = present;
  assign first_o       = first_q;
  assign count_o       = count_q;
  assign log_stamp_o   = log_read_q.stamp;
  assign log_cause_o   = log_read_q.cause;
  assign log_valid_o   = log_valid_q;
  assign log_phase_o   = log_read_q.phase;
  assign log_code_o    = log_read_q.code;

  logic held_q;  // trip_o in the last clock, and no clear
  always_ff @(posedge clk_i) begin
    held_q <= trip_o && !clear_i && !rst_i;
    if (!rst_i) begin
      assert (!held_q || trip_o)
      else $error("fl_trip: trip released without clear");
      assert (!short_o || {causes.phase_current, causes.dc_current, causes.fault_pin} == '0)
      else $error("fl_trip: short circuit with a cause that rules it out");
    end
  end

endmodule
`default_nettype wire
