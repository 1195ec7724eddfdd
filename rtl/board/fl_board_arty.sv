// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Board top: Digilent Arty A7-35, Xilinx XC7A35TICSG324-1L.
//
// The oscillator's 100 MHz become 50 MHz in a PLL; the red RESET button resets. The oscillator of the configuration logic
// (CFGMCLK of STARTUPE2) watches that clock: 65 MHz, +-50 % (UG470, STARTUPE2; DS181, FCFGMCLK and FCFGMCLKTOL).
// Not compared with the sheets: docs/blocks/fl_clock_monitor.md.
// Pins: constraints/arty-a7-35.xdc, drawn in docs/blocks/fl_board_arty.md. Everything else: fl_board.
`default_nettype none
module fl_board_arty #(
    parameter bit    Can           = 1'b0,
    parameter string Init          = "firmware.hex",
    parameter bit    HighActiveLow = 1'b0,            // upper gate pins are active low
    parameter bit    LowActiveLow  = 1'b0             // lower gate pins
) (
    input logic clk_100mhz_i,
    input logic reset_button_ni,

    output logic       adc_cs_no,
    output logic       adc_sclk_o,
    input  logic [8:0] adc_sdata_i,  // v0..v2, i0..i2, vdc, idc, vsm

    output logic [2:0] gate_h_o,
    output logic [2:0] gate_l_o,
    output logic       brake_o,          // brake chopper, high: on
    output logic       driver_enable_o,  // toggles: drivers enabled
    input  logic       fault_pin_i,      // high or open: fault
    input  logic [2:0] hall_i,       // C, B, A
    input  logic [2:0] encoder_i,    // Z, B, A

    input  logic uart_rx_i,
    output logic uart_tx_o,

    input  logic can_rx_i,
    output logic can_tx_o,

    output logic [3:0] led_o
);

  // 100 MHz * 10 = 1000 MHz (800..1600), / 20 = 50 MHz.
  logic pll_clk, pll_feedback, clk, locked, pll_rst;
  PLLE2_BASE #(
      .CLKFBOUT_MULT (10),
      .CLKIN1_PERIOD (10),
      .CLKOUT0_DIVIDE(20)
  ) u_pll (
      .CLKIN1  (clk_100mhz_i),
      .CLKFBIN (pll_feedback),
      .RST     (pll_rst),
      .PWRDWN  (1'b0),
      .CLKFBOUT(pll_feedback),
      .CLKOUT0 (pll_clk),
      .LOCKED  (locked)
  );
  BUFG u_clock (
      .I(pll_clk),
      .O(clk)
  );

  logic osc_raw, osc;
  STARTUPE2 u_startup (
      .CLK      (1'b0),
      .GSR      (1'b0),
      .GTS      (1'b0),
      .KEYCLEARB(1'b1),
      .PACK     (1'b0),
      .USRCCLKO (1'b0),
      .USRCCLKTS(1'b1),
      .USRDONEO (1'b1),
      .USRDONETS(1'b1),
      .CFGMCLK  (osc_raw)
  );
  BUFG u_osc (
      .I(osc_raw),
      .O(osc)
  );

  fl_board #(
      .Phases       (3),
      .Can          (Can),
      .Init         (Init),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow),
      .OscKhz       (65_000),
      .OscPercent   (50)
  ) u_board (
      .clk_i      (clk),
      .osc_i      (osc),
      .locked_i   (locked),
      .pll_rst_o  (pll_rst),
      .button_i   (!reset_button_ni),
      .adc_cs_no,
      .adc_sclk_o,
      .adc_sdata_i,
      .gate_h_o,
      .gate_l_o,
      .brake_o,
      .driver_enable_o,
      .fault_pin_i,
      .hall_i,
      .encoder_i,
      .uart_rx_i,
      .uart_tx_o,
      .can_rx_i,
      .can_tx_o,
      .spi_cs_no   (),
      .spi_sck_o   (),
      .spi_mosi_o  (),
      .spi_miso_i  (1'b1),
      .led_o
  );

endmodule
`default_nettype wire
