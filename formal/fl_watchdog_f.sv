// Proof of the watchdog for all inputs and every period up to Longest: without a right number for the period it has
// expired, a number that does not follow the last one is wrong in the next clock, both hold while it runs, and a handler
// that repeats one number cannot hold it off. The past is kept here in a shift register, not counted.
// Verifies: SAFE-13
`default_nettype none
module fl_watchdog_f #(
    parameter int unsigned Longest = 6
) (
    input logic        clk_i,
    input logic        rst_i,
    input logic        enable_i,
    input logic [23:0] cfg_cycles_i,
    input logic        feed_i,
    input logic [ 7:0] step_i
);

  logic expired, wrong;
  fl_watchdog dut (
      .clk_i,
      .rst_i,
      .enable_i,
      .cfg_cycles_i,
      .feed_i,
      .step_i,
      .expired_o(expired),
      .wrong_o  (wrong)
  );

  logic first = 1'b1;
  logic rst_q, ran_q, expired_q, wrong_q, fed_q;
  logic [23:0] period_q;
  logic [7:0] told_q, told_before_q;
  logic [Longest-1:0] quiet_q;  // the last clocks, newest in bit 0: running, no right number
  logic running, right;
  assign running = enable_i && cfg_cycles_i != '0 && !rst_i;
  assign right   = feed_i && step_i == told_q + 8'd1;

  always_ff @(posedge clk_i) begin
    first     <= 1'b0;
    rst_q     <= rst_i;
    ran_q     <= running;
    period_q  <= cfg_cycles_i;
    expired_q <= expired;
    wrong_q   <= wrong;
    fed_q     <= feed_i;
    if (rst_i) told_q <= '0;
    else if (feed_i) told_q <= step_i;
    told_before_q <= told_q;
    quiet_q       <= (running && !right) ? {quiet_q[Longest-2:0], 1'b1} : '0;
  end

  // No right number in the clocks of the period before the last one of it: one in that last clock comes too late.
  logic due_d, due_q;
  always_comb begin
    due_d = cfg_cycles_i == 24'd1;
    for (int unsigned i = 1; i < Longest; i++) due_d |= cfg_cycles_i == 24'(i + 1) && quiet_q[i-1];
  end
  always_ff @(posedge clk_i) due_q <= due_d;

  always_comb begin
    if (first) assume (rst_i);
    else begin
      // Locked while the gates are on; short enough for the shift register.
      assume (cfg_cycles_i == period_q && cfg_cycles_i <= 24'(Longest));
      a_last : assert (dut.last_q == told_q);
      for (int unsigned i = 0; i < Longest; i++) begin
        assert ((dut.wait_q > 24'(i)) == quiet_q[i]);
      end
      a_stopped : assert (ran_q || !(expired || wrong));
      if (ran_q) begin
        a_expires : assert (expired == (expired_q || due_q));
        a_holds : assert ((!expired_q || expired) && (!wrong_q || wrong));
        a_repeated : assert (!fed_q || told_q != told_before_q || wrong);
        a_wrong : assert (wrong_q || wrong == (fed_q && told_q != told_before_q + 8'd1));
      end
    end
  end

endmodule
`default_nettype wire
