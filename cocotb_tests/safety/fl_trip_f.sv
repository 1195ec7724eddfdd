// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of trips and guard together, wired as on the chip, for all inputs: reaction times from the pin, a code, a pulse
// or level to the gates; a latched trip holds until the key, and the key clears only what is gone; the first causes since
// the last clear, the number of trips, and cause and time stamp of each for the log. Enables are free to change in every
// clock.
// A trip opens all gates, or the upper ones where a short circuit may be made: chosen, the guard enabled before the trip,
// and no cause since the trip began that rules it out.
//
// Deviations are worked out here with signed integers, not with the block's function.
`default_nettype none
module fl_trip_f
  import fl_pkg::*;
#(
    parameter  int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3
) (
    input logic                     clk_i,
    input logic                     rst_i,
    input stamp_t                   now_i,
    input logic                     adc_valid_i,
    input adc_code_t [Channels-1:0] adc_code_i,
    input logic                     fault_pin_i,
    input logic                     lost_i,
    input logic                     software_i,
    input logic                     deadline_i,
    input logic                     guard_enable_i,
    input trip_t                    cfg_enable_i,
    input adc_code_t                cfg_phase_lsb_i,
    input adc_code_t                cfg_dc_lsb_i,
    input adc_code_t                cfg_over_lsb_i,
    input adc_code_t                cfg_under_lsb_i,
    input logic                     cfg_short_i,
    input logic                     never_i,
    input logic                     clear_i,
    input logic      [         2:0] log_index_i,
    input logic      [         9:0] dead_time_i,
    input logic      [  Phases-1:0] req_h_i,
    input logic      [  Phases-1:0] req_l_i
);

  logic trip, short, event_pulse, log_valid;
  trip_t event_cause, latched, present, first_cause, log_cause;
  logic [7:0] count;
  stamp_t log_stamp;
  logic [2:0] log_phase;
  adc_code_t log_code;
  logic [Phases-1:0] gate_h, gate_l;
  logic [2*Phases-1:0] gate;

  fl_trip #(
      .Phases(Phases)
  ) dut (
      .clk_i,
      .rst_i,
      .now_i,
      .adc_valid_i,
      .adc_code_i,
      .fault_pin_i,
      .lost_i,
      .software_i,
      .deadline_i,
      .guard_enable_i,
      .cfg_enable_i,
      .cfg_phase_lsb_i,
      .cfg_dc_lsb_i,
      .cfg_over_lsb_i,
      .cfg_under_lsb_i,
      .cfg_short_i,
      .never_i,
      .clear_i,
      .trip_o       (trip),
      .short_o      (short),
      .event_o      (event_pulse),
      .event_cause_o(event_cause),
      .latched_o    (latched),
      .present_o    (present),
      .first_o      (first_cause),
      .count_o      (count),
      .log_index_i,
      .log_stamp_o  (log_stamp),
      .log_cause_o  (log_cause),
      .log_valid_o  (log_valid),
      .log_phase_o  (log_phase),
      .log_code_o   (log_code)
  );

  fl_gate_guard #(
      .Phases(Phases)
  ) guard (
      .clk_i,
      .rst_i,
      .enable_i(guard_enable_i),
      .dead_time_i,
      .trip_i  (trip),
      .short_i (short),
      .req_h_i,
      .req_l_i,
      .gate_h_o(gate_h),
      .gate_l_o(gate_l),
      .gate_o  (gate)
  );

  function automatic logic beyond(adc_code_t code, adc_code_t limit);
    int signed d;
    d = int'({20'b0, code}) - 2048;
    return d > int'({20'b0, limit}) || -d > int'({20'b0, limit});
  endfunction

  trip_t of_codes;  // causes that the codes of this clock show
  always_comb begin
    of_codes = '0;
    for (int unsigned x = 0; x < Phases; x++) begin
      if (beyond(adc_code_i[Phases+x], cfg_phase_lsb_i)) of_codes.phase_current = 1'b1;
    end
    of_codes.dc_current    = beyond(adc_code_i[2*Phases+1], cfg_dc_lsb_i);
    of_codes.over_voltage  = adc_code_i[2*Phases] > cfg_over_lsb_i;
    of_codes.under_voltage = adc_code_i[2*Phases] < cfg_under_lsb_i;
  end

  // Enables, and the past.
  trip_t enable, enable_q, latched_q, present_q, codes_q;
  trip_t shown;  // by the last sample set
  assign enable = cfg_enable_i;
  logic first = 1'b1;
  logic [2:0] since_reset;  // clocks since reset, saturates at 7
  logic [3:1] pin_q;
  logic trip_q, short_q, clear_q, valid_q, lost_q, software_q, deadline_q;
  // Two clocks after a sample set with an enabled cause, with one that rules a short out.
  logic code_trip_q, code_open_q;
  // A cause that rules a short out: enabled and present, latched, or told; then: there was one since the clock before the
  // trip. The guard was enabled in that clock, and a short chosen ever since.
  logic forbids, forbids_q, spoilt, chosen;
  assign forbids = never_i || ({latched.phase_current, latched.dc_current, latched.fault_pin} != '0) ||
      (present.phase_current && enable.phase_current) || (present.dc_current && enable.dc_current) ||
      (present.fault_pin && enable.fault_pin);
  // Since the last clear, the clear's clock included: causes that there were, and those of the first clock with any.
  trip_t seen, seen_first;
  trip_t fresh, fresh_q;  // enabled, and not latched yet
  assign fresh = present & enable & ~latched;
  stamp_t now_q;
  logic [7:0] count_q;
  logic [Phases-1:0] upper;
  for (genvar x = 0; x < Phases; x++) begin : gen_upper
    assign upper[x] = gate[2*x];
  end
  always_ff @(posedge clk_i) begin
    first       <= 1'b0;
    since_reset <= rst_i ? 3'd0 : (&since_reset ? since_reset : since_reset + 3'd1);
    pin_q       <= {pin_q[2:1], fault_pin_i};
    trip_q      <= trip;
    clear_q     <= clear_i;
    valid_q     <= adc_valid_i;
    codes_q     <= of_codes;
    latched_q   <= latched;
    present_q   <= present;
    enable_q    <= enable;
    lost_q      <= lost_i && !rst_i;
    software_q  <= software_i && !rst_i;
    deadline_q  <= deadline_i && !rst_i;
    code_trip_q <= valid_q && (codes_q & enable) != '0 && since_reset >= 3'd1;
    code_open_q <= valid_q && since_reset >= 3'd1 &&
        ((codes_q.phase_current && enable.phase_current) || (codes_q.dc_current && enable.dc_current));
    short_q     <= short;
    forbids_q   <= forbids;
    spoilt      <= forbids || (trip && spoilt);
    chosen      <= cfg_short_i && (trip ? chosen : guard_enable_i);
    seen        <= (clear_i ? '0 : seen) | (present & enable);
    if (clear_i || seen == '0) seen_first <= present & enable;
    fresh_q     <= fresh;
    now_q       <= now_i;
    count_q     <= count;
    if (adc_valid_i) shown <= of_codes;
    if (rst_i) begin
      seen       <= '0;
      seen_first <= '0;
      shown  <= '0;
      spoilt <= 1'b0;
      chosen <= 1'b0;
    end
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        // Verifies: SAFE-08
        a_sync1 : assert (since_reset < 3'd1 || dut.u_fault_sync.meta_q == pin_q[1]);
        a_sync2 : assert (since_reset < 3'd2 || dut.u_fault_sync.sync_q == pin_q[2]);
        // Verifies: SAFE-07
        a_phase_current : assert (present.phase_current == shown.phase_current);
        a_dc_current : assert (present.dc_current == shown.dc_current);
        a_over_voltage : assert (present.over_voltage == shown.over_voltage);
        a_under_voltage : assert (present.under_voltage == shown.under_voltage);

        a_cause : assert (trip == ((latched | (present & enable)) != '0));
        a_any : assert (latched == '0 || trip);
        // Verifies: SAFE-03
        a_upper_off : assert (!trip_q || upper == '0);
        a_off : assert (!trip_q || short_q || gate == '0);
        // Verifies: SAFE-20
        a_forbidden : assert (!trip_q || !forbids_q || gate == '0);
        a_short : assert (short == (trip && cfg_short_i && !forbids && !spoilt && chosen));
        a_armed : assert (dut.armed_q == (chosen && !spoilt));
        // Verifies: SAFE-11
        a_first : assert (first_cause == seen_first);
        assert (latched == seen);
        // Verifies: SAFE-11
        a_first_since : assert ((first_cause & ~seen) == '0);

        if (since_reset == 3'd0) a_reset : assert (!event_pulse && count == '0 && latched == '0);
        if (since_reset >= 3'd1) begin
          // Verifies: SAFE-10
          a_hold : assert ((latched_q & ~latched) == '0 || clear_q);
          a_gone : assert ((latched_q & ~latched & present_q & enable_q) == '0);
          a_latch : assert ((present_q & enable_q & ~latched) == '0);
          a_release : assert (!trip_q || trip || clear_q);
          // One entry of the log, of the last clock.
          // Verifies: SAFE-12
          a_event : assert (event_pulse == (fresh_q != '0));
          a_event_cause : assert (!event_pulse || event_cause == fresh_q);
          a_event_stamp : assert (!event_pulse || dut.event_stamp_q == now_q);
          // Verifies: SAFE-11
          a_number : assert (count == count_q + 8'(event_pulse && count_q != 8'd255));
          // Causes that a sample set shows trip in the next clock.
          // Verifies: SAFE-07
          a_code : assert (!valid_q || (codes_q & enable) == '0 || trip);
        end
        if (!rst_i) begin
          // Verifies: SAFE-09
          a_lost : assert (!lost_i || !enable.lost_lock || trip);
          a_software : assert (!software_i || !enable.software || trip);
          a_deadline : assert (!deadline_i || !enable.deadline || trip);
        end
        // Off at the third edge after the pin, two clocks after a sample set, one clock after a pulse.
        // Verifies: SAFE-08
        if (since_reset >= 3'd3) a_pin : assert (!pin_q[3] || !enable_q.fault_pin || gate == '0);
        if (since_reset >= 3'd2) begin
          // Verifies: SAFE-07
          a_code_upper : assert (!code_trip_q || upper == '0);
          a_code_gates : assert (!code_open_q || gate == '0);
        end
        // Verifies: SAFE-09
        a_lost_gates : assert (!lost_q || !enable_q.lost_lock || gate == '0 || (short_q && upper == '0));
        a_software_gates : assert (!software_q || !enable_q.software || gate == '0 || (short_q && upper == '0));
        a_deadline_gates : assert (!deadline_q || !enable_q.deadline || gate == '0 || (short_q && upper == '0));
      end
  end

endmodule
`default_nettype wire
