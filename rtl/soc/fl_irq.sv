// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Interrupt lines and overrun counters from the pending bits.
//
// The pending bits themselves are sticky register fields, set by the events; this block routes the enabled ones to the
// control line (pre-empts) or the deferred line and counts events that arrived while their bit was still set.
// Lines are combinational from registers; counters saturate. Latency: 1 clock from event to line (the pending bit).
`default_nettype none
module fl_irq #(
    parameter int unsigned Sources = 8,
    parameter int unsigned TickSource = 0
) (
    input logic clk_i,
    input logic rst_i,

    input logic [Sources-1:0] event_i,    // pulses
    input logic [Sources-1:0] pending_i,
    input logic [Sources-1:0] enable_i,
    input logic [Sources-1:0] control_i,  // 1: control line, 0: deferred line

    output logic        irq_control_o,
    output logic        irq_deferred_o,
    output logic [15:0] overrun_o,
    output logic [15:0] tick_overrun_o
);

  localparam logic [15:0] Full = '1;

  logic [Sources-1:0] active, lost;
  logic [16:0] overrun_sum;

  assign active         = pending_i & enable_i;
  assign irq_control_o  = (active & control_i) != '0;
  assign irq_deferred_o = (active & ~control_i) != '0;

  assign lost           = event_i & pending_i;

  always_comb begin
    overrun_sum = {1'b0, overrun_o};
    if (lost != '0) begin
      for (int unsigned i = 0; i < Sources; i++) overrun_sum += 17'(lost[i]);
    end
  end

  always_ff @(posedge clk_i) begin
    if (lost != '0) overrun_o <= overrun_sum[16] ? Full : overrun_sum[15:0];
    if (lost[TickSource] && tick_overrun_o != Full) tick_overrun_o <= tick_overrun_o + 1'b1;
    if (rst_i) begin
      overrun_o      <= '0;
      tick_overrun_o <= '0;
    end
  end

endmodule
`default_nettype wire
