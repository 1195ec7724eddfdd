// Ratio of two integers as a fraction: ratio = floor(part * 2^RatioBits / whole) for part < whole, three bits
// a clock, the first ones in that of the start.
//
// Restoring division. less_o tells whether part < whole held at the start; if not, ratio_o has no meaning. A start while
// one runs replaces it.
// Latency: start_i to valid_o Latency clocks; ratio_o and less_o are valid from valid_o to the next start.
`default_nettype none
module fl_ratio #(
    parameter  int unsigned WholeBits = 20,
    parameter  int unsigned RatioBits = 17,
    localparam int unsigned Latency   = (RatioBits + 2) / 3
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
  localparam int unsigned Iterations = (RatioBits + BitsPerClock - 1) / BitsPerClock;
  localparam int unsigned Bits = BitsPerClock * Iterations;  // RatioBits and, below them, what fills the last clock
  localparam int unsigned CountBits = fl_pkg::idx_width(Iterations + 1);

  typedef struct packed {
    logic [WholeBits-1:0] remainder;  // below whole
    logic [Bits-1:0]      ratio;
  } work_t;

  logic [WholeBits-1:0] whole, whole_q;
  work_t work, work_q;
  logic [CountBits-1:0] count, count_q;  // iterations to go
  logic less_q, valid_q;

  function automatic work_t bit_of(work_t w, logic [WholeBits-1:0] divisor);
    logic [  WholeBits:0] doubled;
    logic [WholeBits+1:0] trial;
    doubled = {w.remainder, 1'b0};
    trial   = {1'b0, doubled} - {2'b00, divisor};
    return
    '{
        remainder: trial[WholeBits+1] ? doubled[WholeBits-1:0] : trial[WholeBits-1:0],
        ratio: {w.ratio[Bits-2:0], !trial[WholeBits+1]}
    }
    ;
  endfunction

  function automatic work_t bits_of(work_t w, logic [WholeBits-1:0] divisor);
    work_t y;
    y = w;
    for (int unsigned i = 0; i < BitsPerClock; i++) y = bit_of(y, divisor);
    return y;
  endfunction

  assign whole = start_i ? whole_i : whole_q;
  assign work  = start_i ? '{remainder: part_i, ratio: '0} : work_q;
  assign count = start_i ? CountBits'(Iterations) : count_q;

  always_ff @(posedge clk_i) begin
    valid_q <= count == CountBits'(1);
    if (start_i) begin
      whole_q <= whole_i;
      less_q  <= part_i < whole_i;
    end
    if (count != '0) begin
      work_q  <= bits_of(work, whole);
      count_q <= count - CountBits'(1);
    end
    if (rst_i) begin
      count_q <= '0;
      valid_q <= 1'b0;
    end
  end

  assign valid_o = valid_q;
  assign less_o  = less_q;
  assign ratio_o = work_q.ratio[Bits-1-:RatioBits];

endmodule
`default_nettype wire
