// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Behaviour of the vendors' clock primitives, as far as the tests of the board tops go: oscillators and the clock behind a
// PLL are levels that the test drives, the lock too; a reset of the PLL takes lock and clock away at once.
`default_nettype none
module EHXPLLL #(
    parameter int    CLKI_DIV     = 1,
    parameter int    CLKFB_DIV    = 1,
    parameter int    CLKOP_DIV    = 8,
    parameter int    CLKOP_CPHASE = 0,
    parameter string FEEDBK_PATH  = "CLKOP",
    parameter string PLLRST_ENA   = "DISABLED"
) (
    input  logic CLKI,
    input  logic CLKFB,
    input  logic RST,
    input  logic STDBY,
    input  logic ENCLKOP,
    output logic CLKOP,
    output logic LOCK
);
  logic clock, lock;
  assign CLKOP = clock && ENCLKOP && !STDBY && !reset;
  assign LOCK  = lock && !reset;
  logic reset;
  assign reset = RST && PLLRST_ENA == "ENABLED";
endmodule

module OSCG #(
    parameter int DIV = 128
) (
    output logic OSC
);
  logic clock;
  assign OSC = clock;
endmodule

module USRMCLK (
    input logic USRMCLKI,
    input logic USRMCLKTS
);
endmodule

module PLLE2_BASE #(
    parameter int CLKFBOUT_MULT  = 5,
    parameter int CLKIN1_PERIOD  = 0,
    parameter int CLKOUT0_DIVIDE = 1
) (
    input  logic CLKIN1,
    input  logic CLKFBIN,
    input  logic RST,
    input  logic PWRDWN,
    output logic CLKFBOUT,
    output logic CLKOUT0,
    output logic LOCKED
);
  logic clock, lock;
  assign CLKOUT0  = clock && !RST && !PWRDWN;
  assign CLKFBOUT = CLKIN1;
  assign LOCKED   = lock && !RST;
endmodule

module BUFG (
    input  logic I,
    output logic O
);
  assign O = I;
endmodule

module STARTUPE2 (
    input  logic CLK,
    input  logic GSR,
    input  logic GTS,
    input  logic KEYCLEARB,
    input  logic PACK,
    input  logic USRCCLKO,
    input  logic USRCCLKTS,
    input  logic USRDONEO,
    input  logic USRDONETS,
    output logic CFGMCLK
);
  logic clock;
  assign CFGMCLK = clock;
endmodule
`default_nettype wire
