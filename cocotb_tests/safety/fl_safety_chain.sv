// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Test wrapper: trips and guard wired as on the chip, three phases, every channel and enable a plain vector.
`default_nettype none
module fl_safety_chain
  import fl_pkg::*;
#(
    localparam int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3
) (
    input  logic                           clk_i,
    input  logic                           rst_i,
    input  logic                           adc_valid_i,
    input  logic   [AdcWidth*Channels-1:0] adc_code_i,
    input  logic                           fault_pin_i,
    input  logic                           lost_i,
    input  logic                           software_i,
    input  logic                           deadline_i,
    input  logic                           guard_enable_i,
    input  logic   [                  7:0] cfg_enable_i,
    input  logic   [         AdcWidth-1:0] cfg_phase_lsb_i,
    input  logic   [         AdcWidth-1:0] cfg_dc_lsb_i,
    input  logic   [         AdcWidth-1:0] cfg_over_lsb_i,
    input  logic   [         AdcWidth-1:0] cfg_under_lsb_i,
    input  logic                           cfg_short_i,
    input  logic                           never_i,
    input  logic                           clear_i,
    input  logic   [                  2:0] log_index_i,
    input  logic   [                  9:0] dead_time_i,
    input  logic   [           Phases-1:0] req_h_i,
    input  logic   [           Phases-1:0] req_l_i,
    output stamp_t                         now_o,
    output logic                           trip_o,
    output logic                           short_o,
    output logic                           event_o,
    output logic   [                  7:0] event_cause_o,
    output logic   [                  7:0] latched_o,
    output logic   [                  7:0] present_o,
    output logic   [                  7:0] first_o,
    output logic   [                  7:0] count_o,
    output stamp_t                         log_stamp_o,
    output logic   [                  7:0] log_cause_o,
    output logic                           log_valid_o,
    output logic   [                  2:0] log_phase_o,
    output logic   [         AdcWidth-1:0] log_code_o,
    output logic   [         2*Phases-1:0] gate_o
);

  logic [Phases-1:0] gate_h, gate_l;

  // Not a counter: every bit of the stamp differs between any two trips.
  always_ff @(posedge clk_i) now_o <= rst_i ? 32'hFFFF_FF00 : now_o * 32'd1664525 + 32'd1013904223;

  fl_trip #(
      .Phases(Phases)
  ) u_trip (
      .clk_i,
      .rst_i,
      .now_i        (now_o),
      .adc_valid_i,
      .adc_code_i,
      .fault_pin_i,
      .lost_i,
      .software_i,
      .deadline_i,
      .guard_enable_i,
      .cfg_enable_i (trip_t'(cfg_enable_i)),
      .cfg_phase_lsb_i,
      .cfg_dc_lsb_i,
      .cfg_over_lsb_i,
      .cfg_under_lsb_i,
      .cfg_short_i,
      .never_i,
      .clear_i,
      .trip_o,
      .short_o,
      .event_o,
      .event_cause_o(event_cause_o),
      .latched_o    (latched_o),
      .present_o    (present_o),
      .first_o      (first_o),
      .count_o,
      .log_index_i,
      .log_stamp_o,
      .log_cause_o  (log_cause_o),
      .log_valid_o,
      .log_phase_o,
      .log_code_o
  );

  fl_gate_guard #(
      .Phases(Phases)
  ) u_guard (
      .clk_i,
      .rst_i,
      .enable_i         (guard_enable_i),
      .dead_time_i,
      .trip_i           (trip_o),
      .short_i          (short_o),
      .req_h_i,
      .req_l_i,
      .gate_h_o         (gate_h),
      .gate_l_o         (gate_l),
      .gate_o
  );

  logic unused;
  assign unused = ^{gate_h, gate_l};

endmodule
`default_nettype wire
