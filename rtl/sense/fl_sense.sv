// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Sensing: offset and gain correction of all converter channels on one multiplier, time stamp and PWM state of every
// sample set, auto-zero, and the coherent snapshot for the control step.
//
// Channels: v0..v(P-1), i0..i(P-1), vdc, idc, vsm (P = Phases).
//   d = code * 16 - offset_q4,  doubled for currents and idc, saturated to 18 bits;  y = round(d * gain_q15 / 2^14),
// saturated to 18 bits. Code full scale <-> 2^17: a voltage code with gain 1 gives 32 a LSB, a current code (offset
// 2048.0) 64 a LSB.
//
// A set: strobe_i stamps time and PWM state (both of the strobe's clock), adc_valid_i hands over the codes, and
// sample_valid_o follows Latency clocks later with sample_o, sample_time_o = strobe time - cfg_delay_i,
// sample_pwm_o and sample_number_o (the first set after reset is 1). All stay stable until the next sample_valid_o.
// The phase currents are corrected first: current_valid_o with current_o and current_time_o, which hold in that clock
// only, CurrentLatency clocks after adc_valid_i.
// One conversion is in flight: adc_valid_i belongs to the latest strobe before it (the next strobe may come in the same
// clock); a valid without a strobe is ignored, a strobe without a valid is forgotten at the next strobe.
// Least spacing of sets: Channels + 3 clocks (asserted; a closer one is ignored).
//
// Snapshot: at tick_i the latest complete set (one published in this very clock included) and the sums of idc and vdc
// over the sets since the tick before; sums saturate at 32 bits, their count at 16.
// Settings act at once, on the channel that is being corrected.
`default_nettype none
module fl_sense
  import fl_pkg::*;
#(
    parameter int unsigned Phases = 3,
    localparam int unsigned Channels = 2 * Phases + 3,
    localparam int unsigned Latency = Channels + 4,  // clocks from adc_valid_i to sample_valid_o
    localparam int unsigned CurrentLatency = Phases + 4  // to current_valid_o
) (
    input logic clk_i,
    input logic rst_i,

    input logic                      strobe_i,
    input stamp_t                    now_i,
    input pwm_state_t                pwm_state_i,
    input logic                      adc_valid_i,
    input adc_code_t  [Channels-1:0] adc_code_i,

    input logic [        15:0]       cfg_delay_i,   // clocks
    input logic [Channels-1:0][17:0] cfg_offset_i,  // signed Q12.4, converter LSB
    input logic [Channels-1:0][15:0] cfg_gain_i,    // unsigned Q1.15

    input  logic                      az_start_i,
    input  logic [         3:0]       az_log2_i,
    input  logic [Channels-1:0]       az_mask_i,
    output logic                      az_busy_o,
    output logic [Channels-1:0]       az_offset_we_o,
    output logic [Channels-1:0][17:0] az_offset_o,     // signed Q12.4

    output logic                 current_valid_o,
    output sample_t [Phases-1:0] current_o,
    output stamp_t               current_time_o,

    output logic                      sample_valid_o,
    output sample_t    [Channels-1:0] sample_o,
    output stamp_t                    sample_time_o,
    output pwm_state_t                sample_pwm_o,
    output logic       [        31:0] sample_number_o,

    input  logic                       tick_i,
    output logic        [        31:0] snap_number_o,
    output stamp_t                     snap_time_o,
    output logic signed [        31:0] snap_idc_sum_o,
    output logic signed [        31:0] snap_vdc_sum_o,
    output logic        [        15:0] snap_count_o,
    output sample_t     [Channels-1:0] snap_sample_o
);

  if (Phases < 2 || Phases > 5) begin : gen_illegal
    $fatal(1, "fl_sense: Phases must be 2..5, more channels do not fit the least sample period (%m)");
  end

  localparam int unsigned VdcChannel = 2 * Phases;
  localparam int unsigned IdcChannel = 2 * Phases + 1;
  localparam logic [3:0] FirstCurrent = 4'(Phases);
  localparam logic [3:0] LastCurrent = 4'(2 * Phases - 1);
  localparam logic [3:0] LastVoltage = 4'(Phases - 1);
  localparam logic [3:0] LastChannel = 4'(Channels - 1);

  // Order of correction: the phase currents, which the vector path waits for, before the voltages.
  function automatic logic [3:0] after(logic [3:0] channel);
    unique case (channel)
      LastCurrent: return '0;
      LastVoltage: return 4'(VdcChannel);
      default:     return channel + 4'd1;
    endcase
  endfunction

  // Channels with zero in the middle of the converter range.
  function automatic logic is_current(logic [3:0] channel);
    return (32'(channel) >= Phases && 32'(channel) < 2 * Phases) || 32'(channel) == IdcChannel;
  endfunction

  // Strobe in flight, and the set that is being corrected.
  logic pending_q;
  stamp_t strobe_time_q, set_time_q;
  pwm_state_t strobe_pwm_q, set_pwm_q;
  logic accept, busy;

  // Stage 0: issue one channel a clock, the phase currents first.
  logic issue_q, valid1_q, valid2_q, valid3_q;  // occupied: stage 0, 1, 2, 3
  logic [3:0] channel_q;
  adc_code_t [Channels-1:0] code_q;  // channel_q's code in the lowest place

  // A set's stamps must outlive its last channel's way to stage 3.
  assign busy   = issue_q || valid1_q || valid2_q;
  assign accept = adc_valid_i && pending_q && !busy;

  always_ff @(posedge clk_i) begin
    if (adc_valid_i) pending_q <= 1'b0;
    if (strobe_i) begin
      pending_q     <= 1'b1;
      strobe_time_q <= now_i - stamp_t'(cfg_delay_i);
      strobe_pwm_q  <= pwm_state_i;
    end
    if (accept) begin
      set_time_q <= strobe_time_q;
      set_pwm_q  <= strobe_pwm_q;
      code_q     <= {adc_code_i[Channels-1:2*Phases], adc_code_i[Phases-1:0], adc_code_i[2*Phases-1:Phases]};
      channel_q  <= FirstCurrent;
      issue_q    <= 1'b1;
    end else if (issue_q) begin
      code_q    <= code_q >> AdcWidth;
      channel_q <= after(channel_q);
      issue_q   <= channel_q != LastChannel;
    end
    if (rst_i) begin
      pending_q <= 1'b0;
      issue_q   <= 1'b0;
    end else begin
      assert (!(adc_valid_i && busy))
      else $error("fl_sense: sample sets closer than Channels + 3 clocks");
    end
  end

  // Stages 1 operands, 2 difference, 3 product.
  logic last1_q, last2_q, last3_q, double1_q;
  logic currents1_q, currents2_q, currents3_q;  // the last of the phase currents
  adc_code_t code1_q;
  logic signed [17:0] offset1_q;
  logic [15:0] gain1_q, gain2_q;
  sample_t diff2_q;
  logic signed [35:0] product3_q;
  logic signed [19:0] diff;

  assign diff = 20'($signed({1'b0, code1_q, 4'd0})) - 20'(offset1_q);

  // Stage 4: round, saturate, collect.
  logic signed [22:0] rounded;
  sample_t corrected;
  sample_t [Channels-2:0] collect_q;  // the newest in the highest place
  sample_t [Channels-1:0] collected;

  assign rounded   = 23'(product3_q >>> 14) + 23'($signed({1'b0, product3_q[13]}));
  assign corrected = sat_sample(32'(rounded));

  assign collected = {corrected, collect_q};

  logic current_valid_q, sample_valid_q;
  sample_t [Channels-1:0] sample_q;
  stamp_t sample_time_q;
  pwm_state_t sample_pwm_q;
  logic [31:0] number_q;

  always_ff @(posedge clk_i) begin
    valid1_q        <= issue_q;
    valid2_q        <= valid1_q;
    valid3_q        <= valid2_q;
    current_valid_q <= valid3_q && currents3_q;
    sample_valid_q  <= valid3_q && last3_q;
    if (issue_q) begin
      currents1_q <= channel_q == LastCurrent;
      last1_q <= channel_q == LastChannel;
      double1_q <= is_current(channel_q);
      code1_q <= code_q[0];
      offset1_q <= cfg_offset_i[channel_q];
      gain1_q <= cfg_gain_i[channel_q];
    end
    if (valid1_q) begin
      currents2_q <= currents1_q;
      last2_q <= last1_q;
      gain2_q <= gain1_q;
      diff2_q <= sat_sample(double1_q ? 32'(diff) <<< 1 : 32'(diff));
    end
    if (valid2_q) begin
      currents3_q <= currents2_q;
      last3_q    <= last2_q;
      product3_q <= 36'(diff2_q) * 36'($signed({1'b0, gain2_q}));
    end
    if (valid3_q) begin
      collect_q <= collected[Channels-1:1];
      if (last3_q) begin
        sample_q      <= {collected[Channels-1:2*Phases], collected[Phases-1:0], collected[2*Phases-1:Phases]};
        sample_time_q <= set_time_q;
        sample_pwm_q  <= set_pwm_q;
        number_q      <= number_q + 32'd1;
      end
    end
    if (rst_i) begin
      valid1_q        <= 1'b0;
      valid2_q        <= 1'b0;
      valid3_q        <= 1'b0;
      current_valid_q <= 1'b0;
      sample_valid_q  <= 1'b0;
      sample_q        <= '0;
      sample_time_q   <= '0;
      sample_pwm_q    <= '0;
      number_q        <= '0;
    end
  end

  assign current_valid_o = current_valid_q;
  assign current_o       = collect_q[Channels-2-:Phases];
  assign current_time_o  = set_time_q;

  assign sample_valid_o  = sample_valid_q;
  assign sample_o        = sample_q;
  assign sample_time_o   = sample_time_q;
  assign sample_pwm_o    = sample_pwm_q;
  assign sample_number_o = number_q;

  // Auto-zero on the raw codes; the mean is on the bus of every channel, the write enable picks one.
  logic [17:0] az_mean;

  fl_auto_zero #(
      .Channels(Channels)
  ) u_auto_zero (
      .clk_i,
      .rst_i,
      .start_i     (az_start_i),
      .log2_i      (az_log2_i),
      .mask_i      (az_mask_i),
      .set_i       (accept),
      .code_valid_i(issue_q),
      .channel_i   (channel_q),
      .code_i      (code_q[0]),
      .busy_o      (az_busy_o),
      .offset_we_o (az_offset_we_o),
      .offset_o    (az_mean)
  );

  assign az_offset_o = {Channels{az_mean}};

  // Snapshot and sums.
  function automatic logic signed [31:0] add_sat(logic signed [31:0] sum, sample_t x);
    logic signed [32:0] y;
    y = 33'(sum) + 33'(x);
    return (y[32] == y[31]) ? y[31:0] : {y[32], {31{!y[32]}}};
  endfunction

  logic signed [31:0] idc_sum, idc_sum_q, vdc_sum, vdc_sum_q;
  logic [15:0] count, count_q;

  assign idc_sum = sample_valid_q ? add_sat(idc_sum_q, sample_q[IdcChannel]) : idc_sum_q;
  assign vdc_sum = sample_valid_q ? add_sat(vdc_sum_q, sample_q[VdcChannel]) : vdc_sum_q;
  assign count   = (sample_valid_q && count_q != '1) ? count_q + 16'd1 : count_q;

  always_ff @(posedge clk_i) begin
    if (tick_i) begin
      snap_number_o  <= number_q;
      snap_time_o    <= sample_time_q;
      snap_sample_o  <= sample_q;
      snap_idc_sum_o <= idc_sum;
      snap_vdc_sum_o <= vdc_sum;
      snap_count_o   <= count;
    end
    if (tick_i || rst_i) begin
      idc_sum_q <= '0;
      vdc_sum_q <= '0;
      count_q   <= '0;
    end else if (sample_valid_q) begin
      idc_sum_q <= idc_sum;
      vdc_sum_q <= vdc_sum;
      count_q   <= count;
    end
    if (rst_i) begin
      snap_number_o  <= '0;
      snap_time_o    <= '0;
      snap_sample_o  <= '0;
      snap_idc_sum_o <= '0;
      snap_vdc_sum_o <= '0;
      snap_count_o   <= '0;
    end
  end

endmodule
`default_nettype wire
