// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Sample scheduler: decides in which clock the converter holds its inputs.
//
// Modes (fl_pkg::sched_mode_e): CONTINUOUS one strobe every period; CARRIER the same grid, restarted at cfg_offset_i
// after every carrier start; ONCE one strobe a carrier, at cfg_offset_i after its start.
// cfg_period_i (clocks, below 16 counts as 16) is also the least spacing of two strobes in every mode: a strobe that
// would come too early waits. In CARRIER the old grid goes on during the offset as long as it cannot delay the strobe
// that restarts it, so offset >= period is always met to the clock. An offset longer than the carrier never fires ONCE.
//
// Latency: carrier_start_i at clock k, strobe_o at k + StartToStrobeCycles + offset. The gate pins follow the carrier
// by one clock too (registered guard), so the offset counts from the change of the pins, dead time not included.
`default_nettype none
module fl_sample_scheduler
  import fl_pkg::*;
#(
    localparam int unsigned StartToStrobeCycles = 1
) (
    input  logic               clk_i,
    input  logic               rst_i,
    input  sched_mode_e        cfg_mode_i,
    input  logic        [15:0] cfg_period_i,     // clocks
    input  logic        [15:0] cfg_offset_i,     // clocks
    input  logic               carrier_start_i,  // first clock of a carrier
    output logic               strobe_o
);

  localparam logic [15:0] MinPeriod = 16'd16;

  logic [15:0] period;
  logic [15:0] space_q;  // clocks in which no strobe is allowed yet
  logic [15:0] wait_d, wait_q;  // clocks until the strobe that belongs to the carrier start
  logic restart_d, restart_q;  // that strobe is still to come
  logic fire, strobe_q;

  assign period    = (cfg_period_i < MinPeriod) ? MinPeriod : cfg_period_i;
  assign wait_d    = carrier_start_i ? cfg_offset_i : wait_q;
  assign restart_d = carrier_start_i || restart_q;

  always_comb begin
    fire = 1'b0;
    if (space_q == '0) begin
      unique case (cfg_mode_i)
        SchedContinuous: fire = 1'b1;
        SchedCarrier:    fire = !restart_d || wait_d == '0 || wait_d >= period;
        SchedOnce:       fire = restart_d && wait_d == '0;
        default:         fire = 1'b0;
      endcase
    end
  end

  always_ff @(posedge clk_i) begin
    strobe_q  <= fire;
    space_q   <= fire ? period - 16'd1 : (space_q == '0) ? '0 : space_q - 16'd1;
    wait_q    <= (wait_d == '0) ? '0 : wait_d - 16'd1;
    restart_q <= restart_d && !(fire && wait_d == '0);
    if (rst_i) begin
      strobe_q  <= 1'b0;
      space_q   <= '0;
      wait_q    <= '0;
      restart_q <= 1'b0;
    end
  end

  assign strobe_o = strobe_q;

endmodule
`default_nettype wire
