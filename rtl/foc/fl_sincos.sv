// Sine or cosine of an angle: quarter-wave table of 512 straight lines, one angle a clock.
//
//   value = (2^(Width-1) - 1) * sin(angle)    or cos(angle) with cosine_i; 2^32 = one turn
// Width 18, the default: 2^17 - 1 = 1. Half a turn further on the value is exactly the negative one.
// Error: rounding, 0.5 LSB, and the table's (half a chord's sagitta, rounding of its lines), at most 1.05e-6 of full
// scale: 0.64 LSB at Width 18.
// Latency: valid_i to valid_o Latency clocks, an angle every clock.
// Uses one block RAM (512 x 36 bits: line's start 2^22 = 1, line's rise) and one multiplier (18 x 15 bits).
`default_nettype none
module fl_sincos
  import fl_sine_pkg::*;
#(
    parameter  int unsigned Width   = 18,
    localparam int unsigned Latency = 3
) (
    input  logic                    clk_i,
    input  logic                    rst_i,
    input  logic                    valid_i,
    input  logic        [     31:0] angle_i,   // 2^32 = one turn
    input  logic                    cosine_i,
    output logic                    valid_o,
    output logic signed [Width-1:0] value_o
);

  if (Width < 18 || Width > 21) begin : gen_illegal
    $fatal(1, "fl_sincos: Width must be 18..21, the table is made for these (%m)");
  end

  // Position in the quarter, mirrored in the second and fourth: 9 bits line, 17 bits position on it.
  logic [ 1:0] quarter;
  logic [25:0] position;
  logic [16:0] along_q;
  logic negative1_q, negative2_q;
  sine_line_t line_q;
  logic [21:0] start_q;
  logic signed [32:0] rise_q;
  logic [22:0] magnitude;
  logic [Width-2:0] rounded;
  logic [Latency-1:0] valid_q;

  assign quarter  = angle_i[31:30] + {1'b0, cosine_i};
  assign position = angle_i[29:4] ^ {26{quarter[0]}};

  // The lowest 4 bits of the angle move the result by 1e-8.
  logic unused;
  assign unused = &{1'b0, angle_i[3:0], rise_q[32], rise_q[16:0]};

  // Times 2^(Width-1) - 1, rounded half up: the table's scale less its share of the 1 below the power of two.
  assign magnitude = {1'b0, start_q} + {7'd0, rise_q[32:17]} - 23'(start_q >> (Width - 1));
  assign rounded = (Width - 1)'((magnitude + 23'(1 << (22 - Width))) >> (23 - Width));

  always_ff @(posedge clk_i) begin
    line_q      <= SineLines[position[25:17]];
    along_q     <= position[16:0];
    negative1_q <= quarter[1];

    start_q     <= line_q.start;
    rise_q      <= 33'($signed({1'b0, along_q})) * 33'($signed({1'b0, line_q.rise}));
    negative2_q <= negative1_q;

    value_o     <= negative2_q ? -$signed({1'b0, rounded}) : $signed({1'b0, rounded});
    valid_q     <= {valid_q[Latency-2:0], valid_i};
    if (rst_i) valid_q <= '0;
  end

  assign valid_o = valid_q[Latency-1];

endmodule
`default_nettype wire
