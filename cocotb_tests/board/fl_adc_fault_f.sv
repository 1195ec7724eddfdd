// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the converter faults for all inputs: a bad frame and a conversion that was not made each raise the fault in the
// next clock, and it stays until a good frame.
`default_nettype none
module fl_adc_fault_f #(
    parameter int unsigned Channels = 2
) (
    input logic                clk_i,
    input logic                rst_i,
    input logic                valid_i,
    input logic [Channels-1:0] bad_i,
    input logic                missed_i
);

  logic fault;
  logic [1:0] cause, seen;

  fl_adc_fault #(
      .Channels(Channels)
  ) dut (
      .clk_i,
      .rst_i,
      .valid_i,
      .bad_i,
      .missed_i,
      .fault_o(fault),
      .cause_o(cause),
      .seen_o (seen)
  );

  logic first = 1'b1;
  logic rst_q, valid_q, missed_q, good_q, bad_q, fault_q;
  logic [1:0] cause_q;
  always_ff @(posedge clk_i) begin
    first    <= 1'b0;
    rst_q    <= rst_i;
    valid_q  <= valid_i;
    missed_q <= missed_i;
    good_q   <= valid_i && bad_i == '0;
    bad_q    <= valid_i && bad_i != '0;
    fault_q  <= fault;
    cause_q  <= cause;
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        // Verifies: BRD-04
        a_reset : assert (!rst_q || !fault);
        if (!rst_q) begin
          // Verifies: BRD-04
          a_bad : assert (!bad_q || (cause[0] && fault));
          a_missed : assert (!missed_q || (cause[1] && fault));
          a_bad_holds : assert (!cause_q[0] || cause[0] || valid_q);
          a_missed_holds : assert (!cause_q[1] || cause[1] || good_q);
          a_good : assert (!good_q || missed_q || !fault);
        end
      end
  end

endmodule
`default_nettype wire
