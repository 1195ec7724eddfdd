// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Time between a sample and its zero crossing: distance = asin(value / peak) / omega, one sample at a time.
//
// 1 / omega comes from the interval of 60 degrees: asin is taken in intervals, so that
//   distance = interval * asin(x) / (pi/3),   x = value / peak          (Yang 2020: e = psi * omega * sin(omega * t))
//   distance = interval * x / 2               with linear_i: straight flank, peak reached after 30 degrees
// x is a quotient of 16 bits from the divider that the crossing's interpolation uses too (fl_interpolator with
// gap = 2^16 - 1, before = value, after = peak - value); asin is a table of 128 segments with straight lines between.
//
// Formats: value and peak in the same unit, magnitudes; interval and distance in clocks. distance = distance_o + half_o:
// the rounding is left to the sum that it goes into. x at and beyond 125/128
// (linear: beyond 1) saturates: distance is that of the limit (1.29, linear 0.5 intervals), saturated_o comes with it;
// nothing wraps. Error for x <= 0.95: at most interval * 3.2e-4 (0.02 degrees) + 1 clock; up to the limit
// interval * 1.1e-3 + 1 clock.
// Latency: start_i to valid_o Latency clocks, saturated by value >= peak: SaturatedLatency. A start while one runs
// replaces it (the divider is aborted with it).
`default_nettype none
module fl_angle_time #(
    localparam int unsigned Latency          = 25,
    localparam int unsigned SaturatedLatency = 6
) (
    input  logic        clk_i,
    input  logic        rst_i,
    input  logic        start_i,
    input  logic [16:0] value_i,
    input  logic [16:0] peak_i,
    input  logic [23:0] interval_i,    // clocks
    input  logic        linear_i,
    output logic        div_start_o,
    output logic [16:0] div_before_o,
    output logic [16:0] div_after_o,
    input  logic        div_valid_i,
    input  logic [15:0] div_offset_i,
    output logic        busy_o,
    output logic        valid_o,
    output logic [24:0] distance_o,    // clocks, rounded down
    output logic        half_o,        // one more
    output logic        saturated_o
);

  import fl_asin_pkg::*;

  typedef enum logic [2:0] {
    Idle,
    Divide,  // x is being found
    Read,    // table: line at x
    Line,    // product of the slope
    Sum,     // angle in intervals
    Scale,   // times the interval, in two parts
    Add      // of them
  } state_e;

  state_e state_q;
  logic [15:0] x_q;  // Q16
  logic [23:0] interval_q;
  logic linear_q, saturated_q, valid_q;
  logic [6:0] address;  // in the table
  asin_line_t entry_q;
  logic [16:0] start_q;  // of the line
  logic [23:0] factor_q;  // rise of the line, then the interval
  logic [16:0] scale_q;  // place on the line, then the angle in intervals
  logic [28:0] low_q, high_q;  // products of the scale with 12 bits of the factor each
  logic [25:0] distance_q;  // clocks and a half
  logic beyond;

  assign beyond = value_i >= peak_i;

  // The memory's output has a register before the multiplier: both are slow.
  assign address = (start_i || div_offset_i[15:9] >= AsinLast) ? AsinLast : div_offset_i[15:9];

  always_ff @(posedge clk_i) begin
    entry_q <= AsinLines[address];
  end

  always_ff @(posedge clk_i) begin
    valid_q <= 1'b0;
    unique case (state_q)
      Idle:    ;
      Divide: begin
        x_q <= div_offset_i;
        if (div_valid_i) begin
          saturated_q <= div_offset_i[15:9] >= AsinLast && !linear_q;
          state_q     <= Read;
        end
      end
      Read: begin
        factor_q <= 24'(entry_q.rise);
        start_q  <= entry_q.start;
        scale_q  <= 17'(x_q[8:0]);
        state_q  <= Line;
      end
      Line:    state_q <= Sum;
      Sum: begin
        if (!linear_q) scale_q <= start_q + 17'((low_q + 29'd256) >> 9);
        else scale_q <= saturated_q ? 17'h08000 : {2'b0, x_q[15:1]};
        factor_q <= interval_q;
        state_q  <= Scale;
      end
      Scale:   state_q <= Add;
      Add: begin
        valid_q <= 1'b1;
        state_q <= Idle;
      end
      default: state_q <= Idle;
    endcase
    low_q  <= 29'(factor_q[11:0]) * 29'(scale_q);
    high_q <= 29'(factor_q[23:12]) * 29'(scale_q);
    if (state_q == Add) distance_q <= 26'(({high_q, 12'd0} + 41'(low_q)) >> 15);
    if (start_i) begin
      interval_q  <= interval_i;
      linear_q    <= linear_i;
      saturated_q <= beyond;
      valid_q     <= 1'b0;
      state_q     <= beyond ? Read : Divide;
    end
    if (rst_i) begin
      state_q <= Idle;
      valid_q <= 1'b0;
    end
  end

  assign div_start_o  = start_i && !beyond;
  assign div_before_o = value_i;
  assign div_after_o  = peak_i - value_i;
  assign busy_o       = state_q != Idle;
  assign valid_o      = valid_q;
  assign distance_o   = distance_q[25:1];
  assign half_o       = distance_q[0];
  assign saturated_o  = saturated_q;

endmodule
`default_nettype wire
