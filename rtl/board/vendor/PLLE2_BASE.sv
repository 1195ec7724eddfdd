// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// PLL of the Artix-7, declared for the tools that read it: ports and parameters that fl_board_arty sets.
(* blackbox *)
module PLLE2_BASE #(
    parameter int CLKFBOUT_MULT  = 5,
    parameter int CLKIN1_PERIOD  = 0,  // ns; real in the library
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
endmodule
