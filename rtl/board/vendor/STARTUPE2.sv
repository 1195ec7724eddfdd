// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Way to the configuration logic of the 7 series and its oscillator, 65 MHz, declared for the tools that read it: ports
// that fl_board_arty connects.
(* blackbox, keep *)
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
endmodule
