// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of guards, trips and lock behind their registers, for every access in every clock and all other inputs: what the
// firmware can write, and what it cannot. Gates are taken from the pins: on is the level that the polarity makes of it.
//
// One of the two guards is cut off by the script: its outputs are free in every clock, so whatever it does, and whatever
// upset it suffers, what is proved here of the pins rests on the other one, `Kept`. Each guard is kept in one task.
//
// Monitors know bus, pins and the registers' fields. The invariants at the end only tie them to the kept guard, so that
// induction closes.
`default_nettype none
module fl_safety_wb_f
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter  int unsigned Phases        = 3,
    parameter  int unsigned Kept          = 0,
    parameter  bit          HighActiveLow = 1'b0,
    parameter  bit          LowActiveLow  = 1'b0,
    localparam int unsigned Channels      = 2 * Phases + 3
) (
    input logic                     clk_i,
    input logic                     rst_i,
    input bus_req_t                 req_i,
    input logic                     stb_i,
    input stamp_t                   now_i,
    input logic                     adc_valid_i,
    input adc_code_t [Channels-1:0] adc_code_i,
    input logic                     fault_pin_i,
    input logic                     adc_fault_i,
    input logic                     clock_fault_i,
    input logic                     lost_i,
    input logic                     deadline_i,
    input logic      [  Phases-1:0] req_h_i,
    input logic      [  Phases-1:0] req_l_i
);

  logic [31:0] rdat_o;
  logic [Phases-1:0] gate_h_o, gate_l_o;
  logic [2*Phases-1:0] gate_o;
  logic brake_o, driver_enable_o, tripped_o, trip_event_o;
  trip_t trip_cause_o;

  fl_safety_wb #(
      .Phases       (Phases),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow)
  ) dut (
      .*
  );

  // What a leg waits after a reset: the longest dead time.
  localparam logic [9:0] ResetWait = 10'd1023;

  // Writes of this clock.
  logic key_written, lock_written, guard_written;
  function automatic logic written(logic [6:0] address, logic [3:0] lanes);
    return stb_i && req_i.we && req_i.adr[6:0] == address && (req_i.sel & lanes) == lanes;
  endfunction
  assign guard_written = written(7'h00, 4'b0001);
  assign key_written   = written(7'h14, 4'b0010) && req_i.wdat[15:8] == 8'hA5;
  assign lock_written  = written(7'h2C, 4'b0011) && req_i.wdat[15:0] == 16'h10CC;

  // Registers.
  logic locked;
  trip_t latched, now, enables;
  logic [9:0] dead_time;
  logic safe_state;
  assign locked     = dut.hwif_in.monitor.locked.next;
  assign latched    = dut.hwif_in.trip.latched.next;
  assign now        = dut.hwif_in.trip.now.next;
  assign enables    = dut.hwif_out.trip_enable.source.value;
  assign safe_state = dut.hwif_out.guard.safe_state.value;
  assign dead_time  = dut.hwif_out.dead_time.cycles.value < 10'd2 ? 10'd2 : dut.hwif_out.dead_time.cycles.value;
  localparam int unsigned SettingsWidth = 1 + 10 + 8 + 48 + 24 + 1 + 24 + 32 + 20 + 16;
  logic [SettingsWidth-1:0] settings, settings_q;
  assign settings = {
    dut.hwif_out.guard.safe_state.value,
    dut.hwif_out.dead_time.cycles.value,
    dut.hwif_out.trip_enable.source.value,
    dut.hwif_out.current_limit.phase_lsb.value,
    dut.hwif_out.current_limit.dc_lsb.value,
    dut.hwif_out.voltage_limit.over_lsb.value,
    dut.hwif_out.voltage_limit.under_lsb.value,
    dut.hwif_out.watchdog.cycles.value,
    dut.hwif_out.brake.enable.value,
    dut.hwif_out.brake_level.on_lsb.value,
    dut.hwif_out.brake_level.off_lsb.value,
    dut.hwif_out.brake_time.cycles.value,
    dut.hwif_out.sample_age.cycles.value,
    dut.hwif_out.lock.key.value
  };

  logic first = 1'b1;
  logic rst_q, rst_before_q, trip_q, safe_state_q, locked_q, key_q, key_before_q, lock_q, lock_before_q;
  trip_t latched_q, due_q;
  // keyed: the key has been written since the last trip began, or there was none since reset. released: then the guard
  // was enabled by a write, and nothing has ended that.
  logic keyed, released, released_q;
  always_ff @(posedge clk_i) begin
    first         <= 1'b0;
    rst_q         <= rst_i;
    rst_before_q  <= rst_q;
    trip_q        <= tripped_o && !rst_i;
    safe_state_q  <= safe_state;
    locked_q      <= locked && !rst_i;
    settings_q    <= settings;
    key_q         <= key_written;
    key_before_q  <= key_q;
    lock_q        <= lock_written && !rst_i;
    lock_before_q <= lock_q;
    latched_q     <= latched;
    due_q         <= now & enables;
    released_q    <= released && !rst_i;
    keyed         <= rst_i || key_written || (keyed && (!tripped_o || trip_q));
    released      <= !rst_i && !tripped_o && (guard_written ? req_i.wdat[0] && keyed : released);
  end

  always_comb begin
    if (first) assume (rst_i);
    else begin
      // Verifies: SAFE-24
      a_enable : assert (dut.hwif_out.guard.enable.value == released);
      a_tripped : assert (tripped_o || (latched | (now & enables)) == '0);
      if (!rst_q) begin
        // Verifies: SAFE-10
        a_latch : assert ((due_q & ~latched) == '0);
        // Verifies: SAFE-14
        a_held : assert (!locked_q || (locked && settings == settings_q));
        a_lock : assert (!lock_before_q || locked);
        // Verifies: SAFE-10, SAFE-24
        a_key : assert (tripped_o || !trip_q || key_before_q);
        // Verifies: SAFE-10
        a_cleared : assert ((latched_q & ~latched) == '0 || key_before_q);
        a_gone : assert ((latched_q & ~latched & due_q) == '0);
      end
      // Invariants.
      assert (tripped_o || keyed);
      assert ((!dut.clear || key_q) && (!key_q || keyed) && (latched == '0 || trip_q));
      assert (!lock_q || locked || dut.hwif_out.lock.key.value == 16'h10CC);
    end
  end

  // Clocks since reset; saturates, as all counts here, at the longest dead time.
  logic [9:0] age;
  always_ff @(posedge clk_i) age <= rst_i ? '0 : (&age ? age : age + 10'd1);

  for (genvar x = 0; x < Phases; x++) begin : gen_leg
    // Bit 0: upper gate, 1: lower gate; at the pins, in the kept guard, and what that guard says.
    logic [1:0] on, kept, block;
    logic [9:0] left;
    assign on    = {gate_l_o[x] ^ LowActiveLow, gate_h_o[x] ^ HighActiveLow};
    assign kept  = {dut.g_guard[Kept].u_guard.gate_l_q[x], dut.g_guard[Kept].u_guard.gate_h_q[x]};
    assign block = {dut.g_guard[Kept].u_guard.block_l_q[x], dut.g_guard[Kept].u_guard.block_h_q[x]};
    assign left  = dut.g_guard[Kept].u_guard.wait_q[x];
    // Since reset: the gate was on at the pin, in the kept guard. Locked when it was on last. Clocks that it has been off
    // before this one. The least dead time that the register has held since it was on at the pin; the dead time with which
    // it was on in the kept guard.
    logic [1:0] been, kept_been, held;
    logic [1:0][9:0] off, kept_off, least, need;
    always_ff @(posedge clk_i) begin
      for (int unsigned g = 0; g < 2; g++) begin
        been[g]      <= been[g] || on[g];
        kept_been[g] <= kept_been[g] || kept[g];
        off[g]       <= on[g] ? '0 : (&off[g] ? off[g] : off[g] + 10'd1);
        kept_off[g]  <= kept[g] ? '0 : (&kept_off[g] ? kept_off[g] : kept_off[g] + 10'd1);
        if (on[g]) held[g] <= locked;
        if (on[g] || (been[g] && dead_time < least[g])) least[g] <= dead_time;
        if (kept[g]) need[g] <= dead_time;
      end
      if (rst_i) begin
        been      <= '0;
        kept_been <= '0;
        held      <= '0;
        off       <= '0;
        kept_off  <= '0;
        least     <= {2{ResetWait}};
        need      <= {2{ResetWait}};
      end
    end

    always_comb begin
      if (!first) begin
        // Verifies: SAFE-01, SAFE-16, SAFE-22
        a_never_both : assert (on != 2'b11);
        // Verifies: SAFE-24
        a_reset : assert (!rst_q || on == '0);
        a_off_h : assert (!on[0] || (released_q && !trip_q));
        a_off_l : assert (!on[1] || (released_q && !trip_q) || (trip_q && safe_state_q));
        // Verifies: SAFE-02, SAFE-22
        if (on[0]) a_gap_h : assert (off[1] >= least[1]);
        if (on[1]) a_gap_l : assert (off[0] >= least[0]);
        // Verifies: SAFE-16
        if (on[0] && held[1]) a_locked_gap_h : assert (off[1] >= dead_time);
        if (on[1] && held[0]) a_locked_gap_l : assert (off[0] >= dead_time);

        // Invariants: pins and kept guard; its own, as in fl_gate_guard_f; after a reset it waits before the first gate.
        assert (kept != 2'b11 && (on & ~kept) == '0 && (been & ~kept_been) == '0);
        assert ((kept_been | kept) == '0 || age >= ResetWait);
        for (int unsigned g = 0; g < 2; g++) begin
          assert (off[g] >= kept_off[g]);
          assert (been[g] ? least[g] <= need[g] : (least[g] == ResetWait && off[g] == age && !held[g]));
          assert (kept_been[g] || (need[g] == ResetWait && kept_off[g] == age));
          assert (!held[g] || (locked && least[g] == dead_time));
          if (kept[1-g]) assert (kept_off[g] >= need[g]);
          if (!kept[g] && !block[1-g]) assert (kept_off[g] >= need[g]);
          if (kept == '0 && block[1-g]) assert (11'(kept_off[g]) + 11'(left) >= 11'(need[g]));
        end
      end
    end
  end

endmodule
`default_nettype wire
