// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Zero-crossing detector (ZCD): finds when the voltage of the open phase, or its third harmonic, passes the threshold of
// the sector. Source: Yang 2020, chapters 2 to 4. docs/theory/six-step.md derives the equations.
//
// Equation: rel = v - round(vdc * threshold_q17 / 2^17). cfg_source_i chooses v (e: EMF of the open phase):
//   ZcTerminal   terminal of the open phase: C, B, A, C, B, A in sectors I..VI     rel = 3/2 e at the threshold vdc/2
//   ZcStarPoint  star point of the sense resistors, channel vsm                    rel = v_SM = 1/2 e
//   ZcMean       round((va + vb + vc) / 3): the same, computed                     rel = v_SM
// With v_SM = v - vdc/2 the last two are rel = v_SM - vdc * (threshold_q17 - 0x10000) / 2^17.
// rel must rise in II, IV, VI and fall in I, III, V. With cfg_reverse_i it is the other way round.
//
// Which samples count. All of these must hold:
//   - the PWM was on,
//   - the gates last changed cfg_settle_i or more clocks before,
//   - the last commutation lies cfg_blank_i or more clocks back,
//   - no diode clamps the sample,
//   - the cfg_need_previous_i samples before it were unclamped and from the same on-state: same sector, no gate change
//     in between. The filter of the terminal settles in them once a diode has let it go.
// So no clamped or chopped-off sample takes part, on either side of the zero crossing.
// Clamped: v < margin or v > vdc - margin. Third harmonic: a clamped phase gives |v_SM| = vdc/6, so the test is
// |v_SM| > vdc/6 - margin, exactly 3 * (v - margin) < vdc or 3 * (v + margin) > 2 * vdc.
//
// Zero crossing: the first sample of a sector visit that counts and is at or past the threshold. There is one per visit.
// It is late if no sample before it counted: freewheeling hid the crossing. fl_crossing_time finds its time: the
// sample's own, interpolated across the chop-off gap, averaged, or computed back. The last way needs peak and
// interval_i (mean_i with cfg_use_mean_i).
//
// Sector, time and ages belong to the sample, not to the clock that looks at it. A commutation that reaches the gates
// while a sample is in the pipeline does not touch that sample. A new visit begins with enabling, with a sample of
// another sector, or with a sample whose comm_age is shorter than its distance from the sample before.
//
// Outputs: zc_valid_o is a pulse. The others stay until the next zero crossing:
//   zc_value_o, zc_value_before_o  rel of the first sample after and of the last one before (0 when late), signed,
//                                  2^17 = full scale, not inverted for falling sectors
//   zc_late_o                      freewheeling hid the crossing
//   zc_back_o                      late, but the time is that of the crossing
//   zc_averaged_o                  the time is a mean of samples
// Settings are copied at update_i. After reset the detector is disabled.
//
// Latency, sample_valid_i to zc_valid_o in clocks: DirectLatency for a sample's own time, InterpolatedLatency,
// BackLatency. fl_crossing_time states that of averaged times. ZcMean adds MeanLatency to each.
// Asserted: samples are at least 4 clocks apart, 6 with ZcMean.
`default_nettype none
module fl_zcd
  import fl_pkg::*;
#(
    parameter  int unsigned Phases              = 3,
    localparam int unsigned Channels            = 2 * Phases + 3,
    localparam int unsigned DirectLatency       = 5,
    localparam int unsigned InterpolatedLatency = 23,
    localparam int unsigned BackLatency         = 30,
    localparam int unsigned MeanLatency         = 2
) (
    input logic   clk_i,
    input logic   rst_i,
    input stamp_t now_i,

    input logic                    update_i,
    input logic                    cfg_enable_i,
    input zc_method_e              cfg_method_i,         // 3 counts as interpolated
    input logic                    cfg_compute_back_i,
    input logic                    cfg_linear_i,         // flank: 0 sine, 1 straight line
    input logic                    cfg_use_mean_i,       // 0: interval_i, 1: mean_i
    input zc_source_e              cfg_source_i,         // 3 counts as terminal
    input logic       [ 3:0]       cfg_need_previous_i,  // samples
    input logic       [15:0]       cfg_settle_i,         // clocks
    input logic       [15:0]       cfg_blank_i,          // clocks
    input logic       [16:0]       cfg_margin_i,         // 2^17 = full scale
    input logic       [16:0]       cfg_peak_i,           // 2^17 = full scale, 0: unknown
    input logic       [ 7:0]       cfg_wait_q8_i,        // of an interval
    input logic       [ 5:0][16:0] cfg_threshold_i,      // Q0.17 of vdc
    input logic                    cfg_reverse_i,

    input logic [23:0] interval_i,  // clocks, of the last crossing
    input logic [23:0] mean_i,      // clocks, over the last six
    input logic        known_i,

    input logic                      comm_applied_i,
    input logic                      sample_valid_i,
    input sample_t    [Channels-1:0] sample_i,
    input stamp_t                    sample_time_i,
    input pwm_state_t                sample_pwm_i,

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

  if (Phases < 3) begin : gen_illegal
    $fatal(1, "fl_zcd: six-step needs Phases >= 3 (%m)");
  end

  localparam int unsigned VdcChannel = 2 * Phases;
  localparam int unsigned StarChannel = 2 * Phases + 2;

  // Active settings.
  logic enable_q, compute_back_q, linear_q, use_mean_q, reverse_q;
  zc_method_e method_q;
  zc_source_e source_q;
  logic [3:0] need_q;
  logic [15:0] settle_q, blank_q;
  logic [16:0] margin_q, peak_q;
  logic [7:0] wait_q8_q;
  logic [5:0][16:0] threshold_q;

  always_ff @(posedge clk_i) begin
    if (update_i) begin
      enable_q       <= cfg_enable_i;
      method_q       <= cfg_method_i;
      compute_back_q <= cfg_compute_back_i;
      linear_q       <= cfg_linear_i;
      use_mean_q     <= cfg_use_mean_i;
      source_q       <= cfg_source_i;
      need_q         <= cfg_need_previous_i;
      settle_q       <= cfg_settle_i;
      blank_q        <= cfg_blank_i;
      margin_q       <= cfg_margin_i;
      peak_q         <= cfg_peak_i;
      wait_q8_q      <= cfg_wait_q8_i;
      threshold_q    <= cfg_threshold_i;
      reverse_q      <= cfg_reverse_i;
    end
    if (rst_i) enable_q <= 1'b0;
  end

  // Stage 1: pick the sector's channel and threshold. The mean of the terminals takes two clocks more:
  // sum / 3 = sum * 0x55555 / 2^20, which is the exactly rounded quotient for every sum of three samples. With sum =
  // 4 h + l: sum * 0x55555 = 2^4 h * 0x15555 + sum + 4 l * 0x15555, one multiplier for h's 18 bits.
  localparam logic [20:0] ThirdLow[4] = '{21'h080000, 21'h0D5554, 21'h12AAA8, 21'h17FFFC};  // 2^19 + 4 l * 0x15555
  logic mean_q, third_q, wait1_q, wait2_q, fresh_q, valid1_q, valid2_q, valid3_q;
  sample_t value_q, vdc_q;
  logic signed [19:0] sum_q;
  logic signed [34:0] third_high_q;
  logic signed [21:0] third_low_q;  // and half a unit
  logic signed [39:0] third_product;
  logic [16:0] threshold1_q;
  stamp_t time_q;
  pwm_state_t pwm_q;

  assign third_product = (40'(third_high_q) <<< 4) + 40'(third_low_q);
  assign valid1_q      = mean_q ? wait2_q : fresh_q;

  always_ff @(posedge clk_i) begin
    fresh_q   <= sample_valid_i && enable_q;
    wait1_q   <= fresh_q && mean_q;
    wait2_q   <= wait1_q;
    valid2_q  <= valid1_q;
    valid3_q  <= valid2_q;
    third_high_q <= 35'($signed(sum_q[19:2])) * 35'sh15555;
    third_low_q  <= 22'(sum_q) + $signed({1'b0, ThirdLow[sum_q[1:0]]});
    if (wait1_q) value_q <= sample_t'(third_product >>> 20);
    if (sample_valid_i && enable_q) begin
      value_q      <= (source_q == ZcStarPoint) ? sample_i[StarChannel] : sample_i[floating_phase(sample_pwm_i.sector)];
      sum_q        <= 20'(sample_i[0]) + 20'(sample_i[1]) + 20'(sample_i[2]);
      mean_q       <= source_q == ZcMean;
      third_q      <= source_q == ZcMean || source_q == ZcStarPoint;
      vdc_q        <= sample_i[VdcChannel];
      threshold1_q <= (sample_pwm_i.sector < 3'd6) ? threshold_q[sample_pwm_i.sector] : '0;
      time_q       <= sample_time_i;
      pwm_q        <= sample_pwm_i;
    end
    if (rst_i) begin
      fresh_q  <= 1'b0;
      wait1_q  <= 1'b0;
      wait2_q  <= 1'b0;
      valid2_q <= 1'b0;
      valid3_q <= 1'b0;
    end else begin
      assert (!(sample_valid_i && (fresh_q || wait1_q || wait2_q || valid2_q || valid3_q)))
      else $error("fl_zcd: samples too close");
    end
  end

  // Stage 2: threshold product, limits, ages, distances to the sample before and to the last one that counted.
  logic signed [35:0] product_q;
  // Clamped: low < 0, of the third harmonic low + (2 low - vdc) < 0; room < 0, of the third harmonic 2 room < high, which
  // is room + floor(-high / 2) < 0.
  logic signed [18:0] low, low_q, high;  // value - margin, value + margin
  logic signed [19:0] room, room_q;  // vdc - high
  logic signed [20:0] low_more_q;
  logic low_below, room_below;
  logic signed [17:0] room_more_q;
  logic room_carry_q;
  logic aged_q, long_q, gap_long_q;
  logic [15:0] since_q, gap_q;  // clocks
  stamp_t previous_time_q, before_time_q, since, gap;

  assign low   = 19'(value_q) - 19'($signed({1'b0, margin_q}));
  assign high  = 19'(value_q) + 19'($signed({1'b0, margin_q}));
  assign room  = 20'(vdc_q) - 20'(high);
  assign since = time_q - previous_time_q;
  assign gap   = time_q - before_time_q;

  always_ff @(posedge clk_i) begin
    if (valid1_q) begin
      product_q  <= 36'(vdc_q) * 36'($signed({1'b0, threshold1_q}));
      low_q      <= low;
      room_q     <= room;
      low_more_q   <= third_q ? (21'(low) <<< 1) - 21'(vdc_q) : '0;
      room_more_q  <= third_q ? ~high[18:1] : '0;
      room_carry_q <= third_q && !high[0];
      aged_q     <= pwm_q.on && pwm_q.age >= settle_q && pwm_q.comm_age >= blank_q;
      long_q     <= since[31:16] != '0;
      since_q    <= since[15:0];
      gap_long_q <= gap[31:16] != '0;
      gap_q      <= gap[15:0];
    end
  end

  // Stage 3: value against the threshold, relation to the sample before.
  logic known_q, applied_q;  // known: there is a sample before since enabling
  sector_t previous_sector_q;
  sample_t rel_q;
  logic clamped_q, same_state_q, new_visit_q, zero, zero_q;  // zero: of rel
  sample_t below;
  logic same_sector, visit_break;

  // rel is value + below, and 1 unless it is rounded: 0 where all bits differ, or where each sum is the carry that the bits
  // below it give, with no chain through the bits.
  assign below       = ~product_q[34:17];
  assign zero        = (value_q ^ below) == (product_q[16] ? {value_q[16:0] | below[16:0], 1'b0} : '1);

  assign same_sector = known_q && pwm_q.sector == previous_sector_q;
  // A pause of the sampler outlasts the 16-bit age: then only the commutation pulse tells.
  assign visit_break = long_q ? applied_q : pwm_q.comm_age < since_q;

  assign low_below   = 21'(low_q) + low_more_q < 21'sd0;
  assign room_below  = 21'(room_q) + 21'(room_more_q) + 21'($signed({1'b0, room_carry_q})) < 21'sd0;

  always_ff @(posedge clk_i) begin
    if (comm_applied_i) applied_q <= 1'b1;
    if (valid2_q) begin
      rel_q <= 18'(19'(value_q) - 19'(product_q >>> 17) - 19'($signed({1'b0, product_q[16]})));
      zero_q <= zero;
      clamped_q <= low_below || room_below;
      same_state_q <= same_sector && !long_q && pwm_q.age >= since_q;
      new_visit_q <= !same_sector || visit_break;
      known_q <= 1'b1;
      previous_sector_q <= pwm_q.sector;
      previous_time_q <= time_q;
      applied_q <= comm_applied_i;
    end
    if (!enable_q || rst_i) known_q <= 1'b0;
  end

  // Stage 4: decide.
  logic [3:0] run_before, run_q;  // unclamped samples in a row in this on-state, up to 15
  logic rising, counts, past, open, have_before, count, crossing;
  logic done_q, have_before_q;  // of this visit

  always_comb begin
    rising      = pwm_q.sector[0] ^ reverse_q;
    run_before  = same_state_q ? run_q : '0;
    counts      = aged_q && !clamped_q && run_before >= need_q;
    past        = rising ? !rel_q[17] : (rel_q[17] || zero_q);
    open        = new_visit_q || !done_q;
    have_before = !new_visit_q && have_before_q;
    count       = valid3_q && counts;
    crossing    = count && open && past;
  end

  always_ff @(posedge clk_i) begin
    if (valid3_q) begin
      run_q <= (!pwm_q.on || clamped_q) ? '0 : (run_before == '1) ? '1 : run_before + 4'd1;
      done_q <= !open || crossing;
      have_before_q <= have_before;
      if (counts && open && !past) begin
        have_before_q <= 1'b1;
        before_time_q <= time_q;
      end
    end
  end

  fl_crossing_time u_time (
      .clk_i,
      .rst_i,
      .now_i,
      .method_i      (method_q),
      .compute_back_i(compute_back_q),
      .linear_i      (linear_q),
      .peak_i        (peak_q),
      .wait_q8_i     (wait_q8_q),
      .interval_i    (use_mean_q ? mean_i : interval_i),
      .known_i,
      .clear_i       (!enable_q),
      .comm_applied_i,
      .first_i       (!have_before),
      .count_i       (count),
      .crossing_i    (crossing),
      .open_i        (open),
      .past_i        (past),
      .sector_i      (pwm_q.sector),
      .time_i        (time_q),
      .rel_i         (rel_q),
      .before_time_i (before_time_q),
      .gap_i         (gap_q),
      .gap_long_i    (gap_long_q),
      .zc_valid_o,
      .zc_time_o,
      .zc_late_o,
      .zc_back_o,
      .zc_averaged_o,
      .zc_sector_o,
      .zc_value_o,
      .zc_value_before_o,
      .crossings_o,
      .late_o,
      .back_o,
      .averaged_o
  );

endmodule
`default_nettype wire
