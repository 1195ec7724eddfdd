// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Leg carriers of the vector path: one centre-aligned carrier, a compare for every leg, shadow registers with a
// deadline, complementary gate requests.
//
// Carrier of n = period clocks. The ramp goes down over the even numbers (first half, floor(n/2) clocks) and up over the
// odd ones (second half, ceil(n/2) clocks): n & ~1, ..., 4, 2, 1, 3, ..., so that it takes each of 1..n once. Leg x
// asks for its upper switch while ramp <= compare[x], else for the lower one: exactly min(compare, n) clocks a carrier,
// of them floor(compare/2) before the middle and ceil(compare/2) after it. 0 and n and more have no edge.
//
// Updates: at the carrier's start, with cfg_double_i (taken over there) also at its middle; the halves of a pulse then
// follow from different compares. An update takes the newest compare_valid_i since the update before: compares together
// with the period that they were made for, which so changes at updates only and in double update may change at the
// middle. compare_valid_i at clock k is in time for update_o at k + ValidToUpdateCycles and later.
//
// Deadline: an update without new compares keeps the old ones and counts in missed_o; after cfg_miss_limit_i (0: never)
// in a row fault_o rises and stays until enable_i falls.
// Enable: requests begin with the first update that has compares of the time since enable_i rose; deadlines count from
// the update after it. They end in the clock after enable_i falls. Until they begin the carrier runs with cfg_period_i.
//
// Formats: clocks. Periods below 16 count as 16. Latency of the requests to update_o, carrier_start_o, second_o and
// count_o: none, all are registers of the same stage; the guard follows one clock later. After a reset a carrier starts
// 2 clocks after rst_i falls.
// Asserted: no leg is asked for both switches. Proved for all inputs: cocotb_tests/pwm/fl_leg_carrier.sby.
`default_nettype none
module fl_leg_carrier #(
    parameter int unsigned Phases = 3,
    localparam int unsigned ValidToUpdateCycles = 3
) (
    input  logic                    clk_i,
    input  logic                    rst_i,
    input  logic                    enable_i,
    input  logic                    cfg_double_i,      // update at the middle too
    input  logic [      15:0]       cfg_period_i,      // clocks, while no requests are made
    input  logic [       7:0]       cfg_miss_limit_i,  // missed updates in a row that are a fault, 0: never
    input  logic                    compare_valid_i,
    input  logic [Phases-1:0][15:0] compare_i,         // clocks a carrier with the upper switch on
    input  logic [      15:0]       period_i,          // clocks, belongs to compare_i
    output logic                    update_o,          // first clock after an update instant, whether new or missed
    output logic                    carrier_start_o,   // first clock of a carrier
    output logic                    second_o,          // second half of the carrier
    output logic [      15:0]       count_o,           // clocks since the carrier start
    output logic                    active_o,          // requests are made
    output logic [      15:0]       missed_o,          // updates without new compares, wraps
    output logic                    fault_o,
    output logic [Phases-1:0]       req_h_o,
    output logic [Phases-1:0]       req_l_o
);

  if (Phases == 0) begin : gen_illegal
    $fatal(1, "fl_leg_carrier: Phases must be at least 1 (%m)");
  end

  localparam logic [15:0] MinPeriod = 16'd16;

  function automatic logic [15:0] legal_period(logic [15:0] period);
    return (period < MinPeriod) ? MinPeriod : period;
  endfunction

  // Shadow registers.
  logic fresh_q;  // not used by an update yet
  logic [Phases-1:0][15:0] shadow_q;
  logic [15:0] shadow_period_q;

  // Stage 1: the ramp and what the running half uses.
  logic second_d, second_q, double_q, active_q;
  logic [15:0] ramp_d, ramp_q, period_d, period_q;
  logic [Phases-1:0][15:0] compare_q;
  logic middle, wrap, update, take;
  logic start1_q, update1_q;

  assign middle = !second_q && ramp_q <= 16'd2;
  assign wrap   = second_q && ramp_q >= period_q - 16'd1;
  assign update = wrap || (middle && double_q);
  assign take   = update && fresh_q && enable_i;

  always_comb begin
    period_d = period_q;
    if (take) period_d = shadow_period_q;
    else if (update && !active_q) period_d = legal_period(cfg_period_i);
    second_d = second_q;
    ramp_d   = second_q ? ramp_q + 16'd2 : ramp_q - 16'd2;
    if (wrap) begin
      second_d = 1'b0;
      ramp_d   = {period_d[15:1], 1'b0};
    end else if (middle) begin
      second_d = 1'b1;
      ramp_d   = 16'd1;
    end
  end

  logic missed;
  logic [7:0] row_q;  // missed updates in a row
  logic [15:0] missed_q;
  logic fault_q;
  assign missed = update && active_q && enable_i && !fresh_q;

  always_ff @(posedge clk_i) begin
    if (compare_valid_i) begin
      shadow_q        <= compare_i;
      shadow_period_q <= legal_period(period_i);
    end
    fresh_q   <= enable_i && (compare_valid_i || (fresh_q && !update));
    active_q  <= enable_i && (active_q || take);
    second_q  <= second_d;
    ramp_q    <= ramp_d;
    period_q  <= period_d;
    start1_q  <= wrap;
    update1_q <= update;
    if (take) compare_q <= shadow_q;
    if (wrap) double_q <= cfg_double_i;
    if (missed) begin
      missed_q <= missed_q + 16'd1;
      if (row_q != '1) row_q <= row_q + 8'd1;
      if (cfg_miss_limit_i != '0 && row_q >= cfg_miss_limit_i - 8'd1) fault_q <= 1'b1;
    end
    if (take) row_q <= '0;
    if (!enable_i) begin
      row_q   <= '0;
      fault_q <= 1'b0;
    end
    if (rst_i) begin
      fresh_q   <= 1'b0;
      active_q  <= 1'b0;
      second_q  <= 1'b1;
      ramp_q    <= '1;
      period_q  <= MinPeriod;
      start1_q  <= 1'b0;
      update1_q <= 1'b0;
      double_q  <= 1'b0;
      missed_q  <= '0;
      row_q     <= '0;
      fault_q   <= 1'b0;
    end
  end

  // Stage 2: requests, and the carrier's signals beside them.
  logic [Phases-1:0] on, req_h_q, req_l_q;
  logic start_q, update_q, second2_q;
  logic [15:0] count_q;

  always_comb begin
    for (int unsigned x = 0; x < Phases; x++) on[x] = ramp_q <= compare_q[x];
  end

  always_ff @(posedge clk_i) begin
    req_h_q   <= (enable_i && active_q) ? on : '0;
    req_l_q   <= (enable_i && active_q) ? ~on : '0;
    start_q   <= start1_q;
    update_q  <= update1_q;
    second2_q <= second_q;
    count_q   <= start1_q ? '0 : count_q + 16'd1;
    if (rst_i) begin
      req_h_q   <= '0;
      req_l_q   <= '0;
      start_q   <= 1'b0;
      update_q  <= 1'b0;
      second2_q <= 1'b0;
      count_q   <= '0;
    end
  end

  assign update_o        = update_q;
  assign carrier_start_o = start_q;
  assign second_o        = second2_q;
  assign count_o         = count_q;
  assign active_o        = active_q;
  assign missed_o        = missed_q;
  assign fault_o         = fault_q;
  assign req_h_o         = req_h_q;
  assign req_l_o         = req_l_q;

  always_ff @(posedge clk_i) begin
    if (!rst_i) begin
      assert ((req_h_q & req_l_q) == '0)
      else $error("fl_leg_carrier: both switches of a leg requested");
    end
  end

endmodule
`default_nettype wire
