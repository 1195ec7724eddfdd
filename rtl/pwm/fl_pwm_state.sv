// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// PWM state for sensing: what the gates do in this clock, to be latched with a sample.
//
// on: exactly the upper switch of the sector's positive leg and the lower switch of its negative leg are on (so not
// during a dead time, nor while the pulse is off). sector: the one applied to the gates (one clock after the
// sequencer's register, as the guard is registered). age, comm_age: clocks since the last change of any gate and since
// the last commutation reached the gates; 0 in the first clock with the new gates; saturate at 65535.
// comm_age also starts when the sequencer enters a mode.
//
// Latency: none; state_o in a clock describes gate_i of the same clock.
`default_nettype none
module fl_pwm_state
  import fl_pkg::*;
#(
    parameter int unsigned Phases = 3
) (
    input  logic                      clk_i,
    input  logic                      rst_i,
    input  logic       [2*Phases-1:0] gate_i,          // from the guard, bit 2X upper, 2X+1 lower switch of leg X
    input  sector_t                   sector_i,        // from the sequencer
    input  logic                      active_i,        // from the sequencer
    input  logic                      comm_applied_i,  // from the sequencer
    output pwm_state_t                state_o
);

  if (Phases < 3) begin : gen_illegal
    $fatal(1, "fl_pwm_state: six-step needs Phases >= 3 (%m)");
  end

  // Gates of a sector while its pulse is on.
  function automatic logic [2*Phases-1:0] sector_gates(sector_t sector);
    logic [5:0] gates;  // C- C+ B- B+ A- A+
    unique case (sector)
      3'd0: gates = 6'b00_10_01;
      3'd1: gates = 6'b10_00_01;
      3'd2: gates = 6'b10_01_00;
      3'd3: gates = 6'b00_01_10;
      3'd4: gates = 6'b01_00_10;
      3'd5: gates = 6'b01_10_00;
      default: gates = '0;
    endcase
    return (2 * Phases)'(gates);
  endfunction

  function automatic logic [15:0] next_age(logic [15:0] age);
    return (age == '1) ? age : age + 16'd1;
  endfunction

  logic [2*Phases-1:0] gate_q, on_gates_q;
  sector_t sector_q;
  logic active_q, comm_q;
  logic [15:0] age_q, comm_age_q;  // the ages in this clock if nothing changes

  always_comb begin
    state_o.on       = gate_i == on_gates_q && active_q;
    state_o.sector   = sector_q;
    state_o.age      = (gate_i != gate_q) ? '0 : age_q;
    state_o.comm_age = comm_q ? '0 : comm_age_q;
  end

  always_ff @(posedge clk_i) begin
    gate_q     <= gate_i;
    active_q   <= active_i;
    comm_q     <= comm_applied_i || (active_i && !active_q);
    age_q      <= next_age(state_o.age);
    comm_age_q <= next_age(state_o.comm_age);
    sector_q   <= sector_i;
    if (sector_i != sector_q) on_gates_q <= sector_gates(sector_i);
    if (rst_i) begin
      gate_q     <= '0;
      active_q   <= 1'b0;
      comm_q     <= 1'b0;
      age_q      <= '1;
      comm_age_q <= '1;
      sector_q   <= '0;
      on_gates_q <= sector_gates(3'd0);
    end
  end

endmodule
`default_nettype wire
