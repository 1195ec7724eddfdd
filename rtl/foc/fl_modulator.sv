// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Modulator: phase voltages to compare values of the leg carriers. Zero sequence by minimum and maximum, over-modulation
// to six-step, minimum pulse, dead-time compensation; one multiplier.
//
//   z       = floor((max(v) + min(v)) / 2)          the same for all legs (space-vector modulation with three of them)
//   raw     = period/2 + (v - z) * scale            rounded half up, once
//   comp(i) = clamp(beyond(i, band) * slope, -dead_time, dead_time)   rounded half up
//             beyond(i, band) = sign(i) max(|i| - band, 0)
//   comp    = comp(i), with pair_i (comp(i of early_i) + comp(i)) / 2, rounded half up; 0 where raw <= 0 or
//             raw >= period: no edges
//   compare = clamp(raw + comp, margin, period - margin), below min_pulse 0, above period - min_pulse period
//
// scale = period * full_scale / vdc / 2^17 = cfg_scale_i * 2^-cfg_scale_shift_i in clocks a unit, slope likewise; a
// shift of 0 counts as 1. Linear up to vdc/sqrt(3) (three phases) and 0.526 vdc (five); beyond it the legs' clamp is the
// over-modulation, with margin 0 up to square waves of the legs (fundamental 2/pi vdc). A margin keeps every leg
// switching: at most 4/pi * (1/2 - margin/period) vdc. A margin above 0 counts as at least min_pulse; margin and
// min_pulse count as at most half a period.
//
// Formats: v in 2^-17 of the voltage channel's full scale, i in 2^-17 of the current channel's, positive out of the
// leg; clocks elsewhere. compare is 0..period; what exceeds a number's range saturates (v - z, |product| above 131071
// clocks). |compare - exact| <= 1/2 clock + half a unit of v * scale, with compensation 1/2 clock more,
// of two currents 1 clock more.
// Both edges of a pulse may have their current: that of the one comes with early_i, that of the other with valid_i and
// pair_i. Settings are taken at valid_i, those of the currents at early_i too; period_o is the one that compare_o belongs to.
// Latency: valid_i to valid_o Latency clocks; least spacing the same, after early_i EarlyClocks (asserted; what
// comes closer is ignored). compare_o, period_o and clipped_o stay until the next valid_i.
// Asserted: compare_o at most period_o at valid_o.
`default_nettype none
module fl_modulator
  import fl_pkg::*;
#(
    parameter int unsigned Phases = 3,
    localparam int unsigned Latency = 2 * Phases + 6,  // clocks from valid_i to valid_o
    localparam int unsigned EarlyClocks = Phases + 4  // least clocks from early_i to valid_i
) (
    input  logic                       clk_i,
    input  logic                       rst_i,
    input  logic                       early_i,
    input  logic                       valid_i,
    input  logic                       pair_i,
    input  sample_t [Phases-1:0]       v_q17_i,
    input  sample_t [Phases-1:0]       i_q17_i,
    input  logic    [      15:0]       cfg_period_i,       // clocks
    input  logic    [      16:0]       cfg_scale_i,        // mantissa
    input  logic    [       4:0]       cfg_scale_shift_i,
    input  logic    [      16:0]       cfg_band_i,         // currents up to it are not compensated, unit of i
    input  logic    [      16:0]       cfg_slope_i,        // mantissa
    input  logic    [       4:0]       cfg_slope_shift_i,
    input  logic    [       9:0]       cfg_dead_time_i,    // clocks that a leg loses a carrier, 0: no compensation
    input  logic    [      11:0]       cfg_min_pulse_i,    // clocks
    input  logic    [      15:0]       cfg_margin_i,       // clocks
    output logic                       valid_o,
    output logic    [Phases-1:0][15:0] compare_o,          // clocks
    output logic    [      15:0]       period_o,           // clocks
    output logic    [Phases-1:0]       clipped_o           // the clamp bound this leg
);

  if (Phases < 2 || Phases > 8) begin : gen_illegal
    $fatal(1, "fl_modulator: Phases must be 2..8 (%m)");
  end

  typedef logic signed [19:0] half_clocks_t;

  // Settings of the vector in work.
  logic [15:0] period_q, margin_in_q, margin_q, high_q, min_q, longest_q;
  logic [16:0] scale_q, band_q, slope_q;
  logic [4:0] scale_shift_q, slope_shift_q;  // one less than the setting: products are in half clocks
  logic [9:0] dead_time_q;
  logic [11:0] min_in_q;

  function automatic logic [4:0] half_clock_shift(logic [4:0] shift);
    return (shift == '0) ? '0 : shift - 5'd1;
  endfunction

  function automatic sample_t beyond(sample_t i, logic [16:0] band);
    logic signed [18:0] less, more;
    less = 19'(i) - 19'($signed({1'b0, band}));
    more = 19'(i) + 19'($signed({1'b0, band}));
    if (!less[18]) return less[17:0];
    return more[18] ? more[17:0] : '0;
  endfunction

  // Saturation of v - z.
  function automatic sample_t difference(sample_t v, sample_t z);
    logic signed [18:0] y;
    y = 19'(v) - 19'(z);
    return (y[18] == y[17]) ? y[17:0] : {y[18], {17{!y[18]}}};
  endfunction

  // Products beyond 131071 clocks: nothing that follows tells them from the limit.
  function automatic half_clocks_t sat_half_clocks(logic signed [35:0] x);
    return (x[35:18] == {18{x[35]}}) ? x[19:0] : {{2{x[35]}}, {18{!x[35]}}};
  endfunction

  // Steps: the currents' products, beside them the search for the extremes; then the voltages' products.
  localparam int unsigned StepWidth = idx_width(2 * Phases);
  localparam logic [StepWidth-1:0] FirstVoltage = StepWidth'(Phases);
  localparam logic [StepWidth-1:0] LastStep = StepWidth'(2 * Phases - 1);
  logic busy_q, step_on_q, on_voltage, on_last;
  logic early_q;  // the currents in work are those of early_i
  logic pair_q;
  logic [StepWidth-1:0] step_q;
  sample_t [Phases-1:0] v_q, i_q;  // the next one in the lowest place; v_q turns round
  sample_t max_q, min_v_q, zero_q;
  logic accept, accept_early;

  assign accept       = valid_i && !busy_q;
  assign accept_early = early_i && !busy_q && !valid_i;
  assign on_last      = step_q == (early_q ? FirstVoltage - StepWidth'(1) : LastStep);
  assign on_voltage = step_q >= FirstVoltage;

  // Pipeline with the flags of its stages: 1 operands, 2 product, 3 half clocks, 4 raw or compensation, 5 sum; then the
  // compare.
  localparam int unsigned Stages = 6;
  logic [4:1] current_q;
  logic [3:1] early_last_q;
  logic [Stages-1:1] voltage_q, last_q;
  sample_t operand_q;
  logic signed [17:0] factor_q;
  logic [4:0] shift_q;
  logic [2:0] shift2_q;
  logic signed [35:0] product_q, shifted;
  half_clocks_t half_q;
  logic signed [18:0] raw_q, sum_q;
  logic signed [10:0] one_comp, one_comp_q, comp;
  logic [Phases-1:0][10:0] comp_q;  // the next one in the lowest place
  logic signed [19:0] edges_from_q, edges_to_q;  // half clocks
  logic edges_q, below, above;
  logic [15:0] pulse;
  logic valid_q;
  logic [Phases-1:0][15:0] compare_q;
  logic [Phases-1:0] clipped_q;

  assign shifted = product_q >>> shift2_q;

  // All limits are those of the half clocks before the rounding, (x + 1) >>> 1, so that they are looked at beside it.
  always_comb begin
    if (half_q > 20'($signed({1'b0, dead_time_q, 1'b0}))) one_comp = $signed({1'b0, dead_time_q});
    else if (half_q < 20'($signed({1'b1, ~dead_time_q, 1'b1}))) one_comp = -$signed({1'b0, dead_time_q});
    else one_comp = 11'((half_q[11:0] + 12'd1) >> 1);
    comp = (pair_q && !early_q) ? 11'((12'(one_comp_q) + 12'($signed(comp_q[0])) + 12'sd1) >>> 1) : one_comp_q;
  end

  // Margins are at least the minimum pulse or 0, and neither is above half a period: a limited sum is a legal pulse.
  assign below = sum_q < 19'($signed({1'b0, margin_q}));
  assign above = sum_q > 19'($signed({1'b0, high_q}));
  always_comb begin
    if (below) pulse = margin_q;
    else if (above) pulse = high_q;
    else if (sum_q[15:0] < min_q) pulse = '0;
    else if (sum_q[15:0] > longest_q) pulse = period_q;
    else pulse = sum_q[15:0];
  end

  always_ff @(posedge clk_i) begin
    if (accept || accept_early) begin
      busy_q        <= 1'b1;
      early_q       <= accept_early;
      step_on_q     <= 1'b1;
      step_q        <= '0;
      i_q           <= i_q17_i;
      band_q        <= cfg_band_i;
      slope_q       <= cfg_slope_i;
      slope_shift_q <= half_clock_shift(cfg_slope_shift_i);
      dead_time_q   <= cfg_dead_time_i;
    end else if (step_on_q) begin
      step_q    <= step_q + StepWidth'(1);
      step_on_q <= !on_last;
      v_q       <= {v_q[0], v_q[Phases-1:1]};
      i_q       <= {i_q[0], i_q[Phases-1:1]};
      if (!on_voltage) begin
        if (v_q[1] > max_q) max_q <= v_q[1];
        if (v_q[1] < min_v_q) min_v_q <= v_q[1];
      end
    end
    if (accept) begin
      v_q           <= v_q17_i;
      max_q         <= v_q17_i[0];
      min_v_q       <= v_q17_i[0];
      pair_q        <= pair_i;
      period_q      <= cfg_period_i;
      margin_in_q   <= cfg_margin_i;
      scale_q       <= cfg_scale_i;
      scale_shift_q <= half_clock_shift(cfg_scale_shift_i);
      min_in_q      <= cfg_min_pulse_i;
    end

    min_q <= ({4'b0, min_in_q} > period_q >> 1) ? period_q >> 1 : {4'b0, min_in_q};
    if (margin_in_q == '0) margin_q <= '0;
    else if (margin_in_q > period_q >> 1) margin_q <= period_q >> 1;
    else margin_q <= (margin_in_q < min_q) ? min_q : margin_in_q;
    high_q    <= period_q - margin_q;
    longest_q <= period_q - min_q;
    // 0 < raw < period
    edges_from_q <= 20'sd1 - 20'($signed({1'b0, period_q}));
    edges_to_q   <= 20'($signed({1'b0, period_q})) - 20'sd1;

    current_q <= {current_q[3:1], step_on_q && !on_voltage};
    voltage_q <= {voltage_q[Stages-2:1], step_on_q && on_voltage};
    last_q    <= {last_q[Stages-2:1], step_on_q && on_last && !early_q};
    early_last_q <= {early_last_q[2:1], step_on_q && on_last && early_q};

    // The last step before the voltages looks at the first one again: max and min are final there.
    zero_q    <= sample_t'((19'(max_q) + 19'(min_v_q)) >>> 1);
    operand_q <= on_voltage ? difference(v_q[0], zero_q) : beyond(i_q[0], band_q);
    factor_q  <= $signed({1'b0, on_voltage ? scale_q : slope_q});
    shift_q   <= on_voltage ? scale_shift_q : slope_shift_q;
    // Shifted by eights here, by the rest in the next stage.
    product_q <= (36'(operand_q) * 36'(factor_q)) >>> {shift_q[4:3], 3'd0};
    shift2_q  <= shift_q[2:0];
    half_q    <= sat_half_clocks(shifted);
    one_comp_q <= one_comp;
    if (current_q[4]) comp_q <= {comp, comp_q[Phases-1:1]};
    // In half clocks: (period + half + 1) / 2 is period/2 + product, rounded half up.
    raw_q   <= 19'((half_q + 20'($signed({1'b0, period_q})) + 20'sd1) >>> 1);
    edges_q <= half_q >= edges_from_q && half_q < edges_to_q;
    sum_q   <= raw_q + (edges_q ? 19'($signed(comp_q[0])) : 19'sd0);
    if (voltage_q[4]) comp_q <= {comp_q[0], comp_q[Phases-1:1]};
    if (voltage_q[5]) begin
      compare_q <= {pulse, compare_q[Phases-1:1]};
      clipped_q <= {below || above, clipped_q[Phases-1:1]};
    end
    valid_q <= last_q[5];
    if (last_q[5] || early_last_q[3]) busy_q <= 1'b0;

    if (rst_i) begin
      busy_q    <= 1'b0;
      step_on_q <= 1'b0;
      current_q <= '0;
      voltage_q <= '0;
      last_q    <= '0;
      early_last_q <= '0;
      early_q   <= 1'b0;
      pair_q    <= 1'b0;
      valid_q   <= 1'b0;
      compare_q <= '0;
      clipped_q <= '0;
      period_q  <= '0;
    end
  end

  assign valid_o   = valid_q;
  assign compare_o = compare_q;
  assign period_o  = period_q;
  assign clipped_o = clipped_q;

  always_ff @(posedge clk_i) begin
    if (!rst_i) begin
      assert (!((valid_i || early_i) && busy_q))
      else $error("fl_modulator: vectors closer than %0d clocks", early_q ? EarlyClocks : Latency);
      if (valid_q) begin
        for (int unsigned x = 0; x < Phases; x++)
        assert (compare_q[x] <= period_q)
        else $error("fl_modulator: compare above the period");
      end
    end
  end

endmodule
`default_nettype wire
