// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Serial receiver: start bit, 8 data bits (least significant first), stop bit, sampled in the middle of each bit.
//
// rx_i is already synchronous. A start bit that is gone at its middle is a glitch and ignored. valid_o and
// frame_error_o (stop bit low) are pulses in the clock after the middle of the stop bit; after a frame error the line
// must go idle before the next start bit counts. A bit lasts max(bit_cycles_i, 8) clocks.
`default_nettype none
module fl_uart_rx (
    input logic clk_i,
    input logic rst_i,

    input logic [15:0] bit_cycles_i,
    input logic        rx_i,

    output logic       valid_o,
    output logic [7:0] data_o,
    output logic       frame_error_o
);

  localparam logic [15:0] MinBitCycles = 16'd8;

  typedef enum logic [1:0] {
    StIdle,   // line high, waiting for a falling edge
    StStart,  // to the middle of the start bit
    StBits,   // to the middle of each data bit and the stop bit
    StBreak   // stop bit was low: wait for the line to go high
  } state_e;

  state_e state_q, state_d;
  logic [15:0] left_q, left_d;  // clocks to the next sampling instant
  logic [3:0] count_q, count_d;  // data bits received
  logic [7:0] data_d;
  logic valid_d, frame_error_d;
  logic [15:0] bit_cycles;

  assign bit_cycles = (bit_cycles_i < MinBitCycles) ? MinBitCycles : bit_cycles_i;

  always_comb begin
    state_d       = state_q;
    left_d        = left_q - 1'b1;
    count_d       = count_q;
    data_d        = data_o;
    valid_d       = 1'b0;
    frame_error_d = 1'b0;
    unique case (state_q)
      StIdle: begin
        left_d  = bit_cycles >> 1;
        count_d = '0;
        if (!rx_i) state_d = StStart;
      end
      StStart: begin
        if (left_q == 16'd1) begin
          left_d  = bit_cycles;
          state_d = rx_i ? StIdle : StBits;
        end
      end
      StBits: begin
        if (left_q == 16'd1) begin
          left_d = bit_cycles;
          if (count_q == 4'd8) begin
            valid_d       = rx_i;
            frame_error_d = !rx_i;
            state_d       = rx_i ? StIdle : StBreak;
          end else begin
            data_d  = {rx_i, data_o[7:1]};
            count_d = count_q + 1'b1;
          end
        end
      end
      StBreak: if (rx_i) state_d = StIdle;
      default: state_d = StIdle;
    endcase
  end

  always_ff @(posedge clk_i) begin
    state_q       <= state_d;
    left_q        <= left_d;
    count_q       <= count_d;
    data_o        <= data_d;
    valid_o       <= valid_d;
    frame_error_o <= frame_error_d;
    if (rst_i) begin
      state_q       <= StIdle;
      valid_o       <= 1'b0;
      frame_error_o <= 1'b0;
    end
  end

endmodule
`default_nettype wire
