// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// In place of rtl/soc/fl_cpu.sv in a simulation: no core. The firmware runs in the simulator's process (cpu_host.h) and
// comes to the register bus by the variables of this module.
//
// Ports and RAM as in rtl/soc/fl_cpu.sv; of the RAM only what firmware and host look at counts, nothing is executed.
// host_* is written by the simulator between two rising edges, core_* is what it reads after one. An access: host_stb is 1
// until core_done is, which is for 1 clock. Latency: 3 clocks from host_stb to core_done, core_rdat holds the word read then;
// 1 clock from a line to core_irq. They are no registers of the chip, hence without _q: upsets.py.
`default_nettype none
module fl_cpu #(
    parameter int unsigned Words = 32768,
    parameter string Init = "firmware.hex",
    parameter bit Boot = 0,
    parameter string BootInit = "boot.hex"
) (
    input logic clk_i,
    input logic rst_i,

    input logic irq_current_i,
    input logic irq_control_i,
    input logic irq_deferred_i,

    output logic        io_stb_o,   // held until io_ack_i
    output logic        io_we_o,
    output logic [29:0] io_adr_o,   // word address below the I/O base
    output logic [31:0] io_wdat_o,
    output logic [ 3:0] io_sel_o,
    input  logic        io_ack_i,
    input  logic [31:0] io_rdat_i,

    // Debug bus: no core that takes a command.
    input  logic        debug_valid_i,  // held until debug_ready_o
    output logic        debug_ready_o,
    input  logic        debug_we_i,
    input  logic [ 7:0] debug_adr_i,    // byte address
    input  logic [31:0] debug_wdat_i,
    output logic [31:0] debug_rdat_o    // for the address of the clock before
);

  if (Boot) begin : g_check
    $fatal(1, "fl_cpu: without a core nothing loads %s (%m)", BootInit);
  end

  logic host_stb, host_we;
  logic [29:0] host_adr;
  logic [31:0] host_wdat;

  logic core_done;
  logic [31:0] core_rdat;
  logic [2:0] core_irq;  // current, control, deferred in bits 0, 1, 2

  assign io_sel_o = '1;
  assign {debug_ready_o, debug_rdat_o} = '0;
  logic unused;
  assign unused = &{1'b0, debug_valid_i, debug_we_i, debug_adr_i, debug_wdat_i};

  always_ff @(posedge clk_i) begin
    io_stb_o    <= host_stb && !io_ack_i;
    io_we_o     <= host_we;
    io_adr_o    <= host_adr;
    io_wdat_o   <= host_wdat;
    core_done <= io_stb_o && io_ack_i;
    core_rdat <= io_rdat_i;
    core_irq  <= {irq_deferred_i, irq_control_i, irq_current_i};
    if (rst_i) begin
      io_stb_o    <= 1'b0;
      core_done <= 1'b0;
      core_irq  <= '0;
    end
  end

  logic [31:0] unused_a, unused_b;

  fl_ram #(
      .Words(Words),
      .Init (Init)
  ) u_ram (
      .clk_i,
      .a_en_i  (1'b0),
      .a_adr_i ('0),
      .a_rdat_o(unused_a),
      .b_we_i  ('0),
      .b_adr_i ('0),
      .b_wdat_i('0),
      .b_rdat_o(unused_b)
  );

endmodule
`default_nettype wire
