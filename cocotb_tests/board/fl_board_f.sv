// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the way from fault pin, lock, reset and monitors to the pins of a board: whatever the chip asks for, and whatever any
// flip-flop holds, gates and enable are off in the same instant. The properties hold in every state on their own, with no
// step of any clock: no clocked flip-flop can be in between. The task logic frees the flip-flops with an asynchronous clear
// as well: fault pin, lock and the chip's reset reach the pins without any further flip-flop.
`default_nettype none
module fl_board_f #(
    parameter bit HighActiveLow = 1'b0,
    parameter bit LowActiveLow  = 1'b0
) (
    input logic       clk_i,
    input logic       osc_i,
    input logic       locked_i,
    input logic       button_i,
    input logic [8:0] adc_sdata_i,
    input logic       fault_pin_i,
    input logic [2:0] hall_i,
    input logic [2:0] encoder_i,
    input logic       uart_rx_i,
    input logic       can_rx_i,
    input logic       spi_miso_i
);

  logic pll_rst_o, adc_cs_no, adc_sclk_o, brake_o, driver_enable_o;
  logic uart_tx_o, can_tx_o, spi_cs_no, spi_sck_o, spi_mosi_o;
  logic [2:0] gate_h_o, gate_l_o;
  logic [3:0] led_o;
  fl_board #(
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow),
      .ResetCycles  (2)
  ) dut (
      .*
  );

  logic gates_off;
  assign gates_off = gate_h_o == {3{HighActiveLow}} && gate_l_o == {3{LowActiveLow}} && !driver_enable_o;

  always_comb begin
    // Verifies: CLK-02, CLK-03, CLK-07
    a_pin : assert (!fault_pin_i || gates_off);
    a_lock : assert (locked_i || (gates_off && !brake_o));
    a_reset : assert (!dut.rst_q || (gates_off && !brake_o));
    a_clock : assert (!dut.clk_bad || (gates_off && !brake_o));
    a_oscillator : assert (!dut.osc_bad || (gates_off && !brake_o));
    // Without all of these the pins are the chip's.
    a_chip : assert (!locked_i || dut.rst_q || fault_pin_i || !dut.gates_ok ||
                     {gate_h_o, gate_l_o, driver_enable_o} == {dut.gate_h, dut.gate_l, dut.driver_enable});
    a_brake : assert (!locked_i || dut.rst_q || !dut.clocks_ok || brake_o == dut.brake);
  end

endmodule
`default_nettype wire
