// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Current control of a machine with 3 or 5 phases: phase currents in, phase voltages out, on one shared multiplier.
//
// Equations, for subspace 1 at theta, and with 5 phases for subspace 3 at 3 theta too
// (n = 1, 3; P phases; k = 0..P-1; delta = turn / P; Yang 2020, chapter 7):
//   i      = 2/P sum i_k exp(-j n (theta + park - k delta))   Clarke and Park in one, amplitude-invariant
//   e[k]   = i* - i                                       saturates at +-(2^17 - 1)
//   w[k]   = u[k-1] + (h/g) b[k-1] + (g e[k] - h e[k-1]) 2^-shift      complex, h = g Phi
//   u[k]   = limit(w[k]),   b[k] = w[k] - u[k]
//   v      = u + u_ff,  or u_ff alone with bypass_i       saturates per axis
//   v_k    = sum over n of Re((v + v_inject) exp(j n (theta + lead - k delta)))    v + v_inject saturates per axis
//
// Formats: angles 2^32 = one turn. Currents and voltages signed 18 bits, 2^17 = full scale of their channel. State
// signed 28 bits, 2^25 = full scale. g and h signed 18 bits. A complex value is {q, d}: index 0 is d.
//
// Rounding:
//   - w: the four products of an axis add up exactly. The sum times 2^-shift is rounded half up once and added to the
//     state, which saturates at 28 bits.
//   - limit: m = floor(sqrt(d^2 + q^2)) of the state rounded to 2^17 = full scale. If m > u_max, then
//     factor = floor(u_max 2^17 / m), and d, q = round(d, q * factor / 2^17). The limited state is the next u[k-1].
//   - b: w - u rounded down to 2^15 = full scale. Its product with h/g is rounded half up.
// Accuracy: currents and phase voltages are within 1 LSB of the equations in exact arithmetic, while the vectors of all
// subspaces together do not exceed full scale.
// Anti-windup: b does what e[k-1] + (u - w) / g in place of e[k-1] would do. So the error counts that the limit allowed.
//
// Modes:
//   enable_i low  per subspace. The state is preset_i, limited too, while the errors run on. So the regulator takes over
//                 from an applied voltage without a step. b is 0.
//   direct_i      the core is the regulator. A run waits with its currents and with its number in number_o, until go_i
//                 for that number. Then w = wanted_i, and the run goes on with the limit. The block ignores a go_i for
//                 another number. abandon_i ends a direct run without results, wherever the run is. A go_i in the clock
//                 of abandon_i comes too late.
//   injection     first_o tells that i of subspace 1 is there, FirstLatency clocks after start_i. With pause_i = n above
//                 0 the run stops there. n clocks after first_o, filtered_i replaces this i in the regulator and at
//                 current_o.
//   skip_i        the regulator of subspace 1 does not run. Its state, and what it keeps for the next step, stay.
//                 Without effect if direct.
// Reset: state and errors are 0.
//
// Latency in clocks, whatever the values:
//   start_i to valid_o    Latency: 52 for three phases, 99 for five. With a pause n + PauseClocks more.
//   start_i to waiting_o  WaitLatency, direct: 21 and 54
//   go_i to valid_o       direct: 32 and 75
// Starts are at least Spacing clocks apart, 3 more than the latency. busy_o is high until then.
// Errors: the block ignores a start while busy, and counts it (saturating).
// Inputs: start_i copies phase currents, theta, park, lead, pause, skip and inject. All other inputs must not change
// while busy_o. Outputs are stable from valid_o until the next start.
// Size: one multiplier, and for the cosines (fl_sincos) one multiplier and two block RAMs. 2/P is in the second table.
`default_nettype none
module fl_foc
  import fl_pkg::sample_t;
  import fl_foc_pkg::*;
#(
    parameter int unsigned Phases = 3,
    localparam int unsigned Subspaces = subspaces(Phases),
    localparam int unsigned Latency = last_clock(Phases) + 4,
    localparam int unsigned Spacing = Latency + 3,
    localparam int unsigned WaitLatency = wait_clock(Phases),
    localparam int unsigned FirstLatency = gain_clock(Phases, 0) - 1,
    localparam int unsigned PauseClocks = 3
) (
    input logic clk_i,
    input logic rst_i,

    input logic                 start_i,
    input sample_t [Phases-1:0] current_i,
    input logic    [      31:0] theta_i,    // of the currents
    input logic    [      31:0] park_i,     // signed: Park at theta + park
    input logic    [      31:0] lead_i,     // signed: inverse Park at theta + lead

    input logic    [Subspaces-1:0]       enable_i,
    input logic                          bypass_i,
    input sample_t [Subspaces-1:0][ 1:0] reference_i,
    input sample_t [Subspaces-1:0][ 1:0] gain_i,       // g
    input sample_t [Subspaces-1:0][ 1:0] hold_i,       // h
    input sample_t [Subspaces-1:0][ 1:0] ratio_i,      // h / g, 2^17 = 1
    input logic    [Subspaces-1:0][ 4:0] shift_i,
    input logic    [Subspaces-1:0][16:0] limit_i,      // u_max, 2^17 = full scale
    input sample_t [Subspaces-1:0][ 1:0] preset_i,
    input sample_t [Subspaces-1:0][ 1:0] forward_i,    // u_ff

    input  logic    [ 4:0]                pause_i,    // clocks, 0: none
    input  logic                          skip_i,     // the regulator of subspace 1
    input  sample_t [ 1:0]                filtered_i, // in place of i of subspace 1
    input  sample_t [Subspaces-1:0][ 1:0] inject_i,   // v_inject
    output logic                          first_o,    // pulse: current_o of subspace 1 is there

    input  logic                                direct_i,
    input  logic    [Subspaces-1:0][1:0][27:0] wanted_i,   // w, 2^25 = full scale, signed
    input  logic                                go_i,
    input  logic    [15:0]                      go_number_i,
    input  logic                                abandon_i,
    output logic                                waiting_o,  // direct: for go_i
    output logic    [15:0]                      number_o,   // of the run, counts the starts, wraps

    output logic                               busy_o,
    output logic                               valid_o,
    output sample_t [   Phases-1:0]            voltage_o,
    output sample_t [Subspaces-1:0][1:0]       current_o,  // i
    output sample_t [Subspaces-1:0][1:0]       applied_o,  // v
    output logic    [Subspaces-1:0][1:0][27:0] state_o,    // u, 2^25 = full scale, signed
    output logic    [Subspaces-1:0]            limited_o,  // the limit acted
    output logic    [         15:0]            overrun_o   // starts ignored
);

  if (Phases != 3 && Phases != 5) begin : gen_illegal
    $fatal(1, "fl_foc: Phases must be 3 or 5 (%m)");
  end

  localparam program_t Program = foc_program(Phases);
  localparam logic [6:0] LastClock = 7'(Spacing - 1);
  localparam logic [6:0] WaitClock = 7'(WaitLatency);
  localparam logic [6:0] PauseClock = 7'(pause_clock(Phases));
  localparam logic [6:0] ResumeClock = 7'(resume_clock(Phases));
  localparam int unsigned CosineBits = 21;
  localparam int unsigned SumBits = 49;
  // 2 / P is in the cosines of the currents; with five phases 4 / P, for their resolution.
  localparam int unsigned ParkNumerator = (Phases == 5) ? 4 : 2;
  localparam int unsigned ParkShift = (Phases == 5) ? 21 : 20;

  typedef logic signed [27:0] state_t;
  typedef logic signed [SumBits-1:0] wide_t;

  typedef logic signed [29:0] base_t;
  typedef logic signed [20:0] work_t;

  // At most five products with cosines.
  function automatic sample_t sat_sample(logic signed [20:0] x);
    return (x[20:17] == {4{x[20]}}) ? x[17:0] : {x[20], {17{!x[20]}}};
  endfunction

  // State in the format of voltages, rounded half up.
  function automatic work_t to_voltage(state_t u);
    return work_t'(u >>> 8) + work_t'($signed({1'b0, u[7]}));
  endfunction

  // Step whose operands are chosen in this clock, and those of the product, of the sum and behind it.
  logic [6:0] clock_q;  // clocks since the start, 0: idle
  step_t step_q, product_q, sum_q;
  step_t [2:0] tail_q;
  logic start, valid_q;
  logic busy_q, full_q;  // clock_q is not 0, overrun_q counts no further
  logic waiting_q, go, gone_q, abandon;
  logic [15:0] number_q, overrun_q;

  assign start   = start_i && !busy_q;
  assign go      = waiting_q && go_i && go_number_i == number_q;
  assign abandon = direct_i && abandon_i && busy_q;

  // The pause ends with the clock of filtered_i, the first step that needs its error follows.
  logic [5:0] pause_q;
  logic pausing_q, resume_q;

  always_ff @(posedge clk_i) begin
    if (start) pause_q <= (pause_i == '0) ? '0 : {1'b0, pause_i} + 6'(PauseClocks + 1);
    else if (pausing_q) pause_q <= pause_q - 6'd1;
    pausing_q <= !abandon && ((clock_q == PauseClock - 7'd1 && pause_q != '0) || (pausing_q && !resume_q));
    resume_q  <= !abandon && pausing_q && pause_q == 6'd2;
    if (rst_i) begin
      pause_q   <= '0;
      pausing_q <= 1'b0;
      resume_q  <= 1'b0;
    end
  end

  // While it waits the run repeats the step that it goes on with: the products count for nothing.
  always_ff @(posedge clk_i) begin
    if (start) step_q <= Program[1];
    else if (!busy_q || (pausing_q && !resume_q)) step_q <= '0;
    else if (waiting_q) step_q <= Program[ResumeClock];
    else step_q <= Program[clock_q+7'd1];
    product_q <= step_q;
    sum_q     <= product_q;
    tail_q[0] <= sum_q;
    tail_q[1] <= tail_q[0];
    tail_q[2] <= tail_q[1];
    valid_q   <= clock_q == 7'(Latency - 1) && !abandon;
    if (start) busy_q <= 1'b1;
    else if (clock_q == LastClock || abandon) busy_q <= 1'b0;
    if (start) clock_q <= 7'd1;
    else if (clock_q == LastClock || abandon) clock_q <= '0;
    else if (go) clock_q <= ResumeClock;
    else if (busy_q && !waiting_q && (!pausing_q || resume_q)) clock_q <= clock_q + 7'd1;
    waiting_q <= direct_i && !gone_q && !abandon && (clock_q == WaitClock - 7'd1 || (waiting_q && !go));
    if (start) gone_q <= 1'b0;
    else if (go) gone_q <= 1'b1;
    if (start) number_q <= number_q + 16'd1;
    if (start_i && busy_q && !full_q) begin
      overrun_q <= overrun_q + 16'd1;
      full_q    <= overrun_q == 16'hFFFE;
    end
    if (rst_i) begin
      busy_q    <= 1'b0;
      full_q    <= 1'b0;
      clock_q   <= '0;
      step_q    <= '0;
      product_q <= '0;
      sum_q     <= '0;
      tail_q    <= '0;
      valid_q   <= 1'b0;
      waiting_q <= 1'b0;
      gone_q    <= 1'b0;
      number_q  <= '0;
      overrun_q <= '0;
    end
  end

  // Inputs of this run, angles with and without lead.
  sample_t [Phases-1:0] phase_current_q;
  logic [1:0][31:0] angle_q;
  sample_t [Subspaces-1:0][1:0] inject_q;
  logic skip_q;

  always_ff @(posedge clk_i) begin
    if (start) begin
      phase_current_q <= current_i;
      angle_q         <= {theta_i + lead_i, theta_i + park_i};
      inject_q        <= inject_i;
      skip_q          <= skip_i && !direct_i;
    end
    if (rst_i) skip_q <= 1'b0;
  end

  // n k delta
  function automatic logic [Phases-1:0][31:0] phase_angles(int unsigned n);
    logic [Phases-1:0][31:0] y;
    for (int unsigned k = 0; k < Phases; k++) y[k] = 32'(((64'(n * k) << 32) + 64'(Phases / 2)) / 64'(Phases));
    return y;
  endfunction

  localparam logic [Phases-1:0][31:0] PhaseAngles = phase_angles(1);
  localparam logic [Phases-1:0][31:0] ThirdAngles = phase_angles(3);

  // Cosine of n (theta - k delta), a quarter further on for the quadrature. The first one, of phase 0, needs no difference.
  logic [31:0] angle, look, look_q;
  logic third, scaled_q, first_look_q;
  logic signed [CosineBits-1:0] cosine;

  assign angle = angle_q[step_q.look_inverse];
  assign third = (Subspaces > 1) && step_q.look_third;
  assign look  = third ? angle + {angle[30:0], 1'b0} - ThirdAngles[step_q.look_phase]
                       : angle - PhaseAngles[step_q.look_phase];

  always_ff @(posedge clk_i) begin
    look_q       <= {look[31:30] + {1'b0, step_q.look_quadrature}, look[29:0]};
    scaled_q     <= start || !step_q.look_inverse;
    first_look_q <= start;
  end

  fl_sincos #(
      .Width           (CosineBits),
      .ScaleNumerator  (ParkNumerator),
      .ScaleDenominator(Phases)
  ) u_cosine (
      .clk_i,
      .rst_i,
      .valid_i (1'b0),
      .angle_i (first_look_q ? angle_q[0] : look_q),
      .cosine_i(1'b1),
      .scaled_i(scaled_q),
      .valid_o (),
      .value_o (cosine)
  );

  // Operands. Selections beyond a build's subspaces and phases do not occur in its program.
  sample_t [Subspaces-1:0][1:0] error_q, current_q, applied_q, back_q;
  state_t [Subspaces-1:0][1:0] state_q;
  work_t [Subspaces-1:0][1:0] work_q;  // state in the format of voltages
  base_t [Subspaces-1:0][1:0] base_q;  // state and what comes back from the limit
  logic [16:0] factor;
  sample_t x;
  sample_t [Subspaces-1:0][1:0] voltage;
  sample_t coefficient;  // 18 bits, above the lowest ones of c
  logic signed [CosineBits-1:0] c;
  state_t state_x;
  logic s;  // subspace of the operands

  assign s           = (Subspaces > 1) && step_q.subspace;
  assign state_x     = state_q[s][step_q.x_axis];
  assign coefficient = ({18{step_q.c[CGain]}} & gain_i[s][step_q.c_axis])
      | ({18{step_q.c[CHold]}} & hold_i[s][step_q.c_axis])
      | ({18{step_q.c[CFactor]}} & {1'b0, factor})
      | ({18{step_q.c[CRatio]}} & ratio_i[s][step_q.c_axis]);

  // Side by side, so that the choice comes last.
  always_comb begin
    for (int unsigned n = 0; n < Subspaces; n++)
    for (int unsigned axis = 0; axis < 2; axis++)
    voltage[n][axis] = sat_sample(21'(applied_q[n][axis]) + 21'(inject_q[n][axis]));
  end

  assign x = ({18{step_q.x[XCurrent]}} & phase_current_q[step_q.phase])
      | ({18{step_q.x[XError]}} & error_q[s][step_q.x_axis])
      | ({18{step_q.x[XSquare]}} & work_q[s][step_q.x_axis][20:3])
      | ({18{step_q.x[XStateHigh]}} & state_x[27:10])
      | ({18{step_q.x[XStateLow]}} & {8'd0, state_x[9:0]})
      | ({18{step_q.x[XVoltage]}} & voltage[s][step_q.x_axis])
      | ({18{step_q.x[XBack]}} & back_q[s][step_q.x_axis]);
  assign c = ({21{step_q.c[CCosine]}} & cosine)
      | ({21{step_q.c[CSquare]}} & work_q[s][step_q.c_axis])
      | {coefficient, 3'd0};

  // Half of the unit that remains.
  wide_t half_unit_q;
  logic write_q;
  wide_t single_sum, pair_sum;

  always_ff @(posedge clk_i) begin
    unique case (product_q.kind)
      SumCurrent:         half_unit_q <= wide_t'(1 << (ParkShift - 1));
      SumLimit, SumPhase: half_unit_q <= wide_t'(1 << 19);
      SumBack:            half_unit_q <= wide_t'(1 << 9);
      default:            half_unit_q <= '0;
    endcase
    write_q <= product_q.kind != SumNone && !rst_i;
  end

  fl_mac #(
      .CBits  (CosineBits),
      .SumBits(SumBits)
  ) u_mac (
      .clk_i,
      .rst_i,
      .x_i       (x),
      .c_i       (c),
      .square_i  (product_q.square),
      .enable_i  (write_q),
      .pair_i    (sum_q.pair),
      .first_i   (sum_q.first),
      .init_i    (half_unit_q),
      .subtract_i(sum_q.subtract),
      .high_i    (sum_q.high),
      .single_o  (single_sum),
      .pair_o    (pair_sum)
  );

  // Circle limit.
  logic root_valid, less;
  logic [19:0] root;
  logic ratio_s_q;  // subspace of the ratio

  fl_sqrt #(
      .RootBits(20)
  ) u_sqrt (
      .clk_i,
      .rst_i,
      .start_i   (tail_q[0].last && tail_q[0].kind == SumSquare),
      .radicand_i(single_sum[39:0]),
      .valid_o   (root_valid),
      .root_o    (root)
  );

  fl_ratio #(
      .WholeBits(20),
      .RatioBits(17)
  ) u_ratio (
      .clk_i,
      .rst_i,
      .start_i(root_valid),
      .part_i ({3'd0, limit_i[ratio_s_q]}),
      .whole_i(root),
      .valid_o(),
      .less_o (less),
      .ratio_o(factor)
  );

  // Sums to their destinations, from the clock after the last product's on; s1 to s4: subspace before, then and later.
  logic s1, s2, s3, s4, axis1, axis2, axis3, axis4;
  logic regulator4;

  assign {s1, axis1} = {(Subspaces > 1) && sum_q.subspace, sum_q.axis};
  assign {s2, axis2} = {(Subspaces > 1) && tail_q[0].subspace, tail_q[0].axis};
  assign {s3, axis3} = {(Subspaces > 1) && tail_q[1].subspace, tail_q[1].axis};
  assign {s4, axis4} = {(Subspaces > 1) && tail_q[2].subspace, tail_q[2].axis};
  assign regulator4 = tail_q[2].last && tail_q[2].kind == SumRegulator;

  // Saturates at +-(2^17 - 1).
  function automatic sample_t error_of(sample_t wanted, sample_t i);
    logic signed [18:0] difference;
    difference = 19'(wanted) - 19'(i);
    if (difference[18] != difference[17]) return {difference[18], {16{!difference[18]}}, 1'b1};
    else return {difference[17:1], difference[0] || (difference[17] && difference[16:1] == '0)};
  endfunction

  // The regulator of a subspace takes its step in this run.
  function automatic logic runs(logic subspace);
    return subspace || !skip_q;
  endfunction

  // Regulator: shifter, sum with the state, saturation and rounding, a clock each. Base and rounded delta are one sum: the
  // carry is the half of the delta's lowest bit. A preset is a base without a delta.
  logic signed [38:0] delta_q;
  base_t from_q;
  logic signed [40:0] next_sum;
  logic signed [39:0] next_q;
  logic next_fits;
  state_t next;
  work_t next_work;

  assign next_sum  = 41'($signed({from_q, 1'b1})) + 41'(delta_q);
  assign next_fits = next_q[39:27] == {13{next_q[39]}};
  assign next      = next_fits ? next_q[27:0] : {next_q[39], {27{!next_q[39]}}};
  assign next_work = next_fits ? to_voltage(next_q[27:0]) : {next_q[39], 1'b1, 19'd0};

  always_ff @(posedge clk_i) begin
    delta_q <= 39'($signed({pair_sum[40:3], 1'b0}) >>> shift_i[s2]);
    from_q  <= base_q[s2][axis2];
    if (!enable_i[s2]) begin
      delta_q <= '0;
      from_q  <= base_t'($signed({preset_i[s2][axis2], 8'd0}));
    end
    next_q <= next_sum[40:1];
  end

  // Limit: one sum of forward and the state as it is or limited; the carry rounds the state half up.
  state_t kept_q, kept2_q;  // before the limit
  logic bound_q;  // the limit acts
  logic apply_bound_q;  // and its result is applied
  logic signed [20:0] apply_kept_q;  // else this: state and half a unit
  sample_t forward_q;
  logic signed [20:0] added;
  logic signed [21:0] applied_sum;

  assign added       = ({21{apply_bound_q}} & single_sum[47:27]) | apply_kept_q;
  assign applied_sum = 22'(added) + 22'($signed({forward_q, 1'b1}));

  always_ff @(posedge clk_i) begin
    kept_q        <= state_q[s1][axis1];
    kept2_q       <= kept_q;
    bound_q       <= less && runs(s1);
    apply_bound_q <= less && runs(s1) && !bypass_i;
    apply_kept_q  <= ((less && runs(s1)) || bypass_i) ? '0 : state_q[s1][axis1][27:7];
    forward_q     <= forward_i[s1][axis1];
  end

  logic unused;
  assign unused = &{1'b0, applied_sum[0], next_sum[0], single_sum[48], pair_sum[48:41], pair_sum[2:0]};

  // Currents for the errors: measured in the clock before, or filtered at the end of a pause.
  sample_t [Subspaces-1:0][1:0] taken_current;
  logic [Subspaces-1:0][1:0] taken;

  always_comb begin
    taken_current = current_q;
    taken         = '0;
    if (tail_q[1].last && tail_q[1].kind == SumCurrent) taken[s3][axis3] = 1'b1;
    if (resume_q) begin
      taken_current[0] = filtered_i;
      taken[0]         = '1;
    end
  end

  sample_t [Phases-1:0] voltage_q;
  logic [Subspaces-1:0] limited_q;

  always_ff @(posedge clk_i) begin
    if (tail_q[0].last) begin
      unique case (tail_q[0].kind)
        SumCurrent: current_q[s2][axis2] <= sat_sample(single_sum[ParkShift+:21]);
        SumSquare:  ratio_s_q <= s2;
        SumLimit: begin
          applied_q[s2][axis2] <= sat_sample(applied_sum[21:1]);
          if (runs(s2)) limited_q[s2] <= less;
        end
        SumPhase:   voltage_q[tail_q[0].phase] <= sat_sample(tail_q[0].pair ? pair_sum[40:20] : single_sum[40:20]);
        SumBack:    base_q[s2][axis2] <= base_t'(state_q[s2][axis2]) + base_t'($signed(single_sum[39:10]));
        default:    ;
      endcase
    end
    for (int unsigned n = 0; n < Subspaces; n++) begin
      for (int unsigned axis = 0; axis < 2; axis++) begin
        if (taken[n][axis] && runs(n[0])) error_q[n][axis] <= error_of(reference_i[n][axis], taken_current[n][axis]);
        if (resume_q && n == 0) current_q[n][axis] <= filtered_i[axis];
      end
    end
    if (tail_q[1].last && tail_q[1].kind == SumLimit && limited_q[s3] && runs(s3) && enable_i[s3] && !direct_i)
      back_q[s3][axis3] <= sample_t'((kept2_q - state_q[s3][axis3]) >>> 10);
    // Nothing else comes while a run waits.
    if (waiting_q) begin
      if (go && !abandon) begin
        state_q <= wanted_i;
        for (int unsigned n = 0; n < Subspaces; n++)
        for (int unsigned axis = 0; axis < 2; axis++) work_q[n][axis] <= to_voltage(wanted_i[n][axis]);
      end
    end else begin
      if (regulator4 && !direct_i && runs(s4)) begin
        state_q[s4][axis4] <= next;
        work_q[s4][axis4]  <= next_work;
        back_q[s4][axis4]  <= '0;
      end
      if (tail_q[0].last && tail_q[0].kind == SumLimit && bound_q) state_q[s2][axis2] <= single_sum[47:20];
    end
    if (rst_i) begin
      state_q   <= '0;
      base_q    <= '0;
      back_q    <= '0;
      error_q   <= '0;
      current_q <= '0;
      applied_q <= '0;
      voltage_q <= '0;
      limited_q <= '0;
    end
  end

  assign first_o   = tail_q[1].last && tail_q[1].kind == SumCurrent && !s3 && axis3;
  assign waiting_o = waiting_q;
  assign number_o  = number_q;
  assign busy_o    = busy_q;
  assign valid_o   = valid_q;
  assign voltage_o = voltage_q;
  assign current_o = current_q;
  assign applied_o = applied_q;
  assign state_o   = state_q;
  assign limited_o = limited_q;
  assign overrun_o = overrun_q;

endmodule
`default_nettype wire
