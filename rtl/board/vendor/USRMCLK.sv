// Way to the configuration flash's clock pin in the ECP5, declared for the tools that read it.
(* blackbox, keep *)
module USRMCLK (
    input logic USRMCLKI,
    input logic USRMCLKTS  // 1: not driven
);
endmodule
