// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Interrupt controller with its registers, which hold the sticky pending bits.
`default_nettype none
module fl_irq_wb
  import fl_bus_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input  logic [9:0] event_i,        // pulses
    output logic       irq_control_o,
    output logic       irq_deferred_o
);

  fl_irq_regs_pkg::fl_irq_regs__in_t hwif_in;
  fl_irq_regs_pkg::fl_irq_regs__out_t hwif_out;

  logic [9:0] pending;

  // Bit order: fl_irq_regs.
  assign {
    hwif_in.pending.can.next,
    hwif_in.pending.hall.next,
    hwif_in.pending.load.next,
    hwif_in.pending.crossing.next,
    hwif_in.pending.capture.next,
    hwif_in.pending.uart_tx.next,
    hwif_in.pending.uart_rx.next,
    hwif_in.pending.machine.next,
    hwif_in.pending.trip.next,
    hwif_in.pending.tick.next
  } = event_i;

  assign pending = {
    hwif_out.pending.can.value,
    hwif_out.pending.hall.value,
    hwif_out.pending.load.value,
    hwif_out.pending.crossing.value,
    hwif_out.pending.capture.value,
    hwif_out.pending.uart_tx.value,
    hwif_out.pending.uart_rx.value,
    hwif_out.pending.machine.value,
    hwif_out.pending.trip.value,
    hwif_out.pending.tick.value
  };

  fl_irq #(
      .Sources(10)
  ) u_irq (
      .clk_i,
      .rst_i,
      .event_i,
      .pending_i     (pending),
      .enable_i      (hwif_out.enable.source.value),
      .control_i     (hwif_out.route.control.value),
      .irq_control_o,
      .irq_deferred_o,
      .overrun_o     (hwif_in.overrun.count.next),
      .tick_overrun_o(hwif_in.overrun.tick_count.next)
  );

  fl_irq_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_irq_regs_pkg::FL_IRQ_REGS_MIN_ADDR_WIDTH-1:0]),
      .wb_odat (req_i.wdat),
      .wb_sel  (req_i.sel),
      .wb_ack  (),
      .wb_err  (),
      .wb_idat (rdat_o),
      .hwif_in,
      .hwif_out
  );

endmodule
`default_nettype wire
