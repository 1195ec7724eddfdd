// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// PLL of the ECP5, declared for the tools that read it: ports and parameters that fl_board_ulx3s sets.
(* blackbox *)
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
endmodule
