// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Linear interpolation of a crossing: offset = round(gap * before / (before + after)).
//
// gap: time between the two samples (clocks); before, after: distances from the threshold on both sides, same unit,
// not both 0. offset_o is 0..gap_i, rounded half up. Restoring division, one bit a clock, on a registered product.
//
// Latency: start_i to valid_o Latency clocks; start_i while busy is not allowed (asserted) unless abort_i, which drops
// what runs, comes in the same clock or before.
`default_nettype none
module fl_interpolator #(
    parameter  int unsigned TimeBits  = 16,
    parameter  int unsigned ValueBits = 17,
    localparam int unsigned Latency   = TimeBits + 3
) (
    input  logic                 clk_i,
    input  logic                 rst_i,
    input  logic                 start_i,
    input  logic                 abort_i,
    input  logic [ TimeBits-1:0] gap_i,     // clocks
    input  logic [ValueBits-1:0] before_i,
    input  logic [ValueBits-1:0] after_i,
    output logic                 busy_o,
    output logic                 valid_o,
    output logic [ TimeBits-1:0] offset_o   // clocks
);

  if (TimeBits < 2 || ValueBits < 2) begin : gen_illegal
    $fatal(1, "fl_interpolator: TimeBits and ValueBits must be at least 2 (%m)");
  end

  localparam int unsigned SumBits = ValueBits + 1;
  localparam int unsigned ProductBits = TimeBits + SumBits;
  localparam int unsigned CountBits = fl_pkg::idx_width(TimeBits + 1);

  typedef enum logic [1:0] {
    Idle,
    Multiply,
    Round,
    Divide
  } state_e;

  state_e state_q;
  logic [CountBits-1:0] count_q;
  logic [TimeBits-1:0] gap_q;
  logic [ValueBits-1:0] before_q, after_q;
  logic [SumBits-1:0] sum_q;
  logic [ProductBits-1:0] product_q;  // of the operands a clock before
  logic [ProductBits-1:0] work_q;  // remainder above, dividend bits and quotient below
  logic [SumBits+1:0] trial;
  logic valid_q;

  // The remainder is below the divisor, so shifted it needs one bit more; the trial's sign is the bit above.
  assign trial = {1'b0, work_q[ProductBits-1-:SumBits+1]} - {2'b00, sum_q};

  always_ff @(posedge clk_i) begin
    valid_q   <= 1'b0;
    // Operands and product are taken every clock: the multiplier takes half of its clock, and whoever starts may know late.
    gap_q     <= gap_i;
    before_q  <= before_i;
    after_q   <= after_i;
    product_q <= ProductBits'(gap_q) * ProductBits'(before_q);
    unique case (state_q)
      Idle: ;
      Multiply: begin
        sum_q   <= SumBits'(before_q) + SumBits'(after_q);
        state_q <= Round;
      end
      // Half the divisor turns the truncating division into rounding. gap < 2^TimeBits, so the quotient still fits.
      Round: begin
        work_q  <= product_q + ProductBits'(sum_q >> 1);
        count_q <= CountBits'(TimeBits - 1);
        state_q <= Divide;
      end
      Divide: begin
        work_q <= trial[SumBits+1] ? {work_q[ProductBits-2:0], 1'b0} : {trial[SumBits-1:0], work_q[TimeBits-2:0], 1'b1};
        count_q <= count_q - CountBits'(1);
        if (count_q == '0) begin
          valid_q <= 1'b1;
          state_q <= Idle;
        end
      end
      default: state_q <= Idle;
    endcase
    if (abort_i) begin
      valid_q <= 1'b0;
      state_q <= Idle;
    end
    if (start_i) state_q <= Multiply;
    if (rst_i) begin
      state_q <= Idle;
      valid_q <= 1'b0;
    end else begin
      assert (!(start_i && state_q != Idle && !abort_i))
      else $error("fl_interpolator: start while busy");
    end
  end

  assign busy_o   = state_q != Idle;
  assign valid_o  = valid_q;
  assign offset_o = work_q[TimeBits-1:0];

endmodule
`default_nettype wire
