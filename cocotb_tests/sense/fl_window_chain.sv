// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Test wrapper: leg carriers, sample scheduler, sensing and current window wired as the vector path uses them.
`default_nettype none
module fl_window_chain
  import fl_pkg::*;
#(
    parameter  int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3
) (
    input  logic                    clk_i,
    input  logic                    rst_i,
    input  logic                    cfg_double_i,
    input  logic [            15:0] cfg_period_i,
    input  logic [             1:0] cfg_mode_i,
    input  logic [            15:0] cfg_spacing_i,
    input  logic [            15:0] cfg_offset_i,
    input  logic [            15:0] cfg_from_i,
    input  logic [            15:0] cfg_length_i,
    input  logic [            15:0] cfg_delay_i,
    input  logic                    adc_valid_i,
    input  logic [12*Channels-1:0] adc_code_i,
    output logic                    update_o,
    output logic                    strobe_o,
    output logic                    instant_o,
    output logic                    valid_o,
    output logic [  18*Phases-1:0] current_o,
    output stamp_t                  time_o,
    output logic [             7:0] samples_o,
    output stamp_t                  now_o
);

  sample_t [Phases-1:0] sample;
  sample_t [Phases-1:0] current;
  stamp_t now, sample_time;
  logic strobe, update, sample_valid;
  logic [Channels-1:0][17:0] offset;
  logic [Channels-1:0][15:0] gain;

  always_ff @(posedge clk_i) now <= rst_i ? '0 : now + 32'd1;

  always_comb begin
    for (int unsigned c = 0; c < Channels; c++) begin
      offset[c] = (c >= Phases && c < 2 * Phases) ? 18'd32768 : '0;
      gain[c]   = 16'h8000;
    end
  end

  fl_leg_carrier #(
      .Phases(Phases)
  ) u_carrier (
      .clk_i,
      .rst_i,
      .enable_i        (1'b0),
      .cfg_double_i,
      .cfg_period_i,
      .cfg_miss_limit_i('0),
      .compare_valid_i (1'b0),
      .compare_i       ('0),
      .period_i        ('0),
      .update_o        (update),
      .carrier_start_o (),
      .second_o        (),
      .count_o         (),
      .active_o        (),
      .missed_o        (),
      .fault_o         (),
      .req_h_o         (),
      .req_l_o         ()
  );

  fl_sample_scheduler u_scheduler (
      .clk_i,
      .rst_i,
      .cfg_mode_i     (sched_mode_e'(cfg_mode_i)),
      .cfg_period_i   (cfg_spacing_i),
      .cfg_offset_i,
      .carrier_start_i(update),
      .strobe_o       (strobe)
  );

  fl_sense #(
      .Phases(Phases)
  ) u_sense (
      .clk_i,
      .rst_i,
      .strobe_i       (strobe),
      .now_i          (now),
      .pwm_state_i    ('0),
      .adc_valid_i,
      .adc_code_i,
      .cfg_delay_i,
      .cfg_offset_i   (offset),
      .cfg_gain_i     (gain),
      .az_start_i     (1'b0),
      .az_log2_i      ('0),
      .az_mask_i      ('0),
      .az_busy_o      (),
      .az_offset_we_o (),
      .az_offset_o    (),
      .current_valid_o(sample_valid),
      .current_o      (sample),
      .current_time_o (sample_time),
      .sample_valid_o (),
      .sample_o       (),
      .sample_time_o  (),
      .sample_pwm_o   (),
      .sample_number_o(),
      .tick_i         (1'b0),
      .snap_number_o  (),
      .snap_time_o    (),
      .snap_idc_sum_o (),
      .snap_vdc_sum_o (),
      .snap_count_o   (),
      .snap_sample_o  ()
  );

  fl_current_window #(
      .Phases(Phases)
  ) u_window (
      .clk_i,
      .rst_i,
      .now_i         (now),
      .start_i       (update),
      .cfg_from_i,
      .cfg_length_i,
      .cfg_delay_i,
      .strobe_i      (strobe),
      .sample_valid_i(sample_valid),
      .sample_i      (sample),
      .sample_time_i (sample_time),
      .instant_o,
      .valid_o,
      .current_o     (current),
      .time_o,
      .samples_o
  );

  assign now_o     = now;
  assign strobe_o  = strobe;
  assign update_o  = update;
  assign current_o = current;

endmodule
`default_nettype wire
