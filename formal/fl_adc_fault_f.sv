// Proof of the converter faults for all inputs: a bad frame, a conversion that was not made, and gates that were on for
// LateCycles without a frame each raise the fault in the next clock, and it stays until a good frame (late: a frame or
// all gates off). The past is kept here in shift registers, not counted.
// Verifies: BRD-04
`default_nettype none
module fl_adc_fault_f #(
    parameter int unsigned Channels   = 2,
    parameter int unsigned LateCycles = 5
) (
    input logic                clk_i,
    input logic                rst_i,
    input logic                valid_i,
    input logic [Channels-1:0] bad_i,
    input logic                missed_i,
    input logic                gate_on_i
);

  logic fault;
  logic [2:0] cause, seen;

  fl_adc_fault #(
      .Channels  (Channels),
      .LateCycles(LateCycles)
  ) dut (
      .clk_i,
      .rst_i,
      .valid_i,
      .bad_i,
      .missed_i,
      .gate_on_i,
      .fault_o(fault),
      .cause_o(cause),
      .seen_o (seen)
  );

  logic first = 1'b1;
  logic rst_q, valid_q, missed_q, good_q, bad_q, fault_q;
  logic [1:0] cause_q;
  logic [LateCycles-1:0] blind_q;  // the last clocks, newest in bit 0: a gate on, no frame, no reset
  always_ff @(posedge clk_i) begin
    first    <= 1'b0;
    rst_q    <= rst_i;
    valid_q  <= valid_i;
    missed_q <= missed_i;
    good_q   <= valid_i && bad_i == '0;
    bad_q    <= valid_i && bad_i != '0;
    fault_q  <= fault;
    cause_q  <= cause[1:0];
    blind_q  <= rst_i ? '0 : {blind_q[LateCycles-2:0], gate_on_i && !valid_i};
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        a_reset : assert (!rst_q || !fault);
        // The counter of the block is the run of clocks that the shift register shows.
        for (int unsigned i = 0; i < LateCycles; i++) begin
          assert ((dut.wait_q > 21'(i)) == (&(blind_q | ~((LateCycles'(2) << i) - 1'b1))));
        end
        a_range : assert (dut.wait_q <= 21'(LateCycles));
        a_late : assert (cause[2] == (&blind_q));
        if (!rst_q) begin
          a_bad : assert (!bad_q || (cause[0] && fault));
          a_missed : assert (!missed_q || (cause[1] && fault));
          a_bad_holds : assert (!cause_q[0] || cause[0] || valid_q);
          a_missed_holds : assert (!cause_q[1] || cause[1] || good_q);
          a_late_fault : assert (!(&blind_q) || fault);
          a_good : assert (!good_q || missed_q || !fault);
        end
      end
  end

endmodule
`default_nettype wire
