// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Injection path with its registers, beside the vector path.
//
// tap_i is what the vector path shows, injection_o what it takes. The wave's voltage, and whether the regulators' current
// comes from here, belong to the step that starts with it; nothing of it acts while the wave does not run. A period, a
// first phase or a delay out of its range acts as enable 0: no wave starts, and one that runs ends with its period.
`default_nettype none
module fl_injection_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
  import fl_injection_pkg::*;
#(
    parameter int unsigned Phases = 3
) (
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input  logic                      tick_i,
    input  fl_vector_pkg::tap_t       tap_i,
    output fl_vector_pkg::injection_t injection_o
);

  localparam int unsigned Subspaces = fl_foc_pkg::subspaces(Phases);

  fl_injection_regs_pkg::fl_injection_regs__in_t  hwif_in;
  fl_injection_regs_pkg::fl_injection_regs__out_t hwif_out;
  settings_t settings;
  phase_t period;
  logic fits;

  assign period = hwif_out.wave.period.value;
  assign fits = period >= phase_t'(2) && hwif_out.wave.first.value < period && hwif_out.delay.updates.value < period;

  always_comb begin
    settings.enable    = hwif_out.control.enable.value && fits;
    settings.method    = method_e'(hwif_out.control.method.value);
    settings.remove    = hwif_out.control.remove.value;
    settings.sine      = hwif_out.control.sine.value;
    settings.period    = period;
    settings.first     = hwif_out.wave.first.value;
    settings.delay     = hwif_out.delay.updates.value;
    settings.rate      = hwif_out.rate.turn_q36.value;
    settings.lag       = hwif_out.lag.turn_q32.value;
    settings.shift     = hwif_out.filter.shift.value;
    settings.band.fine = hwif_out.filter.band_fine.value;
    settings.band.a1   = hwif_out.band_a1.q17.value;
    settings.band.a2   = hwif_out.band_a2.q17.value;
    settings.band.g    = hwif_out.band_g.q17.value;
    settings.band_k    = hwif_out.band_k.q16.value;
    settings.low.fine  = hwif_out.filter.low_fine.value;
    settings.low.a1    = hwif_out.low_a1.q17.value;
    settings.low.a2    = hwif_out.low_a2.q17.value;
    settings.low.g     = hwif_out.low_g.q17.value;
    for (int unsigned s = 0; s < 2; s++)
    for (int unsigned axis = 0; axis < 2; axis++)
    settings.amplitude[s][axis] = hwif_out.amplitude[2*s+axis].v_q17.value;
  end

  phase_t wave_phase;
  logic active, begun, zero, result_valid, peak, overflow;
  sample_t [Subspaces-1:0][1:0] voltage;
  sample_t [1:0] hf;
  phase_t phase;
  result_t result;
  logic [11:0] count;
  logic [15:0] clipped, overruns;

  fl_injection_path #(
      .Subspaces(Subspaces)
  ) u_path (
      .clk_i,
      .rst_i,
      .settings_i     (settings),
      .clear_i        (hwif_out.control.clear.value),
      .update_i       (tap_i.update),
      .second_i       (tap_i.second),
      .strobe_i       (tap_i.strobe),
      .sample_valid_i (tap_i.sample_valid),
      .current_i      (tap_i.current),
      .active_o       (active),
      .begun_o        (begun),
      .voltage_o      (voltage),
      .phase_o        (wave_phase),
      .zero_o         (zero),
      .current_valid_o(),
      .current_o      (injection_o.current),
      .current_delay_o(injection_o.pause),
      .hf_o           (hf),
      .sample_phase_o (phase),
      .result_valid_o (result_valid),
      .result_o       (result),
      .count_o        (count),
      .peak_o         (peak),
      .overflow_o     (overflow),
      .busy_o         (),
      .clipped_o      (clipped),
      .overrun_o      (overruns)
  );

  // Where the wave has ended the edges go on as those of its first phases: most of what they know is the carrier's ripple.
  // Where it begins anew fl_edge_current forgets, for an update interval: the other phases are from another angle.
  assign injection_o.edges = hwif_out.control.edges.value && !begun;
  assign injection_o.phase = active ? wave_phase : settings.first + phase_t'(tap_i.second);
  assign injection_o.skip = active && settings.remove && settings.method == MethodSeparator && !zero;

  always_comb begin
    injection_o.voltage = '0;
    injection_o.voltage[Subspaces-1:0] = voltage;
  end

  // The latest result, and what the tick keeps of it.
  typedef struct packed {
    result_t value;
    logic [31:0] theta;
    logic [15:0] number;
    logic [11:0] count;
    logic peak;
  } found_t;

  typedef struct packed {
    found_t found;
    logic overflow;
    phase_t phase;
    logic active;
    logic [15:0] clipped;
    logic [15:0] overruns;
    sample_t [1:0] hf;
  } snapshot_t;

  found_t found_q;
  snapshot_t snapshot_q;
  logic [31:0] theta_q;

  always_ff @(posedge clk_i) begin
    if (tap_i.sample_valid) theta_q <= tap_i.theta;
    if (result_valid) begin
      found_q <= '{value: result, theta: theta_q, number: found_q.number + 16'd1, count: count, peak: peak};
    end
    if (tick_i) begin
      snapshot_q <= '{
          found: found_q,
          overflow: overflow,
          phase: phase,
          active: active,
          clipped: clipped,
          overruns: overruns,
          hf: hf
      };
    end
    if (rst_i) begin
      theta_q    <= '0;
      found_q    <= '0;
      snapshot_q <= '0;
    end
  end

  for (genvar axis = 0; axis < 2; axis++) begin : g_axis
    assign hwif_in.snap_re[axis].value.next = snapshot_q.found.value.re[axis];
    assign hwif_in.snap_im[axis].value.next = snapshot_q.found.value.im[axis];
    assign hwif_in.snap_hf[axis].i_q17.next = 32'($signed(snapshot_q.hf[axis]));
  end

  assign hwif_in.snap_theta.turn_q32.next   = snapshot_q.found.theta;
  assign hwif_in.snap_result.results.next   = snapshot_q.found.number;
  assign hwif_in.snap_result.count.next     = snapshot_q.found.count;
  assign hwif_in.snap_result.peak.next      = snapshot_q.found.peak;
  assign hwif_in.snap_result.overflow.next  = snapshot_q.overflow;
  assign hwif_in.snap_state.phase.next      = snapshot_q.phase;
  assign hwif_in.snap_state.active.next     = snapshot_q.active;
  assign hwif_in.snap_faults.clipped.next   = snapshot_q.clipped;
  assign hwif_in.snap_faults.overruns.next  = snapshot_q.overruns;

  fl_injection_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_injection_regs_pkg::FL_INJECTION_REGS_MIN_ADDR_WIDTH-1:0]),
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
