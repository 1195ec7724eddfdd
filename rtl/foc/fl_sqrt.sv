// Integer square root: root = floor(sqrt(radicand)), three result bits a clock, the first ones in that of the start.
//
// Digit by digit: the next two bits of the radicand join the remainder, and the trial 4 * root + 1 is taken off if it fits.
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

  typedef struct packed {
    logic [RootBits:0]   remainder;  // at most 2 * root
    logic [RootBits-1:0] root;
    logic [WorkBits-1:0] radicand;   // bits still to come, highest first
  } work_t;

  function automatic work_t digit(work_t w);
    logic [RootBits+2:0] joined;
    logic [RootBits+3:0] trial;
    joined = {w.remainder, w.radicand[WorkBits-1-:2]};
    trial  = {1'b0, joined} - {2'b00, w.root, 2'b01};
    return
    '{
        remainder: trial[RootBits+3] ? joined[RootBits:0] : trial[RootBits:0],
        root: {w.root[RootBits-2:0], !trial[RootBits+3]},
        radicand: {w.radicand[WorkBits-3:0], 2'b00}
    }
    ;
  endfunction

  function automatic work_t digits(work_t w);
    work_t y;
    y = w;
    for (int unsigned i = 0; i < BitsPerClock; i++) y = digit(y);
    return y;
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
