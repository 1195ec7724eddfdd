// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Windows of the register bus in the order of the address map, and how much of its window each block decodes.
`default_nettype none
package fl_map_pkg;

  localparam int unsigned Blocks = 17;
  typedef enum logic [4:0] {
    Sys       = 5'd0,
    Irq       = 5'd1,
    Timer     = 5'd2,
    Uart      = 5'd3,
    Sense     = 5'd4,
    Zcd       = 5'd5,
    Comm      = 5'd6,
    Pwm       = 5'd7,
    Safety    = 5'd8,
    Capture   = 5'd9,
    Freewheel = 5'd10,
    Hall      = 5'd11,
    Foc       = 5'd12,
    Encoder   = 5'd13,
    Inject    = 5'd14,
    CanBus    = 5'd15,
    Spi       = 5'd16
  } block_e;

  // Bits of the byte address.
  localparam logic [Blocks-1:0][3:0] AddressWidth = {
    4'(fl_spi_regs_pkg::FL_SPI_REGS_MIN_ADDR_WIDTH),
    4'(fl_can_regs_pkg::FL_CAN_REGS_MIN_ADDR_WIDTH),
    4'(fl_injection_regs_pkg::FL_INJECTION_REGS_MIN_ADDR_WIDTH),
    4'(fl_encoder_regs_pkg::FL_ENCODER_REGS_MIN_ADDR_WIDTH),
    4'(fl_foc_regs_pkg::FL_FOC_REGS_MIN_ADDR_WIDTH),
    4'(fl_hall_regs_pkg::FL_HALL_REGS_MIN_ADDR_WIDTH),
    4'(fl_freewheel_regs_pkg::FL_FREEWHEEL_REGS_MIN_ADDR_WIDTH),
    4'(fl_capture_regs_pkg::FL_CAPTURE_REGS_MIN_ADDR_WIDTH),
    4'(fl_safety_regs_pkg::FL_SAFETY_REGS_MIN_ADDR_WIDTH),
    4'(fl_pwm_regs_pkg::FL_PWM_REGS_MIN_ADDR_WIDTH),
    4'(fl_comm_regs_pkg::FL_COMM_REGS_MIN_ADDR_WIDTH),
    4'(fl_zcd_regs_pkg::FL_ZCD_REGS_MIN_ADDR_WIDTH),
    4'(fl_sense_regs_pkg::FL_SENSE_REGS_MIN_ADDR_WIDTH),
    4'(fl_uart_regs_pkg::FL_UART_REGS_MIN_ADDR_WIDTH),
    4'(fl_timer_regs_pkg::FL_TIMER_REGS_MIN_ADDR_WIDTH),
    4'(fl_irq_regs_pkg::FL_IRQ_REGS_MIN_ADDR_WIDTH),
    4'(fl_sys_regs_pkg::FL_SYS_REGS_MIN_ADDR_WIDTH)
  };

endpackage
`default_nettype wire
