// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Reads simultaneous-sampling serial converters of the AD7276 kind, all on one chip select and clock.
//
// strobe_i: cs_no falls at the next edge, which makes the converters hold; sclk_o falls first two clocks later, so that
// the first bit has as long to arrive as the others. A frame is FrameBits periods of sclk_o (clk_i / 2): two leading zeros, 12 bits, most significant first, and with 16 periods two trailing zeros. The converter
// puts the first zero out when it is selected and each later bit after a falling edge of sclk_o; a bit is taken at the
// falling edge after, one sclk_o period later. valid_o (1 clock) comes when the frame is complete and cs_no is high
// again; code_o and bad_o then stay until the next frame.
// The data pins pass one flip-flop at the pad; a bit is stable when it is taken, so no synchroniser is needed
// (constraints/ says what that asks of the board).
//
// bad_o, a bit a channel: a leading or trailing bit was 1 (line stuck high, no converter, a clock edge too many or too
// few), or the line did not return to its pull-up before the frame (stuck low). The second is judged only if cs_no was
// high for ReleaseCycles or more, the time that the pull-up needs; 0: never.
// missed_o (1 clock): a strobe inside a frame or the quiet time, which is ignored.
// After reset one frame runs without valid_o: a reset that cuts a frame short leaves the converters asleep, and the
// first codes of a woken one are void.
//
// Latency: FrameCycles clocks from strobe_i to valid_o. At most one strobe every FrameCycles + QuietCycles clocks: the
// converters need 60 ns from the 13th rising edge of sclk_o to hold again.
`default_nettype none
module fl_adc_serial
  import fl_pkg::*;
#(
    parameter int unsigned Channels      = 9,
    parameter int unsigned FrameBits     = 14,  // 14 or 16
    parameter int unsigned ReleaseCycles = 0    // 0..63
) (
    input logic clk_i,
    input logic rst_i,

    input  logic strobe_i,
    output logic cs_no,
    output logic sclk_o,    // idles high

    input  logic      [Channels-1:0] sdata_i,
    output logic                     valid_o,
    output adc_code_t [Channels-1:0] code_o,
    output logic      [Channels-1:0] bad_o,
    output logic                     missed_o
);

  localparam int unsigned LeadingBits = 2;
  localparam int unsigned FrameCycles = 2 * FrameBits + 2;
  localparam int unsigned QuietCycles = 2;
  localparam logic [5:0] LastClock = 6'(2 * FrameBits + 1);
  localparam logic [5:0] LastCount = 6'(FrameCycles + QuietCycles - 1);
  // Counts at which the first and the last bit of the code are in the pad's register.
  localparam logic [5:0] FirstBit = 6'(2 * (LeadingBits + 1) + 1);
  localparam logic [5:0] LastBit = 6'(2 * (LeadingBits + AdcWidth) + 1);

  if (FrameBits != 14 && FrameBits != 16) begin : gen_illegal_frame
    $fatal(1, "fl_adc_serial: FrameBits must be 14 or 16 (%m)");
  end
  if (ReleaseCycles > 63) begin : gen_illegal_release
    $fatal(1, "fl_adc_serial: ReleaseCycles must be 0..63 (%m)");
  end

  logic [5:0] count_q;  // clocks since cs_no fell, from 1; 0: idle
  logic [5:0] released_q;  // clocks since cs_no rose, saturates
  logic awake_q;  // the frame after reset is done
  logic [Channels-1:0] pad_q;
  logic start, select, judge_release;

  assign start         = count_q == '0 && (strobe_i || !awake_q);
  assign select        = start || (count_q != '0 && count_q < LastClock);
  assign judge_release = ReleaseCycles != 0 && released_q >= 6'(ReleaseCycles);

  always_ff @(posedge clk_i) begin
    pad_q    <= sdata_i;
    valid_o  <= count_q == LastClock && awake_q;
    missed_o <= strobe_i && (count_q != '0 || !awake_q);
    cs_no    <= !select;
    // Falls at counts 3, 5, ..
    sclk_o   <= !(select && count_q != '0 && !count_q[0]);
    if (count_q == '0) count_q <= 6'(start);
    else count_q <= (count_q == LastCount) ? '0 : count_q + 6'd1;
    if (count_q == LastCount) awake_q <= 1'b1;
    if (!cs_no) released_q <= '0;
    else if (released_q != '1) released_q <= released_q + 6'd1;
    if (start) bad_o <= judge_release ? ~pad_q : '0;
    // The pin before the falling edge that ends the bit is now in the pad's register.
    if (count_q > 6'd1 && count_q <= LastClock && count_q[0]) begin
      for (int unsigned i = 0; i < Channels; i++) begin
        if (count_q >= FirstBit && count_q <= LastBit) code_o[i] <= {code_o[i][AdcWidth-2:0], pad_q[i]};
        else if (pad_q[i]) bad_o[i] <= 1'b1;
      end
    end
    if (rst_i) begin
      count_q    <= '0;
      released_q <= '0;
      awake_q    <= 1'b0;
      valid_o    <= 1'b0;
      missed_o   <= 1'b0;
      cs_no      <= 1'b1;
      sclk_o     <= 1'b1;
    end
  end

endmodule
`default_nettype wire
