// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Sine or cosine of an angle: quarter-wave table of 512 straight lines, one angle a clock.
//
//   value = (2^(Width-1) - 1) * sin(angle)    or cos(angle) with cosine_i; 2^32 = one turn
//   value = 2^(Width-1) * ScaleNumerator / ScaleDenominator * sin(angle)    with scaled_i, if they differ
// Width 18, the default: 2^17 - 1 = 1. Half a turn further on the value is exactly the negative one.
// Error: rounding, 0.5 LSB, and the table's (half a chord's sagitta, rounding of its lines), at most 1.05e-6 of full
// scale: 0.64 LSB at Width 18.
// Latency: valid_i to valid_o Latency clocks, an angle every clock.
// Uses one block RAM (512 x 36 bits: line's start 2^22 = 1, line's rise), two with a scale, and one multiplier (18 x 15
// bits).
`default_nettype none
module fl_sincos
  import fl_sine_pkg::*;
#(
    parameter  int unsigned Width            = 18,
    parameter  int unsigned ScaleNumerator   = 1,
    parameter  int unsigned ScaleDenominator = 1,
    localparam int unsigned Latency          = 4
) (
    input  logic                    clk_i,
    input  logic                    rst_i,
    input  logic                    valid_i,
    input  logic        [     31:0] angle_i,   // 2^32 = one turn
    input  logic                    cosine_i,
    input  logic                    scaled_i,
    output logic                    valid_o,
    output logic signed [Width-1:0] value_o
);

  if (Width < 18 || Width > 21) begin : gen_illegal
    $fatal(1, "fl_sincos: Width must be 18..21, the table is made for these (%m)");
  end

  if (ScaleNumerator == 0 || ScaleNumerator > ScaleDenominator || ScaleDenominator > 256) begin : gen_illegal_scale
    $fatal(1, "fl_sincos: ScaleNumerator 1 .. ScaleDenominator, ScaleDenominator at most 256 (%m)");
  end

  localparam bit Scaled = ScaleNumerator != ScaleDenominator;
  localparam int unsigned Tables = Scaled ? 2 : 1;

  // x times the scale, and times 2^(Width-1) / (2^(Width-1) - 1): the lines are read as those of 2^(Width-1) - 1.
  function automatic logic [21:0] scale(logic [21:0] x);
    logic [63:0] numerator, denominator;
    numerator   = 64'(ScaleNumerator) * 64'((1 << (Width - 1)) + 1);
    denominator = 64'(ScaleDenominator) << (Width - 1);
    return 22'((64'(x) * numerator + (denominator >> 1)) / denominator);
  endfunction

  typedef logic [512*Tables-1:0][35:0] lines_t;

  function automatic lines_t all_lines();
    lines_t y;
    sine_line_t line;
    for (int unsigned k = 0; k < 512; k++) begin
      y[k] = SineLines[k];
      if (Scaled) begin
        line = SineLines[k];
        y[512*(Tables-1)+k] = {scale(line.start), 14'(scale(22'(line.rise)))};
      end
    end
    return y;
  endfunction

  localparam lines_t Lines = all_lines();

  // Position in the quarter, mirrored in the second and fourth: 9 bits line, 17 bits position on it.
  logic [ 1:0] quarter;
  logic [Tables+7:0] address;
  logic [25:0] position;
  logic [16:0] along_q, along2_q;
  logic negative_q, negative2_q, negative3_q;
  sine_line_t line_q, line2_q;
  logic signed [22:0] start_q, sum;
  logic signed [32:0] rise_q;
  logic signed [Width-1:0] rounded;
  logic [Latency-1:0] valid_q;

  assign quarter  = angle_i[31:30] + {1'b0, cosine_i};
  assign position = angle_i[29:4] ^ {26{quarter[0]}};

  if (Scaled) begin : gen_scaled
    assign address = {scaled_i, position[25:17]};
  end else begin : gen_plain
    assign address = position[25:17];
    logic unused_scaled;
    assign unused_scaled = scaled_i;
  end

  // The lowest 4 bits of the angle move the result by 1e-8.
  logic unused;
  assign unused = &{1'b0, angle_i[3:0], rise_q[32], rise_q[16:0], sum[22-Width:0]};

  // What the line's start carries along, so that one sum is left: half a unit for the rounding, the share of the 1 below
  // the power of two, and a unit less for a negative value, whose bits are turned over: -x = ~(x - 1).
  function automatic logic signed [7:0] carried(logic [21:0] start, logic negative);
    logic [7:0] y;
    y = 8'(1 << (22 - Width)) - 8'(start >> (Width - 1));
    return negative ? y - 8'(1 << (23 - Width)) : y;
  endfunction

  assign sum     = start_q + 23'($signed({1'b0, rise_q[32:17]}));
  assign rounded = Width'(sum >>> (23 - Width));

  // The memory's output has a register before the multiplier: both are slow.
  always_ff @(posedge clk_i) begin
    line_q      <= Lines[address];
    along_q     <= position[16:0];
    negative_q  <= quarter[1];

    line2_q     <= line_q;
    along2_q    <= along_q;
    negative2_q <= negative_q;

    start_q     <= $signed({1'b0, line2_q.start}) + 23'(carried(line2_q.start, negative2_q));
    rise_q      <= 33'($signed({1'b0, along2_q})) * 33'($signed({1'b0, line2_q.rise}));
    negative3_q <= negative2_q;

    value_o     <= negative3_q ? ~rounded : rounded;
    valid_q     <= {valid_q[Latency-2:0], valid_i};
    if (rst_i) valid_q <= '0;
  end

  assign valid_o = valid_q[Latency-1];

endmodule
`default_nettype wire
