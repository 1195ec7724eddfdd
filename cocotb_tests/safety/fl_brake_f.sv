// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the brake chopper for all codes and every longest on-time: off in the clock after a reset, a code below "off",
// or without enable; on only by a code above "on", and always by it while time is left; never longer in all, between two
// codes below "off", than the longest time; off for good after it until such a code, and told. For every age up to
// Oldest: off when the sample set is as old. Which clocks had one is kept here in a shift register, not counted.
`default_nettype none
module fl_brake_f
  import fl_pkg::*;
#(
    parameter int unsigned Oldest = 6
) (
    input logic             clk_i,
    input logic             rst_i,
    input logic             enable_i,
    input adc_code_t        cfg_on_lsb_i,
    input adc_code_t        cfg_off_lsb_i,
    input logic      [31:0] cfg_longest_cycles_i,
    input logic      [19:0] cfg_age_cycles_i,
    input logic             adc_valid_i,
    input adc_code_t        vdc_i
);

  logic brake, overload;
  fl_brake dut (
      .clk_i,
      .rst_i,
      .enable_i,
      .cfg_on_lsb_i,
      .cfg_off_lsb_i,
      .cfg_longest_cycles_i,
      .cfg_age_cycles_i,
      .adc_valid_i,
      .vdc_i,
      .brake_o   (brake),
      .overload_o(overload)
  );

  logic first = 1'b1;
  logic rst_q, off_q, above_q, below_q, enable_q, brake_q, overload_q;
  logic [31:0] longest_q, past_q;  // clocks with the switch on since the last code below "off", without this one
  logic [19:0] age_q;
  logic [Oldest-1:0] quiet_q;  // the last clocks, newest in bit 0: no sample set
  logic [31:0] total;
  assign total = past_q + 32'(brake);

  logic below;
  assign below = adc_valid_i && vdc_i < cfg_off_lsb_i;
  always_ff @(posedge clk_i) begin
    first      <= 1'b0;
    rst_q      <= rst_i;
    above_q    <= adc_valid_i && vdc_i > cfg_on_lsb_i;
    below_q    <= below;
    enable_q   <= enable_i;
    brake_q    <= brake;
    overload_q <= overload;
    longest_q  <= cfg_longest_cycles_i;
    age_q      <= cfg_age_cycles_i;
    past_q     <= (rst_i || below) ? '0 : total;
    quiet_q    <= rst_i ? '0 : {quiet_q[Oldest-2:0], !adc_valid_i};
  end

  logic stale;  // no set in the last clocks, as many as the age
  always_comb begin
    stale = cfg_age_cycles_i == '0 && quiet_q[0];
    for (int unsigned i = 0; i < Oldest; i++) begin
      stale |= cfg_age_cycles_i == 20'(i + 1) && (quiet_q & Oldest'((64'd1 << (i + 1)) - 1)) == Oldest'((64'd1 << (i + 1)) - 1);
    end
  end

  always_comb begin
    if (first) assume (rst_i);
    else begin
      // Locked; short enough for the shift register.
      assume (cfg_longest_cycles_i == longest_q);
      assume (cfg_age_cycles_i == age_q && cfg_age_cycles_i <= 20'(Oldest));
      assert (dut.used_q == total);
      for (int unsigned i = 0; i < Oldest; i++) begin
        assert ((dut.age_q > 20'(i)) == ((quiet_q & Oldest'((64'd1 << (i + 1)) - 1)) == Oldest'((64'd1 << (i + 1)) - 1)));
      end
      // Verifies: SAFE-17
      a_reset : assert (!rst_q || (!brake && !overload));
      // Verifies: SAFE-18
      a_time : assert (total <= cfg_longest_cycles_i);
      a_told : assert (!(brake && overload));
      if (!rst_q) begin
        // Verifies: SAFE-17
        a_below : assert (!below_q || (!brake && !overload));
        a_enable : assert (enable_q || !brake);
        a_stale : assert (!stale || !brake);
        a_starts : assert (!brake || brake_q || above_q);
        // Verifies: SAFE-18
        a_held : assert (!overload_q || below_q || overload);
        // On with a code above, and on while nothing turns it off, until the time is over: then told.
        if (enable_q && !below_q && (above_q || (brake_q && !stale)) && !overload_q) begin
          // Verifies: SAFE-17
          a_on : assert (brake == (past_q < cfg_longest_cycles_i));
          // Verifies: SAFE-18
          a_over : assert (overload == !brake);
        end else begin
          // Verifies: SAFE-17
          a_quiet : assert (!brake && overload == (overload_q && !below_q));
        end
      end
    end
  end

endmodule
`default_nettype wire
