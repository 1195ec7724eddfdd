// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Test wrapper: timer, sample scheduler, sensing, vector path and injection wired as on the chip; the registers of timer,
// vector path and injection behind one bus port; counters of the requests between two updates.
`default_nettype none
module fl_foc_chain
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter  int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3
) (
    input logic clk_i,
    input logic rst_i,

    input  logic     [ 1:0] block_i,  // 0 timer, 1 foc, 2 injection
    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input sched_mode_e        cfg_mode_i,
    input logic        [15:0] cfg_spacing_i,
    input logic        [15:0] cfg_offset_i,
    input logic        [15:0] cfg_delay_i,

    output logic                         adc_strobe_o,
    input  logic                         adc_valid_i,
    input  logic [AdcWidth*Channels-1:0] adc_code_i,

    output stamp_t                 now_o,
    output logic                   tick_o,
    output logic                   event_o,     // update event
    output logic                   waiting_o,
    output logic                   source_o,
    output logic                   update_o,    // of the leg carriers
    output logic                   sync_o,
    output logic                   deadline_o,
    output logic   [   Phases-1:0] req_h_o,
    output logic   [   Phases-1:0] req_l_o,
    output logic                   instant_o,
    output logic   [         31:0] theta_o,
    output logic   [16*Phases-1:0] high_o,      // clocks of each upper request between the last two updates
    output logic   [16*Phases-1:0] low_o
);

  logic [2:0][31:0] rdat;
  fl_vector_pkg::tap_t tap;
  fl_vector_pkg::injection_t injection;
  logic sample_valid;
  sample_t [Phases-1:0] sample;
  stamp_t sample_time;
  logic [Channels-1:0][17:0] offset;
  logic [Channels-1:0][15:0] gain;
  logic [Phases-1:0][15:0] high_q, low_q;

  assign rdat_o = rdat[block_i];

  always_comb begin
    for (int unsigned c = 0; c < Channels; c++) begin
      offset[c] = (c >= Phases && c < 2 * Phases) ? 18'd32768 : '0;
      gain[c]   = 16'h8000;
    end
  end

  fl_timer_wb u_timer (
      .clk_i,
      .rst_i,
      .req_i,
      .stb_i    (stb_i && block_i == 2'd0),
      .rdat_o   (rdat[0]),
      .sync_i   (sync_o),
      .now_o,
      .tick_o,
      .update_o (event_o),
      .machine_o(),
      .load_o   ()
  );

  fl_sample_scheduler u_scheduler (
      .clk_i,
      .rst_i,
      .cfg_mode_i,
      .cfg_period_i   (cfg_spacing_i),
      .cfg_offset_i,
      .carrier_start_i(source_o && update_o),
      .strobe_o       (adc_strobe_o)
  );

  fl_sense #(
      .Phases(Phases)
  ) u_sense (
      .clk_i,
      .rst_i,
      .strobe_i       (adc_strobe_o),
      .now_i          (now_o),
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
      .tick_i         (tick_o),
      .snap_number_o  (),
      .snap_time_o    (),
      .snap_idc_sum_o (),
      .snap_vdc_sum_o (),
      .snap_count_o   (),
      .snap_sample_o  ()
  );

  fl_foc_wb #(
      .Phases(Phases)
  ) u_foc (
      .clk_i,
      .rst_i,
      .req_i,
      .stb_i         (stb_i && block_i == 2'd1),
      .rdat_o        (rdat[1]),
      .now_i         (now_o),
      .tick_i        (tick_o),
      .update_i      (event_o),
      .strobe_i      (adc_strobe_o),
      .sample_valid_i(sample_valid),
      .sample_i      (sample),
      .sample_time_i (sample_time),
      .encoder_position_i(now_o[17:0]),
      .encoder_indexed_i(now_o[5]),
      .injection_i   (injection),
      .tap_o         (tap),
      .waiting_o,
      .source_o,
      .update_o,
      .sync_o,
      .deadline_o,
      .req_h_o,
      .req_l_o,
      .instant_o,
      .theta_o
  );

  fl_injection_wb #(
      .Phases(Phases)
  ) u_injection (
      .clk_i,
      .rst_i,
      .req_i,
      .stb_i      (stb_i && block_i == 2'd2),
      .rdat_o     (rdat[2]),
      .tick_i     (tick_o),
      .tap_i      (tap),
      .injection_o(injection)
  );

  always_ff @(posedge clk_i) begin
    for (int unsigned x = 0; x < Phases; x++) begin
      high_q[x] <= 16'(req_h_o[x]) + (update_o ? '0 : high_q[x]);
      low_q[x]  <= 16'(req_l_o[x]) + (update_o ? '0 : low_q[x]);
    end
    if (update_o) begin
      high_o <= high_q;
      low_o  <= low_q;
    end
    if (rst_i) begin
      high_q <= '0;
      low_q  <= '0;
    end
  end

endmodule
`default_nettype wire
