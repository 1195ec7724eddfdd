// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Model of a SPI NOR flash from the command table that common parts share: mode 0, addresses of three bytes, pages of
// 256 bytes, sectors of 4 KiB. 9F identification, 05 status (bit 0 busy, bit 1 write enabled), 06 write enable, 03 read,
// 02 page program (ends a write enable, clears bits, wraps within the page), 20 sector erase. While busy only the status
// is answered. power_i = 0: what is under way is left half done (half a sector, every second
// byte of a page), and nothing answers.
`default_nettype none
module fl_spi_flash_model #(
    parameter int unsigned Bytes         = 32'h400000,
    parameter int unsigned ProgramCycles = 200,         // of clk_i, a page
    parameter int unsigned EraseCycles   = 1000         // a sector
) (
    input  logic clk_i,
    input  logic power_i,
    input  logic cs_ni,
    input  logic sck_i,
    input  logic mosi_i,
    output logic miso_o
);

  localparam int unsigned Sector = 4096;
  localparam int unsigned Page = 256;
  localparam logic [23:0] Identity = 24'hEF4016;

  logic [7:0] mem[Bytes]  /* verilator public_flat_rw */;
  logic [7:0] page[Page];
  int unsigned programs  /* verilator public_flat_rd */;
  int unsigned erases  /* verilator public_flat_rd */;
  int unsigned left;  // clocks of the operation under way
  logic erasing, enabled;
  logic [7:0] command, shift_in, shift_out;
  int unsigned bits, filled;
  logic [23:0] address, start;

  initial begin
    for (int unsigned i = 0; i < Bytes; i++) mem[i] = 8'hFF;
    programs = 0;
    erases   = 0;
    left     = 0;
    enabled  = 1'b0;
  end

  logic busy;
  assign busy = left != 0;

  // Bytes arrive at rising edges; what goes out changes at falling ones.
  logic sck_q, cs_q;
  logic [7:0] received;
  assign received = {shift_in[6:0], mosi_i};
  always @(posedge clk_i) begin
    sck_q <= sck_i;
    cs_q  <= cs_ni;
    if (!power_i) begin
      if (busy && erasing) for (int unsigned i = 0; i < Sector / 2; i++) mem[32'(start)+i] = 8'hFF;
      if (busy && !erasing) for (int unsigned i = 0; i < Page; i += 2) mem[32'(start)+i] = mem[32'(start)+i] & page[i];
      left    <= 0;
      enabled <= 1'b0;
      bits    <= 0;
    end else begin
      if (busy) begin
        left <= left - 1;
        if (left == 1) begin
          enabled <= 1'b0;
          if (erasing)
            for (int unsigned i = 0; i < Sector; i++) mem[32'(start)+i] = 8'hFF;
          else
            for (int unsigned i = 0; i < Page; i++) mem[32'(start)+i] = mem[32'(start)+i] & page[i];
        end
      end
      if (cs_ni) begin
        bits <= 0;
        if (!cs_q && bits != 0 && bits % 8 == 0 && !busy) begin
          if (command == 8'h06) enabled <= 1'b1;
          if (command == 8'h02 && enabled && bits > 32) begin
            left     <= ProgramCycles;
            erasing  <= 1'b0;
            start    <= {address[23:8], 8'h00};
            programs <= programs + 1;
          end
          if (command == 8'h20 && enabled && bits == 32) begin
            left    <= EraseCycles;
            erasing <= 1'b1;
            start   <= {address[23:12], 12'h000};
            erases  <= erases + 1;
          end
        end
      end else if (sck_i && !sck_q) begin
        shift_in <= received;
        bits     <= bits + 1;
        if (bits == 7) begin
          command <= received;
          filled  <= 0;
          if (!busy) for (int unsigned i = 0; i < Page; i++) page[i] = 8'hFF;
        end
        if (bits == 15) address[23:16] <= received;
        if (bits == 23) address[15:8] <= received;
        if (bits == 31) address[7:0] <= received;
        if (bits > 32 && bits % 8 == 7 && command == 8'h02 && !busy) begin
          page[(32'(address[7:0])+filled)%Page] = received;
          filled <= filled + 1;
        end
      end else if (!sck_i && sck_q) begin
        shift_out <= {shift_out[6:0], 1'b0};
        if (bits % 8 == 0) begin
          shift_out <= 8'hFF;
          if (command == 8'h05) shift_out <= {6'd0, enabled, busy};
          else if (!busy && command == 8'h9F && bits <= 24) shift_out <= Identity[(24-bits)+:8];
          else if (!busy && command == 8'h03 && bits >= 32) begin
            shift_out <= mem[32'(address)];
            address   <= address + 24'd1;
          end
        end
      end
    end
  end

  assign miso_o = cs_ni || !power_i || shift_out[7];

endmodule
`default_nettype wire
