// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Third-order sinc decimator for the bit streams of sigma-delta modulators at shunts, all channels in step.
//
// value = sum over m of h[m] * bit[last - 2 - m], h = (1 + z^-1 + .. + z^-(R-1))^3, R = 2^cfg_log2_i, 0..R^3.
// (E. Hogenauer, "An economical class of digital filters for decimation and interpolation", IEEE Trans. ASSP, 1981.)
// code_o = value * 4096 / R^3, cut off, and 4095 for R^3: a stream of as many ones as zeros gives 2048, the zero of a
// current. The integrators wrap, which the differences undo: nothing overflows and no start value matters.
//
// Bits come with bit_valid_i, in any clock, up to one a clock. sync_i starts a new window and takes cfg_log2_i over; a
// bit in its clock is the first of the window. The first code comes with bit 3R of the window, from its bits only; one
// more follows every R bits. Without sync_i a window starts with the reset. The code stands for the middle of its bits,
// (3R + 1) / 2 bit periods before the last of them.
// stuck_o: the last StuckBits bits of a channel were equal. A modulator at full scale still puts in an opposite bit now
// and then; only one without clock, supply or line does not.
//
// Latency: Latency clocks from bit 3R, 4R, .. to valid_o.
`default_nettype none
module fl_sinc3
  import fl_pkg::*;
#(
    parameter  int unsigned Channels  = 3,
    parameter  int unsigned StuckBits = 256,  // 2..1023
    localparam int unsigned Latency   = 5
) (
    input logic clk_i,
    input logic rst_i,

    input logic [         3:0] cfg_log2_i,   // ratio 2^4..2^8; below 4 counts as 4, above 8 as 8
    input logic                sync_i,
    input logic                bit_valid_i,
    input logic [Channels-1:0] bit_i,

    output logic                     valid_o,
    output adc_code_t [Channels-1:0] code_o,
    output logic      [Channels-1:0] stuck_o
);

  localparam logic [3:0] LeastLog2 = 4'd4;
  localparam logic [3:0] MostLog2 = 4'd8;
  localparam int unsigned Width = 3 * 8 + 1;  // holds R^3 of the largest ratio
  typedef logic [Width-1:0] value_t;

  if (StuckBits < 2 || StuckBits > 1023) begin : gen_illegal
    $fatal(1, "fl_sinc3: StuckBits must be 2..1023 (%m)");
  end

  function automatic adc_code_t to_code(value_t value, logic [3:0] log2);
    value_t scaled;
    unique case (log2)
      4'd4:    scaled = value;
      4'd5:    scaled = value >> 3;
      4'd6:    scaled = value >> 6;
      4'd7:    scaled = value >> 9;
      default: scaled = value >> 12;
    endcase
    return scaled[AdcWidth] ? '1 : scaled[AdcWidth-1:0];
  endfunction

  // Windows.
  logic sync, first_q, last_bit, step_q;
  logic [3:0] log2_q;
  logic [7:0] count_q;  // bits since the last step
  logic [1:0] steps_q;  // steps since the window began, up to 2
  // Differences at three spaced samples need four samples: the first is that of the sync itself.
  logic [1:0] move_q;  // a sample moves through the differences, a stage a clock
  logic [2:0] good_q;  // it is one that counts

  assign sync     = sync_i || first_q;
  assign last_bit = bit_valid_i && count_q == 8'((9'd1 << log2_q) - 9'd1);

  always_ff @(posedge clk_i) begin
    first_q <= 1'b0;
    step_q  <= last_bit && !sync;
    if (sync) begin
      count_q <= 8'(bit_valid_i);
      steps_q <= '0;
      log2_q  <= (cfg_log2_i < LeastLog2) ? LeastLog2 : (cfg_log2_i > MostLog2) ? MostLog2 : cfg_log2_i;
    end else begin
      if (last_bit) count_q <= '0;
      else count_q <= count_q + 8'(bit_valid_i);
      if (step_q && steps_q != 2'd2) steps_q <= steps_q + 2'd1;
    end
    move_q  <= {move_q[0], sync || step_q};
    good_q  <= {good_q[1:0], step_q && steps_q == 2'd2};
    valid_o <= good_q[2];
    if (rst_i) begin
      first_q <= 1'b1;
      step_q  <= 1'b0;
      move_q  <= '0;
      good_q  <= '0;
      valid_o <= 1'b0;
    end
  end

  // The ratio of the code that is on its way through the differences.
  logic [3:0] log2_code_q;
  always_ff @(posedge clk_i) if (step_q) log2_code_q <= log2_q;

  for (genvar i = 0; i < Channels; i++) begin : g_channel
    value_t sum1_q, sum2_q, sum3_q;  // integrators
    value_t old1_q, old2_q, old3_q, diff1_q, diff2_q, diff3_q;
    logic [9:0] equal_q;  // equal bits, up to StuckBits
    logic bit_q;

    always_ff @(posedge clk_i) begin
      if (bit_valid_i) begin
        sum1_q <= sum1_q + value_t'(bit_i[i]);
        sum2_q <= sum2_q + sum1_q;
        sum3_q <= sum3_q + sum2_q;
        bit_q  <= bit_i[i];
        if (bit_i[i] != bit_q) equal_q <= 10'd1;
        else if (equal_q != 10'(StuckBits)) equal_q <= equal_q + 10'd1;
      end
      if (sync || step_q) begin
        diff1_q <= sum3_q - old1_q;
        old1_q  <= sum3_q;
      end
      if (move_q[0]) begin
        diff2_q <= diff1_q - old2_q;
        old2_q  <= diff1_q;
      end
      if (move_q[1]) begin
        diff3_q <= diff2_q - old3_q;
        old3_q  <= diff2_q;
      end
      if (good_q[2]) code_o[i] <= to_code(diff3_q, log2_code_q);
      if (rst_i) equal_q <= '0;
    end
    assign stuck_o[i] = equal_q == 10'(StuckBits);
  end

endmodule
`default_nettype wire
