// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Serial transmitter: start bit, 8 data bits (least significant first), stop bit.
//
// A byte is taken when valid_i and ready_o are high; frames follow each other without a gap. A bit lasts
// max(bit_cycles_i, 8) clocks; a new bit time takes effect at the next bit.
`default_nettype none
module fl_uart_tx (
    input logic clk_i,
    input logic rst_i,

    input logic [15:0] bit_cycles_i,

    input  logic       valid_i,
    input  logic [7:0] data_i,
    output logic       ready_o,
    output logic       tx_o
);

  localparam logic [15:0] MinBitCycles = 16'd8;

  logic [ 9:0] shift_q;  // next bit at 0; ones follow the stop bit
  logic [ 3:0] bits_q;  // bits left of the frame, 0: idle
  logic [15:0] left_q;  // clocks left of the bit
  logic [15:0] bit_cycles;
  logic        bit_end;

  assign bit_cycles = (bit_cycles_i < MinBitCycles) ? MinBitCycles : bit_cycles_i;
  assign bit_end    = left_q == 16'd1;
  assign ready_o    = bits_q == '0 || (bits_q == 4'd1 && bit_end);

  always_ff @(posedge clk_i) begin
    if (ready_o) begin
      bits_q <= '0;
      tx_o   <= 1'b1;
      if (valid_i) begin
        shift_q <= {1'b1, 1'b1, data_i};
        bits_q  <= 4'd10;
        left_q  <= bit_cycles;
        tx_o    <= 1'b0;
      end
    end else if (bit_end) begin
      shift_q <= {1'b1, shift_q[9:1]};
      tx_o    <= shift_q[0];
      bits_q  <= bits_q - 1'b1;
      left_q  <= bit_cycles;
    end else begin
      left_q <= left_q - 1'b1;
    end
    if (rst_i) begin
      bits_q  <= '0;
      left_q  <= 16'd1;
      shift_q <= '1;
      tx_o    <= 1'b1;
    end
  end

endmodule
`default_nettype wire
