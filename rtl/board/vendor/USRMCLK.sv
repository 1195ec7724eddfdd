// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Way to the configuration flash's clock pin in the ECP5, declared for the tools that read it.
(* blackbox, keep *)
module USRMCLK (
    input logic USRMCLKI,
    input logic USRMCLKTS  // 1: not driven
);
endmodule
