// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// The chip: a RISC-V core with RAM, a register bus, and two paths from converter codes to gate pins.
//
//   six-step  converter -> sense -> zcd -> comm (commutation timer) -> pwm (carrier, sequencer) -> safety (trips, guard)
//   vector    converter -> sense -> foc (window, regulators, modulator, leg carriers) ----------> safety (trips, guard)
//
// The register foc.control.source chooses the path whose requests reach the gates.
//
// Parameters:
//   Phases          3 or 5
//   SixStep         0 leaves the six-step path out. With five phases there is none.
//   Vector          0 leaves the vector path and the encoder out
//   Injection       1 adds the injection path, which needs Vector
//   Can             1 adds the CAN controller
//   Boot            1 adds the port of the SPI flash. The core then starts in the loader, whose image is BootInit (fl_cpu).
//   HighActiveLow,  polarity of the upper and of the lower gate pins. Only the build sets it, no register does.
//   LowActiveLow
// The windows of a block that is left out read 0. Its signals on the trace port stay 0.
//
// Registers: the wrapper fl_<block>_wb joins a block to the bus. Each block has a window of 4 KiB from 0x8000_0000 on, in
// the order of fl_map_pkg. The register reference in the docs lists them.
//
// Formats: codes 12 bits unsigned, time stamps 32 bits in clocks with wrap, angles 2^32 = one turn.
// Latency: docs/architecture.md, section "Timing contract".
//
// Trace port: shows a test bench or a logic analyser what happens inside. Nothing in the chip depends on it. A signal is
// valid in the clock of its pulse:
//   trc_comm_valid_o   first clock of a new sector. trc_comm_sched_o: the instant at which its gates were to change
//   trc_zc_valid_o     the ZCD found a zero crossing. trc_zc_time_o: when it happened
//   trc_update_o       the update event. New settings act from the next clock.
//   trc_trip_o         fl_trip latched causes in the clock before
//   trc_angle_valid_o  instant of a current window while the leg carriers drive the gates. trc_angle_o: the estimated
//                      electrical angle in that clock
`default_nettype none
module fl_soc
  import fl_pkg::*;
  import fl_map_pkg::*;
#(
    parameter  int unsigned Phases        = 3,
    parameter  bit          SixStep       = Phases == 3,     // 0: vector path only
    parameter  bit          Vector        = 1'b1,            // 0: six-step only, three phases
    parameter  int unsigned ClockHz       = 50_000_000,
    parameter  int unsigned RamWords      = 32768,           // less: in banks, see fl_cpu
    parameter  string       Init          = "firmware.hex",
    parameter  int unsigned CaptureDepth  = 1024,
    parameter  bit          Injection     = 0,
    parameter  bit          Can           = 0,
    parameter  bit          Boot          = 0,
    parameter  string       BootInit      = "boot.hex",
    parameter  bit          HighActiveLow = 0,               // upper gate pins are active low
    parameter  bit          LowActiveLow  = 0,               // lower gate pins
    localparam int unsigned Channels      = 2 * Phases + 3   // v0.., i0.., vdc, idc, vsm
) (
    input logic clk_i,
    input logic rst_i,

    output logic                     adc_strobe_o,  // 1 clock: hold the inputs and convert
    input  logic                     adc_valid_i,   // 1 clock: the codes of the last strobe
    input  adc_code_t [Channels-1:0] adc_code_i,
    input  logic                     adc_fault_i,   // level: a bad frame or a missed conversion

    input logic clock_fault_i,  // level: a clock is wrong

    output logic [  Phases-1:0] gate_h_o,         // pins, with polarity
    output logic [  Phases-1:0] gate_l_o,
    output logic [2*Phases-1:0] gate_o,           // of either guard, before polarity: bit 2X upper, 2X+1 lower of leg X
    output logic                brake_o,          // pin of the brake chopper, active high
    output logic                driver_enable_o,  // pin: toggles while the gates are permitted
    input  logic                fault_pin_i,      // asynchronous, active high
    input  logic [         2:0] hall_i,           // Hall sensors C, B, A; asynchronous, 0 where there are none
    input  logic [         2:0] encoder_i,        // encoder Z, B, A; asynchronous, 0 where there is none

    input  logic uart_rx_i,  // asynchronous
    output logic uart_tx_o,

    input  logic can_rx_i,  // asynchronous
    output logic can_tx_o,  // 0 is dominant

    output logic spi_cs_no,  // SPI flash
    output logic spi_sck_o,
    output logic spi_mosi_o,
    input  logic spi_miso_i,

    input  logic        debug_valid_i,  // debug bus of the core, see fl_cpu; 0 where no debugger is
    output logic        debug_ready_o,
    input  logic        debug_we_i,
    input  logic [ 7:0] debug_adr_i,
    input  logic [31:0] debug_wdat_i,
    output logic [31:0] debug_rdat_o,

    output logic    trc_valid_o,       // any pulse of the trace port
    output stamp_t  trc_now_o,
    output logic    trc_zc_valid_o,
    output logic    trc_zc_late_o,
    output sector_t trc_zc_sector_o,
    output stamp_t  trc_zc_time_o,
    output logic    trc_comm_valid_o,
    output sector_t trc_sector_o,
    output stamp_t  trc_comm_sched_o,
    output logic    trc_update_o,
    output logic    trc_trip_o,
    output trip_t   trc_trip_cause_o,
    output logic    trc_angle_valid_o,
    output logic [31:0] trc_angle_o
);

  if (Phases != 3 && Phases != 5) begin : g_check
    $fatal(1, "fl_soc: Phases must be 3 or 5 (%m)");
  end
  if (Phases != 3 && SixStep) begin : g_check_six_step
    $fatal(1, "fl_soc: SixStep needs three phases (%m)");
  end
  if (!SixStep && !Vector) begin : g_check_vector
    $fatal(1, "fl_soc: a chip without SixStep needs Vector (%m)");
  end

  // Windows that are there.
  typedef logic [Blocks-1:0] fitted_t;
  localparam fitted_t SixStepBlocks = fitted_t'(1) << Zcd | fitted_t'(1) << Comm | fitted_t'(1) << Pwm |
      fitted_t'(1) << Freewheel | fitted_t'(1) << Hall;
  localparam fitted_t VectorBlocks = fitted_t'(1) << Foc | fitted_t'(1) << Encoder;
  localparam fitted_t Fitted = '1 & ~(SixStep ? fitted_t'(0) : SixStepBlocks) &
      ~(Vector ? fitted_t'(0) : VectorBlocks) & ~(Vector && Injection ? fitted_t'(0) : fitted_t'(1) << Inject) &
      ~(Can ? fitted_t'(0) : fitted_t'(1) << CanBus) & ~(Boot ? fitted_t'(0) : fitted_t'(1) << Spi);

  // Core and register bus.
  logic io_stb, io_we, io_ack;
  logic [29:0] io_adr;
  logic [31:0] io_wdat, io_rdat;
  logic [3:0] io_sel;
  fl_bus_pkg::bus_req_t req;
  logic [Blocks-1:0] stb;
  logic [Blocks-1:0][31:0] rdat;
  logic irq_current, irq_control, irq_deferred;

  // Events and time.
  stamp_t now;
  logic tick, update, machine_event, load_event, uart_rx_event, uart_tx_event, capture_event, can_event;

  // Samples and the six-step path.
  logic sample_valid, current_valid;
  sample_t [Channels-1:0] sample;
  sample_t [Phases-1:0] current;
  stamp_t sample_time, current_time;
  pwm_state_t sample_pwm, pwm_state;
  logic zc_valid, zc_late;
  stamp_t zc_time;
  sector_t zc_sector;
  logic hall_event, lost;
  logic comm_applied, carrier_start;
  sector_t seq_sector;
  stamp_t comm_sched;
  logic [17:0] duty_q2;
  logic [Phases-1:0] seq_req_h, seq_req_l;

  // Vector path.
  logic vector_source, vector_update, vector_sync, vector_deadline;
  logic [Phases-1:0] vector_req_h, vector_req_l;
  logic vector_instant;
  logic [31:0] vector_theta;

  // Requests of the path that drives.
  logic [Phases-1:0] req_h, req_l;
  logic tripped, trip_event;
  trip_t trip_cause;

  fl_cpu #(
      .Words   (RamWords),
      .Init    (Init),
      .Boot    (Boot),
      .BootInit(BootInit)
  ) u_cpu (
      .clk_i,
      .rst_i,
      .irq_current_i (irq_current),
      .irq_control_i (irq_control),
      .irq_deferred_i(irq_deferred),
      .io_stb_o      (io_stb),
      .io_we_o       (io_we),
      .io_adr_o      (io_adr),
      .io_wdat_o     (io_wdat),
      .io_sel_o      (io_sel),
      .io_ack_i      (io_ack),
      .io_rdat_i     (io_rdat),
      .debug_valid_i,
      .debug_ready_o,
      .debug_we_i,
      .debug_adr_i,
      .debug_wdat_i,
      .debug_rdat_o
  );

  fl_interconnect #(
      .Blocks      (Blocks),
      .AddressWidth(AddressWidth)
  ) u_interconnect (
      .clk_i,
      .rst_i,
      .stb_i (io_stb),
      .we_i  (io_we),
      .adr_i (io_adr),
      .wdat_i(io_wdat),
      .sel_i (io_sel),
      .ack_o (io_ack),
      .rdat_o(io_rdat),
      .req_o (req),
      .stb_o (stb),
      .rdat_i(rdat)
  );

  fl_sys_wb #(
      .Phases  (Phases),
      .Channels(Channels),
      .ClockHz (ClockHz),
      .Fitted  (Fitted)
  ) u_sys (
      .clk_i,
      .rst_i,
      .req_i (req),
      .stb_i (stb[Sys]),
      .rdat_o(rdat[Sys]),
      .now_i (now)
  );

  // Bit order: fl_irq_regs.
  fl_irq_wb u_irq (
      .clk_i,
      .rst_i,
      .req_i(req),
      .stb_i(stb[Irq]),
      .rdat_o(rdat[Irq]),
      .event_i({
        can_event, hall_event, load_event, zc_valid, capture_event, uart_tx_event, uart_rx_event, machine_event,
        trip_event, tick
      }),
      .irq_control_o(irq_control),
      .irq_deferred_o(irq_deferred)
  );

  fl_timer_wb u_timer (
      .clk_i,
      .rst_i,
      .req_i    (req),
      .stb_i    (stb[Timer]),
      .rdat_o   (rdat[Timer]),
      .sync_i   (vector_sync),
      .now_o    (now),
      .tick_o   (tick),
      .update_o (update),
      .machine_o(machine_event),
      .load_o   (load_event)
  );

  fl_uart_wb u_uart (
      .clk_i,
      .rst_i,
      .req_i     (req),
      .stb_i     (stb[Uart]),
      .rdat_o    (rdat[Uart]),
      .rx_i      (uart_rx_i),
      .tx_o      (uart_tx_o),
      .rx_event_o(uart_rx_event),
      .tx_event_o(uart_tx_event)
  );

  fl_sense_wb #(
      .Phases(Phases)
  ) u_sense (
      .clk_i,
      .rst_i,
      .req_i          (req),
      .stb_i          (stb[Sense]),
      .rdat_o         (rdat[Sense]),
      .now_i          (now),
      .tick_i         (tick),
      .carrier_start_i(vector_source ? vector_update : carrier_start),
      .pwm_state_i    (pwm_state),
      .adc_strobe_o,
      .adc_valid_i,
      .adc_code_i,
      .current_valid_o(current_valid),
      .current_o      (current),
      .current_time_o (current_time),
      .sample_valid_o (sample_valid),
      .sample_o       (sample),
      .sample_time_o  (sample_time),
      .sample_pwm_o   (sample_pwm)
  );

  if (SixStep) begin : g_six_step
    fl_six_step u_six_step (
        .clk_i,
        .rst_i,
        .req_i          (req),
        .stb_i          ({stb[Hall], stb[Freewheel], stb[Pwm], stb[Comm], stb[Zcd]}),
        .rdat_o         ({rdat[Hall], rdat[Freewheel], rdat[Pwm], rdat[Comm], rdat[Zcd]}),
        .now_i          (now),
        .tick_i         (tick),
        .update_i       (update),
        .sample_valid_i (sample_valid),
        .sample_i       (sample),
        .sample_time_i  (sample_time),
        .sample_pwm_i   (sample_pwm),
        .hall_i,
        .gate_i         (gate_o),
        .req_h_o        (seq_req_h),
        .req_l_o        (seq_req_l),
        .pwm_state_o    (pwm_state),
        .carrier_start_o(carrier_start),
        .duty_q2_o      (duty_q2),
        .lost_o         (lost),
        .hall_event_o   (hall_event),
        .zc_valid_o     (zc_valid),
        .zc_late_o      (zc_late),
        .zc_sector_o    (zc_sector),
        .zc_time_o      (zc_time),
        .comm_applied_o (comm_applied),
        .sector_o       (seq_sector),
        .comm_sched_o   (comm_sched)
    );
  end else begin : g_no_six_step
    assign {rdat[Hall], rdat[Freewheel], rdat[Pwm], rdat[Comm], rdat[Zcd]} = '0;
    assign {seq_req_h, seq_req_l, duty_q2}                                 = '0;
    assign {lost, hall_event, carrier_start}                               = '0;
    assign {zc_valid, zc_late, zc_sector, zc_time}                         = '0;
    assign {comm_applied, seq_sector, comm_sched}                          = '0;
    assign pwm_state                                                       = '0;
    logic unused;
    assign unused = &{1'b0, stb[Hall], stb[Freewheel], stb[Pwm], stb[Comm], stb[Zcd], hall_i, sample_time, sample_pwm};
  end

  if (Vector) begin : g_vector
    fl_vector_pkg::tap_t vector_tap;
    fl_vector_pkg::injection_t injection;
    logic [17:0] encoder_position;
    logic encoder_indexed;

    fl_foc_wb #(
        .Phases(Phases)
    ) u_foc (
        .clk_i,
        .rst_i,
        .req_i         (req),
        .stb_i         (stb[Foc]),
        .rdat_o        (rdat[Foc]),
        .now_i         (now),
        .tick_i        (tick),
        .update_i      (update),
        .strobe_i      (adc_strobe_o),
        .sample_valid_i(current_valid),
        .sample_i      (current),
        .sample_time_i (current_time),
        .encoder_position_i(encoder_position),
        .encoder_indexed_i(encoder_indexed),
        .injection_i   (injection),
        .tap_o         (vector_tap),
        .waiting_o     (irq_current),
        .source_o      (vector_source),
        .update_o      (vector_update),
        .sync_o        (vector_sync),
        .deadline_o    (vector_deadline),
        .req_h_o       (vector_req_h),
        .req_l_o       (vector_req_l),
        .instant_o     (vector_instant),
        .theta_o       (vector_theta)
    );

    if (Injection) begin : g_injection
      fl_injection_wb #(
          .Phases(Phases)
      ) u_injection (
          .clk_i,
          .rst_i,
          .req_i      (req),
          .stb_i      (stb[Inject]),
          .rdat_o     (rdat[Inject]),
          .tick_i     (tick),
          .tap_i      (vector_tap),
          .injection_o(injection)
      );
    end else begin : g_no_injection
      assign rdat[Inject] = '0;
      assign injection    = '0;
      logic unused;
      assign unused = &{1'b0, stb[Inject], vector_tap};
    end

    fl_encoder_wb u_encoder (
        .clk_i,
        .rst_i,
        .req_i     (req),
        .stb_i     (stb[Encoder]),
        .rdat_o    (rdat[Encoder]),
        .encoder_i,
        .position_o(encoder_position),
        .indexed_o (encoder_indexed)
    );
  end else begin : g_no_vector
    assign {rdat[Foc], rdat[Inject], rdat[Encoder]}                     = '0;
    assign {irq_current, vector_source, vector_update, vector_sync}     = '0;
    assign {vector_deadline, vector_req_h, vector_req_l}                = '0;
    assign {vector_instant, vector_theta}                               = '0;
    logic unused;
    assign unused = &{1'b0, stb[Foc], stb[Inject], stb[Encoder], encoder_i, current_valid, current, current_time};
  end

  if (Can) begin : g_can
    fl_can_wb u_can (
        .clk_i,
        .rst_i,
        .req_i  (req),
        .stb_i  (stb[CanBus]),
        .rdat_o (rdat[CanBus]),
        .now_i  (now),
        .rx_i   (can_rx_i),
        .tx_o   (can_tx_o),
        .event_o(can_event)
    );
  end else begin : g_no_can
    logic unused;
    assign unused       = stb[CanBus] || can_rx_i;
    assign rdat[CanBus] = '0;
    assign can_tx_o     = 1'b1;
    assign can_event    = 1'b0;
  end

  if (Boot) begin : g_boot
    fl_spi_wb u_spi (
        .clk_i,
        .rst_i,
        .req_i (req),
        .stb_i (stb[Spi]),
        .rdat_o(rdat[Spi]),
        .cs_no (spi_cs_no),
        .sck_o (spi_sck_o),
        .mosi_o(spi_mosi_o),
        .miso_i(spi_miso_i)
    );
  end else begin : g_no_boot
    logic unused;
    assign unused                             = stb[Spi] || spi_miso_i;
    assign rdat[Spi]                          = '0;
    assign {spi_cs_no, spi_sck_o, spi_mosi_o} = 3'b100;
  end

  assign req_h = vector_source ? vector_req_h : seq_req_h;
  assign req_l = vector_source ? vector_req_l : seq_req_l;

  fl_safety_wb #(
      .Phases       (Phases),
      .HighActiveLow(HighActiveLow),
      .LowActiveLow (LowActiveLow)
  ) u_safety (
      .clk_i,
      .rst_i,
      .req_i       (req),
      .stb_i       (stb[Safety]),
      .rdat_o      (rdat[Safety]),
      .now_i       (now),
      .adc_valid_i,
      .adc_code_i,
      .adc_fault_i,
      .clock_fault_i,
      .fault_pin_i,
      .lost_i      (lost),
      .deadline_i  (vector_deadline),
      .req_h_i     (req_h),
      .req_l_i     (req_l),
      .gate_h_o,
      .gate_l_o,
      .gate_o,
      .brake_o,
      .driver_enable_o,
      .tripped_o   (tripped),
      .trip_event_o(trip_event),
      .trip_cause_o(trip_cause)
  );

  fl_capture_wb #(
      .Channels(Channels),
      .Depth   (CaptureDepth)
  ) u_capture (
      .clk_i,
      .rst_i,
      .req_i          (req),
      .stb_i          (stb[Capture]),
      .rdat_o         (rdat[Capture]),
      .sample_valid_i (sample_valid),
      .sample_i       (sample),
      .sample_time_i  (sample_time[17:0]),
      .sample_on_i    (sample_pwm.on),
      .sample_sector_i(sample_pwm.sector),
      .duty_q2_i      (duty_q2),
      .trip_i         (trip_event),
      .tripped_i      (tripped),
      .comm_applied_i (comm_applied),
      .sector_i       (seq_sector),
      .done_event_o   (capture_event)
  );

  assign trc_valid_o      = comm_applied || zc_valid || update || trip_event || trc_angle_valid_o;
  assign trc_now_o        = now;
  assign trc_zc_valid_o   = zc_valid;
  assign trc_zc_late_o    = zc_late;
  assign trc_zc_sector_o  = zc_sector;
  assign trc_zc_time_o    = zc_time;
  assign trc_comm_valid_o = comm_applied;
  assign trc_sector_o     = seq_sector;
  assign trc_comm_sched_o = comm_sched;
  assign trc_update_o     = update;
  assign trc_trip_o       = trip_event;
  assign trc_trip_cause_o = trip_cause;

  assign trc_angle_valid_o = vector_source && vector_instant;
  assign trc_angle_o       = vector_theta;

endmodule
`default_nettype wire
