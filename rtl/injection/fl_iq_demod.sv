// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// I/Q demodulation: sums of both currents against a complex reference over whole injection periods.
//
//   sum = sum over the samples of a period of i * 4 (c - j s)
// Sine reference (sine_i): c, s = cosine, sine of the wave's angle at the sample, 2^17 = 1; products rounded half up. Square
// reference: s = square(phase), c = square(phase + floor(period/4)), exact; c and s are orthogonal if the period is
// divisible by 4 and its samples are evenly spread.
// i = A cos(angle + phi) gives A exp(j phi) = 2 sum / (4 count) with the sine reference, whatever the number of samples
// in an injection period, from 3; a constant gives 0. What rises evenly leaks.
//
// A period begins with the first sample whose phase is below that of the sample before; the sums of the samples before it
// are then the result, but for those after reset or clear_i that began somewhere in a period. count_o is their number.
// More than 4095 samples do not fit: that period gives no result, overflow_o rises and stays until clear_i.
//
// Formats: currents signed 18 bits, 2^17 = full scale; sums signed 32 bits, 2^19 = full scale times one sample.
// The multiplier is outside: fl_injection_mac between mac_o, 0 when nothing is asked for, and sum_i.
// Latency: start_i of a period's first sample to valid_o with the sums of the one before 1 clock; busy_o for BusyClocks
// after each start, in which a further start is ignored and counted (saturating). Current and phase are taken at start_i,
// the reference is read in clocks 2 to 5. clear_i acts at once.
`default_nettype none
module fl_iq_demod
  import fl_pkg::sample_t;
  import fl_injection_pkg::*;
#(
    localparam int unsigned Latency = 1,
    localparam int unsigned BusyClocks = 8
) (
    input logic clk_i,
    input logic rst_i,

    input logic          start_i,
    input sample_t [1:0] current_i,
    input phase_t        phase_i,      // of the sample
    input sample_t       cosine_i,
    input sample_t       sine_value_i,
    input logic          clear_i,

    input logic   sine_i,
    input phase_t period_i,

    output mac_t mac_o,
    input  sum_t sum_i,

    output logic                     busy_o,
    output logic                     valid_o,
    output logic [ 1:0][ 1:0][31:0]  sum_o,      // [axis][0: real, 1: imaginary], signed
    output logic [11:0]              count_o,
    output logic                     overflow_o,
    output logic [15:0]              overrun_o
);

  logic [3:0] clock_q;  // clocks since the start, 0: idle
  logic start, wrap;
  logic [15:0] overrun_q;
  phase_t phase_q;
  sample_t [1:0] current_q;

  assign start = start_i && clock_q == '0;
  assign wrap  = phase_i < phase_q;

  always_ff @(posedge clk_i) begin
    if (start) clock_q <= 4'd1;
    else if (clock_q == 4'(BusyClocks)) clock_q <= '0;
    else if (clock_q != '0) clock_q <= clock_q + 4'd1;
    if (start_i && !start && overrun_q != '1) overrun_q <= overrun_q + 16'd1;
    if (start) begin
      current_q <= current_i;
      phase_q   <= phase_i;
    end
    if (clear_i) phase_q <= '0;
    if (rst_i) begin
      clock_q   <= '0;
      overrun_q <= '0;
      phase_q   <= '0;
      current_q <= '0;
    end
  end

  // Products in clocks 2..5: axis 0, 0, 1, 1; imaginary, real alternating. The square reference, a quarter further on for
  // the real part, is found in the clock before.
  logic multiply_q, imaginary_q, axis_q;
  logic signed [1:0] level_q;
  phase_t quarter_q;

  always_ff @(posedge clk_i) begin
    multiply_q  <= clock_q != '0 && clock_q <= 4'd4;
    axis_q      <= clock_q > 4'd2;
    imaginary_q <= clock_q[0];
    quarter_q   <= phase_sum(phase_q, period_i >> 2, period_i);
    level_q     <= square(clock_q[0] ? phase_q : quarter_q, period_i);
    if (rst_i) multiply_q <= 1'b0;
  end

  always_comb begin
    mac_o = '0;
    if (multiply_q) begin
      mac_o.enable      = 1'b1;
      mac_o.accumulator = axis_q;
      mac_o.first       = 1'b1;
      mac_o.half        = sine_i ? 5'd14 : 5'd13;
      mac_o.c           = 25'($signed(current_q[axis_q]));
      if (sine_i) mac_o.x = imaginary_q ? sine_value_i : cosine_i;
      else mac_o.x = {level_q, 16'd0};
    end
  end

  // Sums three clocks later, in clocks 5..8. They go round: turn_q[0] is the next one in turn, and after four all are in
  // their places again. They turn when they are full too, so that clear_i may come in between.
  localparam int unsigned Place[4] = '{1, 0, 3, 2};  // of turn_q in the result: 2 axis + imaginary
  logic signed [20:0] product;
  logic sum_on_q, subtract_q, known_q, full_q, valid_q, overflow_q;
  logic [31:0] turned;
  logic [3:0][31:0] turn_q, result_q;
  logic [11:0] count_q, result_count_q;

  assign product = sine_i ? 21'(sum_i >>> 15) : 21'(sum_i >>> 14);
  assign turned  = subtract_q ? turn_q[0] - 32'(product) : turn_q[0] + 32'(product);

  always_ff @(posedge clk_i) begin
    sum_on_q   <= clock_q >= 4'd4 && clock_q != 4'(BusyClocks);
    subtract_q <= !clock_q[0];  // the imaginary parts
    valid_q    <= start && wrap && known_q && !full_q;
    if (start && wrap) begin
      known_q <= 1'b1;
      full_q  <= 1'b0;
      turn_q  <= '0;
      count_q <= 12'd1;
      if (known_q && full_q) overflow_q <= 1'b1;
      if (known_q && !full_q) begin
        for (int unsigned n = 0; n < 4; n++) result_q[Place[n]] <= turn_q[n];
        result_count_q <= count_q;
      end
    end else if (start) begin
      if (count_q == '1) full_q <= 1'b1;
      else count_q <= count_q + 12'd1;
    end else if (sum_on_q) begin
      turn_q <= {turned, turn_q[3:1]};
    end
    if (clear_i || rst_i) begin
      known_q    <= 1'b0;
      full_q     <= 1'b0;
      overflow_q <= 1'b0;
      count_q    <= '0;
      turn_q     <= '0;
    end
    if (rst_i) begin
      sum_on_q       <= 1'b0;
      valid_q        <= 1'b0;
      result_q       <= '0;
      result_count_q <= '0;
    end
  end

  assign busy_o     = clock_q != '0;
  assign valid_o    = valid_q;
  assign sum_o      = result_q;
  assign count_o    = result_count_q;
  assign overflow_o = overflow_q;
  assign overrun_o  = overrun_q;

endmodule
`default_nettype wire
