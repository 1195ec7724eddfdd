// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Clock monitor: one clock watches another one by the beat that the other makes, and gives a beat for itself.
//
// Two of them, one in each domain, see every clock that stops: neither needs the clock that it watches.
//
//   beat_o   toggles every BeatCycles clocks of clk_i, also while hold_i is high
//   bad_o    rises when beat_i toggles twice in fewer than LeastCycles clocks (the watched clock is too fast), or not
//            within MostCycles clocks (too slow, or stopped). It stays until hold_i.
//   hold_i   high: does not watch, bad_o falls. The first toggle after it only starts the measurement.
//
// With clk_i at f, the other clock at g and its BeatCycles at N, toggles are N f / g clocks apart. The synchroniser moves
// each by up to a clock either way, so a good clock needs
//   LeastCycles <= floor(N f_min / g) - 1,  MostCycles >= ceil(N f_max / g) + 1
// and a clock below N f_min / (MostCycles + 2) or above N f_max / (LeastCycles - 2) is found for certain.
//
// Latency: bad_o is high after clock edge MostCycles + 3 behind the last toggle of beat_i at the latest.
// Clock domains: beat_i and hold_i are asynchronous, each passes fl_sync. bad_o and beat_o are registers of clk_i. There is
// no reset: from configuration on, which leaves flip-flops at 0, bad_o is high until hold_i has been there.
// Asserted: bad_o falls by hold_i alone. Proved for all inputs: cocotb_tests/safety/fl_clock_monitor.sby.
`default_nettype none
module fl_clock_monitor #(
    parameter int unsigned BeatCycles  = 64,  // power of two
    parameter int unsigned LeastCycles = 41,
    parameter int unsigned MostCycles  = 59
) (
    input  logic clk_i,
    input  logic hold_i,  // asynchronous
    input  logic beat_i,  // asynchronous: beat_o of the other monitor
    output logic beat_o,
    output logic bad_o = 1'b1
);

  if (BeatCycles < 2 || (BeatCycles & (BeatCycles - 1)) != 0) begin : gen_illegal_beat
    $fatal(1, "fl_clock_monitor: BeatCycles must be a power of two from 2 on (%m)");
  end
  if (LeastCycles < 2 || MostCycles <= LeastCycles) begin : gen_illegal_limits
    $fatal(1, "fl_clock_monitor: limits must be 2 <= LeastCycles < MostCycles (%m)");
  end

  localparam int unsigned CountWidth = $clog2(MostCycles + 1);
  localparam int unsigned BeatWidth = $clog2(BeatCycles) + 1;
  typedef logic [CountWidth-1:0] count_t;

  logic hold, beat;
  fl_sync u_hold (
      .clk_i,
      .rst_i  (1'b0),
      .async_i(hold_i),
      .sync_o (hold)
  );
  fl_sync u_beat (
      .clk_i,
      .rst_i  (1'b0),
      .async_i(beat_i),
      .sync_o (beat)
  );

  logic beat_q, toggled, begun_q;
  count_t count_q;  // clocks since the last toggle, less 1
  logic [BeatWidth-1:0] divider_q = '0;

  assign toggled = beat != beat_q;
  assign beat_o  = divider_q[BeatWidth-1];

  always_ff @(posedge clk_i) begin
    divider_q <= divider_q + BeatWidth'(1);
    beat_q    <= beat;
    if (hold) begin
      count_q <= '0;
      begun_q <= 1'b0;
      bad_o   <= 1'b0;
    end else begin
      if (toggled) begin
        count_q <= '0;
        begun_q <= 1'b1;
        if (begun_q && count_q < count_t'(LeastCycles - 1)) bad_o <= 1'b1;
      end else if (count_q >= count_t'(MostCycles - 1)) begin
        bad_o <= 1'b1;
      end else begin
        count_q <= count_q + count_t'(1);
      end
    end
  end

  logic kept_q;
  always_ff @(posedge clk_i) begin
    kept_q <= bad_o && !hold;
    assert (!kept_q || bad_o)
    else $error("fl_clock_monitor: a bad clock was forgotten");
  end

endmodule
`default_nettype wire
