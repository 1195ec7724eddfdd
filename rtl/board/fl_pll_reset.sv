// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Reset of the PLL that makes the chip's clock, from the on-chip oscillator: the clock that is to come cannot make it.
//
// While the PLL has no lock, rst_o is high for PulseCycles of every RepeatCycles clocks of clk_i, beginning with the loss.
// With the lock it is low, but for the rest of a pulse that has begun. So a PLL whose lock was lost is reset, as its
// vendor asks for, and one that does not lock is reset again and again:
//   7 series  UG472, port LOCKED: a PLL needs a reset once LOCKED has fallen; reset 5 ns or more, lock in 100 us (DS181)
//   ECP5      reset 1 ms or more, locks within 15 ms (FPGA-DS-02012, sysCLOCK PLL timing)
// These figures were not compared with the sheets: docs/blocks/fl_clock_monitor.md says what supports them.
// The defaults give a pulse of 0.67 ms and a wait of 10 ms with an oscillator of 97.5 MHz (7 series at most), 1.4 ms and
// 22 ms with 44.6 MHz (ECP5 at most).
//
// Clock domains: locked_i is asynchronous; its fall, however short, acts through fl_async_clear. rst_o is a register of
// clk_i that leads to the PLL's asynchronous reset. Latency: rst_o rises at clock edge 1 to 3 after the lock was lost.
`default_nettype none
module fl_pll_reset #(
    parameter int unsigned PulseCycles  = 1 << 16,
    parameter int unsigned RepeatCycles = 1 << 20
) (
    input  logic clk_i,     // the oscillator
    input  logic locked_i,  // asynchronous
    output logic rst_o = 1'b0
);

  if (PulseCycles < 2 || RepeatCycles <= PulseCycles) begin : gen_illegal
    $fatal(1, "fl_pll_reset: 2 <= PulseCycles < RepeatCycles must hold (%m)");
  end

  localparam int unsigned Width = $clog2(RepeatCycles);
  logic locked, idle;
  logic [Width-1:0] count_q = '0;  // clocks since the reset began
  // A reset that has begun is not cut short.
  assign idle = locked && (count_q == '0 || count_q >= Width'(PulseCycles));

  fl_async_clear #(
      .Stages(2)
  ) u_lock (
      .clk_i,
      .clear_i(!locked_i),
      .ok_i   (1'b1),
      .ok_o   (locked)
  );

  always_ff @(posedge clk_i) begin
    count_q <= (idle || count_q == Width'(RepeatCycles - 1)) ? '0 : count_q + Width'(1);
    rst_o   <= !idle && count_q < Width'(PulseCycles);
  end

endmodule
`default_nettype wire
