// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the toggling enable for every permit: low without it, and with it an edge every HalfCycles clocks, no other.
`default_nettype none
module fl_driver_enable_f #(
    parameter int unsigned HalfCycles = 5
) (
    input logic clk_i,
    input logic rst_i,
    input logic permit_i
);

  logic toggle_o;
  fl_driver_enable #(.HalfCycles(HalfCycles)) dut (.*);

  logic first = 1'b1;
  logic permitted_q, toggle_q;
  logic [7:0] since_q;  // clocks with permit, in a row, modulo the period of two edges
  always_ff @(posedge clk_i) begin
    first       <= 1'b0;
    permitted_q <= permit_i && !rst_i;
    toggle_q    <= toggle_o;
    if (!permit_i || rst_i || since_q == 8'(2 * HalfCycles - 1)) since_q <= '0;
    else since_q <= since_q + 8'd1;
  end

  always_comb begin
    if (!first) begin
      // Verifies: CLK-04
      a_low : assert (permitted_q || !toggle_o);
      a_edges : assert (toggle_o == (since_q >= 8'(HalfCycles)));

      // Invariants.
      assert (since_q < 8'(2 * HalfCycles));
      assert (8'(dut.count_q) == (toggle_o ? since_q - 8'(HalfCycles) : since_q));
      assert (permitted_q || since_q == '0);
    end else assume (rst_i);
  end

endmodule
`default_nettype wire
