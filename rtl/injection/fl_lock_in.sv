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
// One run a sample, at whatever rate the coefficients are made for. clear_i zeroes the states (between runs).
// The multiplier is outside: fl_injection_mac between mac_o, 0 when nothing is asked for, and sum_i.
// Latency: start_i to valid_o Latency clocks; current_i is taken at start_i, reference_i is read from clock
// ReferenceLatency on until busy_o falls. Outputs stay from valid_o to the next start. A start while busy is ignored
// and counted (saturating).
`default_nettype none
module fl_lock_in
  import fl_pkg::sample_t;
  import fl_pkg::sat_sample;
  import fl_injection_pkg::*;
#(
    localparam int unsigned ReferenceLatency = 11,
    localparam int unsigned Latency = 25
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
    output logic                  valid_o,
    output sample_t [ 1:0]        hf_o,
    output state_t                error_o,
    output state_t                magnitude_o,
    output logic    [15:0]        clipped_o,
    output logic    [15:0]        overrun_o
);

  typedef enum logic [2:0] {
    OpNone,
    OpState,      // a1 s1
    OpInput,      // + a2 (x - s2): v1
    OpIntegrate,  // g v1: v2
    OpScale,      // k v1: h
    OpMix         // r h
  } op_e;

  typedef struct packed {
    op_e  op;
    logic low;   // low-pass instead of band-pass
    logic axis;  // 0: d, 1: q
  } step_t;

  localparam logic [4:0] LastClock = 5'(Latency - 1);

  logic [4:0] clock_q;  // clocks since the start, 0: idle
  step_t step;
  step_t [3:0] tail_q;  // [2]: its sum is there, [3]: its result is
  logic start, valid_q;
  logic [15:0] overrun_q;

  assign start = start_i && clock_q == '0;

  // A result is an operand four clocks after its step.
  always_comb begin
    unique case (clock_q)
      5'd1:    step = '{op: OpState, low: 1'b0, axis: 1'b0};
      5'd2:    step = '{op: OpInput, low: 1'b0, axis: 1'b0};
      5'd3:    step = '{op: OpState, low: 1'b0, axis: 1'b1};
      5'd4:    step = '{op: OpInput, low: 1'b0, axis: 1'b1};
      5'd6:    step = '{op: OpIntegrate, low: 1'b0, axis: 1'b0};
      5'd7:    step = '{op: OpScale, low: 1'b0, axis: 1'b0};
      5'd8:    step = '{op: OpIntegrate, low: 1'b0, axis: 1'b1};
      5'd9:    step = '{op: OpScale, low: 1'b0, axis: 1'b1};
      5'd11:   step = '{op: OpMix, low: 1'b1, axis: 1'b0};
      5'd12:   step = '{op: OpState, low: 1'b1, axis: 1'b0};
      5'd13:   step = '{op: OpMix, low: 1'b1, axis: 1'b1};
      5'd15:   step = '{op: OpInput, low: 1'b1, axis: 1'b0};
      5'd16:   step = '{op: OpState, low: 1'b1, axis: 1'b1};
      5'd17:   step = '{op: OpInput, low: 1'b1, axis: 1'b1};
      5'd19:   step = '{op: OpIntegrate, low: 1'b1, axis: 1'b0};
      5'd21:   step = '{op: OpIntegrate, low: 1'b1, axis: 1'b1};
      default: step = '{op: OpNone, low: 1'b0, axis: 1'b0};
    endcase
  end

  always_ff @(posedge clk_i) begin
    tail_q  <= {tail_q[2:0], step};
    valid_q <= clock_q == LastClock;
    if (start) clock_q <= 5'd1;
    else if (clock_q == LastClock) clock_q <= '0;
    else if (clock_q != '0) clock_q <= clock_q + 5'd1;
    if (start_i && !start && overrun_q != '1) overrun_q <= overrun_q + 16'd1;
    if (rst_i) begin
      clock_q   <= '0;
      tail_q    <= '0;
      valid_q   <= 1'b0;
      overrun_q <= '0;
    end
  end

  // Operands. v1 and v2 are those of the filter in work, by axis.
  sample_t [1:0] current_q;
  state_t [1:0][1:0] s1_q, s2_q;  // [low][axis]
  state_t [1:0] band_q, mixed_q, v1_q, v2_q;
  filter_t filter;
  sample_t reference;
  logic signed [24:0] x;

  assign filter = step.low ? low_i : band_i;
  assign x = step.low ? 25'($signed(mixed_q[step.axis])) : 25'($signed({current_q[step.axis], 4'd0}));

  always_comb begin
    if (sine_i) reference = reference_i;
    else if (band_q[0] == '0) reference = '0;
    else reference = band_q[0][23] ? -18'sd65536 : 18'sd65536;
  end

  // Shift of a mixed product beyond 2^-17: the sign is 2^16.
  function automatic logic [3:0] gain(logic axis, logic sine, logic [2:0] shift);
    return (axis ? {1'b0, shift} : 4'd0) + {3'd0, !sine};
  endfunction

  always_comb begin
    mac_o             = '0;
    mac_o.enable      = step.op != OpNone;
    mac_o.accumulator = step.axis;
    mac_o.first       = step.op != OpNone && step.op != OpInput;
    unique case (step.op)
      OpState: begin
        mac_o.x    = filter.a1;
        mac_o.c    = 25'($signed(s1_q[step.low][step.axis]));
        mac_o.high = filter.fine;
        mac_o.half = filter.fine ? 5'd21 : 5'd16;
      end
      OpInput: begin
        mac_o.x = filter.a2;
        mac_o.c = x - 25'($signed(s2_q[step.low][step.axis]));
      end
      OpIntegrate: begin
        mac_o.x    = filter.g;
        mac_o.c    = 25'($signed(v1_q[step.axis]));
        mac_o.half = filter.fine ? 5'd21 : 5'd16;
      end
      OpScale: begin
        mac_o.x    = band_k_i;
        mac_o.c    = 25'($signed(v1_q[step.axis]));
        mac_o.half = 5'd15;
      end
      OpMix: begin
        mac_o.x    = reference;
        mac_o.c    = 25'($signed(band_q[step.axis]));
        mac_o.half = 5'd16 - {1'b0, gain(step.axis, sine_i, shift_i)};
      end
      default: ;
    endcase
  end

  // Results: of a filter, and of the mixer, whose shift is a setting. What they depend on is known a clock before.
  step_t done, after;
  sum_t scaled, offset, result, mixed, doubled1, doubled2;
  logic clip, clip_q, fine_q, scale_q, integrate_q;
  logic [4:0] mix_shift_q;

  assign done  = tail_q[2];
  assign after = tail_q[3];

  always_ff @(posedge clk_i) begin
    fine_q      <= tail_q[1].low ? low_i.fine : band_i.fine;
    scale_q     <= tail_q[1].op == OpScale;
    integrate_q <= tail_q[1].op == OpIntegrate;
    mix_shift_q <= 5'd17 - {1'b0, gain(tail_q[1].axis, sine_i, shift_i)};
  end

  always_comb begin
    if (scale_q) scaled = sum_i >>> 16;
    else scaled = fine_q ? sum_i >>> 22 : sum_i >>> 17;
    offset = integrate_q ? sum_t'($signed(s2_q[done.low][done.axis])) : '0;
    result = scaled + offset;
    mixed  = sum_i >>> mix_shift_q;
  end

  assign doubled1 = (sum_t'($signed(v1_q[after.axis])) <<< 1) - sum_t'($signed(s1_q[after.low][after.axis]));
  assign doubled2 = (sum_t'($signed(v2_q[after.axis])) <<< 1) - sum_t'($signed(s2_q[after.low][after.axis]));

  always_comb begin
    clip = (done.op == OpMix) ? clips(mixed) : done.op != OpNone && done.op != OpState && clips(result);
    if (after.op == OpIntegrate) clip = clip || clips(doubled1) || clips(doubled2);
  end

  state_t error_q, magnitude_q;
  logic [15:0] clipped_q;

  always_ff @(posedge clk_i) begin
    if (start) current_q <= current_i;
    unique case (done.op)
      OpInput:     v1_q[done.axis] <= sat_state(result);
      OpIntegrate: v2_q[done.axis] <= sat_state(result);
      OpScale:     band_q[done.axis] <= sat_state(result);
      OpMix:       mixed_q[done.axis] <= sat_state(mixed);
      default:     ;
    endcase
    if (after.op == OpIntegrate) begin
      s1_q[after.low][after.axis] <= sat_state(doubled1);
      s2_q[after.low][after.axis] <= sat_state(doubled2);
    end
    if (clock_q == LastClock) {error_q, magnitude_q} <= {sat_state(result), v2_q[0]};

    clip_q <= !start && (clip_q || clip);
    if (valid_q && (clip_q || clip) && clipped_q != '1) clipped_q <= clipped_q + 16'd1;

    if (clear_i || rst_i) begin
      s1_q <= '0;
      s2_q <= '0;
    end
    if (rst_i) begin
      current_q   <= '0;
      v1_q        <= '0;
      v2_q        <= '0;
      band_q      <= '0;
      mixed_q     <= '0;
      error_q     <= '0;
      magnitude_q <= '0;
      clip_q      <= 1'b0;
      clipped_q   <= '0;
    end
  end

  // Band-passed current in the format of currents, rounded half up.
  function automatic sample_t to_sample(state_t y);
    return sat_sample(32'(y >>> 4) + 32'($signed({1'b0, y[3]})));
  endfunction

  assign hf_o        = {to_sample(band_q[1]), to_sample(band_q[0])};
  assign busy_o      = clock_q != '0;
  assign valid_o     = valid_q;
  assign error_o     = error_q;
  assign magnitude_o = magnitude_q;
  assign clipped_o   = clipped_q;
  assign overrun_o   = overrun_q;

endmodule
`default_nettype wire
