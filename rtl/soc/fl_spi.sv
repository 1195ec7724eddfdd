// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// SPI master of one byte at a time, mode 0: the clock rests low, a bit changes when it falls and is taken when it has
// been high, highest bit first. The chip select is the caller's.
//
// cfg_half_cycles_i: half a period of sck_o in clocks, 1..255, 0 counts as 1; held while busy_o is high.
// miso_i passes one flip-flop without synchroniser: the device changes it in answer to sck_o. It must be valid at the
// clock edge half a period after sck_o has risen, less one clock.
// Latency: start_i to the end of busy_o and to data_o 16 * half_cycles + 1 clocks; data_o is valid from then to the next
// start. A start while busy is ignored.
`default_nettype none
module fl_spi (
    input logic clk_i,
    input logic rst_i,

    input  logic [7:0] cfg_half_cycles_i,
    input  logic       start_i,
    input  logic [7:0] data_i,
    output logic       busy_o,
    output logic [7:0] data_o,

    output logic sck_o,
    output logic mosi_o,
    input  logic miso_i
);

  logic busy_q, sck_q, miso_q;
  logic [7:0] shift_q, wait_q;
  logic [2:0] bit_q;

  always_ff @(posedge clk_i) begin
    miso_q <= miso_i;
    if (!busy_q) begin
      wait_q <= cfg_half_cycles_i;
      bit_q  <= '0;
      busy_q <= start_i;
      if (start_i) shift_q <= data_i;
    end else if (wait_q > 8'd1) begin
      wait_q <= wait_q - 8'd1;
    end else begin
      wait_q <= cfg_half_cycles_i;
      sck_q  <= !sck_q;
      if (sck_q) begin
        shift_q <= {shift_q[6:0], miso_q};
        bit_q   <= bit_q + 3'd1;
        busy_q  <= bit_q != 3'd7;
      end
    end
    if (rst_i) begin
      busy_q  <= 1'b0;
      sck_q   <= 1'b0;
      shift_q <= '0;
    end
  end

  assign busy_o = busy_q;
  assign data_o = shift_q;
  assign sck_o  = sck_q;
  assign mosi_o = shift_q[7];

endmodule
`default_nettype wire
