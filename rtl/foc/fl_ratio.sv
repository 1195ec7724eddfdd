// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Ratio of two integers as a fraction: ratio = floor(part * 2^RatioBits / whole) for part < whole, three bits
// a clock, two in that of the start.
//
// Restoring division, by 8: all multiples of the whole are taken off at once, and the last difference that is not below
// zero stays. less_o tells whether part < whole held at the start; if not, ratio_o has no meaning. A start while
// one runs replaces it.
// Latency: start_i to valid_o Latency clocks; ratio_o and less_o are valid from valid_o to the next start.
`default_nettype none
module fl_ratio #(
    parameter  int unsigned WholeBits = 20,
    parameter  int unsigned RatioBits = 17,
    localparam int unsigned Latency   = (RatioBits + 3) / 3
) (
    input  logic                 clk_i,
    input  logic                 rst_i,
    input  logic                 start_i,
    input  logic [WholeBits-1:0] part_i,
    input  logic [WholeBits-1:0] whole_i,
    output logic                 valid_o,
    output logic                 less_o,
    output logic [RatioBits-1:0] ratio_o
);

  if (WholeBits < 2 || RatioBits < 2) begin : gen_illegal
    $fatal(1, "fl_ratio: WholeBits and RatioBits must be at least 2 (%m)");
  end

  localparam int unsigned BitsPerClock = 3;
  localparam int unsigned FirstBits = 2;
  localparam int unsigned Iterations = Latency - 1;  // behind the first clock
  localparam int unsigned Bits = FirstBits + BitsPerClock * Iterations;  // RatioBits, and what fills the last clock
  localparam int unsigned CountBits = fl_pkg::idx_width(Iterations + 1);
  localparam int unsigned TrialBits = WholeBits + BitsPerClock + 1;  // its sign on top

  typedef logic signed [TrialBits-1:0] trial_t;

  // a - b - c with one chain of carries: the three terms become two without one.
  function automatic trial_t less_both(trial_t a, trial_t b, trial_t c);
    trial_t carry;
    carry = trial_t'({(a & ~b) | (a & ~c) | (~b & ~c), 1'b1});
    return (a ^ b ^ c) - ~carry;
  endfunction

  logic [WholeBits-1:0] remainder_q;  // below whole
  trial_t whole, whole_q, whole3_q, whole5_q, whole7_q;  // times 1, 3, 5, 7
  logic [Bits-1:0] ratio_q;
  logic [CountBits-1:0] count_q;  // iterations to go
  logic less_q, valid_q;

  trial_t first, shifted;
  trial_t [7:0] first_trial, trial;  // less 0 .. 7 times the whole; of the first 0 .. 3
  logic [7:0][31:0] first_wide, wide;
  fl_pkg::digit8_t first_digit, digit;

  assign whole   = trial_t'({1'b0, whole_i});
  assign first   = trial_t'({1'b0, part_i}) <<< FirstBits;
  assign shifted = trial_t'({1'b0, remainder_q}) <<< BitsPerClock;

  // All multiples side by side: a clock holds one subtraction and the choice among the differences.
  always_comb begin
    first_trial    = {8{trial_t'(-1)}};
    first_trial[0] = first;
    first_trial[1] = first - whole;
    first_trial[2] = first - (whole <<< 1);
    first_trial[3] = less_both(first, whole <<< 1, whole);
    trial[0]       = shifted;
    trial[1]       = shifted - whole_q;
    trial[2]       = shifted - (whole_q <<< 1);
    trial[3]       = shifted - whole3_q;
    trial[4]       = shifted - (whole_q <<< 2);
    trial[5]       = shifted - whole5_q;
    trial[6]       = shifted - (whole3_q <<< 1);
    trial[7]       = shifted - whole7_q;
    for (int unsigned k = 0; k < 8; k++) begin
      first_wide[k] = 32'(signed'(first_trial[k]));
      wide[k]       = 32'(signed'(trial[k]));
    end
  end

  assign first_digit = fl_pkg::digit8(first_wide);
  assign digit       = fl_pkg::digit8(wide);

  always_ff @(posedge clk_i) begin
    valid_q <= start_i ? Iterations == 0 : count_q == CountBits'(1);
    if (start_i) begin
      whole_q     <= whole;
      whole3_q    <= whole + (whole <<< 1);
      whole5_q    <= whole + (whole <<< 2);
      whole7_q    <= (whole <<< 3) - whole;
      less_q      <= part_i < whole_i;
      ratio_q     <= Bits'(first_digit.digit);
      remainder_q <= first_digit.difference[WholeBits-1:0];
      count_q     <= CountBits'(Iterations);
    end else if (count_q != '0) begin
      ratio_q     <= Bits'({ratio_q, digit.digit});
      remainder_q <= digit.difference[WholeBits-1:0];
      count_q     <= count_q - CountBits'(1);
    end
    if (rst_i) begin
      count_q <= '0;
      valid_q <= 1'b0;
    end
  end

  assign valid_o = valid_q;
  assign less_o  = less_q;
  assign ratio_o = ratio_q[Bits-1-:RatioBits];

endmodule
`default_nettype wire
