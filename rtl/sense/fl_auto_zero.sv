// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Auto-zero: averages 2^log2 raw codes of every channel and hands the means out as offsets.
//
// Codes are aligned to 2^10 sets when they are added (code * 2^(10 - log2)), so that the sum is Q12.10 for every log2
// and the mean is one rounding: offset = (sum + 2^5) >> 6, Q12.4 in converter LSB, range 0..65520. No overflow.
// The average begins with the first whole set after start_i; start_i while busy begins again. log2_i above 10 counts
// as 10. log2_i and mask_i are taken at start_i.
//
// Latency: offset_we_o for a channel two clocks after its code of the last set; busy_o falls with the last channel's.
`default_nettype none
module fl_auto_zero
  import fl_pkg::*;
#(
    parameter int unsigned Channels = 9
) (
    input  logic                     clk_i,
    input  logic                     rst_i,
    input  logic                     start_i,
    input  logic      [         3:0] log2_i,        // number of averaged sets
    input  logic      [Channels-1:0] mask_i,        // channels whose offset is written
    input  logic                     set_i,         // a set begins; its codes follow in the next Channels clocks
    input  logic                     code_valid_i,  // code_i belongs to channel_i, Channels - 1 the last
    input  logic      [         3:0] channel_i,
    input  adc_code_t                code_i,
    output logic                     busy_o,
    output logic      [Channels-1:0] offset_we_o,
    output logic      [        17:0] offset_o       // signed Q12.4, for the channels in offset_we_o
);

  localparam logic [3:0] MaxLog2 = 4'd10;
  localparam int unsigned SumWidth = AdcWidth + 10;

  (* no_rw_check *) logic [SumWidth-1:0] sum_mem[Channels];

  logic busy_q, include_q, first_q;
  logic [10:0] left_q;  // sets still to be averaged, this one included
  logic [3:0] shift_q;  // 10 - log2
  logic [Channels-1:0] mask_q;

  logic [SumWidth-1:0] aligned, sum;
  logic [SumWidth-1:0] sum_q;
  logic [Channels-1:0] done_q, we_q;  // one hot
  logic [17:0] offset_q;
  logic last_set, last_code;

  assign aligned   = SumWidth'(code_i) << shift_q;
  assign sum       = (first_q ? '0 : sum_mem[channel_i]) + aligned;
  assign last_set  = left_q == 11'd1;
  assign last_code = 32'(channel_i) == Channels - 1;

  always_ff @(posedge clk_i) begin
    done_q <= '0;
    we_q   <= '0;
    if (include_q && code_valid_i) begin
      sum_mem[channel_i] <= sum;
      sum_q              <= sum;
      if (last_set) done_q <= mask_q & (Channels'(1) << channel_i);
      if (last_code) begin
        first_q   <= 1'b0;
        include_q <= 1'b0;
        left_q    <= left_q - 11'd1;
      end
    end
    if (done_q != '0) begin
      offset_q <= 18'((sum_q + SumWidth'(32)) >> 6);
      we_q     <= done_q;
    end
    if (set_i) include_q <= busy_q && left_q != '0;
    if (busy_q && left_q == '0 && done_q == '0) busy_q <= 1'b0;
    if (start_i) begin
      busy_q    <= 1'b1;
      include_q <= 1'b0;
      first_q   <= 1'b1;
      left_q    <= 11'd1 << ((log2_i > MaxLog2) ? MaxLog2 : log2_i);
      shift_q   <= (log2_i > MaxLog2) ? 4'd0 : MaxLog2 - log2_i;
      mask_q    <= mask_i;
      done_q    <= '0;
      we_q      <= '0;
    end
    if (rst_i) begin
      busy_q    <= 1'b0;
      include_q <= 1'b0;
      first_q   <= 1'b0;
      left_q    <= '0;
      done_q    <= '0;
      we_q      <= '0;
    end
  end

  assign busy_o      = busy_q;
  assign offset_we_o = we_q;
  assign offset_o    = offset_q;

endmodule
`default_nettype wire
