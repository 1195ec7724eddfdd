// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Step table of fl_foc: the operands of which product are chosen in which clock after the start, for three and for five
// phases. The product is formed a clock later and added in the next (sum); StepLatency clocks after the choice the sum
// stands in its accumulator.
//
// Subspace s of a machine with P phases, h = hold_clock(P, s), g = gain_clock(P, s) = h + 2 P + 8:
//   h          4        h * previous error
//   h + 4      2 P      currents * cosines times 2/P: Clarke and Park without a stop at alpha, beta
//   g - 3      2        g * error's d
//   g          2        g * error's q
//   g + 6      2        squares of the voltage; square root and ratio end at g + 22
//   limit      4        state * factor of the circle limit, in two halves
//   inverse    2 S P    voltages * cosines, all S subspaces of a phase one after the other
//   back       4        what the limit took away * h / g, for the next step: of the last subspace after everything else
package fl_foc_pkg;

  // One bit each in a step, so that no decoder lies before the choice.
  typedef enum logic [2:0] {
    XCurrent,    // of a phase
    XError,      // i* - i
    XSquare,     // work register, without its lowest bits
    XStateHigh,  // state of the regulator, bits 27:10
    XStateLow,   //                         bits 9:0
    XVoltage,    // to be applied
    XBack        // taken away by the limit
  } x_e;

  typedef enum logic [2:0] {
    CCosine,
    CGain,    // g
    CHold,    // h
    CSquare,  // work register
    CFactor,  // of the circle limit
    CRatio    // h / g
  } c_e;

  // What is done with the sum after its last product; the kind sets the rounding of the first.
  typedef enum logic [2:0] {
    SumNone,
    SumCurrent,    // to the current
    SumRegulator,  // through the shifter to the state
    SumSquare,     // to the square root
    SumLimit,      // to the state if the limit acts
    SumPhase,      // to the phase voltage
    SumBack        // to what the next step starts from
  } sum_e;

  typedef struct packed {
    // Angle looked up for the product LookAhead clocks later.
    logic       look_inverse;     // with the lead
    logic       look_third;       // three times the angle
    logic       look_quadrature;
    logic [2:0] look_phase;
    // Product.
    logic [6:0] x;                // one of x_e
    logic [5:0] c;                // one of c_e
    logic       subspace;
    logic       x_axis;           // 0: d, 1: q
    logic       c_axis;
    logic [2:0] phase;
    // Sum.
    logic       pair;             // of accumulators that take turns
    sum_e       kind;
    logic       axis;             // of the sum's destination
    logic       first;
    logic       last;
    logic       subtract;
    logic       square;
    logic       high;             // times 2^10
  } step_t;

  localparam int unsigned MaxSteps = 128;
  typedef step_t [MaxSteps-1:0] program_t;

  localparam int unsigned StepLatency = 3;  // fl_mac
  localparam int unsigned LookAhead = 5;  // angle, fl_sincos
  localparam int unsigned RootClocks = 7;  // fl_sqrt
  localparam int unsigned RatioClocks = 6;  // fl_ratio

  function automatic int unsigned subspaces(int unsigned phases);
    return (phases == 5) ? 2 : 1;
  endfunction

  function automatic int unsigned hold_clock(int unsigned phases, int unsigned s);
    return 1 + s * (2 * phases + 19);
  endfunction

  function automatic int unsigned gain_clock(int unsigned phases, int unsigned s);
    return hold_clock(phases, s) + 2 * phases + 8;
  endfunction

  // The factor is there when root and ratio have followed the squares. A subspace that is not the last has its factor long
  // before the next one's root is done.
  function automatic int unsigned limit_clock(int unsigned phases, int unsigned s);
    if (s + 1 < subspaces(phases)) return gain_clock(phases, s + 1) + 8;
    else return gain_clock(phases, s) + 7 + StepLatency + RootClocks + RatioClocks;
  endfunction

  function automatic int unsigned inverse_clock(int unsigned phases);
    return limit_clock(phases, subspaces(phases) - 1) + 5;
  endfunction

  // Clock of the last product; its phase voltage is there four clocks later.
  function automatic int unsigned last_clock(int unsigned phases);
    return inverse_clock(phases) + 2 * subspaces(phases) * phases - 1;
  endfunction

  function automatic int unsigned back_clock(int unsigned phases, int unsigned s);
    if (s + 1 < subspaces(phases)) return limit_clock(phases, s) + 8;
    else return last_clock(phases) + 1;
  endfunction

  // Before the first subspace's errors are needed: a run may pause there.
  function automatic int unsigned pause_clock(int unsigned phases);
    return gain_clock(phases, 0) - 4;
  endfunction

  // Clock in which a direct run waits for its voltages: all currents are there. It goes on with the first subspace's
  // squares, with five phases through the second one's currents once more.
  function automatic int unsigned wait_clock(int unsigned phases);
    return gain_clock(phases, subspaces(phases) - 1) + 6;
  endfunction

  function automatic int unsigned resume_clock(int unsigned phases);
    return gain_clock(phases, 0) + 6;
  endfunction

  function automatic logic [6:0] x_of(x_e x);
    return 7'd1 << x;
  endfunction

  function automatic logic [5:0] c_of(c_e c);
    return 6'd1 << c;
  endfunction

  function automatic program_t foc_program(int unsigned phases);
    program_t    p;
    step_t       y;
    int unsigned t;
    p = '0;
    for (int unsigned s = 0; s < subspaces(phases); s++) begin
      // Regulator: d = g_d e_d - g_q e_q - h_d e1_d + h_q e1_q, q = g_q e_d + g_d e_q - h_q e1_d - h_d e1_q.
      for (int unsigned i = 0; i < 8; i++) begin
        logic now, q_error, q_sum;
        now           = i >= 4;
        q_error       = i[1];
        q_sum         = i[0];
        y             = '0;
        y.x           = x_of(XError);
        y.c           = c_of(now ? CGain : CHold);
        y.subspace    = s != 0;
        y.x_axis      = q_error;
        y.c_axis      = q_error ^ q_sum;
        y.pair        = 1'b1;
        y.kind        = SumRegulator;
        y.axis        = q_sum;
        y.first       = i < 2;
        y.last        = i >= 6;
        y.subtract    = (q_error && !q_sum) ^ !now;
        t             = now ? gain_clock(phases, s) + i - (q_error ? 6 : 7) : hold_clock(phases, s) + i;
        p[t]          = y;
      end
      // Park of all phases at once.
      for (int unsigned i = 0; i < 2 * phases; i++) begin
        t                              = hold_clock(phases, s) + 4 + i;
        p[t].x                         = x_of(XCurrent);
        p[t].c                         = c_of(CCosine);
        p[t].subspace                  = s != 0;
        p[t].phase                     = 3'(i % phases);
        p[t].kind                      = SumCurrent;
        p[t].axis                      = i >= phases;
        p[t].first                     = i % phases == 0;
        p[t].last                      = i % phases == phases - 1;
        p[t-LookAhead].look_third      = s != 0;
        p[t-LookAhead].look_quadrature = i >= phases;
        p[t-LookAhead].look_phase      = 3'(i % phases);
      end
      // |u|^2 is one sum over both axes.
      for (int unsigned i = 0; i < 2; i++) begin
        t             = gain_clock(phases, s) + 6 + i;
        p[t].x        = x_of(XSquare);
        p[t].c        = c_of(CSquare);
        p[t].subspace = s != 0;
        p[t].x_axis   = i[0];
        p[t].c_axis   = i[0];
        p[t].kind     = SumSquare;
        p[t].axis     = i[0];
        p[t].first    = !i[0];
        p[t].last     = i[0];
        p[t].square   = 1'b1;
      end
      // Halves of the state, the high one first.
      for (int unsigned i = 0; i < 4; i++) begin
        t             = limit_clock(phases, s) + i;
        p[t].x        = x_of(i[0] ? XStateLow : XStateHigh);
        p[t].c        = c_of(CFactor);
        p[t].subspace = s != 0;
        p[t].x_axis   = i[1];
        p[t].kind     = SumLimit;
        p[t].axis     = i[1];
        p[t].first    = !i[0];
        p[t].last     = i[0];
        p[t].high     = !i[0];
      end
      // Back: d = r_d b_d - r_q b_q, q = r_q b_d + r_d b_q.
      for (int unsigned i = 0; i < 4; i++) begin
        t             = back_clock(phases, s) + i;
        p[t].x        = x_of(XBack);
        p[t].c        = c_of(CRatio);
        p[t].subspace = s != 0;
        p[t].x_axis   = i[0];
        p[t].c_axis   = i[0] ^ i[1];
        p[t].kind     = SumBack;
        p[t].axis     = i[1];
        p[t].first    = !i[0];
        p[t].last     = i[0];
        p[t].subtract = i == 1;
      end
    end
    // Inverse Park of all phases at once. With three the voltage's q comes last: the first two phases take
    // d first, in turns.
    for (int unsigned k = 0; k < phases; k++) begin
      for (int unsigned i = 0; i < 2 * subspaces(phases); i++) begin
        t                              = inverse_clock(phases) + 2 * subspaces(phases) * k + i;
        if (phases == 3 && k + i == 1) t = inverse_clock(phases) + 1 + i;
        p[t].x                         = x_of(XVoltage);
        p[t].c                         = c_of(CCosine);
        p[t].subspace                  = i[1];
        p[t].x_axis                    = i[0];
        p[t].phase                     = 3'(k);
        p[t].pair                      = phases == 3 && k < 2;
        p[t].kind                      = SumPhase;
        p[t].first                     = i == 0;
        p[t].last                      = i == 2 * subspaces(phases) - 1;
        p[t-LookAhead].look_inverse    = 1'b1;
        p[t-LookAhead].look_third      = i[1];
        p[t-LookAhead].look_quadrature = i[0];
        p[t-LookAhead].look_phase      = 3'(k);
      end
    end
    return p;
  endfunction

endpackage
