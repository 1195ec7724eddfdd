// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Zero-crossing detection with its registers.
`default_nettype none
module fl_zcd_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter  int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3
) (
    input logic clk_i,
    input logic rst_i,

    input stamp_t now_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input logic update_i,
    input logic reverse_i,      // staged setting
    input logic comm_applied_i,

    input logic                      sample_valid_i,
    input sample_t    [Channels-1:0] sample_i,
    input stamp_t                    sample_time_i,
    input pwm_state_t                sample_pwm_i,

    output logic    zc_valid_o,
    output stamp_t  zc_time_o,
    output logic    zc_late_o,
    output logic    zc_back_o,
    output sector_t zc_sector_o,

    input logic [23:0] interval_i,
    input logic [23:0] mean_i,
    input logic        known_i
);

  fl_zcd_regs_pkg::fl_zcd_regs__in_t hwif_in;
  fl_zcd_regs_pkg::fl_zcd_regs__out_t hwif_out;
  logic [5:0][16:0] threshold;

  for (genvar i = 0; i < 6; i++) begin : g_threshold
    assign threshold[i] = hwif_out.threshold[i].vdc_q17.value;
  end

  assign hwif_in.zc_time.stamp.next  = zc_time_o;
  assign hwif_in.zc_info.sector.next = zc_sector_o;
  assign hwif_in.zc_info.late.next   = zc_late_o;
  assign hwif_in.zc_info.back.next   = zc_back_o;

  fl_zcd #(
      .Phases(Phases)
  ) u_zcd (
      .clk_i,
      .rst_i,
      .now_i,
      .update_i,
      .cfg_enable_i       (hwif_out.control.enable.value),
      .cfg_method_i       (zc_method_e'(hwif_out.control.method.value)),
      .cfg_compute_back_i (hwif_out.control.compute_back.value),
      .cfg_linear_i       (hwif_out.control.linear.value),
      .cfg_use_mean_i     (hwif_out.control.use_mean.value),
      .cfg_source_i       (zc_source_e'(hwif_out.control.source.value)),
      .cfg_peak_i         (hwif_out.amplitude.peak.value),
      .cfg_wait_q8_i      (hwif_out.wait_limit.interval_q8.value),
      .cfg_need_previous_i(hwif_out.control.need_previous.value),
      .cfg_settle_i       (hwif_out.blanking.settle_cycles.value),
      .cfg_blank_i        (hwif_out.blanking.blank_cycles.value),
      .cfg_margin_i       (hwif_out.clamp.margin.value),
      .cfg_threshold_i    (threshold),
      .cfg_reverse_i      (reverse_i),
      .interval_i,
      .mean_i,
      .known_i,
      .comm_applied_i,
      .sample_valid_i,
      .sample_i,
      .sample_time_i,
      .sample_pwm_i,
      .zc_valid_o,
      .zc_time_o,
      .zc_late_o,
      .zc_back_o,
      .zc_averaged_o      (hwif_in.zc_info.averaged.next),
      .zc_sector_o,
      .zc_value_o         (hwif_in.zc_info.value.next),
      .zc_value_before_o  (),
      .crossings_o        (hwif_in.counters.crossings.next),
      .late_o             (hwif_in.counters.late.next),
      .back_o             (hwif_in.method_counters.back.next),
      .averaged_o         (hwif_in.method_counters.averaged.next)
  );

  fl_zcd_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_zcd_regs_pkg::FL_ZCD_REGS_MIN_ADDR_WIDTH-1:0]),
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
