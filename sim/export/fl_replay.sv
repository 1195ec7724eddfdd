// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Replays a recorded run: drives every input pin of the chip as recorded and compares the gate pins in every clock.
//
// Files, read from the folder in which the simulation runs, a line per change: the clock after whose rising edge it comes, then
//   Pins    hexadecimal word_t, levels of the inputs from then on
//   Gates   hexadecimal, switches that are on: bit 2X upper, 2X+1 lower switch of leg X
// fl_recording_pkg tells which chip was recorded and for how long. The simulation ends with "ok: ..." or with a fatal error
// at the first clock whose gates differ. Inputs change and gates are read at the falling edge.
`default_nettype none
module fl_replay
  import fl_recording_pkg::*;
#(
    parameter string Pins  = "sim/pins.txt",
    parameter string Gates = "sim/gates.txt"
) ();

  localparam int unsigned Channels = 2 * Phases + 3;
  localparam int unsigned ResetCycles = 10;

  typedef struct packed {
    logic [Channels-1:0][11:0] codes;
    logic [2:0]                encoder;
    logic [2:0]                hall;
    logic                      fault;
    logic                      can;
    logic                      uart;
    logic                      valid;
  } word_t;

  logic clk = 1'b0;
  logic rst = 1'b1;
  word_t pins;
  logic [Phases-1:0] gate_h, gate_l;

  always #10 clk = !clk;

  fl_soc #(
      .Phases       (Phases),
      .Injection    (Injection),
      .Can          (Can),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow)
  ) u_soc (
      .clk_i            (clk),
      .rst_i            (rst),
      .adc_strobe_o     (),
      .adc_valid_i      (pins.valid),
      .adc_code_i       (pins.codes),
      .adc_fault_i      (1'b0),
      .clock_fault_i    (1'b0),
      .gate_h_o         (gate_h),
      .gate_l_o         (gate_l),
      .gate_o           (),
      .brake_o          (),
      .driver_enable_o  (),
      .fault_pin_i      (pins.fault),
      .hall_i           (pins.hall),
      .encoder_i        (pins.encoder),
      .uart_rx_i        (pins.uart),
      .uart_tx_o        (),
      .can_rx_i         (pins.can),
      .can_tx_o         (),
      .spi_cs_no        (),
      .spi_sck_o        (),
      .spi_mosi_o       (),
      .spi_miso_i       (1'b0),
      .debug_valid_i    (1'b0),
      .debug_ready_o    (),
      .debug_we_i       (1'b0),
      .debug_adr_i      ('0),
      .debug_wdat_i     ('0),
      .debug_rdat_o     (),
      .trc_valid_o      (),
      .trc_now_o        (),
      .trc_zc_valid_o   (),
      .trc_zc_late_o    (),
      .trc_zc_sector_o  (),
      .trc_zc_time_o    (),
      .trc_comm_valid_o (),
      .trc_sector_o     (),
      .trc_comm_sched_o (),
      .trc_update_o     (),
      .trc_trip_o       (),
      .trc_trip_cause_o (),
      .trc_angle_valid_o(),
      .trc_angle_o      ()
  );

  // Switches that the gate pins turn on.
  logic [Phases-1:0][1:0] switches;
  for (genvar x = 0; x < int'(Phases); x++) begin : g_leg
    assign switches[x] = {gate_l[x] ^ LowActiveLow, gate_h[x] ^ HighActiveLow};
  end

  int pins_file, gates_file;
  int unsigned now, changes, pins_at, gates_at;
  word_t pins_next;
  logic [2*Phases-1:0] gates_next, gates_wanted;

  initial begin
    pins         = '0;
    now          = 0;
    changes      = 0;
    gates_wanted = '0;
    pins_file    = $fopen(Pins, "r");
    gates_file   = $fopen(Gates, "r");
    if (pins_file == 0 || gates_file == 0) $fatal(1, "cannot read %s and %s", Pins, Gates);
    read_pins();
    read_gates();
    pins = pins_next;  // the first line is for clock 0
    read_pins();
  end

  // At the end of a file there is no next change.
  task automatic read_pins();
    if ($fscanf(pins_file, "%d %h", pins_at, pins_next) != 2) pins_at = 0;
  endtask

  task automatic read_gates();
    if ($fscanf(gates_file, "%d %h", gates_at, gates_next) != 2) gates_at = 0;
  endtask

  always @(negedge clk) begin
    now = now + 1;
    if (now == gates_at) begin
      gates_wanted = gates_next;
      changes      = changes + 1;
      read_gates();
    end
    if (now > ResetCycles && switches !== gates_wanted)
      $fatal(1, "clock %0d: gates %h, recorded %h", now, switches, gates_wanted);
    if (now == pins_at) begin
      pins = pins_next;
      read_pins();
    end
    if (now == ResetCycles) rst = 1'b0;
    if (now == Clocks) begin
      $display("ok: %0d clocks, %0d changes of the gates, all as recorded", now, changes);
      $finish;
    end
  end

endmodule
`default_nettype wire
