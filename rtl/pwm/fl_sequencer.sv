// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Six-step sequencer: sector to leg commands, and leg commands with the carrier's pulse to gate requests.
//
// Sector index 0..5 = I..VI = A+B-, A+C-, B+C-, B+A-, C+A-, C+B- (upper leg A A B B C C, lower leg B C C A A B).
// Forward counts up, reverse down. Every phase conducts for two sectors in a row; which of the two legs chops:
//
//   pattern     | forward I III V | forward II IV VI | reverse I III V | reverse II IV VI
//   ON-PWM      | lower           | upper            | upper           | lower
//   H_PWM-L_ON  | upper           | upper            | upper           | upper
//   PWM-ON      | upper           | lower            | lower           | upper
//   H_ON-L_PWM  | lower           | lower            | lower           | lower
//
// ON-PWM chops in the last 60 degrees of a phase's conduction: forward in I that is B (conducting since VI), in reverse
// it is A (conducting since II).
//
// Timing: apply_i or update_i at clock k, sector_o and leg_cmd_o at k + 1; the requests are combinational in leg_cmd_o
// and pulse_i. sync_rect lets the other switch of a chopping leg conduct while the pulse is off (dead time: guard).
// An update that enters SIX_STEP loads the sector from cfg_start_sector_i (above 5: 0), with cfg_start_hall_i and a
// valid Hall code from hall_position_i, the sector for positive speed (three further in reverse). apply_i has no effect
// in that clock, nor outside SIX_STEP; with load_i it goes to load_sector_i (0..5) instead of the next sector.
// Asserted: no leg is asked for both switches; sector_o is 0..5.
`default_nettype none
module fl_sequencer
  import fl_pkg::*;
#(
    parameter int unsigned Phases = 3
) (
    input  logic                       clk_i,
    input  logic                       rst_i,
    input  logic                       update_i,
    input  seq_mode_e                  cfg_mode_i,
    input  chop_pattern_e              cfg_pattern_i,
    input  logic                       cfg_sync_rect_i,
    input  logic                       cfg_reverse_i,
    input  sector_t                    cfg_start_sector_i,
    input  logic                       cfg_start_hall_i,
    input  sector_t                    hall_position_i,     // 0..5
    input  logic                       hall_ok_i,
    input  leg_cmd_e      [Phases-1:0] cfg_manual_i,
    input  logic                       apply_i,             // step to the next sector...
    input  logic                       load_i,              // ...or, with this, to
    input  sector_t                    load_sector_i,
    input  logic                       pulse_i,
    output sector_t                    sector_o,
    output logic                       active_o,            // mode is not OFF
    output logic                       comm_applied_o,      // first clock of a new sector after apply_i
    output leg_cmd_e      [Phases-1:0] leg_cmd_o,
    output logic          [Phases-1:0] req_h_o,
    output logic          [Phases-1:0] req_l_o
);

  if (Phases < 3) begin : gen_illegal
    $fatal(1, "fl_sequencer: six-step needs Phases >= 3 (%m)");
  end

  seq_mode_e mode_d, mode_q;
  chop_pattern_e pattern_d, pattern_q;
  logic reverse_d, reverse_q, sync_rect_q, comm_applied_q, step;
  sector_t sector_d, sector_q;
  leg_cmd_e [Phases-1:0] leg_cmd_d, leg_cmd_q;

  // Leg that conducts to the positive and to the negative rail.
  function automatic logic [1:0] upper_leg(sector_t sector);
    unique case (sector)
      3'd2, 3'd3: return 2'd1;
      3'd4, 3'd5: return 2'd2;
      default: return 2'd0;
    endcase
  endfunction

  function automatic logic [1:0] lower_leg(sector_t sector);
    unique case (sector)
      3'd1, 3'd2: return 2'd2;
      3'd3, 3'd4: return 2'd0;
      default: return 2'd1;
    endcase
  endfunction

  // later_half: the upper leg is in the last 60 degrees of its conduction (the lower leg then in its first).
  function automatic logic upper_chops(chop_pattern_e pattern, logic later_half);
    unique case (pattern)
      ChopOnPwm:   return later_half;
      ChopHPwmLOn: return 1'b1;
      ChopPwmOn:   return !later_half;
      default:     return 1'b0;
    endcase
  endfunction

  assign mode_d    = update_i ? cfg_mode_i : mode_q;
  assign pattern_d = update_i ? cfg_pattern_i : pattern_q;
  assign reverse_d = update_i ? cfg_reverse_i : reverse_q;
  assign step      = apply_i && mode_q == SeqSixStep && mode_d == SeqSixStep;

  always_comb begin
    sector_d = sector_q;
    if (update_i && mode_q != SeqSixStep && cfg_mode_i == SeqSixStep) begin
      sector_d = (cfg_start_sector_i > 3'd5) ? 3'd0 : cfg_start_sector_i;
      if (cfg_start_hall_i && hall_ok_i) sector_d = reverse_d ? opposite_sector(hall_position_i) : hall_position_i;
    end else if (step) begin
      sector_d = load_i ? load_sector_i : sector_after(sector_q, reverse_d);
    end
  end

  logic chop_upper;
  assign chop_upper = upper_chops(pattern_d, sector_d[0] ^ reverse_d);

  // Only used in a clock with update_i or step.
  always_comb begin
    leg_cmd_d = {Phases{LegOff}};
    unique case (mode_d)
      SeqManual: leg_cmd_d = cfg_manual_i;
      SeqSixStep: begin
        leg_cmd_d[upper_leg(sector_d)] = chop_upper ? LegPwmHigh : LegHigh;
        leg_cmd_d[lower_leg(sector_d)] = chop_upper ? LegLow : LegPwmLow;
      end
      default:   leg_cmd_d = {Phases{LegOff}};
    endcase
  end

  always_ff @(posedge clk_i) begin
    comm_applied_q <= step;
    if (update_i || step) begin
      mode_q    <= mode_d;
      pattern_q <= pattern_d;
      reverse_q <= reverse_d;
      sector_q  <= sector_d;
      leg_cmd_q <= leg_cmd_d;
    end
    if (update_i) sync_rect_q <= cfg_sync_rect_i;
    if (rst_i) begin
      comm_applied_q <= 1'b0;
      mode_q         <= SeqOff;
      pattern_q      <= ChopOnPwm;
      reverse_q      <= 1'b0;
      sync_rect_q    <= 1'b0;
      sector_q       <= '0;
      leg_cmd_q      <= {Phases{LegOff}};
    end
  end

  always_comb begin
    for (int unsigned x = 0; x < Phases; x++) begin
      req_h_o[x] = 1'b0;
      req_l_o[x] = 1'b0;
      unique case (leg_cmd_q[x])
        LegHigh: req_h_o[x] = 1'b1;
        LegLow:  req_l_o[x] = 1'b1;
        LegPwmHigh: begin
          req_h_o[x] = pulse_i;
          req_l_o[x] = !pulse_i && sync_rect_q;
        end
        LegPwmLow: begin
          req_l_o[x] = pulse_i;
          req_h_o[x] = !pulse_i && sync_rect_q;
        end
        default: ;
      endcase
    end
  end

  assign sector_o       = sector_q;
  assign active_o       = mode_q != SeqOff;
  assign comm_applied_o = comm_applied_q;
  assign leg_cmd_o      = leg_cmd_q;

  always_ff @(posedge clk_i) begin
    if (!rst_i) begin
      assert ((req_h_o & req_l_o) == '0)
      else $error("fl_sequencer: both switches of a leg requested");
      assert (sector_q <= 3'd5)
      else $error("fl_sequencer: no such sector");
    end
  end

endmodule
`default_nettype wire
