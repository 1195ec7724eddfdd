// Clock buffer of the Artix-7, declared for the tools that read it.
(* blackbox *)
module BUFG (
    input  logic I,
    output logic O
);
endmodule
