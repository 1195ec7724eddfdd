// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// CAN controller with its registers.
`default_nettype none
module fl_can_wb
  import fl_can_pkg::*;
  import fl_bus_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input logic [31:0] now_i,  // clocks

    input  logic rx_i,    // asynchronous
    output logic tx_o,
    output logic event_o  // pulse: an enabled event
);

  localparam int unsigned Buffers = 3;
  localparam int unsigned Filters = 8;
  localparam int unsigned Events = 15;

  fl_can_regs_pkg::fl_can_regs__in_t  hwif_in;
  fl_can_regs_pkg::fl_can_regs__out_t hwif_out;

  can_timing_t bit_timing;
  can_filter_t [Filters-1:0] filter;
  can_frame_t tx_frame;
  can_entry_t rx_entry, rx_shown;
  can_error_e error, error_q;
  logic [Buffers-1:0] put, abort, sent, aborted, refused;
  logic rx_valid, rx_event, rx_overrun;
  logic [2:0] state, state_q;  // bus-off, error passive, warning
  logic [Events-1:0] events;

  assign bit_timing = '{
          sjw: hwif_out.bit_timing.sjw.value,
          tseg2: hwif_out.bit_timing.tseg2.value,
          tseg1: hwif_out.bit_timing.tseg1.value,
          brp: hwif_out.bit_timing.brp.value
      };

  for (genvar x = 0; x < Filters; x++) begin : g_filter
    assign filter[x] = '{
            enable: hwif_out.filter_mask[x].enable.value,
            match_ext: hwif_out.filter_mask[x].ext.value,
            ext: hwif_out.filter_id[x].ext.value,
            match_rtr: hwif_out.filter_mask[x].rtr.value,
            rtr: hwif_out.filter_id[x].rtr.value,
            mask: hwif_out.filter_mask[x].id.value,
            id: hwif_out.filter_id[x].id.value
        };
  end

  assign put   = {hwif_out.tx_command.put2.value, hwif_out.tx_command.put1.value, hwif_out.tx_command.put0.value};
  assign abort = {
    hwif_out.tx_command.abort2.value, hwif_out.tx_command.abort1.value, hwif_out.tx_command.abort0.value
  };

  // The command's own fields have their values in the clock of its pulse.
  assign tx_frame = '{
          ext: hwif_out.tx_id.ext.value,
          rtr: hwif_out.tx_id.rtr.value,
          id: hwif_out.tx_id.id.value,
          dlc: hwif_out.tx_command.dlc.value,
          data: {hwif_out.tx_data[1].bytes.value, hwif_out.tx_data[0].bytes.value}
      };

  fl_can u_can (
      .clk_i,
      .rst_i,
      .now_i,
      .rx_i,
      .tx_o,
      .enable_i       (hwif_out.control.enable.value),
      .listen_i       (hwif_out.control.listen.value),
      .loopback_i     (hwif_out.control.loopback.value),
      .recover_i      (hwif_out.control.recover.value),
      .timing_i       (bit_timing),
      .filter_i       (filter),
      .put_i          (put),
      .put_frame_i    (tx_frame),
      .put_priority_i (hwif_out.tx_command.urgency.value),
      .abort_i        (abort),
      .pending_o      (hwif_in.status.pending.next),
      .sent_o         (sent),
      .aborted_o      (aborted),
      .refused_o      (refused),
      .rx_pop_i       (hwif_out.rx_command.take.value),
      .rx_valid_o     (rx_valid),
      .rx_entry_o     (rx_entry),
      .rx_event_o     (rx_event),
      .rx_overrun_o   (rx_overrun),
      .rx_lost_count_o(hwif_in.status.lost.next),
      .error_o        (error),
      .tec_o          (hwif_in.status.tec.next),
      .rec_o          (hwif_in.status.rec.next),
      .warning_o      (state[0]),
      .passive_o      (state[1]),
      .bus_off_o      (state[2])
  );

  always_ff @(posedge clk_i) begin
    state_q <= state;
    if (error != CanNone) error_q <= error;
    if (rst_i) begin
      state_q <= '0;
      error_q <= CanNone;
    end
  end

  // Bit order: fl_can_regs.
  assign events  = {refused, 1'b0, aborted, 1'b0, sent, state != state_q, error != CanNone, rx_overrun, rx_event};
  assign event_o = (events & hwif_out.event_enable.mask.value) != '0;

  assign hwif_in.events.received.next = events[0];
  assign hwif_in.events.overrun.next  = events[1];
  assign hwif_in.events.error.next    = events[2];
  assign hwif_in.events.state.next    = events[3];
  assign {hwif_in.events.sent2.next, hwif_in.events.sent1.next, hwif_in.events.sent0.next} = sent;
  assign {hwif_in.events.aborted2.next, hwif_in.events.aborted1.next, hwif_in.events.aborted0.next} = aborted;
  assign {hwif_in.events.refused2.next, hwif_in.events.refused1.next, hwif_in.events.refused0.next} = refused;

  assign hwif_in.status.received.next = rx_valid;
  assign {hwif_in.status.bus_off.next, hwif_in.status.passive.next, hwif_in.status.warning.next} = state;
  assign hwif_in.error.kind.next = error_q;

  // Behind an empty FIFO's output is an old frame.
  assign rx_shown                       = rx_valid ? rx_entry : '0;
  assign hwif_in.rx_id.id.next          = rx_shown.frame.id;
  assign hwif_in.rx_id.rtr.next         = rx_shown.frame.rtr;
  assign hwif_in.rx_id.ext.next         = rx_shown.frame.ext;
  assign hwif_in.rx_data[0].bytes.next  = rx_shown.frame.data[31:0];
  assign hwif_in.rx_data[1].bytes.next  = rx_shown.frame.data[63:32];
  assign hwif_in.rx_info.dlc.next       = rx_shown.frame.dlc;
  assign hwif_in.rx_info.filter.next    = rx_shown.filter;
  assign hwif_in.rx_info.lost.next      = rx_shown.lost;
  assign hwif_in.rx_info.valid.next     = rx_valid;
  assign hwif_in.rx_time.stamp.next     = rx_shown.stamp;

  fl_can_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_can_regs_pkg::FL_CAN_REGS_MIN_ADDR_WIDTH-1:0]),
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
