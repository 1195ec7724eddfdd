// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the carrier for all inputs: it counts every clock of exactly the period of its settings and then starts anew,
// before that only for a commutation under CSC. No pulse and no gap is shorter than the minimum pulse but for one that a
// commutation ends.
//
// Assumed: one minimum pulse, whichever, from the first update on; one of the three alignments; a commutation for which the
// carrier waits is not called off, by the alignment neither, and comes within three minimum pulses.
`default_nettype none
module fl_carrier_f
  import fl_pkg::*;
(
    input logic            clk_i,
    input logic            rst_i,
    input stamp_t          now_i,
    input logic            update_i,
    input comm_alignment_e cfg_commutation_i,
    input logic [15:0]     cfg_period_i,
    input logic [23:0]     cfg_duty_q8_i,
    input logic [11:0]     cfg_min_pulse_i,
    input logic            comm_valid_i,
    input logic            sched_valid_i,
    input stamp_t          comm_sched_i
);

  logic apply_o, pulse_o, carrier_start_o;
  logic [15:0] count_o, dropped_o;

  fl_carrier dut (.*);

  logic [11:0] shortest;  // minimum pulse
  assign shortest = cfg_min_pulse_i;
  logic [16:0] four;  // periods are no shorter than that
  logic overdue;  // the pulse goes on beyond its width
  assign four    = (shortest == '0) ? 17'd4 : 17'(shortest) << 2;
  assign overdue = dut.next_q > 17'(dut.width_q);

  // Settings of the last update, and the period they make, as it was three clocks ago: a carrier that starts now has that.
  logic [15:0] cfg_period_q;
  logic [11:0] cfg_min_q;
  comm_alignment_e alignment_q;
  logic updated_q;
  logic [16:0] legal, legal1_q, legal2_q, legal3_q;
  always_comb begin
    legal = {1'b0, cfg_period_q};
    if (legal < 17'd4) legal = 17'd4;
    if (legal < 17'({cfg_min_q, 2'b00})) legal = 17'({cfg_min_q, 2'b00});
  end

  logic first = 1'b1;
  logic rst_q, comm_q, csc_q, pulse_q, near_q;
  logic [15:0] count_q;
  logic [11:0] shortest_q;
  logic [16:0] period, period_q;  // of the running carrier
  logic [11:0] owed, owed_q;  // clocks that the pulse's level must still last after this one
  logic [13:0] near_age, near_age_q;  // clocks for which a commutation has been near; saturates
  assign period = carrier_start_o ? legal3_q : period_q;
  always_comb begin
    owed = (owed_q == '0) ? '0 : owed_q - 12'd1;
    if (pulse_o != pulse_q) owed = (shortest == '0) ? '0 : shortest - 12'd1;
    if (rst_q) owed = '0;
    near_age = '0;
    if (dut.near_q) near_age = (near_age_q == '1) ? near_age_q : near_age_q + 14'd1;
  end

  always_ff @(posedge clk_i) begin
    first    <= 1'b0;
    rst_q    <= rst_i;
    comm_q   <= comm_valid_i;
    csc_q    <= alignment_q == CommCsc;
    near_q   <= dut.near_q;
    near_age_q <= near_age;
    shortest_q <= shortest;
    pulse_q  <= pulse_o;
    count_q  <= count_o;
    period_q <= period;
    legal1_q <= legal;
    legal2_q <= legal1_q;
    legal3_q <= legal2_q;
    if (update_i) begin
      cfg_period_q <= cfg_period_i;
      cfg_min_q    <= cfg_min_pulse_i;
      alignment_q  <= cfg_commutation_i;
      updated_q    <= 1'b1;
    end
    owed_q   <= owed;
    if (rst_i) begin
      period_q     <= 17'h10000;
      cfg_period_q <= '1;
      cfg_min_q    <= '0;
      alignment_q  <= CommCsc;
      updated_q    <= 1'b0;
      legal1_q     <= 17'hFFFF;
      legal2_q     <= 17'h10000;
    end
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        assume (shortest == shortest_q);
        if (near_q && !comm_q && !rst_q) assume (dut.near_q);
        assume (14'(near_age) <= 14'({1'b0, shortest, 1'b0}) + 14'(shortest));
        if (dut.near_q) assume (alignment_q != CommRsc);
        assume (alignment_q == CommCsc || alignment_q == CommNsc || alignment_q == CommRsc);

        // Verifies: PWM-12
        a_counts : assert (rst_q || (carrier_start_o ? count_o == '0 : count_o == count_q + 16'd1));
        a_reload : assert (rst_q || carrier_start_o == (17'(count_q) + 17'd1 == period_q || (comm_q && csc_q)));
        a_period : assert (17'(count_o) < period);
        // The level of the clock before has ended.
        // Verifies: PWM-13
        if (!rst_q && pulse_o != pulse_q && !comm_q) a_shortest : assert (owed_q == '0);

        // Invariants.
        assert (dut.period_a_q == cfg_period_q && dut.min_q == cfg_min_q && dut.commutation_q == alignment_q);
        assert (17'(dut.period_b_q) == legal1_q);
        assert (17'(dut.last_c_q) + 17'd1 == legal2_q);
        assert (17'(dut.last_q) + 17'd1 == period && dut.end_q == period);
        assert (dut.next_q == 17'(dut.count_q) + 17'd1);
        assert (dut.wrap_q == (dut.count_q == dut.last_q));

        // No pulse before the first update.
        assert (dut.min_q == (updated_q ? shortest : '0));
        assert (updated_q || (dut.duty_a_q == '0 && dut.duty_b_q == '0 && dut.none_c_q && !pulse_o));
        assert (updated_q || (dut.commutation_q == CommCsc && cfg_period_q == '1 && !dut.held_q && owed == '0));
        assert (legal1_q >= four && legal2_q >= four && period >= four);
        // The plan, the running carrier.
        assert (dut.none_c_q || dut.full_c_q ||
            (dut.width_c_q >= 16'(shortest) && 17'(dut.width_c_q) + 17'(shortest) <= legal2_q));
        if (shortest <= 12'd1) assert (owed == '0);
        else begin
          assert (owed < shortest);
          if (pulse_o && !dut.full_q) begin
            assert (overdue ? dut.near_q : dut.next_q + 17'(owed) <= 17'(dut.width_q));
            assert (17'(dut.width_q) + 17'(shortest) <= period);
          end
          if (dut.held_q) assert (dut.near_q && !pulse_o && 17'(near_age) >= dut.next_q);
          if (dut.held_q && !dut.full_q) assert (17'(dut.width_q) + 17'(shortest) <= period);
          // Until the carrier's end.
          if (!pulse_o || (dut.full_q && !dut.early_q)) begin
            assert (dut.next_q + 17'(owed) <= period);
          end
        end
      end
  end

endmodule
`default_nettype wire
