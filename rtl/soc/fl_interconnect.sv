// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Register bus: one Wishbone slave port, one window of 4 KiB a block, read data registered.
//
// Read data get a register a block, cleared where the block is not strobed, and are joined behind it: the choice among the
// registers of a block and the choice among the blocks each have a clock of their own.
// A block is strobed for exactly one clock, takes a write or shows its read data combinationally in that clock; the
// answer follows in the next clock. The acknowledge is made here, so that an access to a window or an offset where
// nothing is answers (reads as zero, writes are lost) and never hangs the bus.
// Latency: 1 clock from stb_i to ack_o, one access every 2 clocks.
`default_nettype none
module fl_interconnect
  import fl_bus_pkg::*;
#(
    parameter int unsigned Blocks = 10,
    // Bits of the byte address that a block decodes; offsets beyond are unmapped.
    parameter logic [Blocks-1:0][3:0] AddressWidth = '1
) (
    input logic clk_i,
    input logic rst_i,

    input  logic        stb_i,
    input  logic        we_i,
    input  logic [29:0] adr_i,   // word address below the I/O base
    input  logic [31:0] wdat_i,
    input  logic [ 3:0] sel_i,
    output logic        ack_o,
    output logic [31:0] rdat_o,

    output bus_req_t                    req_o,
    output logic     [Blocks-1:0]       stb_o,
    input  logic     [Blocks-1:0][31:0] rdat_i
);

  localparam int unsigned PageWidth = 30 + 2 - WindowWidth;

  logic access;
  logic [PageWidth-1:0] page;
  logic [Blocks-1:0][31:0] rdat_q;

  assign access     = stb_i && !ack_o;
  assign page       = adr_i[29:WindowWidth-2];

  assign req_o.we   = we_i;
  assign req_o.adr  = {adr_i[WindowWidth-3:0], 2'b00};
  assign req_o.wdat = wdat_i;
  assign req_o.sel  = sel_i;

  for (genvar i = 0; i < Blocks; i++) begin : g_block
    assign stb_o[i] = access && page == PageWidth'(i) && (req_o.adr >> AddressWidth[i]) == '0;
  end

  always_ff @(posedge clk_i) begin
    for (int i = 0; i < Blocks; i++) rdat_q[i] <= stb_o[i] ? rdat_i[i] : '0;
    ack_o <= access;
    if (rst_i) ack_o <= 1'b0;
  end

  always_comb begin
    rdat_o = '0;
    for (int i = 0; i < Blocks; i++) rdat_o |= rdat_q[i];
  end

endmodule
`default_nettype wire
