// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Time base, control tick, update event and the two interval events.
//
// now_o stamps every event on the chip. The control tick is periodic, or with cfg_tick_samples_i = n it follows every n-th
// sync_i (counted from the last tick on) and the period does nothing. A commit is held until the next tick and then
// becomes the update event, the only clock in which the timed blocks take over new settings: no latency of software
// moves an edge.
//
// tick_o, update_o, machine_o and load_o are registered pulses; sync_i in clock k gives tick_o in k + 1; update_o rises
// together with tick_o. A commit in the last clock before a tick still belongs to it. tick_time_o holds the time stamp of
// the clock in which tick_o was high.
`default_nettype none
module fl_timer
  import fl_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input logic [23:0] cfg_tick_period_i,     // clocks, 0: stopped
    input logic [31:0] cfg_machine_period_i,  // clocks, 0: stopped
    input logic [31:0] cfg_load_period_i,     // clocks, 0: stopped
    input logic [ 7:0] cfg_tick_samples_i,    // syncs a tick, 0: periodic
    input logic        sync_i,                // pulse
    input logic        commit_i,              // pulse

    output stamp_t        now_o,
    output logic          tick_o,
    output logic          update_o,
    output logic          update_pending_o,
    output logic   [31:0] tick_count_o,
    output stamp_t        tick_time_o,
    output logic          machine_o,
    output logic          load_o
);

  logic periodic, interval_d, sync_tick, tick_d, update_d;
  logic [7:0] syncs_q;  // since the last tick

  assign periodic  = cfg_tick_samples_i == '0;
  assign sync_tick = !periodic && sync_i && syncs_q >= cfg_tick_samples_i - 8'd1;
  assign tick_d    = interval_d || sync_tick;
  assign update_d  = tick_d && (update_pending_o || commit_i);

  always_ff @(posedge clk_i) begin
    now_o    <= now_o + 1'b1;
    tick_o   <= tick_d;
    update_o <= update_d;
    if (periodic || tick_d) syncs_q <= '0;
    else if (sync_i) syncs_q <= syncs_q + 8'd1;
    if (update_d) update_pending_o <= 1'b0;
    else if (commit_i) update_pending_o <= 1'b1;
    if (tick_d) begin
      tick_count_o <= tick_count_o + 1'b1;
      tick_time_o  <= now_o + 1'b1;
    end
    if (rst_i) begin
      now_o            <= '0;
      tick_o           <= 1'b0;
      syncs_q          <= '0;
      update_o         <= 1'b0;
      update_pending_o <= 1'b0;
      tick_count_o     <= '0;
      tick_time_o      <= '0;
    end
  end

  fl_interval #(
      .Width(24)
  ) u_tick (
      .clk_i,
      .rst_i,
      .period_i (periodic ? cfg_tick_period_i : 24'd0),
      .pulse_d_o(interval_d),
      .pulse_o  ()
  );

  fl_interval #(
      .Width(32)
  ) u_machine (
      .clk_i,
      .rst_i,
      .period_i (cfg_machine_period_i),
      .pulse_d_o(),
      .pulse_o  (machine_o)
  );

  fl_interval #(
      .Width(32)
  ) u_load (
      .clk_i,
      .rst_i,
      .period_i (cfg_load_period_i),
      .pulse_d_o(),
      .pulse_o  (load_o)
  );

endmodule
`default_nettype wire
