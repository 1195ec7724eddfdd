// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Brings one asynchronous pin into the clock domain through two flip-flops.
//
// Latency: a level of async_i seen by clock edge n is on sync_o after edge n + 1. A level shorter than a clock may be
// missed.
`default_nettype none
module fl_sync #(
    parameter logic ResetValue = 1'b0
) (
    input  logic clk_i,
    input  logic rst_i,
    input  logic async_i,
    output logic sync_o
);

  (* async_reg = "true" *) logic meta_q, sync_q;

  always_ff @(posedge clk_i) begin
    meta_q <= async_i;
    sync_q <= meta_q;
    if (rst_i) begin
      meta_q <= ResetValue;
      sync_q <= ResetValue;
    end
  end

  assign sync_o = sync_q;

endmodule
`default_nettype wire
