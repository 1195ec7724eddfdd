// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the leg carriers for all inputs: never both requests of a leg, none after reset, while disabled or before new
// compares, all legs or none, at most one edge of a leg in a half carrier. A carrier has every clock of its period, then
// starts anew; period and compares change at updates only, to the newest handed over in time.
//
// The monitors see ports only. The carrier is written down once more beside the block: not as a ramp but as the number of
// the clock in it, and a leg's upper switch by the distance of that clock from the middle. The invariants at the end tie
// the monitors to the block's registers, so that induction closes.
`default_nettype none
module fl_leg_carrier_f #(
    parameter int unsigned Phases = 3
) (
    input logic                    clk_i,
    input logic                    rst_i,
    input logic                    enable_i,
    input logic                    cfg_double_i,
    input logic [      15:0]       cfg_period_i,
    input logic [       7:0]       cfg_miss_limit_i,
    input logic                    compare_valid_i,
    input logic [Phases-1:0][15:0] compare_i,
    input logic [      15:0]       period_i
);

  logic update_o, carrier_start_o, second_o, active_o, fault_o;
  logic [15:0] count_o, missed_o;
  logic [Phases-1:0] req_h_o, req_l_o;

  fl_leg_carrier #(.Phases(Phases)) dut (.*);

  logic first = 1'b1;
  logic allowed_q, handed, handed_q, second_q, driven_q;
  logic [Phases-1:0] req_h_q;

  always_ff @(posedge clk_i) begin
    first     <= 1'b0;
    allowed_q <= enable_i && !rst_i;
    // Compares have been handed over since enable rose.
    handed    <= enable_i && !rst_i && (handed || compare_valid_i);
    handed_q  <= handed;
    second_q  <= second_o;
    req_h_q   <= req_h_o;
    driven_q  <= (req_h_o | req_l_o) != '0;
  end

  // Clock `place` of a carrier of n clocks; the first floor(n / 2) are its first half. The outputs follow a clock later.
  localparam logic [15:0] MinPeriod = 16'd16;
  function automatic logic [15:0] legal(logic [15:0] clocks);
    return clocks < MinPeriod ? MinPeriod : clocks;
  endfunction
  logic run_q;  // the first carrier after a reset has begun
  logic double_q, new_q, active_q;  // new: handed over and not yet taken or replaced
  logic [15:0] place_q, n_q, next_n_q;
  logic [Phases-1:0][15:0] next_q, compare_q;
  logic [15:0] half;
  logic last, turn, change, take;
  assign half   = n_q >> 1;
  assign last   = place_q == n_q - 16'd1;
  assign turn   = place_q + 16'd1 == half;
  assign change = last || (turn && double_q);
  assign take   = change && new_q && enable_i;
  logic [15:0] n_d;
  assign n_d = take ? next_n_q : ((change && !active_q) ? legal(cfg_period_i) : n_q);
  // Outputs: start and update with the first clock, which is two clocks after the one that makes it.
  logic start_q, start_told_q, change_q, change_told_q, second_told_q;
  logic [15:0] count_told_q, missed_q;
  logic [8:0] row_q;
  logic fault_q;
  logic [Phases-1:0] on_q;
  logic asked_q;
  logic [15:0] number;  // least compare that has its upper switch on in this clock
  assign number = place_q < half ? (half - place_q) << 1 : ((place_q - half) << 1) + 16'd1;
  always_ff @(posedge clk_i) begin
    place_q <= last ? '0 : ((turn && change) ? n_d >> 1 : place_q + 16'd1);
    n_q     <= n_d;
    run_q   <= run_q || last;
    if (last) double_q <= cfg_double_i;
    if (compare_valid_i) begin
      next_q   <= compare_i;
      next_n_q <= legal(period_i);
    end
    new_q <= enable_i && (compare_valid_i || (new_q && !change));
    if (take) compare_q <= next_q;
    active_q <= enable_i && (active_q || take);

    start_q       <= last;
    start_told_q  <= start_q;
    change_q      <= change;
    change_told_q <= change_q;
    second_told_q <= place_q >= half;
    count_told_q  <= start_q ? '0 : count_told_q + 16'd1;
    asked_q       <= enable_i && active_q;
    // Even numbers down to the middle, odd ones up from it.
    for (int unsigned x = 0; x < Phases; x++) on_q[x] <= number <= compare_q[x];

    if (change && active_q && enable_i && !new_q) begin
      missed_q <= missed_q + 16'd1;
      row_q    <= row_q + {8'b0, !row_q[8]};
      if (cfg_miss_limit_i != '0 && row_q + 9'd1 >= {1'b0, cfg_miss_limit_i}) fault_q <= 1'b1;
    end
    if (take || !enable_i) row_q <= '0;
    if (!enable_i) fault_q <= 1'b0;
    if (rst_i) begin
      run_q         <= 1'b0;
      place_q       <= MinPeriod - 16'd1;  // the first carrier starts after this clock
      n_q           <= MinPeriod;
      double_q      <= 1'b0;
      new_q         <= 1'b0;
      active_q      <= 1'b0;
      start_q       <= 1'b0;
      start_told_q  <= 1'b0;
      change_q      <= 1'b0;
      change_told_q <= 1'b0;
      second_told_q <= 1'b0;
      count_told_q  <= '0;
      asked_q       <= 1'b0;
      missed_q      <= '0;
      row_q         <= '0;
      fault_q       <= 1'b0;
    end
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        // Verifies: VPWM-06
        a_never_both : assert ((req_h_o & req_l_o) == '0);
        if (!allowed_q) a_off : assert ((req_h_o | req_l_o) == '0);
        if (!handed_q) a_fresh : assert ((req_h_o | req_l_o) == '0);
        a_all_or_none : assert ((req_h_o | req_l_o) == '0 || (req_h_o ^ req_l_o) == '1);
        if (driven_q && (req_h_o | req_l_o) != '0 && !update_o) begin
          // Verifies: VPWM-06
          if (!second_o) a_first_half_rises : assert ((req_h_q & ~req_h_o) == '0);
          if (second_o && second_q) a_second_half_falls : assert ((~req_h_q & req_h_o) == '0);
          if (second_o && !second_q) a_middle_keeps : assert ((req_h_q & ~req_h_o) == '0);
        end
        if (fault_o) a_fault_enabled : assert (allowed_q);
        // The carrier has all its clocks and is never left out or begun again; what is asked for follows from its clock.
        // Verifies: VPWM-09
        a_start : assert (carrier_start_o == start_told_q);
        a_update : assert (update_o == change_told_q);
        a_second : assert (second_o == second_told_q);
        a_count : assert (count_o == count_told_q);
        a_compare : assert (req_h_o == (asked_q ? on_q : '0));
        a_requests : assert ((req_h_o | req_l_o) == {Phases{asked_q}});
        a_active : assert (active_o == active_q);
        a_missed : assert (missed_o == missed_q);
        a_fault : assert (fault_o == fault_q);

        // Invariants.
        assert (n_q >= MinPeriod && place_q < n_q && dut.period_q == n_q && dut.double_q == double_q);
        assert (dut.second_q == (place_q >= half));
        assert (dut.ramp_q == (run_q ? number : '1));
        assert (run_q || (place_q == MinPeriod - 16'd1 && n_q == MinPeriod));
        assert (dut.fresh_q == new_q && dut.start1_q == start_q && dut.update1_q == change_q);
        assert (!new_q || (dut.shadow_q == next_q && dut.shadow_period_q == next_n_q && next_n_q >= MinPeriod));
        assert (!active_q || dut.compare_q == compare_q);
        assert (row_q <= 9'd256 && dut.row_q == (row_q[8] ? 8'hFF : row_q[7:0]) && dut.fault_q == fault_q);
        assert (!dut.fresh_q || handed);
        assert (!dut.active_q || handed);
        assert (!(dut.active_q || dut.fresh_q || dut.fault_q) || allowed_q);
        assert (dut.second_q == dut.ramp_q[0]);
      end
  end

endmodule
`default_nettype wire
