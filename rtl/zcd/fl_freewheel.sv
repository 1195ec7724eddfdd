// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Freewheel measurement: time from a commutation until the current of the phase that it opened has decayed.
//
// The current has decayed when it is at or below cfg_limit_i in the direction in which it flowed at the first sample of
// the visit, so also when it has changed sign. Time of a measurement:
//   t = t_before + gap * (|i_before| - limit) / (|i_before| - |i|) - t_commutation,
// the straight line between the last sample before and the first one after (|i| negative past zero), rounded. When
// the first sample of the visit has decayed already, or the gap is above 65535 clocks: that sample's time.
// A commutation that comes first leaves the measurement open: value all ones, open flag.
//
// t_commutation is the first clock with the new gates (comm_applied_i + 1). A sample belongs to the visit by its sector
// and by its time. Values are clocks, 24 bits, saturating; |i| of -2^17 counts as 2^17 - 1.
// last_*: the last measurement. snap_*: sum, count, longest (with sector) and number of open ones since the tick before,
// taken at tick_i; a measurement with done_o in the clock of the tick belongs to the next. sum and counts saturate.
// Settings are taken over at update_i (reset: disabled). Enabling begins with the next commutation.
// Latency: sample_valid_i to done_o 5 clocks direct, 23 interpolated.
`default_nettype none
module fl_freewheel
  import fl_pkg::*;
#(
    parameter  int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3
) (
    input logic   clk_i,
    input logic   rst_i,
    input stamp_t now_i,

    input logic        update_i,
    input logic        cfg_enable_i,
    input logic [16:0] cfg_limit_i,   // 2^17 = full scale

    input logic    comm_applied_i,  // first clock of a new sector
    input sector_t sector_i,        // sequencer's sector

    input logic                   sample_valid_i,
    input sample_t [Channels-1:0] sample_i,
    input stamp_t                 sample_time_i,
    input sector_t                sample_sector_i,

    output logic           done_o,         // pulse: last_* are new
    output logic    [23:0] last_cycles_o,
    output sector_t        last_sector_o,
    output logic           last_open_o,

    input  logic           tick_i,
    output logic    [31:0] snap_sum_o,
    output logic    [23:0] snap_max_o,
    output sector_t        snap_max_sector_o,
    output logic    [15:0] snap_count_o,
    output logic    [15:0] snap_open_o
);

  if (Phases < 3) begin : gen_illegal
    $fatal(1, "fl_freewheel: six-step needs Phases >= 3 (%m)");
  end

  logic enable_q;
  logic [16:0] limit_q;

  always_ff @(posedge clk_i) begin
    if (update_i) begin
      enable_q <= cfg_enable_i;
      limit_q  <= cfg_limit_i;
    end
    if (rst_i) enable_q <= 1'b0;
  end

  // Samples: current of the phase that floats in their sector.
  logic valid1_q, valid2_q, valid3_q, mine_q;
  sample_t current_q;
  stamp_t time_q, since, since_q, comm_time_q, gap;
  sector_t sector_q, comm_sector_q;

  // The measurement that runs.
  logic armed_q;  // from the commutation to the decay
  logic have_before_q, negative_q;
  logic signed [18:0] above, above_q;  // current above the limit, in its first direction
  logic signed [18:0] directed;
  logic [16:0] before_q;  // above the limit, last sample before
  logic [15:0] gap_q;
  logic gap_long_q, negative;
  stamp_t before_since_q, base_q;
  logic decayed, interpolate;

  assign since    = time_q - comm_time_q;
  assign negative = have_before_q ? negative_q : current_q[17];
  assign directed = negative ? -19'(current_q) : 19'(current_q);
  assign above    = directed - 19'($signed({1'b0, limit_q}));
  assign gap      = since_q - before_since_q;

  always_ff @(posedge clk_i) begin
    valid1_q <= sample_valid_i && enable_q;
    // What is in the pipeline when the sector changes belongs to the visit before.
    valid2_q <= valid1_q && !comm_applied_i;
    valid3_q <= valid2_q && !comm_applied_i;
    if (sample_valid_i && enable_q) begin
      current_q <= sample_i[Phases+32'(floating_phase(sample_sector_i))];
      time_q    <= sample_time_i;
      sector_q  <= sample_sector_i;
    end
    if (valid1_q) begin
      since_q <= since;
      mine_q  <= sector_q == comm_sector_q && !since[31];
      above_q <= above;
    end
    if (valid2_q) begin
      gap_q      <= gap[15:0];
      gap_long_q <= gap[31:16] != '0;
    end
    if (rst_i) begin
      valid1_q <= 1'b0;
      valid2_q <= 1'b0;
      valid3_q <= 1'b0;
    end
  end

  assign decayed     = valid3_q && mine_q && armed_q && (above_q <= 19'sd0);
  assign interpolate = decayed && have_before_q && !gap_long_q;

  logic direct_q, waiting_q, busy, interpolated, finish, open;
  logic [15:0] offset;
  logic [31:0] value;
  logic [23:0] cycles;

  assign open = comm_applied_i && (armed_q || waiting_q) && enable_q;

  always_ff @(posedge clk_i) begin
    direct_q <= decayed && !interpolate;
    if (valid3_q && mine_q && armed_q) begin
      if (decayed) begin
        armed_q   <= 1'b0;
        waiting_q <= interpolate;
        base_q    <= interpolate ? before_since_q : since_q;
      end else begin
        have_before_q  <= 1'b1;
        negative_q     <= have_before_q ? negative_q : current_q[17];
        before_q       <= (above_q > 19'sd131071) ? '1 : above_q[16:0];
        before_since_q <= since_q;
      end
    end
    if (interpolated) waiting_q <= 1'b0;
    if (comm_applied_i) begin
      armed_q       <= enable_q;
      waiting_q     <= 1'b0;
      have_before_q <= 1'b0;
      comm_time_q   <= now_i + 32'd1;
      comm_sector_q <= sector_i;
      direct_q      <= 1'b0;
    end
    if (!enable_q || rst_i) begin
      armed_q       <= 1'b0;
      waiting_q     <= 1'b0;
      have_before_q <= 1'b0;
      direct_q      <= 1'b0;
    end
  end

  // How far the current fell past the limit; more than the interpolator holds ends at its limit.
  logic [17:0] after;
  assign after = 18'(-above_q);

  fl_interpolator #(
      .TimeBits (16),
      .ValueBits(18)
  ) u_interpolator (
      .clk_i,
      .rst_i,
      .start_i (interpolate),
      .abort_i (interpolate),
      .gap_i   (gap_q),
      .before_i({1'b0, before_q}),
      .after_i (after),
      .busy_o  (busy),
      .valid_o (interpolated),
      .offset_o(offset)
  );

  // Result and statistics.
  assign finish = direct_q || (interpolated && waiting_q && !comm_applied_i);
  assign value  = base_q + (direct_q ? '0 : 32'(offset));
  assign cycles = open ? '1 : (value[31:24] != '0) ? '1 : value[23:0];

  logic [31:0] sum_q;
  logic [32:0] sum;
  logic [23:0] max_q;
  sector_t max_sector_q;
  logic [15:0] count_q, open_q;

  // A clock after the result.
  logic count_done, count_open;
  assign count_done = done_o && !last_open_o;
  assign count_open = done_o && last_open_o;
  assign sum        = {1'b0, sum_q} + 33'(last_cycles_o);

  always_ff @(posedge clk_i) begin
    done_o <= finish || open;
    if (finish || open) begin
      last_cycles_o <= cycles;
      last_sector_o <= comm_sector_q;
      last_open_o   <= open;
    end
    if (tick_i) begin
      snap_sum_o        <= sum_q;
      snap_max_o        <= max_q;
      snap_max_sector_o <= max_sector_q;
      snap_count_o      <= count_q;
      snap_open_o       <= open_q;
      sum_q             <= '0;
      max_q             <= '0;
      max_sector_q      <= '0;
      count_q           <= '0;
      open_q            <= '0;
    end
    if (done_o && (tick_i || last_cycles_o > max_q)) begin
      max_q        <= last_cycles_o;
      max_sector_q <= last_sector_o;
    end
    if (count_done) begin
      sum_q <= tick_i ? 32'(last_cycles_o) : sum[32] ? '1 : sum[31:0];
      if (tick_i || count_q != '1) count_q <= tick_i ? 16'd1 : count_q + 16'd1;
    end
    if (count_open && (tick_i || open_q != '1)) open_q <= tick_i ? 16'd1 : open_q + 16'd1;
    if (rst_i) begin
      done_o            <= 1'b0;
      last_cycles_o     <= '0;
      last_sector_o     <= '0;
      last_open_o       <= 1'b0;
      snap_sum_o        <= '0;
      snap_max_o        <= '0;
      snap_max_sector_o <= '0;
      snap_count_o      <= '0;
      snap_open_o       <= '0;
      sum_q             <= '0;
      max_q             <= '0;
      max_sector_q      <= '0;
      count_q           <= '0;
      open_q            <= '0;
    end else begin
      assert (!(interpolate && busy))
      else $error("fl_freewheel: measurement while the one before is being worked out");
    end
  end

endmodule
`default_nettype wire
