// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Interval meter: times between crossings, their sum over an electrical period, and the crossing counters.
//
// interval = time of this crossing - time of the last one (24 bits, saturates; wrap-safe for any pause). It is taken
// over only if exactly one commutation lies between the two, otherwise a missed crossing would double it; the time of
// the last crossing is taken over in any case. zc_stale_i marks a crossing of the visit that the last commutation ended
// (its sample was still in the pipeline): that commutation is not counted as lying between. Three commutations without
// crossing make the interval unknown.
//
// zc_single_i: the source itself vouches that the crossing is the next one (Hall edges); commutations are not counted.
// run_o tells that the last three intervals, interval_o, interval1_o, interval2_o, follow each other and lie between
// crossings whose times are good (not zc_spoilt_i: a late one that is not computed back).
//
// period_o is the sum of the six sectors' last intervals; it saturates until each sector has one.
// assume_i: no crossing was found in the visit that the commutation of the same clock ends; one is assumed an interval
// after the last (if an interval is known).
//
// Latency: zc_valid_i at clock k, outputs new at k + Latency, all in the same clock, together with done_o.
// clear_i forgets everything; rebase_i: the next crossing ends no interval; forget_i: the interval is unknown from now
// on; restart_i: run_o starts anew. Crossings are at least 4 clocks apart.
`default_nettype none
module fl_interval_meter
  import fl_pkg::*;
#(
    localparam int unsigned Latency = 3
) (
    input  logic                 clk_i,
    input  logic                 rst_i,
    input  logic                 clear_i,
    input  stamp_t               now_i,
    input  logic                 zc_valid_i,
    input  stamp_t               zc_time_i,
    input  sector_t              zc_sector_i,
    input  logic                 zc_late_i,
    input  logic                 zc_spoilt_i,
    input  logic                 zc_stale_i,
    input  logic                 zc_single_i,
    input  logic                 rebase_i,
    input  logic                 forget_i,
    input  logic                 restart_i,
    input  logic                 comm_i,
    input  logic                 assume_i,
    output logic                 done_o,
    output logic                 known_o,            // interval_o is a measured one
    output logic    [23:0]       interval_o,         // clocks, saturates
    output logic    [23:0]       interval1_o,        // the one before
    output logic    [23:0]       interval2_o,        // the one before that
    output logic                 run_o,
    output logic    [26:0]       period_o,           // clocks, saturates
    output logic    [ 5:0][23:0] sector_interval_o,  // clocks, saturates; that ended in sector index + 1
    output stamp_t               zc_time_o,          // last crossing
    output logic    [15:0]       crossings_o,        // wraps
    output logic    [ 7:0]       late_o              // wraps
);

  localparam logic [23:0] Saturated = '1;
  localparam logic [26:0] PeriodSaturated = 27'd6 * 27'(Saturated);

  // Distance of the arriving crossing, or of this clock, from the last crossing.
  stamp_t distance_q, last_q;
  logic elapsed_q;  // so long ago that stamps may have wrapped since

  // Crossing in work: 1 distance known, 2 interval known.
  logic valid1_q, valid2_q, done_q, measure1_q, measure2_q, late1_q, spoilt1_q;
  stamp_t  time1_q;
  sector_t sector1_q;
  logic [23:0] new_q, old_q;

  logic have_q, known_q, assume_zc, assumed_q;
  logic [1:0] span_q;  // commutations since the last crossing, saturates
  logic [1:0] span_base;
  logic [2:0] good_q;  // good crossings in a row, each an interval after the one before; up to 4

  assign assume_zc = assume_i && known_q;
  assign span_base = zc_valid_i ? {1'b0, zc_stale_i} : assume_zc ? 2'd0 : span_q;

  always_ff @(posedge clk_i) begin
    valid1_q   <= zc_valid_i;
    valid2_q   <= valid1_q;
    done_q     <= valid2_q;
    distance_q <= (zc_valid_i ? zc_time_i : now_i) - last_q;
    span_q     <= (comm_i && span_base != '1) ? span_base + 2'd1 : span_base;
    if (span_q == '1) known_q <= 1'b0;
    assumed_q <= assume_zc;
    // distance_q of a clock without crossing lags last_q by a clock.
    if (!valid1_q && !done_q && !assumed_q && !distance_q[31] && distance_q[30:28] != '0) elapsed_q <= 1'b1;
    if (zc_valid_i) begin
      time1_q    <= zc_time_i;
      sector1_q  <= zc_sector_i;
      late1_q    <= zc_late_i;
      spoilt1_q  <= zc_spoilt_i;
      measure1_q <= have_q && (zc_single_i || span_q == (zc_stale_i ? 2'd2 : 2'd1));
    end
    if (valid1_q) begin
      measure2_q <= measure1_q && !(distance_q[31] && !elapsed_q) && distance_q != '0 && sector1_q < 3'd6;
      new_q      <= (elapsed_q || distance_q[31:24] != '0) ? Saturated : distance_q[23:0];
      old_q      <= (sector1_q < 3'd6) ? sector_interval_o[sector1_q] : '0;
    end
    if (assume_zc) begin
      last_q    <= last_q + stamp_t'(interval_o);
      elapsed_q <= 1'b0;
    end
    if (valid2_q) begin
      have_q      <= 1'b1;
      last_q      <= time1_q;
      elapsed_q   <= 1'b0;
      crossings_o <= crossings_o + 16'd1;
      if (late1_q) late_o <= late_o + 8'd1;
      if (spoilt1_q) good_q <= 3'd0;
      else if (!measure2_q || good_q == 3'd0) good_q <= 3'd1;
      else if (good_q != 3'd4) good_q <= good_q + 3'd1;
      if (measure2_q) begin
        known_q                      <= 1'b1;
        interval_o                   <= new_q;
        interval1_o                  <= interval_o;
        interval2_o                  <= interval1_o;
        sector_interval_o[sector1_q] <= new_q;
        period_o                     <= period_o - 27'(old_q) + 27'(new_q);
      end
    end
    if (rebase_i || forget_i) have_q <= 1'b0;
    if (forget_i) known_q <= 1'b0;
    if (rebase_i || forget_i || restart_i || assume_zc || span_q == '1) good_q <= '0;
    if (clear_i || rst_i) begin
      valid1_q          <= 1'b0;
      valid2_q          <= 1'b0;
      done_q            <= 1'b0;
      have_q            <= 1'b0;
      known_q           <= 1'b0;
      good_q            <= '0;
      elapsed_q         <= 1'b0;
      span_q            <= '0;
      last_q            <= '0;
      interval_o        <= Saturated;
      period_o          <= PeriodSaturated;
      sector_interval_o <= {6{Saturated}};
      crossings_o       <= '0;
      late_o            <= '0;
    end
  end

  assign done_o    = done_q;
  assign known_o   = known_q;
  assign run_o     = good_q == 3'd4;
  assign zc_time_o = last_q;

endmodule
`default_nettype wire
