// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Brake chopper: a switch that puts a resistor across the DC link while the link is too high.
//
// It turns on with a vdc code above cfg_on_lsb_i and off with one below cfg_off_lsb_i, which wins where both hold. It
// knows nothing of trips: a machine that feeds the link through the diodes of opened gates needs it as well. Off after a
// reset, while enable_i is low, and from cfg_age_cycles_i clocks after the last sample set on, if there was no other; it
// then stays off until a code is above cfg_on_lsb_i.
// The resistor bears cfg_longest_cycles_i clocks between two codes below cfg_off_lsb_i, however they are divided: then
// the switch stays off and overload_o is high until the next such code or a reset.
//
// Input: raw 12-bit codes with adc_valid_i. cfg_longest_cycles_i = 0: never on; cfg_age_cycles_i = 0 acts as 1.
// Latency: 1 clock. brake_o comes from a register and is active high.
// Asserted: off in the clock after enable_i was low, and with overload_o. Proved: cocotb_tests/safety/fl_brake.sby.
`default_nettype none
module fl_brake
  import fl_pkg::*;
#(
    parameter int unsigned LongestWidth = 32  // bits of the longest time
) (
    input  logic                         clk_i,
    input  logic                         rst_i,
    input  logic                         enable_i,
    input  adc_code_t                    cfg_on_lsb_i,
    input  adc_code_t                    cfg_off_lsb_i,
    input  logic      [LongestWidth-1:0] cfg_longest_cycles_i,  // clocks
    input  logic      [            19:0] cfg_age_cycles_i,      // clocks
    input  logic                         adc_valid_i,
    input  adc_code_t                    vdc_i,                 // with adc_valid_i
    output logic                         brake_o,
    output logic                         overload_o
);

  if (LongestWidth == 0) begin : gen_illegal
    $fatal(1, "fl_brake: LongestWidth must be at least 1 (%m)");
  end

  logic above, below, stale, wanted, spent, brake_d;
  logic [LongestWidth-1:0] used_q;  // clocks with the switch on since the last code below cfg_off_lsb_i, with this one
  logic [19:0] age_q;  // clocks since the last sample set, less 1

  assign above   = adc_valid_i && vdc_i > cfg_on_lsb_i;
  assign below   = adc_valid_i && vdc_i < cfg_off_lsb_i;
  assign stale   = !adc_valid_i && {1'b0, age_q} + 21'd1 >= {1'b0, cfg_age_cycles_i};
  assign wanted  = enable_i && !below && (above || (brake_o && !stale));
  assign spent   = overload_o || used_q >= cfg_longest_cycles_i;
  assign brake_d = wanted && !spent;

  always_ff @(posedge clk_i) begin
    brake_o    <= brake_d;
    overload_o <= !below && (overload_o || (wanted && spent));
    if (below) used_q <= '0;
    else if (brake_d) used_q <= used_q + LongestWidth'(1);
    if (adc_valid_i) age_q <= '0;
    else if (age_q != '1) age_q <= age_q + 20'd1;
    if (rst_i) begin
      brake_o    <= 1'b0;
      overload_o <= 1'b0;
      used_q     <= '0;
      age_q      <= '0;
    end
  end

  logic enabled_q;
  always_ff @(posedge clk_i) begin
    enabled_q <= enable_i && !rst_i;
    if (!rst_i) begin
      assert (enabled_q || !brake_o)
      else $error("fl_brake: on without enable");
      assert (!(brake_o && overload_o))
      else $error("fl_brake: on after its longest time");
    end
  end

endmodule
`default_nettype wire
