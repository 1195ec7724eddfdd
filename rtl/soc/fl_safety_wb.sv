// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Gate guard, trips, watchdog, brake chopper and lock with their registers.
//
// There are two guards, alike and fed alike, and a gate is on if both say so: a bit that flips in one of them turns a gate
// off or makes a gap longer.
//
// The watchdog, a locked setting that changed, the brake chopper's longest on-time, samples that stay away, converter and
// clock faults act as the deadline trip; the monitor register tells them apart. Samples have a watchdog of their own, the same
// block, that every sample set feeds: nothing else sees a current that nobody looks at.
`default_nettype none
module fl_safety_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter  int unsigned Phases        = 3,
    parameter  bit          HighActiveLow = 1'b0,           // upper gate pins are active low
    parameter  bit          LowActiveLow  = 1'b0,           // lower gate pins
    localparam int unsigned Channels      = 2 * Phases + 3
) (
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input stamp_t                   now_i,
    input logic                     adc_valid_i,
    input adc_code_t [Channels-1:0] adc_code_i,
    input logic                     fault_pin_i,    // asynchronous
    input logic                     adc_fault_i,    // level: a bad frame or a missed conversion
    input logic                     clock_fault_i,  // level: a clock is wrong
    input logic                     lost_i,
    input logic                     deadline_i,

    input logic [Phases-1:0] req_h_i,
    input logic [Phases-1:0] req_l_i,

    output logic [  Phases-1:0] gate_h_o,         // pins
    output logic [  Phases-1:0] gate_l_o,
    output logic [2*Phases-1:0] gate_o,           // of either guard, before polarity
    output logic                brake_o,          // pin, active high
    output logic                driver_enable_o,  // pin, toggles while the gates are permitted

    output logic  tripped_o,     // level
    output logic  trip_event_o,  // pulse
    output trip_t trip_cause_o
);

  fl_safety_regs_pkg::fl_safety_regs__in_t  hwif_in;
  fl_safety_regs_pkg::fl_safety_regs__out_t hwif_out;
  if ($bits(trip_t) != TripSources || $bits(hwif_out.trip_enable.source.value) != TripSources) begin : g_check
    $fatal(1, "fl_safety_wb: trip registers and fl_pkg::trip_t do not match (%m)");
  end

  localparam logic [7:0] ClearKey = 8'hA5;
  logic enabled, trip, short, clear;
  logic clear_written_q, feed_written_q;
  logic locked, changed, expired, wrong, brake_overload, sample_expired, sample_wrong, late, outside;
  logic [6:0] monitor_q;

  assign enabled = hwif_out.guard.enable.value;

  // Key and report act once, in the clock after they have been written.
  assign clear = clear_written_q && hwif_out.command.clear_key.value == ClearKey;
  always_ff @(posedge clk_i) begin
    clear_written_q <= hwif_out.command.clear_key.swmod;
    feed_written_q  <= hwif_out.feed.step.swmod;
    monitor_q       <= (clear ? 7'd0 : monitor_q) |
                       {clock_fault_i, adc_fault_i, late, brake_overload, changed, wrong, expired};
    if (rst_i) begin
      clear_written_q <= 1'b0;
      feed_written_q  <= 1'b0;
      monitor_q       <= '0;
    end
  end

  assign hwif_in.command.clear_key.hwclr        = clear_written_q;
  assign hwif_in.guard.high_active_low.next     = HighActiveLow;
  assign hwif_in.guard.low_active_low.next      = LowActiveLow;
  assign hwif_in.guard.safe_state.swwel         = locked;
  assign hwif_in.dead_time.cycles.swwel         = locked;
  assign hwif_in.trip_enable.source.swwel       = locked;
  assign hwif_in.current_limit.phase_lsb.swwel  = locked;
  assign hwif_in.current_limit.dc_lsb.swwel     = locked;
  assign hwif_in.voltage_limit.over_lsb.swwel   = locked;
  assign hwif_in.voltage_limit.under_lsb.swwel  = locked;
  assign hwif_in.watchdog.cycles.swwel          = locked;
  assign hwif_in.brake.enable.swwel             = locked;
  assign hwif_in.brake_level.on_lsb.swwel       = locked;
  assign hwif_in.brake_level.off_lsb.swwel      = locked;
  assign hwif_in.brake_time.cycles.swwel        = locked;
  assign hwif_in.sample_age.cycles.swwel        = locked;
  assign hwif_in.lock.key.swwel                 = locked;
  assign hwif_in.monitor.cause.next             = monitor_q;
  assign hwif_in.monitor.locked.next            = locked;

  localparam int unsigned SettingsWidth = 1 + 10 + TripSources + 4 * AdcWidth + 24 + 1 + 20 + 2 * AdcWidth + 32;
  fl_settings_lock #(
      .Width(SettingsWidth)
  ) u_lock (
      .clk_i,
      .rst_i,
      .key_i     (hwif_out.lock.key.value),
      .settings_i({
        hwif_out.guard.safe_state.value,
        hwif_out.dead_time.cycles.value,
        hwif_out.trip_enable.source.value,
        hwif_out.current_limit.phase_lsb.value,
        hwif_out.current_limit.dc_lsb.value,
        hwif_out.voltage_limit.over_lsb.value,
        hwif_out.voltage_limit.under_lsb.value,
        hwif_out.watchdog.cycles.value,
        hwif_out.brake.enable.value,
        hwif_out.brake_level.on_lsb.value,
        hwif_out.brake_level.off_lsb.value,
        hwif_out.brake_time.cycles.value,
        hwif_out.sample_age.cycles.value
      }),
      .locked_o  (locked),
      .changed_o (changed)
  );

  fl_watchdog u_watchdog (
      .clk_i,
      .rst_i,
      .enable_i    (enabled),
      .cfg_cycles_i(hwif_out.watchdog.cycles.value),
      .feed_i      (feed_written_q),
      .step_i      (hwif_out.feed.step.value),
      .expired_o   (expired),
      .wrong_o     (wrong)
  );

  logic [7:0] sample_step_q;  // number of the next sample set
  always_ff @(posedge clk_i) begin
    if (adc_valid_i) sample_step_q <= sample_step_q + 8'd1;
    if (rst_i) sample_step_q <= 8'd1;
  end

  // In a short too, whose trip has cleared the guard's enable.
  fl_watchdog u_sample_watchdog (
      .clk_i,
      .rst_i,
      .enable_i    (enabled || short),
      .cfg_cycles_i(24'(hwif_out.sample_age.cycles.value)),
      .feed_i      (adc_valid_i),
      .step_i      (sample_step_q),
      .expired_o   (sample_expired),
      .wrong_o     (sample_wrong)
  );
  assign late    = sample_expired || sample_wrong;
  assign outside = adc_fault_i || clock_fault_i;

  localparam int unsigned ChannelVdc = 2 * Phases;
  fl_brake u_brake (
      .clk_i,
      .rst_i,
      .enable_i            (hwif_out.brake.enable.value),
      .cfg_on_lsb_i        (hwif_out.brake_level.on_lsb.value),
      .cfg_off_lsb_i       (hwif_out.brake_level.off_lsb.value),
      .cfg_longest_cycles_i(hwif_out.brake_time.cycles.value),
      .cfg_age_cycles_i    (hwif_out.sample_age.cycles.value),
      .adc_valid_i,
      .vdc_i               (adc_code_i[ChannelVdc]),
      .brake_o,
      .overload_o          (brake_overload)
  );

  // A changed setting trips even if it is the enable of its own trip that has changed.
  trip_t trip_enable;
  always_comb begin
    trip_enable          = hwif_out.trip_enable.source.value;
    trip_enable.deadline = trip_enable.deadline || changed;
  end

  assign hwif_in.brake.on.next      = brake_o;
  assign hwif_in.guard.enable.hwclr = trip;
  assign hwif_in.gates.gate.next    = 10'(gate_o);
  assign tripped_o                  = trip;

  fl_trip #(
      .Phases(Phases)
  ) u_trip (
      .clk_i,
      .rst_i,
      .now_i,
      .adc_valid_i,
      .adc_code_i,
      .fault_pin_i,
      .lost_i,
      .software_i     (hwif_out.command.trip.value),
      .deadline_i     (deadline_i || expired || wrong || changed || brake_overload || late || outside),
      .guard_enable_i (enabled),
      .cfg_enable_i   (trip_enable),
      .cfg_phase_lsb_i(hwif_out.current_limit.phase_lsb.value),
      .cfg_dc_lsb_i   (hwif_out.current_limit.dc_lsb.value),
      .cfg_over_lsb_i (hwif_out.voltage_limit.over_lsb.value),
      .cfg_under_lsb_i(hwif_out.voltage_limit.under_lsb.value),
      .cfg_short_i    (hwif_out.guard.safe_state.value),
      .never_i        (changed || late || outside),
      .clear_i        (clear),
      .trip_o         (trip),
      .short_o        (short),
      .event_o        (trip_event_o),
      .event_cause_o  (trip_cause_o),
      .latched_o      (hwif_in.trip.latched.next),
      .present_o      (hwif_in.trip.now.next),
      .first_o        (hwif_in.trip.first.next),
      .count_o        (hwif_in.trip.count.next),
      .log_index_i    (hwif_out.log_index.index.value),
      .log_stamp_o    (hwif_in.log_time.stamp.next),
      .log_cause_o    (hwif_in.log_cause.cause.next),
      .log_valid_o    (hwif_in.log_cause.valid.next),
      .log_phase_o    (hwif_in.log_cause.phase.next),
      .log_code_o     (hwif_in.log_cause.code.next)
  );

  // Not by the trip alone: the watchdog must run, and hold the drivers off even where its trip is not enabled.
  logic fed;
  assign fed = hwif_out.watchdog.cycles.value != '0 && !expired && !wrong;
  fl_driver_enable u_driver_enable (
      .clk_i,
      .rst_i,
      .permit_i(short || (enabled && !trip && fed)),
      .toggle_o(driver_enable_o)
  );

  // Nothing makes one of the two: their registers follow from themselves.
  logic [1:0][  Phases-1:0] guard_h, guard_l;
  logic [1:0][2*Phases-1:0] guard_gate;
  for (genvar n = 0; n < 2; n++) begin : g_guard
    fl_gate_guard #(
        .Phases       (Phases),
        .HighActiveLow(HighActiveLow),
        .LowActiveLow (LowActiveLow)
    ) u_guard (
        .clk_i,
        .rst_i,
        .enable_i   (enabled),
        .dead_time_i(hwif_out.dead_time.cycles.value),
        .trip_i     (trip),
        .short_i    (short),
        .req_h_i,
        .req_l_i,
        .gate_h_o   (guard_h[n]),
        .gate_l_o   (guard_l[n]),
        .gate_o     (guard_gate[n])
    );
  end
  assign gate_h_o = HighActiveLow ? guard_h[0] | guard_h[1] : guard_h[0] & guard_h[1];
  assign gate_l_o = LowActiveLow ? guard_l[0] | guard_l[1] : guard_l[0] & guard_l[1];
  // Not the pins' signal: they are one LUT behind the flip-flops.
  assign gate_o = guard_gate[0] | guard_gate[1];

  fl_safety_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_safety_regs_pkg::FL_SAFETY_REGS_MIN_ADDR_WIDTH-1:0]),
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
