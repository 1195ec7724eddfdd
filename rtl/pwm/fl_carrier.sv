// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// PWM carrier: edge-aligned, with the pulse at its start. It applies a commutation by one of the commutation alignments
// RSC, NSC and CSC, keeps the minimum pulse and gives exact volt-seconds.
//
// Formats: period in clocks, 16 bits. Duty in clocks, unsigned Q16.8. Carry in clocks, signed Q16.8.
//
// Volt-seconds. A carrier of n clocks owes the load min(duty, n). The carry holds what is owed:
//   - it gains 1 in every clock with count < duty, and the fraction once the carrier reaches it,
//   - it loses 1 in every clock in which the pulse is on.
// The next pulse is floor(duty + carry) clocks long, with the carry of 3 clocks before the pulse. Later changes go into
// the pulse after it. So fractions, held-back pulses and stretched pulses all return. |carry| <= one period: the block
// drops what exceeds that. A duty of 0, or of a period or more, needs no edge: the block then clears the carry.
//
// Minimum pulse. The carrier starts no pulse and opens no gap shorter than min_pulse. The rule also covers a commutation
// that would end them, if sched_valid_i announces it min_pulse + 2 or more clocks before comm_sched_i:
//   - the carrier does not start a pulse that the commutation would cut below min_pulse (NSC: it starts with the
//     commutation),
//   - the carrier does not open a gap that the commutation would end before min_pulse,
//   - NSC: a rest of the pulse shorter than min_pulse ends with the commutation,
//   - NSC: a rest of the carrier shorter than min_pulse is filled, and the next pulse starts with the commutation.
// The rule never delays a commutation, whatever pulse the commutation cuts. dropped_o counts each carrier whose pulse or
// gap the rule changes, once per carrier, two clocks after the first change.
//
// Commutation, with comm_valid_i in clock k:
//   NSC  apply_o in clock k. Sector register, count_o and pulse_o change together in k + 1.
//   CSC  as NSC, and the carrier restarts: count_o = 0 in k + 1.
//   RSC  apply_o one clock before the next carrier start. Commutations that arrive before that merge into one, so RSC
//        needs at least one carrier per sector.
//
// Settings are copied at update_i. Period and duty act from the first carrier that starts 4 or more clocks after
// update_i. Before the first update the period is 65535 and the duty 0.
// Errors: none are reported. The block raises a period below 4 * min_pulse to that value.
// Asserted: count_o stays below the period. Proved for all inputs: cocotb_tests/pwm/fl_carrier.sby.
`default_nettype none
module fl_carrier
  import fl_pkg::*;
(
    input  logic                   clk_i,
    input  logic                   rst_i,
    input  stamp_t                 now_i,
    input  logic                   update_i,
    input  comm_alignment_e        cfg_commutation_i,
    input  logic            [15:0] cfg_period_i,       // clocks, raised to 4 * min_pulse
    input  logic            [23:0] cfg_duty_q8_i,      // clocks, Q16.8
    input  logic            [11:0] cfg_min_pulse_i,    // clocks
    input  logic                   comm_valid_i,       // commutate now
    input  logic                   sched_valid_i,      // a commutation is scheduled...
    input  stamp_t                 comm_sched_i,       // ...to change the gates at this instant
    output logic                   apply_o,            // the sequencer steps at the end of this clock
    output logic                   pulse_o,
    output logic                   carrier_start_o,    // first clock of a carrier
    output logic            [15:0] count_o,            // clocks since the carrier start
    output logic            [15:0] dropped_o           // carriers changed by the rule, wraps
);

  typedef logic signed [25:0] volt_seconds_t;  // clocks, signed Q17.8

  // Stage A: the settings of the last update.
  comm_alignment_e commutation_q;
  logic [11:0] min_q;
  logic [15:0] period_a_q;
  logic [23:0] duty_a_q;

  // Stage B: what a carrier that started now would want.
  logic [15:0] period_b_q;
  logic [23:0] duty_b_q;
  volt_seconds_t want_sum;
  logic signed [17:0] want_b_q;  // clocks

  // Stage C: the plan of the next carrier.
  logic [15:0] last_c_q;  // period - 1
  logic [23:0] duty_c_q;
  logic [15:0] width_c_q;
  logic none_c_q;  // no pulse
  logic full_c_q;  // no gap
  logic pinned_c_q;  // duty 0 or at least a period

  // The running carrier.
  logic [15:0] count_q, last_q, width_d, width_q;
  logic [16:0] next_q;  // count_q + 1
  logic [16:0] end_q;  // last_q + 1
  logic [23:0] duty_q;
  logic pulse_d, pulse_q, full_d, full_q, pinned_q, start_q;
  logic early_d, early_q;  // the pulse began before this carrier's end, for the next one
  logic held_d, held_q;  // this carrier's pulse was held back for a commutation
  logic changed_q;  // the rule has changed this carrier
  logic pending_q;  // RSC: a commutation waits
  logic [15:0] dropped_q;
  volt_seconds_t carry_q;

  logic [16:0] period_min;
  assign period_min = {3'b0, min_q, 2'b00};
  assign want_sum   = carry_q + signed'({2'b00, duty_a_q});

  always_ff @(posedge clk_i) begin
    if (update_i) begin
      commutation_q <= cfg_commutation_i;
      min_q         <= cfg_min_pulse_i;
      period_a_q    <= cfg_period_i;
      duty_a_q      <= cfg_duty_q8_i;
    end
    duty_b_q <= duty_a_q;
    want_b_q <= 18'(want_sum >>> 8);
    if ({1'b0, period_a_q} >= period_min) period_b_q <= (period_a_q < 16'd4) ? 16'd4 : period_a_q;
    else period_b_q <= (period_min < 17'd4) ? 16'd4 : period_min[15:0];

    duty_c_q <= duty_b_q;
    last_c_q <= period_b_q - 16'd1;
    width_c_q <= want_b_q[15:0];
    none_c_q <= duty_b_q == '0 || want_b_q <= 0 || want_b_q < signed'({6'b0, min_q});
    full_c_q   <= duty_b_q[23:8] >= period_b_q || want_b_q >= signed'({2'b0, period_b_q}) ||
                  want_b_q + signed'({6'b0, min_q}) > signed'({2'b0, period_b_q});
    pinned_c_q <= duty_b_q == '0 || duty_b_q[23:8] >= period_b_q;
    if (rst_i) begin
      commutation_q <= CommCsc;
      min_q         <= '0;
      period_a_q    <= '1;
      duty_a_q      <= '0;
      duty_b_q      <= '0;
      period_b_q    <= '1;
      want_b_q      <= '0;
      duty_c_q      <= '0;
      last_c_q      <= '1;
      width_c_q     <= '0;
      none_c_q      <= 1'b1;
      full_c_q      <= 1'b0;
      pinned_c_q    <= 1'b1;
    end
  end

  // Instants. A level that pulse_o takes at the next clock lasts comm_sched_i - 2 - now_i clocks until the commutation;
  // the compare is made one clock ahead.
  stamp_t until_comm;
  logic wrap_q, restart, start, natural, near, near_q;
  logic [12:0] near_limit_q;
  logic [16:0] reach;  // end of a pulse of min_pulse that started or went on at the next clock
  logic ended;  // the pulse's width is reached at the end of this clock
  logic rest_short;  // what is left of the pulse is shorter than min_pulse
  logic tail_short;  // what is left of the carrier is shorter than min_pulse

  assign until_comm = comm_sched_i - now_i;
  always_ff @(posedge clk_i) begin
    near_limit_q <= {1'b0, min_q} + 13'd3;
    near_q <= !rst_i && sched_valid_i && !comm_valid_i && commutation_q != CommRsc &&
        signed'(until_comm) < signed'({19'b0, near_limit_q});
  end
  assign near = near_q && !comm_valid_i;
  assign restart = comm_valid_i && commutation_q == CommCsc;
  assign start = wrap_q || restart;
  assign natural = comm_valid_i && commutation_q == CommNsc && !wrap_q;
  assign reach = next_q + {5'b0, min_q};
  assign ended = next_q >= {1'b0, width_q};
  assign rest_short = !full_q && (ended || reach > {1'b0, width_q});
  assign tail_short = reach > end_q;

  logic drop, drop_q;
  always_comb begin
    pulse_d = pulse_q;
    width_d = width_q;
    full_d  = full_q;
    early_d = early_q;
    held_d  = held_q;
    drop    = 1'b0;
    if (start) begin
      early_d = 1'b0;
      held_d  = 1'b0;
      width_d = width_c_q;
      full_d  = full_c_q && !none_c_q;
      drop    = (none_c_q || full_c_q) && !pinned_c_q;
      if (near) begin
        // Nothing is begun that the commutation would end too soon; what goes on goes on.
        held_d = !pulse_q && !none_c_q;
        drop   = drop || pulse_q == none_c_q;
        if (none_c_q) width_d = '0;
      end else if (!none_c_q) begin
        pulse_d = 1'b1;
      end else begin
        // A pulse begun early that turns out to be the only one gets its minimum.
        pulse_d = early_q && pulse_q;
        width_d = {4'b0, min_q};
        drop    = drop || pulse_d;
      end
    end else if (natural) begin
      held_d = 1'b0;
      if (pulse_q ? !rest_short : held_q && !rest_short) begin
        pulse_d = 1'b1;
      end else if (tail_short && (pulse_q || !none_c_q)) begin
        pulse_d = 1'b1;
        full_d  = 1'b1;
        early_d = 1'b1;
        drop    = 1'b1;
      end else begin
        pulse_d = 1'b0;
        drop    = pulse_q && !ended;
      end
    end else if (pulse_q && !full_q && ended) begin
      pulse_d = near;
      drop    = near;
    end
  end

  // Volt-seconds owed.
  volt_seconds_t carry_step;
  logic carry_up_ok, carry_down_ok;
  assign carry_up_ok   = signed'(carry_q[25:8]) < signed'({2'b0, last_q});
  assign carry_down_ok = signed'(carry_q[25:8]) > -signed'({2'b0, last_q});
  always_comb begin
    carry_step = pulse_q ? -26'sd256 : 26'sd0;
    if (count_q < duty_q[23:8]) carry_step += 26'sd256;
    else if (count_q == duty_q[23:8]) carry_step += signed'({18'b0, duty_q[7:0]});
  end

  always_ff @(posedge clk_i) begin
    start_q   <= start;
    count_q   <= start ? '0 : next_q[15:0];
    next_q    <= start ? 17'd1 : next_q + 17'd1;
    wrap_q    <= !start && next_q >= {1'b0, last_q};  // count_q reaches last_q; a period has 4 clocks or more
    pulse_q   <= pulse_d;
    width_q   <= width_d;
    full_q    <= full_d;
    early_q   <= early_d;
    held_q    <= held_d;
    changed_q <= drop || (changed_q && !start);
    drop_q    <= drop && (start || !changed_q);
    dropped_q <= dropped_q + 16'(drop_q);
    if (start) begin
      last_q   <= last_c_q;
      end_q    <= {1'b0, last_c_q} + 17'd1;
      duty_q   <= duty_c_q;
      pinned_q <= pinned_c_q;
    end
    if (pinned_q) carry_q <= '0;
    else if (carry_step[25] ? carry_down_ok : carry_up_ok) carry_q <= carry_q + carry_step;
    pending_q <= commutation_q == CommRsc && !start && (pending_q || comm_valid_i);
    if (rst_i) begin
      start_q   <= 1'b0;
      count_q   <= '0;
      next_q    <= 17'd1;
      wrap_q    <= 1'b0;
      pulse_q   <= 1'b0;
      width_q   <= '0;
      full_q    <= 1'b0;
      early_q   <= 1'b0;
      held_q    <= 1'b0;
      changed_q <= 1'b0;
      drop_q    <= 1'b0;
      dropped_q <= '0;
      last_q    <= '1;
      end_q     <= 17'h10000;
      duty_q    <= '0;
      pinned_q  <= 1'b1;
      carry_q   <= '0;
      pending_q <= 1'b0;
    end
  end

  assign apply_o = (commutation_q == CommRsc) ? start && (pending_q || comm_valid_i) : comm_valid_i || pending_q;
  assign pulse_o = pulse_q;
  assign carrier_start_o = start_q;
  assign count_o = count_q;
  assign dropped_o = dropped_q;

  always_ff @(posedge clk_i) begin
    if (!rst_i) begin
      assert (count_q <= last_q)
      else $error("fl_carrier: count beyond the period");
    end
  end

endmodule
`default_nettype wire
