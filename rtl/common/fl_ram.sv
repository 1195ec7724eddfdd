// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Dual-port block RAM of 32-bit words. Port a reads (instructions), port b reads or writes bytes (data).
//
// Latency: 1 clock to rdat. Port a keeps its output while it is not enabled: by a register behind the RAM, which reads in
// every clock, since an enable that the core decides late would have to reach every block RAM on the die in the same clock
// (measured: 5 ns of 20). Port b reads in every clock; while it writes, its output is undefined for that access. The contents come from the
// hexadecimal file Init (one word a line), read at the start of a simulation from its working directory and by synthesis
// from where it runs; without a name nothing is known of them.
`default_nettype none
module fl_ram #(
    parameter int unsigned Words = 32768,
    parameter string Init = "firmware.hex"
) (
    input logic clk_i,

    input  logic                     a_en_i,
    input  logic [$clog2(Words)-1:0] a_adr_i,
    output logic [             31:0] a_rdat_o,

    input  logic [              3:0] b_we_i,    // byte lanes, 0: read
    input  logic [$clog2(Words)-1:0] b_adr_i,
    input  logic [             31:0] b_wdat_i,
    output logic [             31:0] b_rdat_o
);

  // Nobody uses a word read in the clock in which it is written, so no bypass is needed.
  (* no_rw_check *) logic [31:0] mem[Words];

  if (Init != "") begin : g_init
    initial $readmemh(Init, mem);
  end

  logic a_en_q;
  logic [31:0] a_read_q, a_kept_q;

  always_ff @(posedge clk_i) begin
    a_en_q   <= a_en_i;
    a_read_q <= mem[a_adr_i];
    a_kept_q <= a_rdat_o;
  end

  assign a_rdat_o = a_en_q ? a_read_q : a_kept_q;

  // No always_ff: what Init holds is a second writer.
  always @(posedge clk_i) begin
    for (int i = 0; i < 4; i++) begin
      if (b_we_i[i]) mem[b_adr_i][8*i+:8] <= b_wdat_i[8*i+:8];
    end
    b_rdat_o <= mem[b_adr_i];
  end

endmodule
`default_nettype wire
