// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Currents at the edges of the legs that are to come, from those of the same edges one and two injection periods before.
//
// What a leg loses to the dead time depends on the sign of its current at its own edge. That is not the current of the
// sample from which its voltage is computed: the HF current moves on, and the ripple of the carrier comes on top. Both
// repeat with the wave, and turn with the rotor; so do
//   excursion[phase][edge][leg] = i[first sample that comes after the edge] - i[step whose voltage made the edge]
//   next[phase][edge][leg] = 2 excursion - the excursion before, or excursion where none was before
//   ahead[edge][leg] = i[this step] + next[phase of this step's voltage][edge][leg]
// edge: 0 rising, 1 falling, of req_h_i. phase: place of a voltage in the wave, phase_i at start_i; the step between two
// update_i acts from the second one on. A sample belongs to the interval in which it comes: an edge after which none comes
// before the next update keeps its values of before, and so does one whose sample comes within 2 Phases clocks of
// another edge's. next is 0 until the first excursion of its phase, and for phases from 64 on: ahead is the sample then.
//
// Without a wave phase_i tells the halves of the carrier apart; what repeats is its ripple.
// enable_i low: nothing is learned, and a word of the memory becomes 0 in every clock.
// Formats: currents signed 18 bits, 2^17 = full scale; excursion, next and ahead saturate. An excursion of -2^17 counts as none.
// What a sample teaches is written into the memory 4 to 2 Phases + 3 clocks after it.
// Latency: start_i to valid_o Latency clocks; least spacing the same (asserted; a closer start_i is ignored). ahead_o
// stays until the next start_i.
// Uses two block RAMs: 1024 x 18 bits each with five phases, 512 with three.
`default_nettype none
module fl_edge_current
  import fl_pkg::*;
#(
    parameter int unsigned Phases = 3,
    localparam int unsigned Latency = 2 * Phases + 3  // clocks from start_i to valid_o
) (
    input logic clk_i,
    input logic rst_i,
    input logic enable_i,

    input logic                 update_i,        // of the leg carriers
    input logic    [Phases-1:0] req_h_i,         // requests for the upper switches
    input logic                 sample_valid_i,
    input sample_t [Phases-1:0] sample_i,        // every sample of the phase currents

    input logic                 start_i,    // a step begins
    input sample_t [Phases-1:0] current_i,  // of the step
    input logic    [      11:0] phase_i,    // of its voltage in the wave

    output logic                      valid_o,
    output sample_t [1:0][Phases-1:0] ahead_o   // [edge][leg]
);

  if (Phases < 2 || Phases > 8) begin : gen_illegal
    $fatal(1, "fl_edge_current: Phases must be 2..8 (%m)");
  end

  localparam int unsigned PhaseBits = 6;
  localparam int unsigned LegBits = idx_width(Phases);
  localparam int unsigned AddressBits = PhaseBits + 1 + LegBits;
  localparam logic [LegBits-1:0] LastLeg = LegBits'(Phases - 1);

  // An edge of a leg; counts through the legs of one edge, then of the other.
  typedef struct packed {
    logic edge_kind;
    logic [LegBits-1:0] leg;
  } place_t;

  function automatic place_t following(place_t place);
    return (place.leg == LastLeg) ? {!place.edge_kind, LegBits'(0)} : {place.edge_kind, place.leg + LegBits'(1)};
  endfunction

  function automatic logic is_last(place_t place);
    return place.edge_kind && place.leg == LastLeg;
  endfunction

  // The step since the latest update, and the one whose voltage acts.
  sample_t [Phases-1:0] step_q, acting_q;
  logic [11:0] step_phase_q, acting_phase_q;
  logic step_known_q, acting_known_q;
  logic start, reading_q, found_valid_q, sum_valid_q;

  assign start = start_i && !reading_q && !found_valid_q && !sum_valid_q;

  always_ff @(posedge clk_i) begin
    if (update_i) begin
      acting_q       <= step_q;
      acting_phase_q <= step_phase_q;
      acting_known_q <= step_known_q;
      step_known_q   <= 1'b0;
    end
    if (start) begin
      step_q       <= current_i;
      step_phase_q <= phase_i;
      step_known_q <= 1'b1;
    end
    if (rst_i || !enable_i) begin
      step_known_q   <= 1'b0;
      acting_known_q <= 1'b0;
    end
    if (rst_i) begin
      step_q         <= '0;
      step_phase_q   <= '0;
      acting_q       <= '0;
      acting_phase_q <= '0;
    end
  end

  // Edges that wait for a sample, and those whose sample is being written.
  logic [Phases-1:0] req_h_q;
  logic [1:0][Phases-1:0] fresh, pending_q, todo_q;
  sample_t [Phases-1:0] sample_q;
  place_t write_q;
  logic writing_q, store;

  assign fresh = {req_h_q & ~req_h_i, req_h_i & ~req_h_q};
  assign store = writing_q && todo_q[write_q.edge_kind][write_q.leg] && acting_phase_q[11:PhaseBits] == '0;

  always_ff @(posedge clk_i) begin
    req_h_q   <= req_h_i;
    pending_q <= pending_q | fresh;
    if (writing_q) begin
      write_q   <= following(write_q);
      writing_q <= !is_last(write_q);
    end else if (sample_valid_i && pending_q != '0) begin
      sample_q  <= sample_i;
      todo_q    <= pending_q;
      pending_q <= fresh;
      write_q   <= '0;
      writing_q <= acting_known_q;
    end
    if (rst_i || update_i || !enable_i) begin
      pending_q <= '0;
      writing_q <= 1'b0;
    end
    if (rst_i) begin
      req_h_q  <= '0;
      todo_q   <= '0;
      sample_q <= '0;
      write_q  <= '0;
    end
  end

  // Learning: excursion and the one before, next, both written.
  localparam sample_t None = {1'b1, {$bits(sample_t) - 1{1'b0}}};
  typedef logic [AddressBits-1:0] address_t;
  (* no_rw_check *) sample_t latest_mem[1 << AddressBits];
  (* no_rw_check *) sample_t next_mem[1 << AddressBits];
  address_t clear_q, read_address, learn_address, look_address_q, compare_address_q, write_address_q;
  sample_t read_before_q, before_q, read_excursion_q, excursion_q, latest_q, next_q, found_q;
  place_t read_q, found_place_q;
  logic look_q, compare_q, store_q, in_range;

  assign learn_address = {acting_phase_q[PhaseBits-1:0], write_q};
  assign read_address  = {step_phase_q[PhaseBits-1:0], read_q};
  assign in_range      = step_phase_q[11:PhaseBits] == '0;

  always_ff @(posedge clk_i) begin
    read_before_q    <= latest_mem[learn_address];
    read_excursion_q <= sat_sample(32'(sample_q[write_q.leg]) - 32'(acting_q[write_q.leg]));
    look_address_q   <= learn_address;
    look_q           <= store;

    // A clock for the way out of the block RAM.
    before_q          <= read_before_q;
    excursion_q       <= read_excursion_q;
    compare_address_q <= look_address_q;
    compare_q         <= look_q;

    latest_q        <= excursion_q;
    next_q          <= (before_q == None) ? excursion_q : sat_sample(2 * 32'(excursion_q) - 32'(before_q));
    write_address_q <= compare_address_q;
    store_q         <= compare_q;

    if (!enable_i) begin
      latest_mem[clear_q] <= None;
      next_mem[clear_q]   <= '0;
    end else if (store_q) begin
      latest_mem[write_address_q] <= latest_q;
      next_mem[write_address_q]   <= next_q;
    end
    found_q <= next_mem[read_address];

    if (rst_i || !enable_i) begin
      look_q    <= 1'b0;
      compare_q <= 1'b0;
      store_q   <= 1'b0;
    end
  end

  // Reading: address, move, operands, sum.
  sample_t [1:0][Phases-1:0] ahead_q;
  sample_t step_current_q, move_q;
  place_t sum_place_q;
  logic valid_q;

  always_ff @(posedge clk_i) begin
    clear_q       <= clear_q + address_t'(1);
    found_valid_q <= reading_q;
    found_place_q <= read_q;
    if (start) begin
      reading_q <= 1'b1;
      read_q    <= '0;
    end else if (reading_q) begin
      read_q    <= following(read_q);
      reading_q <= !is_last(read_q);
    end
    sum_valid_q    <= found_valid_q;
    sum_place_q    <= found_place_q;
    step_current_q <= step_q[found_place_q.leg];
    move_q         <= (enable_i && in_range) ? found_q : '0;
    if (sum_valid_q)
      ahead_q[sum_place_q.edge_kind][sum_place_q.leg] <= sat_sample(32'(step_current_q) + 32'(move_q));
    valid_q <= sum_valid_q && is_last(sum_place_q);
    if (rst_i) begin
      clear_q       <= '0;
      reading_q     <= 1'b0;
      read_q        <= '0;
      found_valid_q <= 1'b0;
      found_place_q <= '0;
      sum_valid_q   <= 1'b0;
      sum_place_q   <= '0;
      ahead_q       <= '0;
      valid_q       <= 1'b0;
    end
  end

  assign valid_o = valid_q;
  assign ahead_o = ahead_q;

  always_ff @(posedge clk_i) begin
    if (!rst_i) begin
      assert (!start_i || start)
      else $error("fl_edge_current: steps closer than %0d clocks", Latency);
    end
  end

endmodule
`default_nettype wire
