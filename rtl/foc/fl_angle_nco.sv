// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Electrical angle: an accumulator that adds the speed every clock, corrected by firmware, latched at sample and update.
//
//   theta[n+1] = theta[n] + omega[n]  (+ correction at update_i),   modulo one turn
// Accumulator 36 bits, 2^36 = one turn; speed signed 32 bits, 2^-36 turn a clock (at 50 MHz 0.73 mHz, +- 1.56 MHz).
//
// Staging: omega_we_i and correct_we_i put a value aside, the last one written counts. At update_i both act: omega takes
// the staged speed, kept until the next one, and the correction (signed, 2^32 = one turn) is added once. The clock of
// update_i itself still adds the old speed; a value written in that clock waits for the next update.
// Latches: strobe_i and carrier_update_i keep the angle of their own clock, seen one clock later; 32 bits, truncated
// (error 0 to 2^-32 turn). All angles wrap; nothing saturates. Reset: angle, speed, staged values 0.
`default_nettype none
module fl_angle_nco (
    input logic clk_i,
    input logic rst_i,

    input logic               update_i,
    input logic               omega_we_i,
    input logic signed [31:0] omega_i,       // 2^-36 turn a clock
    input logic               correct_we_i,
    input logic        [31:0] correct_i,     // 2^32 = one turn, signed

    input logic strobe_i,
    input logic carrier_update_i,

    output logic        [31:0] theta_o,         // of this clock, 2^32 = one turn
    output logic        [31:0] theta_sample_o,  // at the latest strobe_i
    output logic        [31:0] theta_update_o,  // at the latest carrier_update_i
    output logic signed [31:0] omega_o          // 2^-36 turn a clock, in use
);

  logic [35:0] theta_q;
  logic [31:0] omega_q, omega_next_q, correct_q, sample_q, carrier_q, correction;

  assign correction = update_i ? correct_q : '0;

  always_ff @(posedge clk_i) begin
    theta_q <= theta_q + 36'($signed(omega_q)) + {correction, 4'd0};
    if (update_i) begin
      omega_q   <= omega_next_q;
      correct_q <= '0;
    end
    if (omega_we_i) omega_next_q <= omega_i;
    if (correct_we_i) correct_q <= correct_i;
    if (strobe_i) sample_q <= theta_o;
    if (carrier_update_i) carrier_q <= theta_o;
    if (rst_i) begin
      theta_q      <= '0;
      omega_q      <= '0;
      omega_next_q <= '0;
      correct_q    <= '0;
      sample_q     <= '0;
      carrier_q    <= '0;
    end
  end

  assign theta_o        = theta_q[35:4];
  assign theta_sample_o = sample_q;
  assign theta_update_o = carrier_q;
  assign omega_o        = omega_q;

endmodule
`default_nettype wire
