// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Clock buffer of the Artix-7, declared for the tools that read it.
(* blackbox *)
module BUFG (
    input  logic I,
    output logic O
);
endmodule
