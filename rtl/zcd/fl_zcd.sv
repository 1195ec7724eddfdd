// Zero-crossing detection: finds where the floating phase's terminal voltage passes the threshold of its sector.
//
// rel = v_float - round(vdc * threshold_q17 / 2^17). The floating phase is C, B, A, C, B, A in sectors I..VI; it must
// rise in II, IV, VI and fall in I, III, V (the other way round with cfg_reverse_i).
//
// A sample counts when it was taken with the PWM on, cfg_settle_i after the last gate change, cfg_blank_i after the
// last commutation, at margin <= v <= vdc - margin (not clamped by a diode), and right after cfg_need_previous_i
// unclamped samples of the same on-state: same sector, no gate change in between. What was clamped or chopped off
// therefore never takes part, on either side of the crossing.
//
// Crossing of a sector visit, one a visit: the first sample that counts and is at or past the threshold. If a sample
// before it counted, the time is interpolated between the last one before and this one, however long the chop-off gap
// between them; if none did, the crossing was overridden: it is reported late, at the sample's time. The sample's own
// time is also taken without cfg_interpolate_i and for gaps above 65535 clocks.
//
// Sector, time and ages are those of the sample, not of the clock in which it is looked at: a commutation that reaches
// the gates while a sample is in the pipeline does not touch it. A new visit begins with a sample of another sector or
// one whose comm_age is shorter than its distance from the sample before, and with enabling.
//
// Outputs: zc_valid_o is a pulse; time, sector, late flag and values stay until the next crossing. Values are rel of
// the first sample after and of the last one before (0 when late), 2^17 = full scale, not inverted for falling sectors.
// Settings are taken over at update_i (reset: disabled).
// Latency, sample_valid_i to zc_valid_o: DirectLatency for a sample's own time, InterpolatedLatency otherwise.
// Asserted: samples are at least 4 clocks apart.
`default_nettype none
module fl_zcd
  import fl_pkg::*;
#(
    parameter  int unsigned Phases              = 3,
    localparam int unsigned Channels            = 2 * Phases + 3,
    // verilator lint_off UNUSEDPARAM
    localparam int unsigned DirectLatency       = 5,
    localparam int unsigned InterpolatedLatency = 23
    // verilator lint_on UNUSEDPARAM
) (
    input logic clk_i,
    input logic rst_i,

    input logic              update_i,
    input logic              cfg_enable_i,
    input logic              cfg_interpolate_i,
    input logic [ 1:0]       cfg_need_previous_i,  // samples
    input logic [15:0]       cfg_settle_i,         // clocks
    input logic [15:0]       cfg_blank_i,          // clocks
    input logic [16:0]       cfg_margin_i,         // 2^17 = full scale
    input logic [ 5:0][16:0] cfg_threshold_i,      // Q0.17 of vdc
    input logic              cfg_reverse_i,

    input logic                      comm_applied_i,
    input logic                      sample_valid_i,
    input sample_t    [Channels-1:0] sample_i,
    input stamp_t                    sample_time_i,
    input pwm_state_t                sample_pwm_i,

    output logic           zc_valid_o,
    output stamp_t         zc_time_o,
    output logic           zc_late_o,
    output sector_t        zc_sector_o,
    output sample_t        zc_value_o,
    output sample_t        zc_value_before_o,
    output logic    [15:0] crossings_o,        // wraps
    output logic    [15:0] late_o              // wraps
);

  if (Phases < 3) begin : gen_illegal
    $fatal(1, "fl_zcd: six-step needs Phases >= 3 (%m)");
  end

  localparam int unsigned VdcChannel = 2 * Phases;

  function automatic logic [1:0] floating_phase(sector_t sector);
    unique case (sector)
      3'd0, 3'd3: return 2'd2;
      3'd1, 3'd4: return 2'd1;
      default:    return 2'd0;
    endcase
  endfunction

  // Magnitude of a value on the known side of the threshold.
  function automatic logic [16:0] magnitude(sample_t value, logic negative);
    return negative ? 17'(-value) : 17'(value);
  endfunction

  // Active settings.
  logic enable_q, interpolate_q, reverse_q;
  logic [1:0] need_q;
  logic [15:0] settle_q, blank_q;
  logic [16:0] margin_q;
  logic [5:0][16:0] threshold_q;

  always_ff @(posedge clk_i) begin
    if (update_i) begin
      enable_q      <= cfg_enable_i;
      interpolate_q <= cfg_interpolate_i;
      need_q        <= cfg_need_previous_i;
      settle_q      <= cfg_settle_i;
      blank_q       <= cfg_blank_i;
      margin_q      <= cfg_margin_i;
      threshold_q   <= cfg_threshold_i;
      reverse_q     <= cfg_reverse_i;
    end
    if (rst_i) enable_q <= 1'b0;
  end

  // Stage 1: pick the sector's channel and threshold.
  logic valid1_q, valid2_q, valid3_q;
  sample_t value_q, vdc_q;
  logic [16:0] threshold1_q;
  stamp_t time_q;
  pwm_state_t pwm_q;

  always_ff @(posedge clk_i) begin
    valid1_q <= sample_valid_i && enable_q;
    valid2_q <= valid1_q;
    valid3_q <= valid2_q;
    if (sample_valid_i && enable_q) begin
      value_q      <= sample_i[floating_phase(sample_pwm_i.sector)];
      vdc_q        <= sample_i[VdcChannel];
      threshold1_q <= (sample_pwm_i.sector < 3'd6) ? threshold_q[sample_pwm_i.sector] : '0;
      time_q       <= sample_time_i;
      pwm_q        <= sample_pwm_i;
    end
    if (rst_i) begin
      valid1_q <= 1'b0;
      valid2_q <= 1'b0;
      valid3_q <= 1'b0;
    end else begin
      assert (!(sample_valid_i && (valid1_q || valid2_q || valid3_q)))
      else $error("fl_zcd: samples closer than 4 clocks");
    end
  end

  // Stage 2: threshold product, limits, ages, distances to the sample before and to the last one that counted.
  logic signed [35:0] product_q;
  logic signed [18:0] high_q;
  logic low_clamped_q, aged_q, long_q, gap_long_q;
  logic [15:0] since_q, gap_q;  // clocks
  stamp_t previous_time_q, before_time_q, since, gap;

  assign since = time_q - previous_time_q;
  assign gap   = time_q - before_time_q;

  always_ff @(posedge clk_i) begin
    if (valid1_q) begin
      product_q     <= 36'(vdc_q) * 36'($signed({1'b0, threshold1_q}));
      high_q        <= 19'(vdc_q) - 19'($signed({1'b0, margin_q}));
      low_clamped_q <= value_q < $signed({1'b0, margin_q});
      aged_q        <= pwm_q.on && pwm_q.age >= settle_q && pwm_q.comm_age >= blank_q;
      long_q        <= since[31:16] != '0;
      since_q       <= since[15:0];
      gap_long_q    <= gap[31:16] != '0;
      gap_q         <= gap[15:0];
    end
  end

  // Stage 3: value against the threshold, relation to the sample before.
  logic known_q, applied_q;  // known: there is a sample before since enabling
  sector_t previous_sector_q;
  sample_t rel_q;
  logic clamped_q, same_state_q, new_visit_q;
  logic same_sector, visit_break;

  assign same_sector = known_q && pwm_q.sector == previous_sector_q;
  // A pause of the sampler outlasts the 16-bit age: then only the commutation pulse tells.
  assign visit_break = long_q ? applied_q : pwm_q.comm_age < since_q;

  always_ff @(posedge clk_i) begin
    if (comm_applied_i) applied_q <= 1'b1;
    if (valid2_q) begin
      rel_q <= 18'(19'(value_q) - 19'(product_q >>> 17) - 19'($signed({1'b0, product_q[16]})));
      clamped_q <= low_clamped_q || 19'(value_q) > high_q;
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
  logic [1:0] run_before, run_q;  // unclamped samples in a row in this on-state, up to 3
  logic rising, counts, past, open, have_before, crossing, late, interpolate;
  logic done_q, have_before_q;  // of this visit
  sample_t before_rel_q;

  always_comb begin
    rising      = pwm_q.sector[0] ^ reverse_q;
    run_before  = same_state_q ? run_q : '0;
    counts      = aged_q && !clamped_q && run_before >= need_q;
    past        = rising ? !rel_q[17] : (rel_q[17] || rel_q == '0);
    open        = new_visit_q || !done_q;
    have_before = !new_visit_q && have_before_q;
    crossing    = valid3_q && counts && open && past;
    late        = !have_before;
    interpolate = interpolate_q && have_before && !gap_long_q;
  end

  // The crossing that is being timed.
  logic direct_q, busy, interpolated;
  logic late_q;
  sector_t sector_q;
  sample_t value_after_q, value_before_q;
  stamp_t base_q;
  logic [15:0] offset;

  always_ff @(posedge clk_i) begin
    direct_q <= crossing && !interpolate;
    if (valid3_q) begin
      run_q <= (!pwm_q.on || clamped_q) ? '0 : (run_before == '1) ? '1 : run_before + 2'd1;
      done_q <= !open || crossing;
      have_before_q <= have_before;
      if (counts && open && !past) begin
        have_before_q <= 1'b1;
        before_time_q <= time_q;
        before_rel_q  <= rel_q;
      end
    end
    if (crossing) begin
      late_q         <= late;
      sector_q       <= pwm_q.sector;
      value_after_q  <= rel_q;
      value_before_q <= late ? '0 : before_rel_q;
      base_q         <= interpolate ? before_time_q : time_q;
    end
    if (rst_i) direct_q <= 1'b0;
    else begin
      assert (!(crossing && (busy || direct_q)))
      else $error("fl_zcd: crossing while the one before is being timed");
    end
  end

  fl_interpolator #(
      .TimeBits (16),
      .ValueBits(17)
  ) u_interpolator (
      .clk_i,
      .rst_i,
      .start_i (crossing && interpolate && !busy),
      .gap_i   (gap_q),
      .before_i(magnitude(before_rel_q, rising)),
      .after_i (magnitude(rel_q, !rising)),
      .busy_o  (busy),
      .valid_o (interpolated),
      .offset_o(offset)
  );

  always_ff @(posedge clk_i) begin
    zc_valid_o <= direct_q || interpolated;
    if (direct_q || interpolated) begin
      zc_time_o         <= direct_q ? base_q : base_q + stamp_t'(offset);
      zc_late_o         <= late_q;
      zc_sector_o       <= sector_q;
      zc_value_o        <= value_after_q;
      zc_value_before_o <= value_before_q;
      crossings_o       <= crossings_o + 16'd1;
      if (late_q) late_o <= late_o + 16'd1;
    end
    if (rst_i) begin
      zc_valid_o        <= 1'b0;
      zc_time_o         <= '0;
      zc_late_o         <= 1'b0;
      zc_sector_o       <= '0;
      zc_value_o        <= '0;
      zc_value_before_o <= '0;
      crossings_o       <= '0;
      late_o            <= '0;
    end
  end

endmodule
`default_nettype wire
