// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Lock-in demodulator: band-pass on both axes, product with the reference, second-order low-pass.
//
// Filters in trapezoidal state-variable form, g = tan(pi f0 / fs), k = 1/Q:
//   v1 = a1 s1 + a2 (x - s2),  v2 = s2 + g v1,  s1 <- 2 v1 - s1,  s2 <- 2 v2 - s2;   a1 = 1/(1 + g (g + k)), a2 = g a1
//   band-pass k v1: no phase at f0; low-pass v2: 1 at direct current
//   h      = band-pass of i, d and q
//   error  = low-pass of h_q r 2^shift,  magnitude = low-pass of h_d r
//   r      = sign(h_d), 0 at 0 (Tian 2019: reference and signal pass the same delays), or reference_i with sine_i
// The machine's L_q > L_d: error / magnitude is proportional to theta - theta_hat, sign as in Yu 2022.
//
// Formats: current and hf signed 18 bits, 2^17 = full scale; states, error and magnitude signed 24 bits, 2^21 = full
// scale, error times 2^shift. a1 2^17 = 1; a2, g 2^17 = 1 (f0 / fs below 0.25), fine 2^22 = 1 (0.0099); band_k 2^16 = 1;
// reference 2^17 = 1. Every product sum is exact and rounded half up once; whatever exceeds 24 bits saturates, and runs
// in which that happened are counted in clipped_o (saturating). Settings must not change while busy_o.
//
// One run a sample, at whatever rate the coefficients are made for. clear_i: the next run begins with states of 0; in
// the clocks of a run it does not touch that run.
// The multiplier is outside: fl_injection_mac between mac_o, 0 when nothing is asked for, and sum_i.
// Latency: start_i to valid_o Latency clocks, to hf_valid_o, from which hf_o is that of the run, HfLatency. current_i is
// read in clocks 2 and 3, reference_i from clock ReferenceLatency on for two clocks. Outputs stay until
// those of the next run. clipped_o is up to date ClippedLatency after start_i. A start while busy is ignored and counted
// (saturating).
//
// One serial data path: sums are shifted in two clocks, one adder makes of them, of the current or of the result before
// what is stored, limited in the same clock. Its first operand has 25 bits: what is beyond them limits the result, for
// no state has more than 24. States are in LUT RAM, of which the multiplier has a port and the adder one.
`default_nettype none
module fl_lock_in
  import fl_pkg::sample_t;
  import fl_pkg::sat_sample;
  import fl_injection_pkg::*;
#(
    localparam int unsigned HfLatency = 18,
    localparam int unsigned ReferenceLatency = 18,
    localparam int unsigned Latency = 39,
    localparam int unsigned ClippedLatency = 41
) (
    input logic clk_i,
    input logic rst_i,

    input logic          start_i,
    input sample_t [1:0] current_i,
    input sample_t       reference_i,
    input logic          clear_i,

    input logic          sine_i,
    input filter_t       band_i,
    input sample_t       band_k_i,
    input filter_t       low_i,
    input logic    [2:0] shift_i,

    output mac_t mac_o,
    input  sum_t sum_i,

    output logic                  busy_o,
    output logic                  hf_valid_o,
    output logic                  valid_o,
    output sample_t [ 1:0]        hf_o,
    output state_t                error_o,
    output state_t                magnitude_o,
    output logic    [15:0]        clipped_o,
    output logic    [15:0]        overrun_o
);

  // Products.
  typedef enum logic [2:0] {
    OpNone,
    OpState,      // a1 s1
    OpInput,      // + a2 (x - s2): v1
    OpIntegrate,  // g v1: v2
    OpScale,      // k v1: h
    OpMix         // r h
  } op_e;

  // What the adder makes. Of a product's sum: v1, v2, h, r h.
  typedef enum logic [3:0] {
    AddNone,
    AddCurrent,    // i - s2: x - s2 of the band-pass
    AddMixed,      // result before - s2: that of the low-pass
    AddInput,      // v1
    AddDouble1,    // 2 v1 - s1: s1
    AddScale,      // h
    AddIntegrate,  // g v1 + s2: v2
    AddDouble2,    // 2 v2 - s2: s2
    AddMix         // r h
  } add_e;

  typedef struct packed {
    op_e  op;
    logic low;   // low-pass instead of band-pass
    logic axis;  // 0: d, 1: q
  } step_t;

  typedef struct packed {
    add_e add;
    logic low;
    logic axis;
  } sum_step_t;

  localparam logic [5:0] FirstClock = 6'd2;  // both tables go on every second clock, d before q
  localparam logic [5:0] LastClock = 6'(Latency);

  logic [5:0] clock_q;  // clocks since the start + 1, 0: idle
  step_t step_d, step_q;
  sum_step_t early, load_q, add_q;
  logic start, valid_q;
  logic [15:0] overrun_q;

  assign start = start_i && clock_q == '0;

  // A product is asked for the clock after its entry, its sum is shifted with the entry of the adder 4 clocks after it,
  // and stored 2 clocks later.
  always_comb begin
    unique case (clock_q[5:1])
      5'd1:    step_d.op = OpState;
      5'd2:    step_d.op = OpInput;
      5'd5:    step_d.op = OpScale;
      5'd6:    step_d.op = OpIntegrate;
      5'd9:    step_d.op = OpMix;
      5'd12:   step_d.op = OpState;
      5'd13:   step_d.op = OpInput;
      5'd16:   step_d.op = OpIntegrate;
      default: step_d.op = OpNone;
    endcase
    step_d.low  = clock_q[5:1] >= 5'd12;
    step_d.axis = clock_q[0];
    unique case (clock_q[5:1])
      5'd1:    early.add = AddCurrent;
      5'd4:    early.add = AddInput;
      5'd5:    early.add = AddDouble1;
      5'd7:    early.add = AddScale;
      5'd8:    early.add = AddIntegrate;
      5'd9:    early.add = AddDouble2;
      5'd11:   early.add = AddMix;
      5'd12:   early.add = AddMixed;
      5'd15:   early.add = AddInput;
      5'd16:   early.add = AddDouble1;
      5'd18:   early.add = AddIntegrate;
      5'd19:   early.add = AddDouble2;
      default: early.add = AddNone;
    endcase
    early.low  = clock_q[5:1] >= 5'd12;
    early.axis = clock_q[0];
  end

  always_ff @(posedge clk_i) begin
    step_q  <= step_d;
    load_q  <= early;
    add_q   <= load_q;
    valid_q <= clock_q == LastClock;
    if (start) clock_q <= FirstClock;
    else if (clock_q == LastClock) clock_q <= '0;
    else if (clock_q != '0) clock_q <= clock_q + 6'd1;
    if (start_i && !start && overrun_q != '1) overrun_q <= overrun_q + 16'd1;
    if (rst_i) begin
      clock_q   <= '0;
      step_q    <= '0;
      load_q    <= '0;
      add_q     <= '0;
      valid_q   <= 1'b0;
      overrun_q <= '0;
    end
  end

  // States of the first run after a clear are read as 0.
  logic clear_q, fresh_q;

  always_ff @(posedge clk_i) begin
    if (start) begin
      fresh_q <= clear_q || clear_i;
      clear_q <= 1'b0;
    end else if (clear_i) begin
      clear_q <= 1'b1;
    end
    if (rst_i) clear_q <= 1'b1;
  end

  // Operands of the products: s1, v1, x. x is x - s2 of the filter in work or, between both, h.
  typedef logic signed [24:0] operand_t;

  (* ram_style = "distributed" *) operand_t operands[8];
  logic [2:0] operand_address, operand_store;
  operand_t operand, result, result_q;
  filter_t filter;
  sample_t reference;
  logic negative_q, zero_q;  // h_d

  always_comb begin
    unique case (step_q.op)
      OpState:            operand_address = {1'b0, step_q.low, step_q.axis};
      OpInput, OpMix:     operand_address = {2'b11, step_q.axis};
      default:            operand_address = {2'b10, step_q.axis};
    endcase
  end

  assign operand = operands[operand_address];
  assign filter  = step_q.low ? low_i : band_i;

  always_comb begin
    if (sine_i) reference = reference_i;
    else if (zero_q) reference = '0;
    else reference = negative_q ? -18'sd65536 : 18'sd65536;
  end

  // Shift of a mixed product beyond 2^-17: the sign is 2^16.
  function automatic logic [3:0] gain(logic axis, logic sine, logic [2:0] shift);
    return (axis ? {1'b0, shift} : 4'd0) + {3'd0, !sine};
  endfunction

  always_comb begin
    mac_o             = '0;
    mac_o.enable      = step_q.op != OpNone;
    mac_o.accumulator = step_q.axis;
    mac_o.first       = step_q.op != OpNone && step_q.op != OpInput;
    if (step_q.op != OpNone && !(step_q.op == OpState && fresh_q)) mac_o.c = operand;
    unique case (step_q.op)
      OpState: begin
        mac_o.x    = filter.a1;
        mac_o.high = filter.fine;
        mac_o.half = filter.fine ? 5'd21 : 5'd16;
      end
      OpInput: mac_o.x = filter.a2;
      OpIntegrate: begin
        mac_o.x    = filter.g;
        mac_o.half = filter.fine ? 5'd21 : 5'd16;
      end
      OpScale: begin
        mac_o.x    = band_k_i;
        mac_o.half = 5'd15;
      end
      OpMix: begin
        mac_o.x    = reference;
        mac_o.half = 5'd16 - {1'b0, gain(step_q.axis, sine_i, shift_i)};
      end
      default: ;
    endcase
  end

  // Shift by 9 to 17 or 22: 9 with 0, 4, 8 or 13 more, then 0 to 3.
  localparam int unsigned LeastShift = 9;
  localparam int unsigned ShiftedBits = SumBits - LeastShift;

  logic [3:0] more;
  logic signed [ShiftedBits-1:0] raw, shifted_q;
  logic [1:0] rest_q;
  logic over;

  assign raw = ShiftedBits'(sum_i >>> LeastShift);

  always_comb begin
    unique case (early.add)
      AddScale: more = 4'd7;
      AddMix:   more = 4'd8 - gain(early.axis, sine_i, shift_i);
      default:  more = (early.low ? low_i.fine : band_i.fine) ? 4'd13 : 4'd8;
    endcase
  end

  always_ff @(posedge clk_i) begin
    unique case (more[3:2])
      2'd0: shifted_q <= raw;
      2'd1: shifted_q <= raw >>> 4;
      2'd2: shifted_q <= raw >>> 8;
      2'd3: shifted_q <= raw >>> 13;
    endcase
    rest_q <= (more[3:2] == 2'd3) ? 2'd0 : more[1:0];
  end

  // Beyond 25 bits after the rest of the shift.
  always_comb begin
    over = shifted_q[ShiftedBits-2:27] != {(ShiftedBits - 28) {shifted_q[ShiftedBits-1]}};
    for (int unsigned i = 0; i < 3; i++)
    if (rest_q <= 2'(i) && shifted_q[24+i] != shifted_q[ShiftedBits-1]) over = 1'b1;
  end

  // Operands of the adder.
  (* ram_style = "distributed" *) state_t states[8];  // {s2, low, axis}
  logic second, subtract;
  state_t state;
  operand_t left_q, right_q;
  logic carry_q, over_q, over_negative_q, use_state;

  assign second = load_q.add != AddDouble1;
  assign state  = states[{second, load_q.low, load_q.axis}];
  assign subtract = load_q.add == AddCurrent || load_q.add == AddMixed || load_q.add == AddDouble1 ||
      load_q.add == AddDouble2;
  assign use_state = (subtract || load_q.add == AddIntegrate) && !fresh_q;

  always_ff @(posedge clk_i) begin
    unique case (load_q.add)
      AddCurrent:             left_q <= 25'($signed({current_i[load_q.axis], 4'd0}));
      AddMixed:               left_q <= result_q;
      AddDouble1, AddDouble2: left_q <= result_q <<< 1;
      default:                left_q <= 25'(shifted_q >>> rest_q);
    endcase
    over_q <= over && (load_q.add == AddInput || load_q.add == AddScale || load_q.add == AddIntegrate ||
        load_q.add == AddMix);
    over_negative_q <= shifted_q[ShiftedBits-1];
    right_q <= (use_state ? 25'(state) : 25'sd0) ^ {25{subtract}};
    carry_q <= subtract;
  end

  // Sum, limited to 24 bits but for the differences, which fit.
  logic signed [25:0] sum;
  logic limited, clip, negative;

  assign sum      = 26'(left_q) + 26'(right_q) + 26'($signed({1'b0, carry_q}));
  assign limited  = add_q.add != AddNone && add_q.add != AddCurrent && add_q.add != AddMixed;
  assign clip     = limited && (over_q || sum[25:23] != {3{sum[25]}});
  assign negative = over_q ? over_negative_q : sum[25];
  assign result   = clip ? {{2{negative}}, {23{!negative}}} : sum[24:0];

  logic store_state, store_operand;

  always_comb begin
    store_state   = add_q.add == AddDouble1 || add_q.add == AddDouble2;
    store_operand = 1'b1;
    unique case (add_q.add)
      AddDouble1:                     operand_store = {1'b0, add_q.low, add_q.axis};
      AddInput:                       operand_store = {2'b10, add_q.axis};
      AddCurrent, AddMixed, AddScale: operand_store = {2'b11, add_q.axis};
      default: begin
        operand_store = {2'b11, add_q.axis};
        store_operand = 1'b0;
      end
    endcase
  end

  always_ff @(posedge clk_i) begin
    result_q <= result;
    if (store_operand) operands[operand_store] <= result;
    if (store_state) states[{add_q.add==AddDouble2, add_q.low, add_q.axis}] <= result[23:0];
  end

  // Results.
  state_t error_q, magnitude_q;
  sample_t [1:0] hf_q;
  logic [15:0] clipped_q;
  logic clip_q, hf_valid_q, is_hf_q, hf_axis_q;

  // Band-passed current in the format of currents, rounded half up.
  function automatic sample_t to_sample(operand_t y);
    return sat_sample(32'(y >>> 4) + 32'($signed({1'b0, y[3]})));
  endfunction

  always_ff @(posedge clk_i) begin
    if (add_q.add == AddIntegrate && add_q.low) begin
      if (add_q.axis) error_q <= result[23:0];
      else magnitude_q <= result[23:0];
    end
    is_hf_q    <= add_q.add == AddScale;
    hf_axis_q  <= add_q.axis;
    hf_valid_q <= is_hf_q && hf_axis_q;
    if (is_hf_q) hf_q[hf_axis_q] <= to_sample(result_q);
    if (is_hf_q && !hf_axis_q) begin
      negative_q <= result_q[23];
      zero_q     <= result_q == '0;
    end

    // The last sum of a run tells whether it was clipped.
    clip_q <= clip_q || clip;
    if (add_q.add == AddDouble2 && add_q.low && add_q.axis) begin
      clip_q <= 1'b0;
      if ((clip_q || clip) && clipped_q != '1) clipped_q <= clipped_q + 16'd1;
    end
    if (rst_i) begin
      hf_q        <= '0;
      is_hf_q     <= 1'b0;
      hf_valid_q  <= 1'b0;
      error_q     <= '0;
      magnitude_q <= '0;
      clip_q      <= 1'b0;
      clipped_q   <= '0;
    end
  end

  assign hf_o        = hf_q;
  assign hf_valid_o  = hf_valid_q;
  assign busy_o      = clock_q != '0;
  assign valid_o     = valid_q;
  assign error_o     = error_q;
  assign magnitude_o = magnitude_q;
  assign clipped_o   = clipped_q;
  assign overrun_o   = overrun_q;

endmodule
`default_nettype wire
