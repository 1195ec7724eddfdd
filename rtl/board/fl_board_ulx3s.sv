// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Board top: ULX3S, Lattice ECP5 LFE5U-85F-6BG381C; with fewer words of RAM also its smaller devices.
//
// The oscillator's 25 MHz become 50 MHz in a PLL; button FIRE1 resets. The on-chip oscillator OSCG watches that clock:
// 310 MHz, +-15 % (FPGA-TN-02200, internal oscillator; FPGA-DS-02012), here divided by 8. Not compared with the sheets:
// docs/blocks/fl_clock_monitor.md.
// Boot = 1: firmware and parameter block come from the configuration flash, whose clock pin is reached through USRMCLK.
// Pins: constraints/ulx3s.lpf, drawn in docs/blocks/fl_board_ulx3s.md. Everything else: fl_board.
`default_nettype none
module fl_board_ulx3s #(
    parameter  int unsigned Phases        = 3,               // 3 or 5
    parameter  bit          Vector        = 1'b1,
    parameter  bit          Injection     = 1'b0,
    parameter  bit          Can           = 1'b0,
    parameter  int unsigned RamWords      = 32768,           // of the core: fl_cpu
    parameter  string       Init          = "firmware.hex",
    parameter  bit          Boot          = 0,
    parameter  string       BootInit      = "boot.hex",
    parameter  bit          HighActiveLow = 1'b0,            // upper gate pins are active low
    parameter  bit          LowActiveLow  = 1'b0,            // lower gate pins
    localparam int unsigned Channels      = 2 * Phases + 3   // v0.., i0.., vdc, idc, vsm
) (
    input logic clk_25mhz_i,
    input logic reset_button_i,

    output logic                adc_cs_no,
    output logic                adc_sclk_o,
    input  logic [Channels-1:0] adc_sdata_i,

    output logic [Phases-1:0] gate_h_o,
    output logic [Phases-1:0] gate_l_o,
    output logic              brake_o,          // brake chopper, high: on
    output logic              driver_enable_o,  // toggles: drivers enabled
    input  logic              fault_pin_i,      // high or open: fault
    input  logic [       2:0] hall_i,       // C, B, A
    input  logic [       2:0] encoder_i,    // Z, B, A

    input  logic uart_rx_i,
    output logic uart_tx_o,

    input  logic can_rx_i,
    output logic can_tx_o,

    output logic flash_cs_no,
    output logic flash_mosi_o,
    input  logic flash_miso_i,
    output logic flash_wp_no,
    output logic flash_hold_no,

    output logic [3:0] led_o
);

  // 25 MHz / 1 * 2 * 12 = 600 MHz (400..800), / 12 = 50 MHz.
  logic clk, locked, pll_rst;
  EHXPLLL #(
      .CLKI_DIV    (1),
      .CLKFB_DIV   (2),
      .CLKOP_DIV   (12),
      .CLKOP_CPHASE(5),
      .FEEDBK_PATH ("CLKOP"),
      .PLLRST_ENA  ("ENABLED")
  ) u_pll (
      .CLKI   (clk_25mhz_i),
      .CLKFB  (clk),
      .RST    (pll_rst),
      .STDBY  (1'b0),
      .ENCLKOP(1'b1),
      .CLKOP  (clk),
      .LOCK   (locked)
  );

  // 310 MHz / 8.
  logic osc;
  OSCG #(
      .DIV(8)
  ) u_osc (
      .OSC(osc)
  );

  logic flash_sck;
  assign flash_wp_no   = 1'b1;
  assign flash_hold_no = 1'b1;
  USRMCLK u_flash_clock (
      .USRMCLKI (flash_sck),
      .USRMCLKTS(!Boot)
  );

  fl_board #(
      .Phases       (Phases),
      .Vector       (Vector),
      .Injection    (Injection),
      .Can          (Can),
      .RamWords     (RamWords),
      .Init         (Init),
      .Boot         (Boot),
      .BootInit     (BootInit),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow),
      .OscKhz       (38_750),
      .OscPercent   (15)
  ) u_board (
      .clk_i    (clk),
      .osc_i    (osc),
      .locked_i (locked),
      .pll_rst_o(pll_rst),
      .button_i (reset_button_i),
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
      .spi_cs_no (flash_cs_no),
      .spi_sck_o (flash_sck),
      .spi_mosi_o(flash_mosi_o),
      .spi_miso_i(flash_miso_i),
      .led_o
  );

endmodule
`default_nettype wire
