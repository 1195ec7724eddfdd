// Makes one fault level for the protection out of what can go wrong with the converters.
//
// cause_o, bit 0: a channel of the last frame was bad; bit 1: a conversion was asked for and not made (its sample would
// carry the wrong time); bit 2: late, a gate has been on for LateCycles without a finished conversion, so nothing looks
// at the currents. Bad and missed hold until a frame without a bad channel; late holds until the next frame or until all
// gates are off. fault_o = any cause.
//
// Latency: one clock from valid_i or missed_i to fault_o. Late: fault_o is high after LateCycles clocks in each of which a
// gate is on and valid_i low. The default is above the longest spacing of strobes that the sample scheduler can be set to.
// seen_o: causes since reset, for indicators.
`default_nettype none
module fl_adc_fault #(
    parameter int unsigned Channels   = 9,
    parameter int unsigned LateCycles = 65536  // 2..2^20
) (
    input logic clk_i,
    input logic rst_i,

    input  logic                valid_i,
    input  logic [Channels-1:0] bad_i,     // with valid_i
    input  logic                missed_i,
    input  logic                gate_on_i, // any gate
    output logic                fault_o,
    output logic [         2:0] cause_o,
    output logic [         2:0] seen_o
);

  if (LateCycles < 2 || LateCycles > 1 << 20) begin : gen_illegal
    $fatal(1, "fl_adc_fault: LateCycles must be 2..2^20 (%m)");
  end

  logic [20:0] wait_q;  // clocks with a gate on since the last frame, up to LateCycles
  logic late_q, bad_q, missed_q;
  logic [2:0] seen_q;

  always_ff @(posedge clk_i) begin
    if (valid_i || !gate_on_i) wait_q <= '0;
    else if (wait_q != 21'(LateCycles)) wait_q <= wait_q + 21'd1;
    late_q <= !valid_i && gate_on_i && wait_q >= 21'(LateCycles - 1);
    if (valid_i) bad_q <= bad_i != '0;
    missed_q <= missed_i || (missed_q && !(valid_i && bad_i == '0));
    seen_q   <= seen_q | cause_o;
    if (rst_i) begin
      wait_q   <= '0;
      late_q   <= 1'b0;
      bad_q    <= 1'b0;
      missed_q <= 1'b0;
      seen_q   <= '0;
    end
  end

  assign cause_o = {late_q, missed_q, bad_q};
  assign fault_o = cause_o != '0;
  assign seen_o  = seen_q;

endmodule
`default_nettype wire
