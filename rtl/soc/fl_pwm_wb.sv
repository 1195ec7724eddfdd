// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// PWM carrier, six-step sequencer and PWM state with their registers.
`default_nettype none
module fl_pwm_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter int unsigned Phases = 3
) (
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input stamp_t now_i,
    input logic   update_i,

    input logic   comm_valid_i,
    input logic   sched_valid_i,
    input stamp_t comm_sched_i,

    input logic    comm_load_i,      // the commutation is into...
    input sector_t comm_sector_i,
    input sector_t hall_position_i,
    input logic    hall_ok_i,

    output logic [Phases-1:0] req_h_o,  // to the guard
    output logic [Phases-1:0] req_l_o,

    input  logic       [2*Phases-1:0] gate_i,      // from the guard
    output pwm_state_t                pwm_state_o,

    output logic           carrier_start_o,
    output logic           comm_applied_o,   // first clock of a new sector
    output sector_t        sector_o,
    output logic           reverse_o,        // staged setting, as the sequencer takes it over
    output logic    [17:0] duty_q2_o         // staged setting, clocks, Q16.2
);

  fl_pwm_regs_pkg::fl_pwm_regs__in_t  hwif_in;
  fl_pwm_regs_pkg::fl_pwm_regs__out_t hwif_out;
  logic apply, pulse, active;
  leg_cmd_e [Phases-1:0] manual;

  // The register holds three legs; a leg beyond them stays off in manual mode.
  always_comb begin
    manual    = {Phases{LegOff}};
    manual[0] = leg_cmd_e'(hwif_out.manual.leg_a.value);
    manual[1] = leg_cmd_e'(hwif_out.manual.leg_b.value);
    manual[2] = leg_cmd_e'(hwif_out.manual.leg_c.value);
  end

  assign reverse_o = hwif_out.control.backward.value;
  assign duty_q2_o = hwif_out.duty.cycles_q8.value[23:6];

  fl_carrier u_carrier (
      .clk_i,
      .rst_i,
      .now_i,
      .update_i,
      .cfg_commutation_i(comm_alignment_e'(hwif_out.control.commutation.value)),
      .cfg_period_i     (hwif_out.period.cycles.value),
      .cfg_duty_q8_i    (hwif_out.duty.cycles_q8.value),
      .cfg_min_pulse_i  (hwif_out.min_pulse.cycles.value),
      .comm_valid_i,
      .sched_valid_i,
      .comm_sched_i,
      .apply_o          (apply),
      .pulse_o          (pulse),
      .carrier_start_o,
      .count_o          (),
      .dropped_o        (hwif_in.state.dropped.next)
  );

  fl_sequencer #(
      .Phases(Phases)
  ) u_sequencer (
      .clk_i,
      .rst_i,
      .update_i,
      .cfg_mode_i        (seq_mode_e'(hwif_out.control.mode.value)),
      .cfg_pattern_i     (chop_pattern_e'(hwif_out.control.pattern.value)),
      .cfg_sync_rect_i   (hwif_out.control.sync_rect.value),
      .cfg_reverse_i     (hwif_out.control.backward.value),
      .cfg_start_sector_i(hwif_out.control.start_sector.value),
      .cfg_start_hall_i  (hwif_out.control.start_hall.value),
      .hall_position_i,
      .hall_ok_i,
      .cfg_manual_i      (manual),
      .apply_i           (apply),
      .load_i            (comm_load_i),
      .load_sector_i     (comm_sector_i),
      .pulse_i           (pulse),
      .sector_o,
      .active_o          (active),
      .comm_applied_o,
      .leg_cmd_o         (),
      .req_h_o,
      .req_l_o
  );

  assign hwif_in.state.sector.next = sector_o;

  fl_pwm_state #(
      .Phases(Phases)
  ) u_state (
      .clk_i,
      .rst_i,
      .gate_i,
      .sector_i      (sector_o),
      .active_i      (active),
      .comm_applied_i(comm_applied_o),
      .state_o       (pwm_state_o)
  );

  fl_pwm_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_pwm_regs_pkg::FL_PWM_REGS_MIN_ADDR_WIDTH-1:0]),
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
