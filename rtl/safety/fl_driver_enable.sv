// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Enable of the gate drivers that must toggle: a charge pump behind the pin makes the enable of its edges.
//
// While permit_i is high, toggle_o changes every HalfCycles clocks, first HalfCycles clocks after permit_i rose. Else it is
// low. A pin that stands still, high or low, is no enable: with the clock stops everything that depends on it.
//
// Latency: low in the clock after permit_i fell. Asserted: low in the clock after permit_i was low. Proved for all inputs:
// cocotb_tests/safety/fl_driver_enable.sby.
`default_nettype none
module fl_driver_enable #(
    parameter int unsigned HalfCycles = 64  // clocks between two edges
) (
    input  logic clk_i,
    input  logic rst_i,
    input  logic permit_i,
    output logic toggle_o
);

  if (HalfCycles < 2) begin : gen_illegal
    $fatal(1, "fl_driver_enable: HalfCycles must be at least 2 (%m)");
  end

  localparam int unsigned Width = $clog2(HalfCycles);
  logic [Width-1:0] count_q;
  logic last;
  assign last = count_q == Width'(HalfCycles - 1);

  always_ff @(posedge clk_i) begin
    if (!permit_i || rst_i) begin
      count_q  <= '0;
      toggle_o <= 1'b0;
    end else begin
      count_q  <= last ? '0 : count_q + Width'(1);
      toggle_o <= toggle_o ^ last;
    end
  end

  logic permitted_q;
  always_ff @(posedge clk_i) begin
    permitted_q <= permit_i && !rst_i;
    if (!rst_i) begin
      assert (permitted_q || !toggle_o)
      else $error("fl_driver_enable: high without permit");
    end
  end

endmodule
`default_nettype wire
