// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Time of a crossing that fl_zcd has found: direct, interpolated, averaged, or computed back.
//
// Samples come with count_i when they count for the visit, in order of time: those before the crossing, the crossing
// sample itself (with crossing_i), those after it. rel is the value against the threshold; time, rel and past stay for
// the clock after count_i too.
//   direct        t = time of the crossing sample: late crossings, method FIRST, gaps above 65535 clocks
//   interpolated  t = t_before + gap * |rel_before| / (|rel_before| + |rel|), the straight line across the gap
//   averaged      t = T_b + (T_a - T_b) * D_b / (D_b + D_a): the line between the mean of 4 samples before and the mean of
//                 4 after, else of 2 and 2. T: mean time; D: mean of d(|rel_i|) (fl_angle_time), negative for a sample
//                 after the crossing that noise puts before it. d straightens the sine; its scale (flux, speed) cancels.
//                 Where D_a is not positive there is no such line: t = T_a - D_a, which continues it at D_a = 0.
//                 Interpolated where fewer count, the interval or the peak is unknown, or one of the two nearest samples
//                 on a side saturates, lies FarClocks or more from the interpolated crossing or has d >= 2^15 - 1 clocks.
//   computed back t = t_i - d(|rel_i|) of a late crossing with compute_back_i, direct where that saturates (sine) or
//                 interval or peak are unknown (six-step.md: better than the thesis)
// An averaged crossing waits for samples until now_i is interval * wait / 2^8 after it or the visit ends (comm_applied_i)
// and is then reported with those that are worked out. A new crossing drops one that still waits.
//
// Latency, crossing_i to zc_valid_o: direct 2, interpolated 20, computed back BackLatency, averaged 22 to AverageLatency
// where the samples are there, and never later than WaitLatency after the wait limit (20 if that is later).
// Asserted: no crossing while one is being interpolated or handed over.
`default_nettype none
module fl_crossing_time
  import fl_pkg::*;
#(
    localparam int unsigned BackLatency    = 27,
    localparam int unsigned WaitLatency    = 24,
    localparam int unsigned AverageLatency = 20 + 8 * 27 + 2 + 20,
    localparam int unsigned FarClocks      = 1 << 13
) (
    input logic   clk_i,
    input logic   rst_i,
    input stamp_t now_i,

    input zc_method_e        method_i,
    input logic              compute_back_i,
    input logic              linear_i,
    input logic       [16:0] peak_i,          // 2^17 = full scale, 0: unknown
    input logic       [ 7:0] wait_q8_i,       // of an interval
    input logic       [23:0] interval_i,      // clocks
    input logic              known_i,         // interval_i is a measured one

    input logic           clear_i,         // drop a crossing that waits
    input logic           comm_applied_i,
    input logic           first_i,         // with count_i: no sample of this visit counted before
    input logic           count_i,
    input logic           crossing_i,      // with count_i
    input logic           open_i,          // with count_i: the visit's crossing is still to come
    input logic           past_i,          // at or past the threshold
    input sector_t        sector_i,
    input stamp_t         time_i,
    input sample_t        rel_i,
    input stamp_t         before_time_i,   // of the last sample that counted before the crossing
    input logic    [15:0] gap_i,           // clocks since then
    input logic           gap_long_i,      // more than that

    output logic           zc_valid_o,
    output stamp_t         zc_time_o,
    output logic           zc_late_o,
    output logic           zc_back_o,
    output logic           zc_averaged_o,
    output sector_t        zc_sector_o,
    output sample_t        zc_value_o,
    output sample_t        zc_value_before_o,
    output logic    [15:0] crossings_o,        // these wrap
    output logic    [15:0] late_o,
    output logic    [15:0] back_o,
    output logic    [15:0] averaged_o
);

  // Distance from the threshold.
  function automatic logic [16:0] magnitude(sample_t value);
    if (value == 18'sh20000) return '1;
    return value[17] ? 17'(-value) : 17'(value);
  endfunction

  // x + y + carry in one adder.
  function automatic logic signed [31:0] plus(logic signed [31:0] x, logic signed [31:0] y, logic carry);
    return 32'(({x, 1'b1} + {y, carry}) >> 1);
  endfunction

  typedef enum logic [2:0] {
    Idle,
    Interpolate,  // the divider runs
    Back,         // the distance of a late crossing's sample is worked out
    Choose,       // averaged: pick the next sample that is there
    Angle,        // averaged: its distance is worked out
    Mean,         // averaged: the divider runs for the line between the means
    Report        // averaged: the mean, or what was interpolated
  } state_e;

  // Sums for the line between the means, over half of the samples or all. None can wrap.
  typedef struct packed {
    logic [14:0] lead;  // from T_b to the interpolated crossing, clocks
    logic [14:0] lag;  // from there to T_a
    logic [16:0] distance_before;  // D_b, clocks
    logic signed [17:0] distance_after;  // D_a, clocks
  } sums_t;

  state_e state_d, state_q;

  // Samples around the crossing: 0..7 before it (a ring, four are used), 8..11 after it. A sample is written where it would
  // belong, whether it is before the crossing shows later; that of the crossing comes once more, as the first one after.
  localparam int unsigned EntryBits = 32 + 17 + 1;
  (* ram_style = "distributed" *) logic [EntryBits-1:0] store[16];
  logic [EntryBits-1:0] entry_q;
  logic [2:0] newest_q;  // place of the last one before
  logic [2:0] before_q, after_q;  // samples stored, 0..4
  logic [2:0] before_next;
  logic [3:0] store_address;
  logic take_before, take_after;
  logic [16:0] size, before_size_q;

  logic late, can_interpolate, can_angle, begun_q;  // begun: the clock after crossing_i
  logic busy, interpolated;
  logic [15:0] offset;

  assign late            = first_i;
  assign can_interpolate = method_i != ZcFirst && !late && !gap_long_i;
  assign can_angle       = known_i && peak_i != '0;
  assign size            = magnitude(rel_i);

  assign take_before     = count_i && open_i && !crossing_i;
  assign take_after      = count_i && !open_i && !crossing_i && after_q != 3'd4;
  assign before_next     = first_i ? 3'd0 : before_q;

  // The ring turns with every sample before the crossing.
  always_comb begin
    if (begun_q) store_address = 4'd8;
    else if (open_i) store_address = {1'b0, newest_q + 3'd1};
    else store_address = {1'b1, after_q};
  end

  always_ff @(posedge clk_i) begin
    if (count_i || begun_q) store[store_address] <= {past_i, size, time_i};
    if (take_before) begin
      newest_q <= newest_q + 3'd1;
      before_q <= (before_next == 3'd4) ? 3'd4 : before_next + 3'd1;
      after_q  <= 3'd4;
    end
    if (crossing_i) after_q <= 3'd1;
    else if (take_after) after_q <= after_q + 3'd1;
    if (clear_i || rst_i) begin
      newest_q <= '0;
      before_q <= '0;
      after_q  <= 3'd4;
    end
  end

  // The crossing that is being timed.
  logic late_q, direct_q, average_q;
  sector_t sector_q;
  sample_t before_rel_q, value_after_q, value_before_q;
  stamp_t base_q, correction, corrected;
  logic correction_carry;
  logic interpolate_q, back_q;  // state_q is Interpolate; Back and the distance is used
  logic mean_half_q, mean_all_q;  // state_q is Report, of the first half or of all

  always_ff @(posedge clk_i) begin
    if (take_before) begin
      before_rel_q  <= rel_i;
      before_size_q <= size;
    end
    if (crossing_i) begin
      late_q         <= late;
      average_q      <= method_i == ZcAveraged && before_q >= 3'd2 && can_angle;
      sector_q       <= sector_i;
      value_after_q  <= rel_i;
      value_before_q <= late ? '0 : before_rel_q;
      base_q         <= can_interpolate ? before_time_i : time_i;
    end else if (interpolated && state_q == Interpolate) begin
      base_q <= corrected;
    end
  end

  // Averaging. Order of work: the first half, after 0, before 0, 1, after 1; then the second one, before 2, 3, after 2, 3.
  localparam logic [3:0] HalfDone = 4'd4, AllDone = 4'd8;
  logic [3:0] step_q;  // samples that are in the sums
  logic failed_q;  // the next one: no more are taken
  logic [2:0] pick;  // place around the crossing: before 0..3 from the newest, 4 + after 0..3
  logic ready, enough;
  logic wait_over, wait_over_q, limit_passed_q;
  sums_t sums_q, half_q, divided;
  logic line, mean_start, mean_started_q, mean_done;  // line: there is one
  logic [31:0] since_base_q;  // between the sample and the interpolated crossing, 0 or more
  logic half, sample_failed, opposite;  // half: a clock that distance lacks
  logic signed [18:0] mean_sum_q;  // from the interpolated crossing, times the samples on a side, half a unit more
  logic angle_start, angle_started_q, angle_valid, angle_done, angle_saturated, back_right;
  logic [24:0] distance;
  stamp_t elapsed;
  logic [31:0] limit_q;
  logic [7:0] wait_q;
  logic [3:0] wait_count_q;

  always_comb begin
    unique case (step_q[2:0])
      3'd0: pick = 3'd4;
      3'd1: pick = 3'd0;
      3'd2: pick = 3'd1;
      3'd3: pick = 3'd5;
      3'd4: pick = 3'd2;
      3'd5: pick = 3'd3;
      3'd6: pick = 3'd6;
      default: pick = 3'd7;
    endcase
  end

  // An average begins with two before the crossing; the second half counts with all eight only.
  assign ready = !pick[2] || after_q > {1'b0, pick[1:0]};
  assign enough = failed_q || step_q == AllDone || (step_q == HalfDone && before_q != 3'd4);
  assign elapsed = now_i - base_q;

  assign sample_failed = angle_saturated || since_base_q >= FarClocks || distance >= 25'h7FFF;
  assign opposite = !entry_q[EntryBits-1];  // of one after the crossing: before it by its value

  assign divided = (step_q == AllDone) ? sums_q : half_q;
  assign line = divided.distance_after > 18'sd0;
  assign mean_start = state_q == Mean && !mean_started_q && line && !crossing_i;
  assign mean_done = state_q == Mean && (mean_started_q ? interpolated : !line);

  logic busy_average, busy_average_q;
  assign wait_over    = wait_over_q || (busy_average_q && limit_passed_q);
  assign busy_average = state_q == Choose || state_q == Angle || state_q == Mean || state_q == Report;

  always_comb begin
    state_d     = state_q;
    angle_start = 1'b0;
    unique case (state_q)
      Idle: ;
      Interpolate: if (interpolated) state_d = average_q ? Choose : Idle;
      Back: begin
        angle_start = !angle_started_q;
        if (angle_done) state_d = Idle;
      end
      Choose: begin
        if (enough || wait_over) state_d = (step_q >= HalfDone) ? Mean : Report;
        else if (ready) state_d = Angle;
      end
      // What is being worked on when the wait is over is left out.
      Angle: begin
        angle_start = !angle_started_q;
        if (wait_over || angle_done) state_d = Choose;
      end
      Mean: if (mean_done) state_d = Report;
      Report: state_d = Idle;
      default: state_d = Idle;
    endcase
    if (busy_average && clear_i) state_d = Idle;
    if (crossing_i) begin
      state_d = Idle;
      if (can_interpolate) state_d = Interpolate;
      else if (late && compute_back_i && can_angle) state_d = Back;
    end
  end

  assign back_right = linear_i || !angle_saturated;
  assign angle_done = angle_valid && angle_started_q;

  always_ff @(posedge clk_i) begin
    state_q         <= state_d;
    begun_q         <= crossing_i;
    // The sum of the report chooses by these alone. What they tell of holds until then: back_right since the angle's start.
    interpolate_q   <= state_d == Interpolate;
    back_q          <= state_d == Back && back_right;
    mean_half_q     <= mean_done && state_d == Report && step_q != AllDone;
    mean_all_q      <= mean_done && state_d == Report && step_q == AllDone;
    direct_q        <= crossing_i && state_d == Idle;
    // What the unit still worked on for a crossing that is gone is not taken.
    angle_started_q <= (state_q == Back || state_q == Angle) && state_d == state_q && !crossing_i;
    if (state_q == Choose) begin
      entry_q <= store[pick[2]?{2'b10, pick[1:0]} : {1'b0, newest_q-{1'b0, pick[1:0]}}];
    end
    if (crossing_i) entry_q[48:32] <= size;  // computed back: that of the crossing sample
    // The later less the earlier; with the sample's distance, 24 clocks later, it is long there.
    since_base_q   <= (entry_q[31:0] ^ {32{!pick[2]}}) + (base_q ^ {32{pick[2]}}) + 32'd1;
    mean_started_q <= state_q == Mean && state_d == Mean;
    // Sums: a distance of the opposite sign is subtracted, -(x + h) = ~x + !h.
    if (state_q == Angle && angle_done) begin
      failed_q <= sample_failed;
      if (!sample_failed) begin
        step_q <= step_q + 4'd1;
        if (!pick[2]) begin
          sums_q.lead            <= sums_q.lead + 15'(since_base_q[12:0]);
          sums_q.distance_before <= sums_q.distance_before + 17'(distance[14:0]) + 17'(half);
        end else begin
          sums_q.lag            <= sums_q.lag + 15'(since_base_q[12:0]);
          sums_q.distance_after <= sums_q.distance_after + $signed({18{opposite}} ^ {3'd0, distance[14:0]}) +
              $signed({17'd0, opposite ^ half});
        end
      end
    end
    if (state_q == Choose && step_q == HalfDone) half_q <= sums_q;
    if (mean_done) begin
      mean_sum_q <= $signed(line ? {3'd0, offset} : {4'd0, divided.lag}) -
          (line ? $signed({4'd0, divided.lead}) : 19'(divided.distance_after)) +
          ((step_q == AllDone) ? 19'sd2 : 19'sd1);
    end
    // Wait limit: interval * wait_q8 by shifts while the divider runs; then the clock decides.
    if (wait_count_q != 4'd0) begin
      wait_count_q <= wait_count_q - 4'd1;
      wait_q       <= {1'b0, wait_q[7:1]};
      limit_q      <= (limit_q >> 1) + (wait_q[0] ? {1'b0, interval_i, 7'd0} : 32'd0);
    end
    // The comparison takes a clock for itself.
    limit_passed_q <= elapsed >= 32'(limit_q[31:8]) && !elapsed[31];
    busy_average_q <= busy_average;
    wait_over_q    <= wait_over;
    // Used when the interpolation is done at the earliest.
    if (begun_q) begin
      sums_q       <= '0;
      step_q       <= '0;
      failed_q     <= 1'b0;
      wait_over_q  <= 1'b0;
      limit_q      <= '0;
      wait_q       <= wait_q8_i;
      wait_count_q <= 4'd8;
    end
    if (comm_applied_i && !crossing_i) wait_over_q <= 1'b1;
    if (rst_i) begin
      state_q  <= Idle;
      direct_q <= 1'b0;
    end else begin
      assert (!(crossing_i && (busy && state_q == Interpolate || direct_q)))
      else $error("fl_crossing_time: crossing while the one before is being timed");
    end
  end

  // One divider for both lines and for the arc sine's argument.
  logic div_start, start_interpolation;
  logic [15:0] div_gap;
  logic [16:0] div_before, div_after, div_left, div_right;

  assign start_interpolation = crossing_i && can_interpolate && !(busy && state_q == Interpolate);

  always_comb begin
    div_gap   = '1;
    div_left  = div_before;
    div_right = div_after;
    if (start_interpolation) begin
      div_gap   = gap_i;
      div_left  = before_size_q;
      div_right = size;
    end else if (mean_start) begin
      div_gap   = 16'(divided.lead) + 16'(divided.lag);
      div_left  = divided.distance_before;
      div_right = divided.distance_after[16:0];
    end
  end

  fl_angle_time u_angle (
      .clk_i,
      .rst_i,
      .start_i     (angle_start),
      .value_i     (entry_q[48:32]),
      .peak_i,
      .interval_i,
      .linear_i,
      .div_start_o (div_start),
      .div_before_o(div_before),
      .div_after_o (div_after),
      .div_valid_i (interpolated),
      .div_offset_i(offset),
      .busy_o      (),
      .valid_o     (angle_valid),
      .distance_o  (distance),
      .half_o      (half),
      .saturated_o (angle_saturated)
  );

  fl_interpolator #(
      .TimeBits (16),
      .ValueBits(17)
  ) u_interpolator (
      .clk_i,
      .rst_i,
      .start_i (start_interpolation || div_start || mean_start),
      .abort_i (start_interpolation || div_start || mean_start),
      .gap_i   (div_gap),
      .before_i(div_left),
      .after_i (div_right),
      .busy_o  (busy),
      .valid_o (interpolated),
      .offset_o(offset)
  );

  // Report.
  logic report_interpolated, report_back, report_mean, back_taken, mean_taken, emit;

  assign report_interpolated = state_q == Interpolate && interpolated && !average_q;
  assign report_back         = state_q == Back && angle_done;
  assign report_mean         = state_q == Report;
  assign back_taken          = report_back && back_q;
  assign mean_taken          = report_mean && (mean_half_q || mean_all_q);
  assign emit                = direct_q || report_interpolated || report_back || report_mean;

  // One sum for all of them; the interpolated time is also the base of the mean.
  always_comb begin
    correction = ({32{interpolate_q}} & stamp_t'(offset)) | ({32{back_q}} & ~stamp_t'(distance)) |
        ({32{mean_half_q}} & stamp_t'(32'(mean_sum_q) >>> 1)) | ({32{mean_all_q}} & stamp_t'(32'(mean_sum_q) >>> 2));
    correction_carry = back_q && !half;
  end
  assign corrected = stamp_t'(plus($signed(base_q), $signed(correction), correction_carry));

  always_ff @(posedge clk_i) begin
    zc_valid_o <= emit;
    if (emit) begin
      zc_time_o         <= corrected;
      zc_late_o         <= late_q;
      zc_back_o         <= back_taken;
      zc_averaged_o     <= mean_taken;
      zc_sector_o       <= sector_q;
      zc_value_o        <= value_after_q;
      zc_value_before_o <= value_before_q;
      crossings_o       <= crossings_o + 16'd1;
      if (late_q) late_o <= late_o + 16'd1;
      if (back_taken) back_o <= back_o + 16'd1;
      if (mean_taken) averaged_o <= averaged_o + 16'd1;
    end
    if (rst_i) begin
      zc_valid_o        <= 1'b0;
      zc_time_o         <= '0;
      zc_late_o         <= 1'b0;
      zc_back_o         <= 1'b0;
      zc_averaged_o     <= 1'b0;
      zc_sector_o       <= '0;
      zc_value_o        <= '0;
      zc_value_before_o <= '0;
      crossings_o       <= '0;
      late_o            <= '0;
      back_o            <= '0;
      averaged_o        <= '0;
    end
  end

endmodule
`default_nettype wire
