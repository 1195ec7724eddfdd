// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Settings and snapshot of the vector path (fl_vector), with room for two subspaces whatever the number of phases.
//
// Complex values are {q, d}: index 0 is d. Formats: fl_foc, fl_modulator, fl_leg_carrier, fl_current_window.
package fl_vector_pkg;

  import fl_pkg::sample_t;
  import fl_pkg::stamp_t;

  localparam int unsigned MaxSubspaces = 2;

  typedef sample_t [MaxSubspaces-1:0][1:0] vectors_t;
  typedef logic [MaxSubspaces-1:0][1:0][31:0] wide_vectors_t;  // signed
  typedef logic [MaxSubspaces-1:0][1:0][27:0] vectors_state_t;  // signed

  typedef struct packed {
    logic source;  // 1: the leg carriers' requests go to the guard
    logic enable;
    logic double_update;
    logic bypass;
    logic direct;  // the core is the regulator
    logic [MaxSubspaces-1:0] regulate;
    logic [7:0] miss_limit;
    logic [15:0] period;
    logic [15:0] from;
    logic [15:0] length;
    logic [15:0] delay;
    logic [31:0] lead;
    logic [31:0] park;
    logic [16:0] scale;
    logic [4:0] scale_shift;
    logic [16:0] band;
    logic [16:0] slope;
    logic [4:0] slope_shift;
    logic [9:0] dead_time;
    logic [11:0] min_pulse;
    logic [15:0] margin;
    vectors_t current_reference;
    vectors_t gain;
    vectors_t hold;
    vectors_t ratio;
    vectors_t preset;
    vectors_t forward;
    logic [MaxSubspaces-1:0][4:0] shift;
    logic [MaxSubspaces-1:0][16:0] limit;
  } settings_t;

  // Direct path, from the core and not staged.
  typedef struct packed {
    vectors_state_t wanted;  // 2^25 = full scale
    logic go;
    logic [15:0] number;     // of the run that it is for
  } answer_t;

  // Direct path, to the core: of the run that waits.
  typedef struct packed {
    logic waiting;
    logic [15:0] number;
    wide_vectors_t current;
  } question_t;

  typedef struct packed {
    logic indexed;
    logic [17:0] position;  // quarters of a line
  } encoder_t;

  // To the injection path.
  typedef struct packed {
    logic update;            // of the leg carriers
    logic second;            // the carrier's second half begins with it
    logic strobe;            // instant of a window
    logic sample_valid;      // the current of the latest instant is there
    sample_t [1:0] current;  // d, q of subspace 1
    logic [31:0] theta;      // of that sample, 2^32 = one turn, without park
  } tap_t;

  // From the injection path; all 0: none.
  typedef struct packed {
    logic [4:0] pause;       // clocks from sample_valid to current, 0: the regulators take what they measure
    sample_t [1:0] current;  // in place of the measured one
    logic skip;              // the regulators of subspace 1 do not run in this step
    vectors_t voltage;       // added to the voltage
    logic edges;             // dead time by the currents at the legs' edges (fl_edge_current)
    logic [11:0] phase;      // of the voltage in the wave, updates
  } injection_t;

  // A regulator step.
  typedef struct packed {
    wide_vectors_t current;
    wide_vectors_t applied;
    wide_vectors_t state;
    logic [MaxSubspaces-1:0] limited;
    logic [31:0] theta;    // of the currents
    stamp_t stamp;         // of the currents
    logic [7:0] samples;
    encoder_t encoder;     // at the instant of theta
  } step_t;

  typedef struct packed {
    step_t step;                // the last one before the tick
    wide_vectors_t applied_sum; // since the tick before
    logic [15:0] steps;         // since the tick before, saturates
    logic [31:0] theta_update;
    logic [31:0] omega;
    logic [15:0] missed;
    logic [15:0] overruns;
  } snapshot_t;

endpackage
