// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// On-chip oscillator of the ECP5, 310 MHz / DIV, declared for the tools that read it.
(* blackbox *)
module OSCG #(
    parameter int DIV = 128
) (
    output logic OSC
);
endmodule
