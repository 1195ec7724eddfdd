// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Capture buffer with its registers.
`default_nettype none
module fl_capture_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter int unsigned Channels = 9,
    parameter int unsigned Depth = 1024
) (
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input logic                   sample_valid_i,
    input sample_t [Channels-1:0] sample_i,
    input logic    [        17:0] sample_time_i,
    input logic                   sample_on_i,
    input sector_t                sample_sector_i,
    input logic    [        17:0] duty_q2_i,

    input logic    trip_i,          // pulse
    input logic    tripped_i,       // level
    input logic    comm_applied_i,  // pulse
    input sector_t sector_i,

    output logic done_event_o
);

  fl_capture_regs_pkg::fl_capture_regs__in_t  hwif_in;
  fl_capture_regs_pkg::fl_capture_regs__out_t hwif_out;
  localparam int unsigned IndexWidth = $clog2(Depth);
  logic [3:0][SampleWidth-1:0] lane;
  logic done, done_q;

  fl_capture #(
      .Channels(Channels),
      .Depth   (Depth)
  ) u_capture (
      .clk_i,
      .rst_i,
      .arm_i(hwif_out.control.arm.value),
      .cfg_trigger_i(hwif_out.control.trigger.value),
      .cfg_decimation_i(hwif_out.control.decimation.value),
      .cfg_pre_trigger_i(IndexWidth'(hwif_out.control.pre_trigger.value)),
      .cfg_lane_i({
        hwif_out.lanes.lane3.value, hwif_out.lanes.lane2.value, hwif_out.lanes.lane1.value, hwif_out.lanes.lane0.value
      }),
      .sample_valid_i,
      .sample_i,
      .sample_time_i,
      .sample_on_i,
      .sample_sector_i,
      .duty_q2_i,
      .trip_i,
      .tripped_i,
      .comm_applied_i,
      .sector_i,
      .busy_o(hwif_in.status.busy.next),
      .done_o(done),
      .read_record_i(IndexWidth'(hwif_out.read_address.record.value)),
      .lane_o(lane)
  );

  assign hwif_in.status.done.next  = done;
  assign hwif_in.status.depth.next = 16'(Depth);
  for (genvar i = 0; i < 4; i++) begin : g_lane
    assign hwif_in.data[i].value.next = 32'(signed'(lane[i]));
  end

  assign done_event_o = done && !done_q;

  always_ff @(posedge clk_i) begin
    done_q <= done;
    if (rst_i) done_q <= 1'b0;
  end

  fl_capture_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_capture_regs_pkg::FL_CAPTURE_REGS_MIN_ADDR_WIDTH-1:0]),
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
