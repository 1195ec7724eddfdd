// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Triggered scope: four lanes of 18 bits into block RAM at every (decimation + 1)-th sample set.
//
// Armed, it fills a ring; once pre_trigger records are there, the trigger ends the pre-trigger phase and the rest of the
// depth is filled. Then record 0 is the oldest and the records are in time order. A trigger before that is not
// remembered. Lane sources: 0..Channels-1 the corrected channels; 13 flags (bits 2..0 sector, bit 4 PWM on, bit 5 gates
// tripped); 14 time stamp bits 17..0; 15 duty in clocks, Q16.2. A source that does not exist reads zero.
//
// Latency: a record is written in the clock of sample_valid_i; lane_o shows record read_record_i 1 clock later, valid
// while done_o.
`default_nettype none
module fl_capture
  import fl_pkg::*;
#(
    parameter int unsigned Channels = 9,
    parameter int unsigned Depth = 1024
) (
    input logic clk_i,
    input logic rst_i,

    input logic                          arm_i,              // pulse
    input logic [              1:0]      cfg_trigger_i,      // 0 now, 1 trip, 2 commutation, 3 entry into sector I
    input logic [              7:0]      cfg_decimation_i,
    input logic [$clog2(Depth)-1:0]      cfg_pre_trigger_i,  // records
    input logic [              3:0][3:0] cfg_lane_i,

    input logic                   sample_valid_i,
    input sample_t [Channels-1:0] sample_i,
    input logic    [        17:0] sample_time_i,    // low bits of the time stamp
    input logic                   sample_on_i,
    input sector_t                sample_sector_i,
    input logic    [        17:0] duty_q2_i,

    input logic    trip_i,          // pulse
    input logic    tripped_i,       // level
    input logic    comm_applied_i,  // pulse
    input sector_t sector_i,        // after the commutation, valid with comm_applied_i

    output logic                                      busy_o,
    output logic                                      done_o,
    input  logic [$clog2(Depth)-1:0]                  read_record_i,
    output logic [              3:0][SampleWidth-1:0] lane_o
);

  if (Depth < 2 || (Depth & (Depth - 1)) != 0) begin : g_check_depth
    $fatal(1, "fl_capture: Depth must be a power of two, at least 2 (%m)");
  end
  if (Channels < 1 || Channels > 13) begin : g_check_channels
    $fatal(1, "fl_capture: Channels must be 1..13 (%m)");
  end

  localparam int unsigned IndexWidth = $clog2(Depth);
  localparam logic [3:0] LaneFlags = 4'd13;
  localparam logic [3:0] LaneTime = 4'd14;
  localparam logic [3:0] LaneDuty = 4'd15;

  typedef enum logic [1:0] {
    TriggerNow         = 2'd0,
    TriggerTrip        = 2'd1,
    TriggerCommutation = 2'd2,
    TriggerSector0     = 2'd3
  } trigger_e;

  typedef enum logic [1:0] {
    StIdle,  // not armed since reset
    StPre,   // ring runs, waiting for the trigger
    StPost,  // filling what is left of the depth
    StDone   // complete, can be read
  } state_e;

  function automatic logic [SampleWidth-1:0] lane(logic [3:0] source);
    unique case (source)
      LaneFlags: return SampleWidth'({tripped_i, sample_on_i, 1'b0, sample_sector_i});
      LaneTime:  return sample_time_i;
      LaneDuty:  return duty_q2_i;
      default:   return (32'(source) < Channels) ? sample_i[source] : '0;
    endcase
  endfunction

  (* no_rw_check *) logic [4*SampleWidth-1:0] mem[Depth];

  state_e state_q, state_d;
  logic [IndexWidth-1:0] write_q, write_d;  // next record of the ring
  logic [IndexWidth:0] count_q, count_d;  // pre phase: records kept; post phase: records left
  logic [7:0] skip_q, skip_d;  // sample sets to leave out
  logic store, trigger;

  always_comb begin
    unique case (trigger_e'(cfg_trigger_i))
      TriggerNow:         trigger = 1'b1;
      TriggerTrip:        trigger = trip_i;
      TriggerCommutation: trigger = comm_applied_i;
      TriggerSector0:     trigger = comm_applied_i && sector_i == '0;
      default:            trigger = 1'b0;
    endcase
  end

  assign busy_o = state_q == StPre || state_q == StPost;
  assign done_o = state_q == StDone;
  assign store  = busy_o && sample_valid_i && skip_q == '0;

  always_comb begin
    state_d = state_q;
    write_d = write_q;
    count_d = count_q;
    skip_d  = skip_q;
    if (busy_o && sample_valid_i) skip_d = (skip_q == '0) ? cfg_decimation_i : skip_q - 1'b1;
    if (store) write_d = write_q + 1'b1;
    unique case (state_q)
      StIdle, StDone: ;
      StPre: begin
        if (count_q >= (IndexWidth + 1)'(cfg_pre_trigger_i)) begin
          if (trigger) begin
            state_d = StPost;
            count_d = (IndexWidth + 1)'(Depth) - (IndexWidth + 1)'(cfg_pre_trigger_i);
          end
        end else if (store) begin
          count_d = count_q + 1'b1;
        end
      end
      StPost: begin
        if (store) begin
          count_d = count_q - 1'b1;
          if (count_q == (IndexWidth + 1)'(1)) state_d = StDone;
        end
      end
      default: state_d = StIdle;
    endcase
    if (arm_i) begin
      state_d = StPre;
      count_d = '0;
      skip_d  = '0;
    end
  end

  always_ff @(posedge clk_i) begin
    if (store) begin
      mem[write_q] <= {lane(cfg_lane_i[3]), lane(cfg_lane_i[2]), lane(cfg_lane_i[1]), lane(cfg_lane_i[0])};
    end
  end

  // In state done the ring is full: its oldest record is the next to be written.
  always_ff @(posedge clk_i) begin
    if (done_o) lane_o <= mem[write_q+read_record_i];
  end

  always_ff @(posedge clk_i) begin
    state_q <= state_d;
    write_q <= write_d;
    count_q <= count_d;
    skip_q  <= skip_d;
    if (rst_i) begin
      state_q <= StIdle;
      write_q <= '0;
      count_q <= '0;
      skip_q  <= '0;
    end
  end

endmodule
`default_nettype wire
