// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Sample scheduler, correction and snapshot of the converter channels with their registers.
`default_nettype none
module fl_sense_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter  int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3
) (
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input stamp_t     now_i,
    input logic       tick_i,
    input logic       carrier_start_i,
    input pwm_state_t pwm_state_i,

    output logic                     adc_strobe_o,
    input  logic                     adc_valid_i,
    input  adc_code_t [Channels-1:0] adc_code_i,

    output logic                 current_valid_o,
    output sample_t [Phases-1:0] current_o,
    output stamp_t               current_time_o,

    output logic                      sample_valid_o,
    output sample_t    [Channels-1:0] sample_o,
    output stamp_t                    sample_time_o,
    output pwm_state_t                sample_pwm_o
);

  fl_sense_regs_pkg::fl_sense_regs__in_t  hwif_in;
  fl_sense_regs_pkg::fl_sense_regs__out_t hwif_out;

  localparam int unsigned MaxChannels = $size(hwif_out.gain);
  logic [Channels-1:0][17:0] offset, az_offset;
  logic [Channels-1:0][15:0] gain;
  logic [Channels-1:0] az_offset_we;
  sample_t [Channels-1:0] snap_sample;

  for (genvar i = 0; i < Channels; i++) begin : g_channel
    assign offset[i]                          = hwif_out.offset[i].lsb_q4.value;
    assign gain[i]                            = hwif_out.gain[i].q15.value;
    assign hwif_in.offset[i].lsb_q4.we        = az_offset_we[i];
    assign hwif_in.offset[i].lsb_q4.next      = az_offset[i];
    assign hwif_in.snap_channel[i].value.next = 32'(snap_sample[i]);
  end

  // Registers of channels that this build does not have.
  for (genvar i = Channels; i < MaxChannels; i++) begin : g_no_channel
    assign hwif_in.offset[i].lsb_q4.we        = 1'b0;
    assign hwif_in.offset[i].lsb_q4.next      = '0;
    assign hwif_in.snap_channel[i].value.next = '0;
  end

  fl_sample_scheduler u_scheduler (
      .clk_i,
      .rst_i,
      .cfg_mode_i  (sched_mode_e'(hwif_out.scheduler.mode.value)),
      .cfg_period_i(hwif_out.period.cycles.value),
      .cfg_offset_i(hwif_out.scheduler.offset_cycles.value),
      .carrier_start_i,
      .strobe_o    (adc_strobe_o)
  );

  fl_sense #(
      .Phases(Phases)
  ) u_sense (
      .clk_i,
      .rst_i,
      .strobe_i       (adc_strobe_o),
      .now_i,
      .pwm_state_i,
      .adc_valid_i,
      .adc_code_i,
      .cfg_delay_i    (hwif_out.delay.cycles.value),
      .cfg_offset_i   (offset),
      .cfg_gain_i     (gain),
      .az_start_i     (hwif_out.auto_zero.start.value),
      .az_log2_i      (hwif_out.auto_zero.log2_samples.value),
      .az_mask_i      (hwif_out.auto_zero.mask.value[Channels-1:0]),
      .az_busy_o      (hwif_in.auto_zero.busy.next),
      .az_offset_we_o (az_offset_we),
      .az_offset_o    (az_offset),
      .tick_i,
      .current_valid_o,
      .current_o,
      .current_time_o,
      .sample_valid_o,
      .sample_o,
      .sample_time_o,
      .sample_pwm_o,
      .sample_number_o(),
      .snap_number_o  (hwif_in.snap_number.sample.next),
      .snap_time_o    (hwif_in.snap_time.stamp.next),
      .snap_idc_sum_o (hwif_in.snap_idc_sum.total.next),
      .snap_vdc_sum_o (hwif_in.snap_vdc_sum.total.next),
      .snap_count_o   (hwif_in.snap_count.count.next),
      .snap_sample_o  (snap_sample)
  );

  fl_sense_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_sense_regs_pkg::FL_SENSE_REGS_MIN_ADDR_WIDTH-1:0]),
      .wb_odat (req_i.wdat),
      .wb_sel  (req_i.sel),
      .wb_ack  (),
      .wb_err  (),
      .wb_idat (rdat_o),
      .hwif_in,
      .hwif_out
  );

endmodule
`default_nettype wire
