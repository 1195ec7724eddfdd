// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Current window: the mean of the phase currents over a window of the carrier, with the instant that it belongs to.
//
//   mean = floor((sum + floor(n/2)) / n)   of n samples, exact (offset binary, three quotient bits a clock)
//
// start_i at clock k: the window's first clock is k + StartToWindowCycles + cfg_from_i, its length cfg_length_i clocks; a
// sample belongs to it if its strobe does, whenever it arrives. instant_o is high in the window's clock
// floor(length/2): there the angle is to be latched; time_o is that clock's time less cfg_delay_i, as fl_sense stamps.
// Samples s clocks apart whose first falls into the window's first clock have their mean instant there (to half a
// clock) if length = (n - 1) * s + 1.
// Length 0: the first sample strobed in that clock or later; instant_o with its strobe, time_o its own stamp.
//
// Windows may touch (length = distance of the starts) and may reach into the next carrier. No output is given for a
// window that the next one cuts short, that holds no sample, or of which a sample was lost or had not arrived when the
// first sample of the next window did.
//
// Formats: samples signed 18 bit, 2^17 = full scale; at most 255 samples a window count, further ones are left out.
// Latency: sample_valid_i of the window's last sample, or the window's last clock if that is later, to valid_o:
// MeanLatency clocks; length 0: SingleLatency. current_o, time_o and samples_o stay until the next valid_o.
// Settings are taken in the clock before the window's first. Least distance of two windows' ends: 7 clocks.
// Asserted: a division is finished before the next begins.
`default_nettype none
module fl_current_window
  import fl_pkg::*;
#(
    parameter int unsigned Phases = 3,
    localparam int unsigned StartToWindowCycles = 1,
    localparam int unsigned MeanLatency = 8,
    localparam int unsigned SingleLatency = 1
) (
    input  logic                  clk_i,
    input  logic                  rst_i,
    input  stamp_t                now_i,
    input  logic                  start_i,         // first clock of a carrier, or an update
    input  logic    [      15:0]  cfg_from_i,      // clocks
    input  logic    [      15:0]  cfg_length_i,    // clocks, 0: one sample
    input  logic    [      15:0]  cfg_delay_i,     // clocks, as at fl_sense
    input  logic                  strobe_i,        // the converter samples
    input  logic                  sample_valid_i,
    input  sample_t [Phases-1:0]  sample_i,        // phase currents
    input  stamp_t                sample_time_i,
    output logic                  instant_o,       // latch the angle now
    output logic                  valid_o,
    output sample_t [Phases-1:0]  current_o,
    output stamp_t                time_o,
    output logic    [       7:0]  samples_o        // number averaged
);

  if (Phases == 0) begin : gen_illegal
    $fatal(1, "fl_current_window: Phases must be at least 1 (%m)");
  end

  localparam int unsigned SumWidth = SampleWidth + 8;
  localparam int unsigned BitsPerClock = 3;
  localparam logic [2:0] LastDigit = 3'(SampleWidth / BitsPerClock - 1);

  typedef logic [SampleWidth-1:0] offset_binary_t;
  typedef logic [SumWidth-1:0] sum_t;

  function automatic offset_binary_t to_offset_binary(sample_t x);
    return {!x[SampleWidth-1], x[SampleWidth-2:0]};
  endfunction

  // From the start to the window.
  logic [15:0] wait_d, wait_q;
  logic restart_d, restart_q, open_d, open_q;

  assign wait_d    = start_i ? cfg_from_i : wait_q;
  assign restart_d = start_i || restart_q;
  assign open_d    = restart_d && wait_d == '0;

  // The window at the strobes; slot_q is its number modulo 2, what the samples need of it is kept until the next but
  // one.
  logic slot_q, running_q, waiting_q;
  logic [15:0] length_q, delay_q, elapsed_d, elapsed_q;
  stamp_t shifted_now;
  logic in_window, whole, single, take_strobe;
  // Of the newest window and the one before: first clock, first clock after it, middle.
  stamp_t newest_open_d, newest_open_q, newest_close_d, newest_close_q, newest_middle_d, newest_middle_q;
  stamp_t older_open_q, older_close_q, older_middle_q;
  logic [1:0][7:0] expected_q;
  logic [1:0] whole_q;  // ran to its end
  logic want_q, got_single;  // length 0: the sample strobed at want_time_q is to come
  stamp_t want_time_q;

  assign shifted_now = now_i - stamp_t'(delay_q);
  assign elapsed_d   = open_q ? '0 : elapsed_q;
  assign single      = length_q == '0;
  assign in_window      = (open_q && !single) || running_q;
  assign whole       = in_window && elapsed_d == length_q - 16'd1;
  assign take_strobe = single && strobe_i && (open_q || waiting_q);
  assign got_single  = want_q && sample_valid_i && sample_time_i == want_time_q;
  assign instant_o   = take_strobe || (in_window && elapsed_d == length_q >> 1);

  // The samples.
  logic in_newest, in_older, add, fresh, complete;
  logic acc_slot_q, acc_open_q;
  logic [7:0] count_q;
  sum_t [Phases-1:0] sum_q;

  function automatic logic earlier(stamp_t x, stamp_t y);
    return signed'(x - y) < 0;
  endfunction

  assign newest_open_d   = open_q ? shifted_now : newest_open_q;
  assign newest_close_d  = open_q ? shifted_now + stamp_t'(length_q) : newest_close_q;
  assign newest_middle_d = open_q ? shifted_now + (stamp_t'(length_q) >> 1) : newest_middle_q;

  assign in_newest  = !earlier(sample_time_i, newest_open_q) && earlier(sample_time_i, newest_close_q);
  assign in_older   = !earlier(sample_time_i, older_open_q) && earlier(sample_time_i, older_close_q);
  assign add        = sample_valid_i && (in_newest || in_older);
  assign fresh      = !acc_open_q || acc_slot_q != (in_newest ? slot_q : !slot_q);
  assign complete   = acc_open_q && whole_q[acc_slot_q] && count_q == expected_q[acc_slot_q];

  always_ff @(posedge clk_i) begin
    wait_q    <= (wait_d == '0) ? '0 : wait_d - 16'd1;
    restart_q <= restart_d && !open_d;
    open_q    <= open_d;
    if (open_d) begin
      slot_q              <= !slot_q;
      length_q            <= cfg_length_i;
      delay_q             <= cfg_delay_i;
      whole_q[!slot_q]    <= 1'b0;
      expected_q[!slot_q] <= '0;
    end
    newest_open_q   <= newest_open_d;
    newest_close_q  <= newest_close_d;
    newest_middle_q <= newest_middle_d;
    if (open_d) begin
      // Until its first clock the newest one holds no sample.
      newest_close_q <= newest_open_d;
      older_open_q   <= newest_open_d;
      older_close_q  <= newest_close_d;
      older_middle_q <= newest_middle_d;
    end
    elapsed_q <= elapsed_d + 16'd1;
    running_q <= in_window && !whole && !open_d;
    waiting_q <= (open_q || waiting_q) && single && !strobe_i && !open_d;
    if (in_window && strobe_i && expected_q[slot_q] != '1) expected_q[slot_q] <= expected_q[slot_q] + 8'd1;
    if (whole) whole_q[slot_q] <= 1'b1;
    if (got_single) want_q <= 1'b0;
    if (take_strobe) begin
      want_q      <= 1'b1;
      want_time_q <= shifted_now;
    end

    if (add) begin
      acc_open_q <= 1'b1;
      acc_slot_q <= in_newest ? slot_q : !slot_q;
      if (fresh || count_q != '1) begin
        count_q <= fresh ? 8'd1 : count_q + 8'd1;
        for (int unsigned x = 0; x < Phases; x++)
          sum_q[x] <= fresh ? SumWidth'(to_offset_binary(sample_i[x])) :
            sum_q[x] + SumWidth'(to_offset_binary(sample_i[x]));
      end
    end
    if (complete) begin
      whole_q[acc_slot_q] <= 1'b0;
      if (!add || !fresh) acc_open_q <= 1'b0;
    end
    if (rst_i) begin
      restart_q  <= 1'b0;
      open_q     <= 1'b0;
      running_q  <= 1'b0;
      waiting_q  <= 1'b0;
      slot_q     <= 1'b0;
      length_q   <= '0;
      newest_open_q  <= '0;
      newest_close_q <= '0;
      older_open_q   <= '0;
      older_close_q  <= '0;
      whole_q    <= '0;
      expected_q <= '0;
      acc_open_q <= 1'b0;
      want_q     <= 1'b0;
    end
  end

  // Division: remainder below the divisor, the dividend's rest moves out at the top of what the quotient fills.
  logic divide_q;
  logic [2:0] digit_q;
  logic [7:0] divisor_q;
  logic [10:0] times3_q, times5_q, times7_q;  // multiples of divisor_q
  logic [7:1][10:0] multiple;
  stamp_t divide_time_q;
  logic [Phases-1:0][7:0] remainder_d, remainder_q;
  offset_binary_t [Phases-1:0] rest_d, rest_q;

  assign multiple = {
    times7_q,
    {times3_q[9:0], 1'b0},
    times5_q,
    {1'b0, divisor_q, 2'b00},
    times3_q,
    {2'b00, divisor_q, 1'b0},
    {3'b000, divisor_q}
  };

  // Three bits of the quotient a clock, by all multiples of the divisor side by side.
  for (genvar x = 0; x < Phases; x++) begin : gen_divider
    logic [10:0] dividend;  // below 8 * divisor_q
    logic [7:0][11:0] left;  // less each multiple
    logic [2:0] digit;
    logic unused;

    assign dividend = {remainder_q[x], rest_q[x][SampleWidth-1-:BitsPerClock]};

    always_comb begin
      left[0] = {1'b0, dividend};
      for (int unsigned n = 1; n < 8; n++) left[n] = {1'b0, dividend} - {1'b0, multiple[n]};
      digit[2] = !left[4][11];
      digit[1] = digit[2] ? !left[6][11] : !left[2][11];
      unique case (digit[2:1])
        2'd0: digit[0] = !left[1][11];
        2'd1: digit[0] = !left[3][11];
        2'd2: digit[0] = !left[5][11];
        2'd3: digit[0] = !left[7][11];
      endcase
      remainder_d[x] = left[digit][7:0];
      rest_d[x]      = {rest_q[x][SampleWidth-1-BitsPerClock:0], digit};
    end

    assign unused = &{1'b0, left};
  end

  // Below n * 2^SampleWidth.
  function automatic sum_t half_more(sum_t sum, logic [7:0] n);
    return sum + SumWidth'(n >> 1);
  endfunction

  logic valid_q;
  sample_t [Phases-1:0] current_q;
  stamp_t time_q;
  logic [7:0] samples_q;

  always_ff @(posedge clk_i) begin
    valid_q  <= 1'b0;
    divide_q <= divide_q && digit_q != LastDigit;
    digit_q  <= digit_q + 3'd1;
    if (divide_q) begin
      remainder_q <= remainder_d;
      rest_q      <= rest_d;
      if (digit_q == LastDigit) begin
        for (int unsigned x = 0; x < Phases; x++) current_q[x] <= sample_t'(to_offset_binary(rest_d[x]));
        valid_q   <= 1'b1;
        time_q    <= divide_time_q;
        samples_q <= divisor_q;
      end
    end
    if (complete) begin
      for (int unsigned x = 0; x < Phases; x++)
        {remainder_q[x], rest_q[x]} <= half_more(sum_q[x], count_q);
      divisor_q     <= count_q;
      times3_q      <= {3'b000, count_q} + {2'b00, count_q, 1'b0};
      times5_q      <= {3'b000, count_q} + {1'b0, count_q, 2'b00};
      times7_q      <= {count_q, 3'b000} - {3'b000, count_q};
      divide_time_q <= (acc_slot_q == slot_q) ? newest_middle_q : older_middle_q;
      divide_q      <= 1'b1;
      digit_q       <= '0;
    end
    if (got_single) begin
      current_q <= sample_i;
      valid_q   <= 1'b1;
      time_q    <= sample_time_i;
      samples_q <= 8'd1;
    end
    if (rst_i) begin
      valid_q   <= 1'b0;
      divide_q  <= 1'b0;
      current_q <= '0;
      time_q    <= '0;
      samples_q <= '0;
    end
  end

  assign valid_o   = valid_q;
  assign current_o = current_q;
  assign time_o    = time_q;
  assign samples_o = samples_q;

  always_ff @(posedge clk_i) begin
    if (!rst_i) begin
      assert (!(complete && divide_q))
      else $error("fl_current_window: a window ended while the mean of the one before was worked out");
    end
  end

endmodule
`default_nettype wire
