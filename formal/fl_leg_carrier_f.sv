// Proof of the leg carriers for all inputs: never both requests of a leg, none after reset, while disabled or before new
// compares, all legs or none, at most one edge of a leg in a half carrier.
//
// The monitors see ports only; the invariants at the end tie them to the block's registers, so that induction closes.
// Verifies: VPWM-06
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

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        a_never_both : assert ((req_h_o & req_l_o) == '0);
        if (!allowed_q) a_off : assert ((req_h_o | req_l_o) == '0);
        if (!handed_q) a_fresh : assert ((req_h_o | req_l_o) == '0);
        a_all_or_none : assert ((req_h_o | req_l_o) == '0 || (req_h_o ^ req_l_o) == '1);
        if (driven_q && (req_h_o | req_l_o) != '0 && !update_o) begin
          if (!second_o) a_first_half_rises : assert ((req_h_q & ~req_h_o) == '0);
          if (second_o && second_q) a_second_half_falls : assert ((~req_h_q & req_h_o) == '0);
          if (second_o && !second_q) a_middle_keeps : assert ((req_h_q & ~req_h_o) == '0);
        end
        if (fault_o) a_fault_enabled : assert (allowed_q);

        // Invariants.
        assert (!dut.fresh_q || handed);
        assert (!dut.active_q || handed);
        assert (!(dut.active_q || dut.fresh_q || dut.fault_q) || allowed_q);
        assert (dut.period_q >= 16'd16 && (dut.shadow_period_q >= 16'd16 || !dut.fresh_q));
        assert (dut.second_q == dut.ramp_q[0]);
      end
  end

endmodule
`default_nettype wire
