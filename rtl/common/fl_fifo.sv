// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Small synchronous FIFO with the oldest word always visible at the output.
//
// push_i while full and pop_i while empty are ignored, so the contents are never damaged; the user counts what is
// dropped. Latency from push_i to valid_o: 1 clock, with Block 2 clocks: its memory is a block RAM, which has a register at
// its output, else the distributed RAM of the device. A word can be popped in every clock in which valid_o is high.
`default_nettype none
module fl_fifo #(
    parameter int unsigned Width = 8,
    parameter int unsigned Depth = 16,
    parameter bit          Block = 1'b0
) (
    input  logic             clk_i,
    input  logic             rst_i,
    input  logic             push_i,
    input  logic [Width-1:0] data_i,
    output logic             full_o,
    input  logic             pop_i,
    output logic [Width-1:0] data_o,
    output logic             valid_o
);

  if (Depth < 2 || (Depth & (Depth - 1)) != 0) begin : g_check
    $fatal(1, "fl_fifo: Depth must be a power of two, at least 2 (%m)");
  end

  localparam int unsigned IndexWidth = $clog2(Depth);

  // One bit more than the index tells full from empty.
  logic [IndexWidth:0] write_q, read_q;
  logic push, pop, full_q;

  // A flip-flop: it decides in the clock of a push about the write enable of every memory.
  assign full_o  = full_q;
  assign push    = push_i && !full_o;
  assign pop     = pop_i && valid_o;

  if (Block) begin : g_block
    // The word that is the oldest one in the next clock is read now. One that is written in the same clock does not count
    // as there yet, so what the memory reads then does not matter.
    (* ram_style = "block", no_rw_check *) logic [Width-1:0] mem[Depth];
    logic [IndexWidth:0] read_d;
    logic [Width-1:0] data_q;
    logic valid_q;
    assign read_d = read_q + (IndexWidth + 1)'(pop);
    always_ff @(posedge clk_i) begin
      if (push) mem[write_q[IndexWidth-1:0]] <= data_i;
      data_q <= mem[read_d[IndexWidth-1:0]];
    end
    always_ff @(posedge clk_i) begin
      valid_q <= write_q != read_d;
      if (rst_i) valid_q <= 1'b0;
    end
    assign data_o  = data_q;
    assign valid_o = valid_q;
  end else begin : g_distributed
    logic [Width-1:0] mem[Depth];
    always_ff @(posedge clk_i) begin
      if (push) mem[write_q[IndexWidth-1:0]] <= data_i;
    end
    assign data_o  = mem[read_q[IndexWidth-1:0]];
    assign valid_o = write_q != read_q;
  end

  always_ff @(posedge clk_i) begin
    if (push) write_q <= write_q + 1'b1;
    if (pop) read_q <= read_q + 1'b1;
    full_q <= !pop && (full_q || (push && write_q - read_q == (IndexWidth + 1)'(Depth - 1)));
    if (rst_i) begin
      full_q  <= 1'b0;
      write_q <= '0;
      read_q  <= '0;
    end
  end

endmodule
`default_nettype wire
