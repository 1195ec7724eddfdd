// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Six-step path with its registers: crossings, commutation timer, Hall sensors, freewheel meter, carrier and sequencer.
//
//   samples -> zcd -> comm (commutation timer) -> pwm (carrier, sequencer) -> requests of three legs
//                       hall -> comm
// Register windows of stb_i and rdat_o, the lowest first: zcd, comm, pwm, freewheel, hall.
`default_nettype none
module fl_six_step
  import fl_pkg::*;
#(
    localparam int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3,
    localparam int unsigned Blocks   = 5
) (
    input logic clk_i,
    input logic rst_i,

    input  fl_bus_pkg::bus_req_t                   req_i,
    input  logic                 [Blocks-1:0]       stb_i,
    output logic                 [Blocks-1:0][31:0] rdat_o,

    input stamp_t now_i,
    input logic   tick_i,
    input logic   update_i,

    input logic                      sample_valid_i,
    input sample_t    [Channels-1:0] sample_i,
    input stamp_t                    sample_time_i,
    input pwm_state_t                sample_pwm_i,

    input  logic       [         2:0] hall_i,           // C, B, A; asynchronous
    input  logic       [2*Phases-1:0] gate_i,
    output logic       [  Phases-1:0] req_h_o,
    output logic       [  Phases-1:0] req_l_o,
    output pwm_state_t                pwm_state_o,
    output logic                      carrier_start_o,
    output logic       [        17:0] duty_q2_o,
    output logic                      lost_o,
    output logic                      hall_event_o,

    output logic    zc_valid_o,      // a crossing was found
    output logic    zc_late_o,
    output sector_t zc_sector_o,
    output stamp_t  zc_time_o,
    output logic    comm_applied_o,  // first clock of a new sector
    output sector_t sector_o,
    output stamp_t  comm_sched_o     // instant at which its gates were to change
);

  localparam int unsigned Zcd = 0;
  localparam int unsigned Comm = 1;
  localparam int unsigned Pwm = 2;
  localparam int unsigned Freewheel = 3;
  localparam int unsigned Hall = 4;

  logic zc_back;
  logic [23:0] interval, mean_interval;
  logic interval_known;
  logic hall_valid, hall_backward, hall_single, hall_ok;
  stamp_t hall_time;
  sector_t hall_position, comm_sector;
  logic comm_valid, comm_load, sched_valid, seq_reverse;
  stamp_t comm_sched, comm_sched_q;

  fl_zcd_wb #(
      .Phases(Phases)
  ) u_zcd (
      .clk_i,
      .rst_i,
      .now_i,
      .req_i,
      .stb_i         (stb_i[Zcd]),
      .rdat_o        (rdat_o[Zcd]),
      .update_i,
      .reverse_i     (seq_reverse),
      .comm_applied_i(comm_applied_o),
      .sample_valid_i,
      .sample_i,
      .sample_time_i,
      .sample_pwm_i,
      .zc_valid_o,
      .zc_time_o,
      .zc_late_o,
      .zc_back_o     (zc_back),
      .zc_sector_o,
      .interval_i    (interval),
      .mean_i        (mean_interval),
      .known_i       (interval_known)
  );

  fl_comm_wb u_comm (
      .clk_i,
      .rst_i,
      .req_i,
      .stb_i          (stb_i[Comm]),
      .rdat_o         (rdat_o[Comm]),
      .now_i,
      .tick_i,
      .update_i,
      .zc_valid_i     (zc_valid_o),
      .zc_time_i      (zc_time_o),
      .zc_late_i      (zc_late_o),
      .zc_back_i      (zc_back),
      .zc_sector_i    (zc_sector_o),
      .sector_i       (sector_o),
      .reverse_i      (seq_reverse),
      .hall_valid_i   (hall_valid),
      .hall_time_i    (hall_time),
      .hall_position_i(hall_position),
      .hall_backward_i(hall_backward),
      .hall_single_i  (hall_single),
      .hall_ok_i      (hall_ok),
      .comm_valid_o   (comm_valid),
      .comm_sched_o   (comm_sched),
      .comm_load_o    (comm_load),
      .comm_sector_o  (comm_sector),
      .sched_valid_o  (sched_valid),
      .lost_o,
      .interval_o     (interval),
      .mean_o         (mean_interval),
      .known_o        (interval_known)
  );

  fl_hall_wb u_hall (
      .clk_i,
      .rst_i,
      .req_i,
      .stb_i     (stb_i[Hall]),
      .rdat_o    (rdat_o[Hall]),
      .now_i,
      .hall_i,
      .update_i,
      .reverse_i (seq_reverse),
      .zc_valid_i(zc_valid_o),
      .zc_time_i (zc_time_o),
      .valid_o   (hall_valid),
      .time_o    (hall_time),
      .position_o(hall_position),
      .backward_o(hall_backward),
      .single_o  (hall_single),
      .ok_o      (hall_ok),
      .event_o   (hall_event_o)
  );

  fl_freewheel_wb #(
      .Phases(Phases)
  ) u_freewheel (
      .clk_i,
      .rst_i,
      .req_i,
      .stb_i          (stb_i[Freewheel]),
      .rdat_o         (rdat_o[Freewheel]),
      .now_i,
      .tick_i,
      .update_i,
      .comm_applied_i (comm_applied_o),
      .sector_i       (sector_o),
      .sample_valid_i,
      .sample_i,
      .sample_time_i,
      .sample_sector_i(sample_pwm_i.sector)
  );

  fl_pwm_wb #(
      .Phases(Phases)
  ) u_pwm (
      .clk_i,
      .rst_i,
      .req_i,
      .stb_i          (stb_i[Pwm]),
      .rdat_o         (rdat_o[Pwm]),
      .now_i,
      .update_i,
      .comm_valid_i   (comm_valid),
      .sched_valid_i  (sched_valid),
      .comm_sched_i   (comm_sched),
      .comm_load_i    (comm_load),
      .comm_sector_i  (comm_sector),
      .hall_position_i(hall_position),
      .hall_ok_i      (hall_ok),
      .req_h_o,
      .req_l_o,
      .gate_i,
      .pwm_state_o,
      .carrier_start_o,
      .comm_applied_o,
      .sector_o,
      .reverse_o      (seq_reverse),
      .duty_q2_o
  );

  // The timer may already plan the next commutation when this one reaches the sequencer.
  always_ff @(posedge clk_i) begin
    if (comm_valid) comm_sched_q <= comm_sched;
    if (rst_i) comm_sched_q <= '0;
  end

  assign comm_sched_o = comm_sched_q;

endmodule
`default_nettype wire
