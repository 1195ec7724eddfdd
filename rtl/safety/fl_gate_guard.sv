// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Gate guard, the last stage before the pins: enable, trip, interlock, dead time and polarity of every leg.
//
// A gate turns off one clock after its request goes (or the other request of the leg comes, or trip_i, or enable_i
// falls), never later. It turns on one clock after its request once the other gate of the leg has been off for at least
// the dead time; the dead time is the one at the turn-off, raised to 2 clocks. The same gate may turn on again at once.
// Both requests of a leg together turn both gates off. After a reset a leg waits 1023 clocks, the longest dead time:
// what was on before is not known. Legs are independent.
//
// short_i beside trip_i asks every leg for its lower gate alone, whatever is requested or enabled: an active short
// circuit of the machine. Without trip_i it does nothing.
//
// Latency: 1 clock; trip_i combinationally forces the next value of every output register to off, with short_i that of
// the upper gates.
// Polarity is of the build: nothing can change it, and from the end of configuration on, during reset too, pins show "off"
// in it.
// Asserted: never both gates of a leg; off in the clock after trip_i, in a short the upper ones. Proved for all inputs:
// cocotb_tests/safety/fl_gate_guard.sby.
`default_nettype none
module fl_gate_guard #(
    parameter int unsigned Phases        = 3,
    parameter bit          HighActiveLow = 1'b0,  // upper gate pins are active low
    parameter bit          LowActiveLow  = 1'b0   // lower gate pins
) (
    input  logic                clk_i,
    input  logic                rst_i,
    input  logic                enable_i,
    input  logic [         9:0] dead_time_i,  // clocks
    input  logic                trip_i,
    input  logic                short_i,      // with trip_i: lower gates on
    input  logic [  Phases-1:0] req_h_i,
    input  logic [  Phases-1:0] req_l_i,
    output logic [  Phases-1:0] gate_h_o,     // pins
    output logic [  Phases-1:0] gate_l_o,
    output logic [2*Phases-1:0] gate_o        // before polarity: bit 2X upper, 2X+1 lower switch of leg X
);

  if (Phases == 0) begin : gen_illegal
    $fatal(1, "fl_gate_guard: Phases must be at least 1 (%m)");
  end

  logic [9:0] dead_time;
  logic shorted, switching;
  logic [Phases-1:0] gate_h_d, gate_h_q, gate_l_d, gate_l_q;
  // block_h: the lower gate was on last, so the upper waits until wait_q is over; block_l the reverse.
  logic [Phases-1:0] block_h_q, block_l_q, over;
  logic [Phases-1:0][9:0] wait_q;  // clocks that the blocked gate must still stay off

  assign dead_time = (dead_time_i < 10'd2) ? 10'd2 : dead_time_i;
  assign shorted   = trip_i && short_i;
  assign switching = enable_i && !trip_i;

  always_comb begin
    for (int unsigned x = 0; x < Phases; x++) begin
      over[x] = wait_q[x] <= 10'd1;
      gate_h_d[x] = switching && req_h_i[x] && !req_l_i[x] && !gate_l_q[x] && (over[x] || !block_h_q[x]);
      gate_l_d[x] = (shorted || (switching && req_l_i[x] && !req_h_i[x])) && !gate_h_q[x] && (over[x] || !block_l_q[x]);
    end
  end

  always_ff @(posedge clk_i) begin
    gate_h_q <= gate_h_d;
    gate_l_q <= gate_l_d;
    for (int unsigned x = 0; x < Phases; x++) begin
      if (gate_h_q[x] || gate_l_q[x]) begin
        wait_q[x]    <= dead_time;
        block_h_q[x] <= gate_l_q[x];
        block_l_q[x] <= gate_h_q[x];
      end else if (wait_q[x] != '0) begin
        wait_q[x] <= wait_q[x] - 10'd1;
      end
    end
    if (rst_i) begin
      gate_h_q  <= '0;
      gate_l_q  <= '0;
      block_h_q <= '1;
      block_l_q <= '1;
      wait_q    <= '1;
    end
  end

  assign gate_h_o = gate_h_q ^ {Phases{HighActiveLow}};
  assign gate_l_o = gate_l_q ^ {Phases{LowActiveLow}};
  always_comb begin
    for (int unsigned x = 0; x < Phases; x++) begin
      gate_o[2*x]   = gate_h_q[x];
      gate_o[2*x+1] = gate_l_q[x];
    end
  end

  logic tripped_q, shorted_q;
  always_ff @(posedge clk_i) begin
    tripped_q <= trip_i && !rst_i;
    shorted_q <= shorted;
    if (!rst_i) begin
      assert ((gate_h_q & gate_l_q) == '0)
      else $error("fl_gate_guard: both gates of a leg on");
      assert (!tripped_q || (gate_h_q | (shorted_q ? '0 : gate_l_q)) == '0)
      else $error("fl_gate_guard: gate on after a trip");
    end
  end

endmodule
`default_nettype wire
