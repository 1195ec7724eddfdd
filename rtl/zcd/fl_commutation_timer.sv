// Commutation timer: from crossing time to commutation instant.
//
// ZCD: the gates are wanted to change at
//   t_c = zc_time + round(interval * k / 2^16) - cfg_latency,   k = delay_q16 - advance_q16, limited to 0..2^16,
// interval = the last measured crossing interval; forced_interval stands in until there is one.
// FORCED: t_c = previous t_c + forced_interval (first: clock of the update that enters the mode + forced_interval, not
// below 64). An interval taken over at an update counts from the next schedule. FORCED to ZCD: the running schedule
// stays until a crossing replaces it. Crossings are measured in both modes.
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
// Latency: zc_valid_i to comm_valid_o at least CrossingLatency.
// Asserted: no two commutations in successive clocks.
`default_nettype none
module fl_commutation_timer
  import fl_pkg::*;
#(
    // verilator lint_off UNUSEDPARAM
    localparam int unsigned CrossingLatency = 7
    // verilator lint_on UNUSEDPARAM
) (
    input logic   clk_i,
    input logic   rst_i,
    input stamp_t now_i,
    input logic   update_i,

    input comm_mode_e         cfg_mode_i,
    input logic               cfg_force_on_miss_i,
    input logic        [ 7:0] cfg_miss_limit_i,
    input logic        [15:0] cfg_delay_q16_i,        // of an interval
    input logic signed [15:0] cfg_advance_q16_i,      // of an interval, positive = earlier
    input logic        [15:0] cfg_latency_i,          // clocks
    input logic        [23:0] cfg_forced_interval_i,  // clocks
    input logic        [15:0] cfg_timeout_q12_i,      // of an interval

    input logic    zc_valid_i,
    input stamp_t  zc_time_i,
    input logic    zc_late_i,
    input sector_t zc_sector_i,
    input sector_t sector_i,     // sequencer's sector

    output logic   comm_valid_o,
    output stamp_t comm_sched_o,
    output logic   sched_valid_o,
    output logic   overdue_o,      // with comm_valid_o: t_c had passed
    output logic   lost_o,

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
    output logic   [ 5:0][23:0] snap_sector_interval_o
);

  localparam logic [23:0] MinForcedInterval = 24'd64;
  localparam sector_t NoSector = 3'd7;

  // Active settings.
  comm_mode_e mode_d, mode_q;
  logic force_on_miss_q;
  logic [7:0] miss_limit_q;
  logic [15:0] latency_q, timeout_q;
  logic [23:0] forced_q;
  logic signed [17:0] fraction_d;
  logic [16:0] fraction_q;  // k

  assign fraction_d = 18'($signed({2'b00, cfg_delay_q16_i})) - 18'(cfg_advance_q16_i);

  always_comb begin
    mode_d = mode_q;
    if (update_i) begin
      mode_d = (cfg_mode_i == TimerForced || cfg_mode_i == TimerZcd) ? cfg_mode_i : TimerOff;
    end
  end

  always_ff @(posedge clk_i) begin
    mode_q <= mode_d;
    if (update_i) begin
      force_on_miss_q <= cfg_force_on_miss_i;
      miss_limit_q    <= cfg_miss_limit_i;
      latency_q       <= cfg_latency_i;
      timeout_q       <= cfg_timeout_q12_i;
      forced_q        <= (cfg_forced_interval_i < MinForcedInterval) ? MinForcedInterval : cfg_forced_interval_i;
      if (fraction_d < 18'sd0) fraction_q <= '0;
      else if (fraction_d > 18'sd65536) fraction_q <= 17'h10000;
      else fraction_q <= fraction_d[16:0];
    end
    if (rst_i) mode_q <= TimerOff;
  end

  logic to_off, from_off, to_forced, to_zcd;  // this update changes the mode
  assign to_off    = mode_d == TimerOff;
  assign from_off  = mode_q == TimerOff && mode_d != TimerOff;
  assign to_forced = mode_d == TimerForced && mode_q != TimerForced;
  assign to_zcd    = mode_d == TimerZcd && mode_q == TimerOff;

  // Crossings: measured always, used when fresh and in ZCD mode.
  logic measured, fresh, use_crossing, fire, commutate, assume_zc, known, meter_done;
  logic [23:0] interval, meter_interval;
  logic [26:0] period;
  logic [5:0][23:0] sector_interval;
  stamp_t last_zc_time;
  logic [15:0] crossings;
  logic [7:0] late;
  sector_t left_sector_q;  // sector that the last commutation left

  assign measured     = zc_valid_i && mode_q != TimerOff;
  assign fresh        = zc_sector_i != left_sector_q;
  assign use_crossing = measured && fresh && mode_q == TimerZcd;

  fl_interval_meter u_meter (
      .clk_i,
      .rst_i,
      .clear_i          (from_off),
      .now_i,
      .zc_valid_i       (measured),
      .zc_time_i,
      .zc_sector_i,
      .zc_late_i,
      .zc_stale_i       (!fresh),
      .comm_i           (commutate),
      .assume_i         (assume_zc),
      .done_o           (meter_done),
      .known_o          (known),
      .interval_o       (meter_interval),
      .period_o         (period),
      .sector_interval_o(sector_interval),
      .zc_time_o        (last_zc_time),
      .crossings_o      (crossings),
      .late_o           (late)
  );

  assign interval = known ? meter_interval : forced_q;

  // The schedule: one target instant, either of a commutation or of a timeout.
  stamp_t sched_q, base_q, zc_base_q, ahead_q, target, target_base;
  logic armed_q, is_timeout_q, hold;
  stamp_t passed;  // clocks since the last chance to meet the target

  // ahead_q is the instant at which the gates change if this clock decides to commutate.
  assign passed    = ahead_q - sched_q;
  assign fire      = armed_q && !hold && !passed[31] && !to_off;
  assign commutate = fire && (!is_timeout_q || force_on_miss_q);
  assign assume_zc = fire && is_timeout_q && force_on_miss_q;

  // Arithmetic on one multiplier and one adder.
  typedef enum logic [2:0] {
    Idle,
    Measure,         // crossing: wait for its interval
    ZcProduct,       // interval * k
    ZcLoad,          // schedule the commutation
    TimeoutProduct,  // interval * timeout
    TimeoutLoad      // arm the timeout
  } state_e;

  state_e state_d, state_q;
  logic timeout_pending_q, forced_load_q, load_operands;
  logic [23:0] factor_q;
  logic [16:0] scale_q;
  logic [28:0] product_q;  // without the 12 lowest bits of the product
  stamp_t addend;
  logic round;

  always_comb begin
    state_d       = state_q;
    load_operands = 1'b0;
    unique case (state_q)
      Idle: begin
        if (timeout_pending_q) begin
          load_operands = 1'b1;
          state_d       = TimeoutProduct;
        end
      end
      Measure: begin
        if (meter_done) begin
          load_operands = 1'b1;
          state_d       = ZcProduct;
        end
      end
      ZcProduct:           state_d = ZcLoad;
      TimeoutProduct:      state_d = TimeoutLoad;
      ZcLoad, TimeoutLoad: state_d = Idle;
      default:             state_d = Idle;
    endcase
    if (use_crossing) state_d = Measure;
    if (to_off || to_forced) state_d = Idle;
  end

  // A crossing in work replaces whatever is armed.
  assign hold = use_crossing || state_q == Measure || state_q == ZcProduct || state_q == ZcLoad;

  always_comb begin
    target_base = base_q;
    addend      = stamp_t'(forced_q);
    round       = 1'b0;
    if (state_q == ZcLoad) begin
      target_base = zc_base_q;
      addend      = stamp_t'(product_q[28:4]);
      round       = product_q[3];
    end else if (state_q == TimeoutLoad) begin
      addend = stamp_t'(product_q);
    end
    target = target_base + addend + stamp_t'(round);
  end

  always_ff @(posedge clk_i) begin
    ahead_q       <= now_i + stamp_t'(CommLatencyCycles + 1);
    state_q       <= state_d;
    forced_load_q <= 1'b0;
    if (use_crossing) begin
      zc_base_q         <= zc_time_i - stamp_t'(latency_q);
      timeout_pending_q <= 1'b0;
    end
    if (load_operands) begin
      factor_q <= interval;
      scale_q  <= (state_q == Measure) ? fraction_q : {1'b0, timeout_q};
    end
    if (state_q == ZcProduct || state_q == TimeoutProduct) begin
      product_q <= 29'((41'(factor_q) * 41'(scale_q)) >> 12);
    end
    if (forced_load_q || state_q == ZcLoad || state_q == TimeoutLoad) begin
      sched_q           <= target;
      armed_q           <= 1'b1;
      is_timeout_q      <= state_q == TimeoutLoad;
      timeout_pending_q <= 1'b0;
    end
    if (fire) begin
      armed_q           <= 1'b0;
      base_q            <= ahead_q;
      forced_load_q     <= mode_d == TimerForced;
      timeout_pending_q <= mode_d == TimerZcd;
    end
    if (commutate) left_sector_q <= sector_i;
    if (to_forced || to_zcd) begin
      base_q            <= now_i;
      forced_load_q     <= to_forced;
      timeout_pending_q <= to_zcd;
      armed_q           <= 1'b0;
    end
    if (from_off) left_sector_q <= NoSector;
    if (to_off) begin
      armed_q           <= 1'b0;
      forced_load_q     <= 1'b0;
      timeout_pending_q <= 1'b0;
    end
    if (rst_i) begin
      state_q           <= Idle;
      armed_q           <= 1'b0;
      is_timeout_q      <= 1'b0;
      forced_load_q     <= 1'b0;
      timeout_pending_q <= 1'b0;
      sched_q           <= '0;
      left_sector_q     <= NoSector;
    end
  end

  assign comm_sched_o  = sched_q;
  assign sched_valid_o = armed_q && !is_timeout_q;

  // Events and counters.
  logic [15:0] commutations_q;
  logic [7:0] misses_q, overdue_q, timeouts_q;
  logic missed, late_fire;

  assign missed    = fire && is_timeout_q;
  assign late_fire = fire && !is_timeout_q && passed != '0;

  always_ff @(posedge clk_i) begin
    comm_valid_o <= commutate;
    overdue_o    <= late_fire;
    lost_o       <= missed && miss_limit_q != '0 && misses_q + 8'd1 == miss_limit_q;
    if (commutate) commutations_q <= commutations_q + 16'd1;
    if (late_fire) overdue_q <= overdue_q + 8'd1;
    if (missed) begin
      timeouts_q <= timeouts_q + 8'd1;
      if (misses_q != '1) misses_q <= misses_q + 8'd1;
    end
    if (measured) misses_q <= '0;
    if (from_off || rst_i) begin
      commutations_q <= '0;
      overdue_q      <= '0;
      timeouts_q     <= '0;
      misses_q       <= '0;
    end
    if (rst_i) begin
      comm_valid_o <= 1'b0;
      overdue_o    <= 1'b0;
      lost_o       <= 1'b0;
    end else begin
      assert (!(comm_valid_o && fire))
      else $error("fl_commutation_timer: two commutations in a row");
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
    end
  end

endmodule
`default_nettype wire
