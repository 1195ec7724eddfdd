// Reads simultaneous-sampling serial converters of the AD7276 kind, all on one chip select and clock.
//
// strobe_i: cs_no falls at the next edge, which makes the converters hold. A frame is 14 periods of sclk_o (clk_i / 2):
// two leading zeros, then 12 bits, most significant first. The converter puts a bit out after a falling edge of sclk_o;
// it is taken into the shift register at the next falling edge, one sclk_o period later.
// valid_o (1 clock) comes when the frame is complete and cs_no is high again; code_o then stays until the next frame.
// The data pins pass one flip-flop at the pad; a bit is stable for the 40 ns before it is taken, so no synchroniser is
// needed (constraints/ says what that asks of the board).
//
// Latency: FrameCycles clocks from strobe_i to valid_o. A strobe inside a frame is ignored: at most one every
// FrameCycles + QuietCycles clocks (converter's quiet time).
`default_nettype none
module fl_adc_serial
  import fl_pkg::*;
#(
    parameter int unsigned Channels = 9
) (
    input logic clk_i,
    input logic rst_i,

    input  logic strobe_i,
    output logic cs_no,
    output logic sclk_o,    // idles high

    input  logic      [Channels-1:0] sdata_i,
    output logic                     valid_o,
    output adc_code_t [Channels-1:0] code_o
);

  localparam int unsigned FrameBits = 14;
  localparam int unsigned FrameCycles = 2 * FrameBits + 1;
  localparam int unsigned QuietCycles = 2;
  localparam logic [5:0] LastClock = 6'(2 * FrameBits);
  localparam logic [5:0] LastCount = 6'(FrameCycles + QuietCycles - 1);

  logic [5:0] count_q;  // clocks since cs_no fell, from 1; 0: idle
  logic [Channels-1:0] pad_q;
  logic select;

  assign select = (count_q == '0) ? strobe_i : count_q < LastClock;

  always_ff @(posedge clk_i) begin
    pad_q   <= sdata_i;
    valid_o <= count_q == LastClock;
    cs_no   <= !select;
    // Falls at counts 2, 4, .. 28.
    sclk_o  <= !(select && count_q[0]);
    if (count_q == '0) count_q <= 6'(strobe_i);
    else count_q <= (count_q == LastCount) ? '0 : count_q + 6'd1;
    // The pin before the falling edge that ends the bit is now in the pad's register.
    if (count_q != '0 && count_q <= LastClock && !count_q[0]) begin
      for (int unsigned i = 0; i < Channels; i++) code_o[i] <= {code_o[i][AdcWidth-2:0], pad_q[i]};
    end
    if (rst_i) begin
      count_q <= '0;
      valid_o <= 1'b0;
      cs_no   <= 1'b1;
      sclk_o  <= 1'b1;
    end
  end

endmodule
`default_nettype wire
