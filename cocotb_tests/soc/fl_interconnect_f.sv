// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the register bus for all inputs, each clock another: an access is answered in the next clock, once, wherever it
// goes; it strobes the block of its window for one clock if the block decodes its offset, else none; the answer is what
// that block showed, or zero.
//
// Windows and offsets are told here by division of the byte address.
`default_nettype none
module fl_interconnect_f
  import fl_bus_pkg::*;
#(
    localparam int unsigned Blocks = 6
) (
    input logic                    clk_i,
    input logic                    rst_i,
    input logic                    stb_i,
    input logic                    we_i,
    input logic [      29:0]       adr_i,
    input logic [      31:0]       wdat_i,
    input logic [       3:0]       sel_i,
    input logic [Blocks-1:0][31:0] rdat_i
);

  localparam logic [Blocks-1:0][3:0] Widths = {4'd12, 4'd9, 4'd2, 4'd5, 4'd7, 4'd4};  // of block 5 first

  logic ack_o;
  logic [31:0] rdat_o;
  bus_req_t req_o;
  logic [Blocks-1:0] stb_o;

  fl_interconnect #(
      .Blocks      (Blocks),
      .AddressWidth(Widths)
  ) dut (
      .*
  );

  // What the access of this clock asks for.
  logic [31:0] address, window, offset;
  logic [Blocks-1:0] wanted;
  logic [31:0] shown;
  assign address = {adr_i, 2'b00};
  assign window  = address / 32'd4096;
  assign offset  = address % 32'd4096;
  always_comb begin
    wanted = '0;
    shown  = '0;
    for (int unsigned i = 0; i < Blocks; i++) begin
      if (window == i && offset < (32'd1 << Widths[i])) begin
        wanted[i] = 1'b1;
        shown     = rdat_i[i];
      end
    end
  end

  logic first = 1'b1;
  logic stb_q, ack_q, rst_q;
  logic [31:0] shown_q;
  logic [Blocks-1:0] stb_o_q;
  always_ff @(posedge clk_i) begin
    first   <= 1'b0;
    stb_q   <= stb_i;
    ack_q   <= ack_o;
    rst_q   <= rst_i;
    shown_q <= shown;
    stb_o_q <= stb_o;
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        // Verifies: SOC-10, SOC-11
        a_answer : assert (ack_o == (stb_q && !ack_q && !rst_q));
        a_strobe : assert (stb_o == ((stb_i && !ack_o) ? wanted : '0));
        // Verifies: SOC-10
        if (!rst_q) a_once : assert (stb_o_q == '0 || stb_o == '0);
        // Verifies: SOC-11
        if (ack_o) a_data : assert (rdat_o == shown_q);
        // Verifies: SOC-10
        a_request : assert ({req_o.we, req_o.wdat, req_o.sel} == {we_i, wdat_i, sel_i});
        a_offset : assert (32'(req_o.adr) == offset);
      end
  end

endmodule
`default_nettype wire
