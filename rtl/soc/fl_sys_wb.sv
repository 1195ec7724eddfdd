// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// System registers: identity, build options, blocks of the build, clock frequency, time base.
`default_nettype none
module fl_sys_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter int unsigned Phases   = 3,
    parameter int unsigned Channels = 9,
    parameter int unsigned ClockHz  = 50_000_000,
    parameter logic [16:0] Fitted   = '0  // bit n: the block of window n is there
) (
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input stamp_t now_i
);

  fl_sys_regs_pkg::fl_sys_regs__in_t hwif_in;

  assign hwif_in.build.phases.next   = 4'(Phases);
  assign hwif_in.build.channels.next = 4'(Channels);
  assign hwif_in.blocks.fitted.next  = Fitted;
  assign hwif_in.clock.hz.next       = ClockHz;
  assign hwif_in.time_now.now.next   = now_i;

  fl_sys_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_sys_regs_pkg::FL_SYS_REGS_MIN_ADDR_WIDTH-1:0]),
      .wb_odat (req_i.wdat),
      .wb_sel  (req_i.sel),
      .wb_ack  (),
      .wb_err  (),
      .wb_idat (rdat_o),
      .hwif_in
  );

endmodule
`default_nettype wire
