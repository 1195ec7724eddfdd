// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Commutation timer: from crossing time to commutation instant.
//
// ZCD: the gates are wanted to change at
//   t_c = zc_time + round(interval * k / 2^16) - cfg_latency,   k = delay_q16 - advance_q16, limited to 0..2^16,
// interval = the last measured crossing interval; forced_interval stands in until there is one.
// With cfg_correction_a_i and three good intervals t[n], t[n-1], t[n-2] in a row (Yang 2020, ch. 2)
//   t_c = zc_time + round(interval * k / 2^16) + (-4 t[n] + t[n-1] + 3 t[n-2]) / 6 - cfg_latency,
// the delay limited to 0..1 interval; at delay_q16 = 0x8000 that is (-t[n] + t[n-1] + 3 t[n-2]) / 6 less the advance. The
// quotient is good to 4e-6 and a clock. A miss, a late crossing that is not computed back (zc_late_i without
// zc_back_i) and a change of direction start the row anew.
//
// FORCED: t_c = previous t_c + forced_interval (first: clock of the update that enters the mode + forced_interval, not
// below 64). An interval taken over at an update counts from the next schedule. FORCED or HALL to ZCD: the running
// schedule stays until a crossing replaces it; HALL without one: an interval after the last edge. Crossings are
// measured in both modes.
//
// HALL: the edge into sector s at hall_time_i names the sector to drive; comm_load_o and comm_sector_o go with every
// commutation. At the edge: at once. With cfg_hall_timed_i, when the interval is known and the edge is one of the set
// direction, with mean = mean interval of the last six edges (last interval until there are six):
//   t_c = hall_time + round(mean * (hall_offset[s] - advance_q16) / 2^16) - cfg_latency     into s, then
//   t_c + mean                                                                              into the sector after s
// whichever is still to come; the edge into that sector corrects it. So a sensor that comes late is timed from the
// edge before. No edge for interval * timeout_q12: the interval is forgotten and the sector of the sensors is driven.
// On entry the last edge counts as if it came now; a sector that is one ahead of it is left if the motor turns, until
// the edge into it comes. hall_*
// stay until the next edge; hall_ok_i: the code is valid, hall_single_i: it is the neighbour of the one before.
//
// comm_valid_o comes CommToGateCycles before t_c, so that CSC and NSC change the gate pins exactly in the clock with
// now_i = t_c; if t_c is nearer than that when it is computed, at once, marked and counted overdue. comm_sched_o is t_c
// while sched_valid_o (still ahead) and with comm_valid_o.
//
// Timeout (ZCD): no crossing by interval * timeout_q12 / 2^12 after the last commutation (or entry) counts a miss. With
// force_on_miss a commutation comes at that instant and a crossing is assumed an interval after the last one; without,
// the same time runs again. Timeouts are not announced by sched_valid_o. A crossing that arrives no later than the
// clock that would decide wins. misses counts consecutive ones, lost_o pulses when they reach miss_limit (0: never).
//
// A crossing belongs to the visit of its own sector: one whose sector the last commutation has already left (its sample
// was in the pipeline) is measured but starts no commutation.
//
// Settings are taken over at update_i (reset: OFF). Leaving OFF clears all measurements and counters. Snapshots are
// taken at tick_i. Stamps wrap; instants may lie 2^31 clocks apart.
// Latency: zc_valid_i to comm_valid_o at least CrossingLatency, with correction A CorrectionLatency; hall_valid_i to
// comm_valid_o at least HallLatency.
// Asserted: no two commutations in successive clocks.
`default_nettype none
module fl_commutation_timer
  import fl_pkg::*;
#(
    localparam int unsigned CrossingLatency   = 7,
    localparam int unsigned CorrectionLatency = 10,
    localparam int unsigned HallLatency       = 10
) (
    input logic   clk_i,
    input logic   rst_i,
    input stamp_t now_i,
    input logic   update_i,

    input comm_mode_e               cfg_mode_i,
    input logic                     cfg_force_on_miss_i,
    input logic        [ 7:0]       cfg_miss_limit_i,
    input logic        [15:0]       cfg_delay_q16_i,        // of an interval
    input logic signed [15:0]       cfg_advance_q16_i,      // of an interval, positive = earlier
    input logic        [15:0]       cfg_latency_i,          // clocks
    input logic        [23:0]       cfg_forced_interval_i,  // clocks
    input logic        [15:0]       cfg_timeout_q12_i,      // of an interval
    input logic                     cfg_correction_a_i,
    input logic                     cfg_hall_timed_i,
    input logic        [ 5:0][15:0] cfg_hall_offset_q16_i,  // of an interval, signed
    input logic                     cfg_reverse_i,

    input logic    zc_valid_i,
    input stamp_t  zc_time_i,
    input logic    zc_late_i,
    input logic    zc_back_i,
    input sector_t zc_sector_i,
    input sector_t sector_i,     // sequencer's sector

    input logic    hall_valid_i,
    input stamp_t  hall_time_i,
    input sector_t hall_position_i,  // sector for positive speed after the edge, 0..5
    input logic    hall_backward_i,  // direction of the edge
    input logic    hall_single_i,
    input logic    hall_ok_i,

    output logic    comm_valid_o,
    output stamp_t  comm_sched_o,
    output logic    comm_load_o,    // the commutation is into comm_sector_o; stays until the next
    output sector_t comm_sector_o,
    output logic    sched_valid_o,
    output logic    overdue_o,      // with comm_valid_o: t_c had passed
    output logic    lost_o,

    output logic [23:0] interval_o,  // clocks, last one measured
    output logic [23:0] mean_o,      // clocks, of the last six; the last one until there are six
    output logic        known_o,     // they are measured ones

    input  logic                tick_i,
    output logic   [23:0]       snap_interval_o,
    output logic   [26:0]       snap_period_o,
    output stamp_t              snap_zc_time_o,
    output logic   [15:0]       snap_crossings_o,
    output logic   [ 7:0]       snap_misses_o,
    output logic   [ 7:0]       snap_late_o,
    output logic   [15:0]       snap_commutations_o,
    output logic   [ 7:0]       snap_overdue_o,
    output logic   [ 7:0]       snap_timeouts_o,
    output logic   [ 5:0][23:0] snap_sector_interval_o,
    output logic   [23:0]       snap_mean_o,
    output logic                snap_known_o,
    output logic                snap_corrected_o
);

  localparam logic [23:0] MinForcedInterval = 24'd64;
  localparam sector_t NoSector = 3'd7;

  // Active settings.
  comm_mode_e mode_d, mode_q;
  logic force_on_miss_q;
  logic [7:0] miss_limit_q;
  logic [15:0] latency_q, timeout_q;
  logic [23:0] forced_d, forced_q;
  logic signed [17:0] fraction_d;
  logic [16:0] fraction_q;  // k
  logic correction_q, hall_timed_q, reverse_q;
  logic signed [15:0] advance_q;
  logic [5:0][15:0] hall_offset_q;

  assign fraction_d = 18'($signed({2'b00, cfg_delay_q16_i})) - 18'(cfg_advance_q16_i);

  always_comb begin
    mode_d = mode_q;
    forced_d = forced_q;
    if (update_i) begin
      mode_d   = cfg_mode_i;
      forced_d = (cfg_forced_interval_i < MinForcedInterval) ? MinForcedInterval : cfg_forced_interval_i;
    end
  end

  always_ff @(posedge clk_i) begin
    mode_q   <= mode_d;
    forced_q <= forced_d;
    if (update_i) begin
      force_on_miss_q <= cfg_force_on_miss_i;
      miss_limit_q    <= cfg_miss_limit_i;
      latency_q       <= cfg_latency_i;
      timeout_q       <= cfg_timeout_q12_i;
      correction_q    <= cfg_correction_a_i;
      hall_timed_q    <= cfg_hall_timed_i;
      hall_offset_q   <= cfg_hall_offset_q16_i;
      advance_q       <= cfg_advance_q16_i;
      reverse_q       <= cfg_reverse_i;
      if (fraction_d < 18'sd0) fraction_q <= '0;
      else if (fraction_d > 18'sd65536) fraction_q <= 17'h10000;
      else fraction_q <= fraction_d[16:0];
    end
    if (rst_i) mode_q <= TimerOff;
  end

  logic armed_q, is_timeout_q;  // a commutation or a timeout is scheduled
  logic to_off, from_off, to_forced, to_zcd, to_hall, from_hall;  // this update changes the mode
  assign to_off    = mode_d == TimerOff;
  assign from_off  = mode_q == TimerOff && mode_d != TimerOff;
  assign to_forced = mode_d == TimerForced && mode_q != TimerForced;
  assign to_zcd    = mode_d == TimerZcd && (mode_q == TimerOff || (mode_q == TimerHall && !(armed_q && !is_timeout_q)));
  assign to_hall   = mode_d == TimerHall && mode_q != TimerHall;
  assign from_hall = mode_q == TimerHall && mode_d != TimerHall;

  // Crossings: measured always, used when fresh and in ZCD mode. In HALL mode edges take their place.
  logic hall, use_edge, forget;
  sector_t hall_sector, hall_sector_q;  // to drive after the edge
  logic measured, fresh, use_crossing, fire, commutate, assume_zc, known, meter_done, run;
  logic [23:0] interval, meter_interval, interval1, interval2;
  logic [26:0] period;
  logic [5:0][23:0] sector_interval;
  stamp_t last_zc_time;
  logic [15:0] crossings;
  logic [7:0] late;
  sector_t left_sector_q;  // sector that the last commutation left

  assign hall         = mode_q == TimerHall;
  assign hall_sector  = reverse_q ? opposite_sector(hall_position_i) : hall_position_i;
  assign use_edge     = hall && hall_valid_i;
  assign measured     = (zc_valid_i && mode_q != TimerOff && !hall) || use_edge;
  assign fresh        = zc_sector_i != left_sector_q;
  assign use_crossing = zc_valid_i && fresh && mode_q == TimerZcd;

  fl_interval_meter u_meter (
      .clk_i,
      .rst_i,
      .clear_i          (from_off),
      .now_i,
      .zc_valid_i       (measured),
      .zc_time_i        (hall ? hall_time_i : zc_time_i),
      .zc_sector_i      (hall ? hall_sector : zc_sector_i),
      .zc_late_i        (zc_late_i && !hall),
      .zc_spoilt_i      (zc_late_i && !zc_back_i),
      .zc_stale_i       (!fresh && !hall),
      .zc_single_i      (hall && hall_single_i),
      .rebase_i         (to_hall || from_hall || (use_edge && !hall_single_i)),
      .forget_i         (forget),
      .restart_i        (update_i && cfg_reverse_i != reverse_q),
      .comm_i           (commutate && !hall),
      .assume_i         (assume_zc),
      .done_o           (meter_done),
      .known_o          (known),
      .interval_o       (meter_interval),
      .interval1_o      (interval1),
      .interval2_o      (interval2),
      .run_o            (run),
      .period_o         (period),
      .sector_interval_o(sector_interval),
      .zc_time_o        (last_zc_time),
      .crossings_o      (crossings),
      .late_o           (late)
  );

  assign interval = known ? meter_interval : forced_q;

  // The schedule: one target instant, either of a commutation or of a timeout.
  stamp_t sched_q, base_q, zc_base_q, ahead_q, target, target_base;
  logic hold, resync;
  sector_t target_sector_q;  // HALL: into which the armed commutation goes...
  logic target_known_q;  // ...unless it is one of before, which steps
  logic chain_q;  // HALL: an interval after it follows that into the sector after
  stamp_t passed;  // clocks since the last chance to meet the target

  // ahead_q is the instant at which the gates change if this clock decides to commutate.
  assign passed    = ahead_q - sched_q;
  assign fire      = armed_q && !hold && !passed[31] && !to_off;
  assign resync    = hall_ok_i && sector_i != hall_sector;
  assign commutate = fire && (!is_timeout_q || (hall ? resync : force_on_miss_q));
  assign assume_zc = fire && is_timeout_q && force_on_miss_q && !hall;
  assign forget    = (fire && is_timeout_q && hall) || (use_edge && !hall_single_i);

  // Arithmetic on one multiplier and one adder.
  typedef enum logic [3:0] {
    Idle,
    Measure,            // crossing: wait for its interval
    ZcProduct,          // interval * k
    CorrectionLoad,     // keep it, take up the difference of the intervals
    CorrectionProduct,  // difference / 6
    CorrectionSum,
    ZcLoad,             // schedule the commutation
    TimeoutProduct,     // interval * timeout
    TimeoutLoad,        // arm the timeout
    MeanProduct,        // period / 6
    MeanLoad,
    HallMeasure,        // edge: wait for its interval
    HallOperands,       // mean interval, offset of the sector less advance
    HallProduct,        // their product
    HallLoad            // schedule the commutation
  } state_e;

  localparam logic [16:0] SixthQ19 = 17'd87381;

  state_e state_d, state_q;
  logic timeout_pending_q, mean_pending_q, entry_q, forced_load_q, load_operands, correct, corrected_q;
  logic [23:0] factor_q, mean_d, mean_q;
  logic [16:0] scale_q;
  logic [28:0] product_q;  // without the 12 lowest bits of the product
  logic [24:0] partial_q;  // interval * k
  logic negative_q;  // sign of what the multiplier does not see
  logic signed [26:0] difference, difference_q;
  logic [26:0] interval0_w, interval2_w;
  logic [26:0] difference_size;
  logic signed [26:0] corrected_delay_q, room_q, sixth;  // room: from partial_q to the interval
  logic load_corrected;  // next, the sum with the correction
  logic beyond;  // the corrected delay is beyond the interval
  logic zc_load_q, hall_load_q, timeout_load_q;  // state_q is ZcLoad, HallLoad, TimeoutLoad
  // What is added in this clock: a product and its sign, the timeout's, the corrected delay, something else.
  logic add_fraction_q, add_negative_q, add_corrected_q, add_other_q, from_zc_q;
  logic [23:0] other_d, other_q;  // interval, mean or forced interval
  stamp_t next_base_q;  // zc_base_q and a mean interval
  logic signed [27:0] corrected_sum;
  logic signed [16:0] hall_offset, hall_fraction_q, hall_negated_q;  // offset less advance, and the other way round
  logic [24:0] rounded;
  stamp_t addend;
  logic carry;  // half a unit that the addend lacks
  logic [32:0] target_sum;
  logic period_known_q;

  // HALL: what the edge that is being worked on asks for.
  logic hall_ready, hall_timing, in_sector, one_ahead;
  logic into_next_q;  // HallLoad: the motor is driven in that sector
  assign hall_ready = hall_ok_i && hall_single_i && hall_backward_i == reverse_q;
  assign hall_timing = hall_timed_q && known && hall_ready;
  assign in_sector = sector_i == hall_sector_q;
  assign one_ahead = entry_q && known && hall_ready && sector_i == sector_after(hall_sector_q, reverse_q);

  assign correct = correction_q && run;
  // -4 t[n] + t[n-1] + 3 t[n-2]
  assign interval0_w = 27'(meter_interval);  // a run is of measured ones
  assign interval2_w = 27'(interval2);
  assign difference = 27'(interval1) + interval2_w + (interval2_w << 1) - (interval0_w << 2);
  assign difference_size = difference_q[26] ? 27'(-difference_q) : 27'(difference_q);
  assign hall_offset = 17'($signed(hall_offset_q[hall_sector_q]));

  always_comb begin
    state_d       = state_q;
    load_operands = 1'b0;
    unique case (state_q)
      Idle: begin
        if (timeout_pending_q) begin
          load_operands = 1'b1;
          state_d       = TimeoutProduct;
        end else if (mean_pending_q || entry_q) begin
          state_d = MeanProduct;
        end
      end
      Measure: begin
        if (meter_done) begin
          load_operands = 1'b1;
          state_d       = ZcProduct;
        end
      end
      ZcProduct:                     state_d = correct ? CorrectionLoad : ZcLoad;
      CorrectionLoad:                state_d = CorrectionProduct;
      CorrectionProduct:             state_d = CorrectionSum;
      CorrectionSum:                 state_d = ZcLoad;
      TimeoutProduct:                state_d = TimeoutLoad;
      MeanProduct:                   state_d = MeanLoad;
      MeanLoad:                      state_d = hall ? HallOperands : Idle;
      HallMeasure:                   if (meter_done) state_d = MeanProduct;
      HallOperands:                  state_d = HallProduct;
      HallProduct:                   state_d = HallLoad;
      ZcLoad, TimeoutLoad, HallLoad: state_d = Idle;
      default:                       state_d = Idle;
    endcase
    if (use_crossing) state_d = Measure;
    if (use_edge) state_d = HallMeasure;
    if (to_off || to_forced || to_hall || from_hall) state_d = Idle;
  end

  // A crossing in work replaces whatever is armed; an edge does so when it is worked out. The last commutation before that
  // must have reached the sector when HallProduct looks at it.
  assign hold = use_crossing || state_q == Measure || state_q == ZcProduct || state_q == CorrectionLoad ||
      state_q == CorrectionProduct || state_q == CorrectionSum || state_q == ZcLoad ||
      state_q == HallOperands || state_q == HallProduct || state_q == HallLoad;

  // What is added to the base: the last product, rounded, or the sum with the correction, limited. Products are rounded
  // by the carry of the sum that they go into; -(x + r) = ~x + !r.
  assign rounded = product_q[28:4] + 25'(product_q[3]);
  assign sixth = {27{negative_q}} ^ {5'b0, product_q[28:7]};
  assign corrected_sum = 28'($signed({2'b0, partial_q, 1'b1})) + 28'($signed({sixth, negative_q ^ product_q[6]}));

  logic unused;
  assign unused = &{1'b0, corrected_sum[0], target_sum[0]};

  always_comb begin
    target_base = base_q;
    if (from_zc_q) target_base = into_next_q ? next_base_q : zc_base_q;
    addend = ({32{add_fraction_q}} & ({32{add_negative_q}} ^ stamp_t'(product_q[28:4]))) |
        ({32{timeout_load_q}} & stamp_t'(product_q)) |
        ({32{add_corrected_q}} & stamp_t'(corrected_delay_q)) | ({32{add_other_q}} & stamp_t'(other_q));
    carry = add_fraction_q && (add_negative_q ^ product_q[3]);
    target_sum = {target_base, 1'b1} + {addend, carry};
    target     = target_sum[32:1];
  end

  assign load_corrected = state_q == CorrectionSum && state_d == ZcLoad;
  assign beyond = $signed({sixth, negative_q ^ product_q[6]}) > $signed({room_q, 1'b0});

  always_comb begin
    mean_d = mean_q;
    if (state_q == MeanLoad) mean_d = period_known_q ? 24'(product_q[28:7]) + 24'(product_q[6]) : meter_interval;
    if (from_off || rst_i) mean_d = '1;

    // Where the correction leads beyond it, the interval.
    other_d = (mode_d == TimerForced) ? forced_d : mean_d;
    if (load_corrected) other_d = meter_interval;
  end

  always_ff @(posedge clk_i) begin
    // Chosen a clock ahead: the sum takes a clock for itself.
    other_q         <= other_d;
    from_zc_q       <= state_d == ZcLoad || state_d == HallLoad;
    add_fraction_q  <= (state_d == ZcLoad && !load_corrected) || state_d == HallLoad;
    add_negative_q  <= negative_q && state_d == HallLoad;
    add_corrected_q <= load_corrected && !corrected_sum[27] && !beyond;
    add_other_q     <= load_corrected ? !corrected_sum[27] && beyond :
        state_d != ZcLoad && state_d != HallLoad && state_d != TimeoutLoad;
    ahead_q       <= now_i + stamp_t'(CommLatencyCycles + 1);
    state_q       <= state_d;
    zc_load_q      <= state_d == ZcLoad;
    hall_load_q    <= state_d == HallLoad;
    into_next_q    <= state_d == HallLoad && in_sector;
    hall_sector_q   <= hall_sector;
    hall_fraction_q <= hall_offset - 17'(advance_q);
    hall_negated_q  <= 17'(advance_q) - hall_offset;
    timeout_load_q <= state_d == TimeoutLoad;
    next_base_q    <= zc_base_q + stamp_t'(mean_q);
    difference_q  <= difference;
    period_known_q <= period < 27'h0FFFFFF;
    forced_load_q <= 1'b0;
    if (use_crossing || state_q == HallOperands) begin
      zc_base_q         <= (hall ? hall_time_i : zc_time_i) - stamp_t'(latency_q);
      timeout_pending_q <= 1'b0;
    end
    if (state_q == Idle || state_q == HallMeasure) begin
      factor_q <= period[23:0];
      scale_q  <= SixthQ19;
    end
    if (load_operands) begin
      factor_q <= interval;
      scale_q  <= (state_q == Measure) ? fraction_q : {1'b0, timeout_q};
    end
    if (meter_done) mean_pending_q <= 1'b1;
    if (state_q == ZcProduct) corrected_q <= correct;
    if (state_q == CorrectionLoad) begin
      partial_q  <= rounded;
      negative_q <= difference_q[26];
      factor_q   <= (difference_size[26:24] != '0) ? '1 : difference_size[23:0];
      scale_q    <= SixthQ19;
    end
    room_q <= 27'($signed({3'b0, meter_interval})) - 27'($signed({2'b0, partial_q}));
    if (state_q == CorrectionSum) corrected_delay_q <= corrected_sum[27:1];
    if (state_q == MeanLoad) begin
      mean_pending_q <= 1'b0;
    end
    if (state_q == HallOperands) begin
      factor_q   <= mean_q;
      scale_q    <= hall_fraction_q[16] ? hall_negated_q : hall_fraction_q;
      negative_q <= hall_fraction_q[16];
    end
    if (state_q == ZcProduct || state_q == TimeoutProduct || state_q == MeanProduct || state_q == CorrectionProduct ||
        state_q == HallProduct) begin
      product_q <= 29'((41'(factor_q) * 41'(scale_q)) >> 12);
    end
    if (forced_load_q || zc_load_q || timeout_load_q) begin
      sched_q           <= target;
      armed_q           <= 1'b1;
      is_timeout_q      <= timeout_load_q;
      chain_q           <= 1'b0;
      timeout_pending_q <= 1'b0;
    end
    if (chain_q && forced_load_q) target_sector_q <= sector_after(target_sector_q, reverse_q);
    if (hall_load_q) begin
      entry_q <= 1'b0;
      if (hall_ok_i && one_ahead) armed_q <= 1'b0;
      if (hall_ok_i && !one_ahead) begin
        sched_q         <= hall_timing ? target : ahead_q + 32'd1;
        armed_q         <= hall_timing || !into_next_q;
        is_timeout_q    <= 1'b0;
        target_known_q  <= 1'b1;
        target_sector_q <= (hall_timing && into_next_q) ? sector_after(hall_sector_q, reverse_q) : hall_sector_q;
        chain_q         <= hall_timing && !into_next_q;
      end
    end
    if (fire) begin
      armed_q           <= 1'b0;
      base_q            <= (hall && chain_q) ? sched_q : ahead_q;
      forced_load_q     <= mode_d == TimerForced || (hall && chain_q);
      timeout_pending_q <= mode_d == TimerZcd || (hall && hall_timing && !chain_q && !is_timeout_q);
    end
    if (commutate) left_sector_q <= sector_i;
    if (to_forced || to_zcd) begin
      base_q            <= now_i;
      forced_load_q     <= to_forced;
      timeout_pending_q <= to_zcd;
      armed_q           <= 1'b0;
      chain_q           <= 1'b0;
    end
    if (to_hall) begin
      // A schedule of crossings stays until the last edge has been looked at; a timeout does not.
      entry_q           <= 1'b1;
      target_known_q    <= 1'b0;
      timeout_pending_q <= 1'b0;
      forced_load_q     <= 1'b0;
      chain_q           <= 1'b0;
      if (is_timeout_q) armed_q <= 1'b0;
    end
    if (to_zcd && from_hall && known && hall_ready && in_sector) begin
      // The crossing of this visit may have been: an interval after the edge, until a crossing replaces it.
      base_q            <= zc_base_q;
      forced_load_q     <= 1'b1;
      chain_q           <= 1'b1;
      timeout_pending_q <= 1'b0;
    end
    if (from_off) left_sector_q <= NoSector;
    if (to_off || from_hall) entry_q <= 1'b0;
    if (to_off) begin
      armed_q           <= 1'b0;
      forced_load_q     <= 1'b0;
      timeout_pending_q <= 1'b0;
      mean_pending_q    <= 1'b0;
      chain_q           <= 1'b0;
    end
    mean_q <= mean_d;
    if (rst_i) begin
      state_q           <= Idle;
      zc_load_q         <= 1'b0;
      hall_load_q       <= 1'b0;
      timeout_load_q    <= 1'b0;
      armed_q           <= 1'b0;
      is_timeout_q      <= 1'b0;
      forced_load_q     <= 1'b0;
      timeout_pending_q <= 1'b0;
      mean_pending_q    <= 1'b0;
      entry_q           <= 1'b0;
      chain_q           <= 1'b0;
      corrected_q       <= 1'b0;
      sched_q           <= '0;
      left_sector_q     <= NoSector;
    end
  end

  assign comm_sched_o  = sched_q;
  assign sched_valid_o = armed_q && !is_timeout_q;
  assign interval_o    = meter_interval;
  assign mean_o        = mean_q;
  assign known_o       = known;

  // Events and counters.
  logic [15:0] commutations_q;
  logic [7:0] misses_q, overdue_q, timeouts_q;
  logic missed, late_fire;

  assign missed    = fire && is_timeout_q;
  assign late_fire = fire && !is_timeout_q && passed != '0;

  always_ff @(posedge clk_i) begin
    comm_valid_o <= commutate;
    if (commutate) begin
      comm_load_o   <= hall && (is_timeout_q || target_known_q);
      comm_sector_o <= is_timeout_q ? hall_sector : target_sector_q;
    end
    overdue_o <= late_fire;
    lost_o    <= missed && !hall && miss_limit_q != '0 && misses_q + 8'd1 == miss_limit_q;
    if (commutate) commutations_q <= commutations_q + 16'd1;
    if (late_fire) overdue_q <= overdue_q + 8'd1;
    if (missed) begin
      timeouts_q <= timeouts_q + 8'd1;
      if (misses_q != '1 && !hall) misses_q <= misses_q + 8'd1;
    end
    if (measured || hall) misses_q <= '0;
    if (from_off || rst_i) begin
      commutations_q <= '0;
      overdue_q      <= '0;
      timeouts_q     <= '0;
      misses_q       <= '0;
    end
    if (rst_i) begin
      comm_valid_o <= 1'b0;
      comm_load_o  <= 1'b0;
      overdue_o    <= 1'b0;
      lost_o       <= 1'b0;
    end else begin
      assert (!(comm_valid_o && fire))
      else $error("fl_commutation_timer: two commutations in a row");
      assert (!forced_load_q || chain_q == (mode_q != TimerForced))
      else $error("fl_commutation_timer: the interval added is not that of the schedule");
    end
  end

  always_ff @(posedge clk_i) begin
    if (tick_i) begin
      snap_interval_o        <= meter_interval;
      snap_period_o          <= period;
      snap_zc_time_o         <= last_zc_time;
      snap_crossings_o       <= crossings;
      snap_misses_o          <= misses_q;
      snap_late_o            <= late;
      snap_commutations_o    <= commutations_q;
      snap_overdue_o         <= overdue_q;
      snap_timeouts_o        <= timeouts_q;
      snap_sector_interval_o <= sector_interval;
      snap_mean_o            <= mean_q;
      snap_known_o           <= known;
      snap_corrected_o       <= corrected_q;
    end
    if (rst_i) begin
      snap_interval_o        <= '1;
      snap_period_o          <= '1;
      snap_zc_time_o         <= '0;
      snap_crossings_o       <= '0;
      snap_misses_o          <= '0;
      snap_late_o            <= '0;
      snap_commutations_o    <= '0;
      snap_overdue_o         <= '0;
      snap_timeouts_o        <= '0;
      snap_sector_interval_o <= '1;
      snap_mean_o            <= '1;
      snap_known_o           <= 1'b0;
      snap_corrected_o       <= 1'b0;
    end
  end

endmodule
`default_nettype wire
