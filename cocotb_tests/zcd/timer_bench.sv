// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Commutation timer with the time base and the sector that it sees on the chip: the sector follows comm_valid_o by one
// clock, unless hold_sector_i keeps it (as RSC does until the next carrier). now_o can be loaded, to jump in time.
`default_nettype none
module timer_bench
  import fl_pkg::*;
(
    input  logic        clk_i,
    input  logic        rst_i,
    input  logic        load_i,
    input  stamp_t      load_now_i,
    input  logic        hold_sector_i,
    output stamp_t      now_o,
    output sector_t     sector_o,

    input  logic               update_i,
    input  comm_mode_e         cfg_mode_i,
    input  logic               cfg_force_on_miss_i,
    input  logic        [ 7:0] cfg_miss_limit_i,
    input  logic        [15:0] cfg_delay_q16_i,
    input  logic signed [15:0] cfg_advance_q16_i,
    input  logic        [15:0] cfg_latency_i,
    input  logic        [23:0] cfg_forced_interval_i,
    input  logic        [15:0] cfg_timeout_q12_i,
    input  logic               cfg_correction_a_i,
    input  logic               cfg_hall_timed_i,
    input  logic  [5:0] [15:0] cfg_hall_offset_q16_i,
    input  logic               cfg_reverse_i,

    input  logic    zc_valid_i,
    input  stamp_t  zc_time_i,
    input  logic    zc_late_i,
    input  logic    zc_back_i,
    input  sector_t zc_sector_i,

    input  logic    hall_valid_i,
    input  stamp_t  hall_time_i,
    input  sector_t hall_position_i,
    input  logic    hall_backward_i,
    input  logic    hall_single_i,
    input  logic    hall_ok_i,

    output logic   comm_valid_o,
    output stamp_t comm_sched_o,
    output logic   comm_load_o,
    output sector_t comm_sector_o,
    output logic   sched_valid_o,
    output logic   overdue_o,
    output logic   lost_o,
    output logic   event_o,  // any of comm_valid_o, lost_o

    input  logic              tick_i,
    output logic       [23:0] snap_interval_o,
    output logic       [26:0] snap_period_o,
    output stamp_t            snap_zc_time_o,
    output logic       [15:0] snap_crossings_o,
    output logic       [ 7:0] snap_misses_o,
    output logic       [ 7:0] snap_late_o,
    output logic       [15:0] snap_commutations_o,
    output logic       [ 7:0] snap_overdue_o,
    output logic       [ 7:0] snap_timeouts_o,
    output logic [5:0] [23:0] snap_sector_interval_o,
    output logic       [23:0] snap_mean_o,
    output logic              snap_known_o,
    output logic              snap_corrected_o,
    output logic       [23:0] interval_o,
    output logic       [23:0] mean_o,
    output logic              known_o
);

  stamp_t now_q;
  sector_t sector_q;
  logic waiting_q, reverse_q;

  always_ff @(posedge clk_i) begin
    now_q <= load_i ? load_now_i : now_q + 32'd1;
    if (comm_valid_o) waiting_q <= 1'b1;
    if ((comm_valid_o || waiting_q) && !hold_sector_i) begin
      waiting_q <= 1'b0;
      if (comm_load_o) sector_q <= comm_sector_o;
      else if (reverse_q) sector_q <= (sector_q == 3'd0) ? 3'd5 : sector_q - 3'd1;
      else sector_q <= (sector_q == 3'd5) ? 3'd0 : sector_q + 3'd1;
    end
    if (update_i) reverse_q <= cfg_reverse_i;
    if (rst_i) begin
      reverse_q <= 1'b0;
      now_q     <= '0;
      sector_q  <= '0;
      waiting_q <= 1'b0;
    end
  end

  assign now_o    = now_q;
  assign sector_o = sector_q;
  assign event_o  = comm_valid_o || lost_o;

  fl_commutation_timer u_timer (
      .clk_i,
      .rst_i,
      .now_i(now_q),
      .sector_i(sector_q),
      .*
  );

endmodule
`default_nettype wire
