// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Integer square root: root = floor(sqrt(radicand)), three result bits a clock, the first ones in that of the start.
//
// By digits of three bits: the next six bits of the radicand join the remainder, 16 * k * root + k^2 is taken off for all
// digits k at once, and the last difference that is not below zero stays.
// Unsigned integers without scaling; exact for every radicand. A start while one runs replaces it.
// Latency: start_i to valid_o Latency clocks; root_o is valid from valid_o to the next start.
`default_nettype none
module fl_sqrt #(
    parameter  int unsigned RootBits = 20,
    localparam int unsigned Latency  = (RootBits + 2) / 3
) (
    input  logic                  clk_i,
    input  logic                  rst_i,
    input  logic                  start_i,
    input  logic [2*RootBits-1:0] radicand_i,
    output logic                  valid_o,
    output logic [  RootBits-1:0] root_o
);

  if (RootBits < 2) begin : gen_illegal
    $fatal(1, "fl_sqrt: RootBits must be at least 2 (%m)");
  end

  localparam int unsigned BitsPerClock = 3;
  localparam int unsigned Iterations = (RootBits + BitsPerClock - 1) / BitsPerClock;
  localparam int unsigned WorkBits = 2 * BitsPerClock * Iterations;  // the radicand with zeros above it
  localparam int unsigned CountBits = fl_pkg::idx_width(Iterations + 1);

  localparam int unsigned TrialBits = RootBits + 2 * BitsPerClock + 2;  // its sign on top

  typedef logic signed [TrialBits-1:0] trial_t;
  typedef struct packed {
    logic [RootBits:0]   remainder;  // at most 2 * root
    logic [RootBits-1:0] root;
    logic [WorkBits-1:0] radicand;   // bits still to come, highest first
  } work_t;

  // a - b - c and a - b + c with one chain of carries: the three terms become two without one.
  function automatic trial_t less_both(trial_t a, trial_t b, trial_t c);
    trial_t carry;
    carry = trial_t'({(a & ~b) | (a & ~c) | (~b & ~c), 1'b1});
    return (a ^ b ^ c) - ~carry;
  endfunction

  function automatic trial_t less_plus(trial_t a, trial_t b, trial_t c);
    trial_t carry;
    carry = trial_t'({(a & ~b) | (a & c) | (~b & c), 1'b1});
    return (a ^ ~b ^ c) + carry;
  endfunction

  // All digits side by side: a clock holds one difference of at most three terms and the choice among them.
  function automatic work_t digits(work_t w);
    trial_t joined, root;
    trial_t [7:0] trial;
    logic [7:0][31:0] wide;
    fl_pkg::digit8_t y;
    joined   = trial_t'({1'b0, w.remainder, w.radicand[WorkBits-1-:2*BitsPerClock]});
    root     = trial_t'({1'b0, w.root});
    // 16 * k * root + k^2, the square split such that it does not overlap the roots.
    trial[0] = joined;
    trial[1] = joined - (root << 4 | trial_t'(1));
    trial[2] = joined - (root << 5 | trial_t'(4));
    trial[3] = less_both(joined, root << 5, root << 4 | trial_t'(9));
    trial[4] = joined - (root << 6 | trial_t'(16));
    trial[5] = less_both(joined, root << 6 | trial_t'(16), root << 4 | trial_t'(9));
    trial[6] = less_both(joined, root << 6 | trial_t'(32), root << 5 | trial_t'(4));
    trial[7] = less_plus(joined, root << 7 | trial_t'(49), root << 4);
    for (int unsigned k = 0; k < 8; k++) wide[k] = 32'(signed'(trial[k]));
    y = fl_pkg::digit8(wide);
    return
    '{
        remainder: y.difference[RootBits:0],
        root: RootBits'({w.root, y.digit}),
        radicand: w.radicand << 2 * BitsPerClock
    }
    ;
  endfunction

  // The first digits, of the highest bits alone: a table, so that no chain of carries lies behind the radicand's logic.
  function automatic work_t first_digits(logic [WorkBits-1:0] radicand);
    logic [2*BitsPerClock-1:0] high, square;
    work_t y;
    high   = radicand[WorkBits-1-:2*BitsPerClock];
    square = '0;
    y      = '{remainder: '0, root: '0, radicand: radicand << 2 * BitsPerClock};
    for (int unsigned root = 1; root < 2 ** BitsPerClock; root++) begin
      if (high >= (2 * BitsPerClock)'(root * root)) begin
        y.root = RootBits'(root);
        square = (2 * BitsPerClock)'(root * root);
      end
    end
    y.remainder = (RootBits + 1)'(high - square);
    return y;
  endfunction

  work_t work_q;
  logic [CountBits-1:0] count_q;  // clocks to go
  logic valid_q;

  always_ff @(posedge clk_i) begin
    valid_q <= start_i ? Iterations == 1 : count_q == CountBits'(1);
    if (start_i) begin
      work_q  <= first_digits(WorkBits'(radicand_i));
      count_q <= CountBits'(Iterations - 1);
    end else if (count_q != '0) begin
      work_q  <= digits(work_q);
      count_q <= count_q - CountBits'(1);
    end
    if (rst_i) begin
      count_q <= '0;
      valid_q <= 1'b0;
    end
  end

  assign valid_o = valid_q;
  assign root_o  = work_q.root;

endmodule
`default_nettype wire
