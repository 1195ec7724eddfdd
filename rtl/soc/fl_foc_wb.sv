// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Vector path with its registers.
`default_nettype none
module fl_foc_wb
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
    input logic   tick_i,
    input logic   update_i,

    input logic                 strobe_i,        // the converter samples
    input logic                 sample_valid_i,
    input sample_t [Phases-1:0] sample_i,        // phase currents
    input stamp_t               sample_time_i,
    input logic [17:0]          encoder_position_i,  // of this clock, quarters
    input logic                 encoder_indexed_i,
    input fl_vector_pkg::injection_t injection_i,

    output fl_vector_pkg::tap_t tap_o,     // for the injection path
    output logic              waiting_o,   // a regulator step waits for the core's voltages
    output logic              source_o,    // 1: these requests go to the guard
    output logic              update_o,    // first clock after an update of the leg carriers
    output logic              sync_o,      // compares of a regulator step are made
    output logic              deadline_o,
    output logic [Phases-1:0] req_h_o,
    output logic [Phases-1:0] req_l_o,
    output logic              instant_o,   // instant of a window
    output logic [      31:0] theta_o      // angle of this clock, 2^32 = one turn
);

  fl_foc_regs_pkg::fl_foc_regs__in_t  hwif_in;
  fl_foc_regs_pkg::fl_foc_regs__out_t hwif_out;
  fl_vector_pkg::settings_t settings;
  fl_vector_pkg::snapshot_t snapshot;
  fl_vector_pkg::answer_t answer;
  fl_vector_pkg::question_t question;
  logic correct_written_q, go_written_q;

  // The value is there in the clock after it has been written.
  always_ff @(posedge clk_i) begin
    correct_written_q <= hwif_out.correct.turn_q32.swmod && !rst_i;
    go_written_q      <= hwif_out.direct_go.step.swmod && !rst_i;
  end

  always_comb begin
    answer.go     = go_written_q;
    answer.number = hwif_out.direct_go.step.value;
    for (int unsigned s = 0; s < 2; s++)
    for (int unsigned axis = 0; axis < 2; axis++)
    answer.wanted[s][axis] = hwif_out.direct_v[2*s+axis].v_q25.value;
  end

  always_comb begin
    settings.source        = hwif_out.control.source.value;
    settings.enable        = hwif_out.control.enable.value;
    settings.double_update = hwif_out.control.double.value;
    settings.bypass        = hwif_out.control.bypass.value;
    settings.direct        = hwif_out.control.direct.value;
    settings.regulate      = hwif_out.control.regulate.value;
    settings.miss_limit    = hwif_out.control.miss_limit.value;
    settings.period        = hwif_out.period.cycles.value;
    settings.from          = hwif_out.window.from_cycles.value;
    settings.length        = hwif_out.window.length_cycles.value;
    settings.delay         = hwif_out.delay.cycles.value;
    settings.lead          = hwif_out.lead.turn_q32.value;
    settings.park          = hwif_out.park.turn_q32.value;
    settings.scale         = hwif_out.scale.mantissa.value;
    settings.scale_shift   = hwif_out.scale.shift.value;
    settings.band          = hwif_out.band.i_q17.value;
    settings.slope         = hwif_out.slope.mantissa.value;
    settings.slope_shift   = hwif_out.slope.shift.value;
    settings.dead_time     = hwif_out.dead_time.cycles.value;
    settings.min_pulse     = hwif_out.min_pulse.cycles.value;
    settings.margin        = hwif_out.margin.cycles.value;
    for (int unsigned s = 0; s < 2; s++) begin
      settings.shift[s] = hwif_out.shift[s].bits.value;
      settings.limit[s] = hwif_out.limit[s].v_q17.value;
      for (int unsigned axis = 0; axis < 2; axis++) begin
        settings.current_reference[s][axis] = hwif_out.reference[2*s+axis].i_q17.value;
        settings.gain[s][axis]              = hwif_out.gain[2*s+axis].mantissa.value;
        settings.hold[s][axis]              = hwif_out.hold[2*s+axis].mantissa.value;
        settings.ratio[s][axis]             = hwif_out.ratio[2*s+axis].q17.value;
        settings.preset[s][axis]            = hwif_out.preset[2*s+axis].v_q17.value;
        settings.forward[s][axis]           = hwif_out.forward[2*s+axis].v_q17.value;
      end
    end
  end

  for (genvar s = 0; s < 2; s++) begin : g_subspace
    for (genvar axis = 0; axis < 2; axis++) begin : g_axis
      assign hwif_in.direct_i[2*s+axis].i_q17.next   = question.current[s][axis];
      assign hwif_in.snap_i[2*s+axis].i_q17.next     = snapshot.step.current[s][axis];
      assign hwif_in.snap_v[2*s+axis].v_q17.next     = snapshot.step.applied[s][axis];
      assign hwif_in.snap_u[2*s+axis].v_q25.next     = snapshot.step.state[s][axis];
      assign hwif_in.snap_v_sum[2*s+axis].v_q17.next = snapshot.applied_sum[s][axis];
    end
  end

  assign hwif_in.direct_run.step.next            = question.number;
  assign hwif_in.direct_run.waiting.next         = question.waiting;
  assign hwif_in.snap_count.steps.next           = snapshot.steps;
  assign hwif_in.snap_count.samples.next         = snapshot.step.samples;
  assign hwif_in.snap_count.limited.next         = snapshot.step.limited;
  assign hwif_in.snap_theta_sample.turn_q32.next = snapshot.step.theta;
  assign hwif_in.snap_theta_update.turn_q32.next = snapshot.theta_update;
  assign hwif_in.snap_omega.turn_q36.next        = snapshot.omega;
  assign hwif_in.snap_time.stamp.next            = snapshot.step.stamp;
  assign hwif_in.snap_encoder.position.next      = snapshot.step.encoder.position;
  assign hwif_in.snap_encoder.indexed.next       = snapshot.step.encoder.indexed;
  assign hwif_in.snap_missed.missed.next         = snapshot.missed;
  assign hwif_in.snap_missed.overruns.next       = snapshot.overruns;

  fl_vector #(
      .Phases(Phases)
  ) u_vector (
      .clk_i,
      .rst_i,
      .now_i,
      .tick_i,
      .update_i,
      .settings_i  (settings),
      .omega_i     (hwif_out.omega.turn_q36.value),
      .correct_we_i(correct_written_q),
      .correct_i   (hwif_out.correct.turn_q32.value),
      .strobe_i,
      .sample_valid_i,
      .sample_i,
      .sample_time_i,
      .encoder_i   ({encoder_indexed_i, encoder_position_i}),
      .answer_i    (answer),
      .injection_i,
      .tap_o,
      .question_o  (question),
      .source_o,
      .update_o,
      .sync_o,
      .deadline_o,
      .req_h_o,
      .req_l_o,
      .instant_o,
      .theta_o,
      .snapshot_o  (snapshot)
  );

  assign waiting_o = question.waiting;

  fl_foc_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_foc_regs_pkg::FL_FOC_REGS_MIN_ADDR_WIDTH-1:0]),
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
