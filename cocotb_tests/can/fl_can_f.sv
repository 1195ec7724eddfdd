// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the CAN controller's pin for all inputs: recessive one clock after reset, disabling and bus-off, and while
// listening or looping back; these modes hold while enabled; bus-off ends only by reset or after 128 runs of eleven
// sampled recessive bits.
`default_nettype none
module fl_can_f
  import fl_can_pkg::*;
(
    input logic              clk_i,
    input logic              rst_i,
    input logic       [31:0] now_i,
    input logic              rx_i,
    input logic              enable_i,
    input logic              listen_i,
    input logic              loopback_i,
    input logic              recover_i,
    input can_timing_t       timing_i,
    input can_filter_t [7:0] filter_i,
    input logic        [2:0] put_i,
    input can_frame_t        put_frame_i,
    input logic        [1:0] put_priority_i,
    input logic        [2:0] abort_i,
    input logic              rx_pop_i
);

  logic tx_o, rx_valid_o, rx_event_o, rx_overrun_o, warning_o, passive_o, bus_off_o;
  logic [2:0] pending_o, sent_o, aborted_o, refused_o;
  can_entry_t rx_entry_o;
  logic [7:0] rx_lost_count_o, tec_o, rec_o;
  can_error_e error_o;

  fl_can dut (.*);

  localparam logic [4:0] StBusOff = 5'd1;

  logic first = 1'b1;
  logic rst_q, enable_q, bus_off_q;
  // On since the last clock; the mode that came with it.
  logic on_q, listen_q, loopback_q;
  logic silent_q;  // the pin must be recessive
  logic [3:0] run_q;  // recessive bits in a row in bus-off
  logic [7:0] runs_q;  // of eleven, saturates

  always_ff @(posedge clk_i) begin
    first     <= 1'b0;
    rst_q     <= rst_i;
    on_q      <= enable_i && !rst_i;
    enable_q  <= on_q;
    bus_off_q <= bus_off_o;
    if (!on_q) {listen_q, loopback_q} <= {listen_i, loopback_i};
    silent_q <= rst_i || !enable_i || !on_q || bus_off_o || listen_q || loopback_q;
    if (!bus_off_o) runs_q <= '0;
    if (!bus_off_o || !bus_off_q || !on_q || !enable_q) run_q <= '0;
    else if (dut.sample) begin
      run_q <= (!dut.sampled || run_q == 4'd10) ? '0 : run_q + 4'd1;
      if (dut.sampled && run_q == 4'd10 && runs_q != '1) runs_q <= runs_q + 8'd1;
    end
    if (rst_i) {listen_q, loopback_q} <= '0;
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        // What the bit stream processor has made ready for a bit is of the state in which the bit finds it.
        assert (dut.u_bit_timing.sample_q != '0);
        assert (dut.u_bit_timing.quantum_q == '0 || dut.u_bit_timing.sample_q == {1'b0, dut.timing_q.tseg1} + 7'd1);
        assert (!dut.u_bit_timing.strobe_q || dut.u_bit_timing.quantum_q == dut.u_bit_timing.sample_q + 7'd1);
        if (dut.sample && dut.u_bsp.state_q == StBusOff) begin
          assert (dut.u_bsp.view_q.last == (run_q == 4'd10) && dut.u_bsp.view_q.count == {2'b0, run_q} + 6'd1);
          assert (!dut.u_bsp.view_q.stuffed && !dut.u_bsp.view_q.stuff_bit);
        end
        // Verifies: CAN-21
        a_silent : assert (!silent_q || tx_o);
        a_on : assert (dut.enable_q == on_q);
        a_listen : assert (dut.listen_q == listen_q);
        a_loopback : assert (dut.loopback_q == loopback_q);
        if (bus_off_o) begin
          assert (8'(dut.u_confinement.quiet_q) + 8'(dut.u_confinement.count_q.quiet11) <= runs_q && run_q <= 4'd10);
          if (dut.u_bsp.state_q == StBusOff) assert (dut.u_bsp.count_q == {2'b0, run_q});
        end else assert (dut.u_bsp.state_q != StBusOff || bus_off_q);
        // Verifies: CAN-11
        if (bus_off_q && !bus_off_o) a_recovered : assert (rst_q || runs_q >= 8'd128);
      end
  end

endmodule
`default_nettype wire
