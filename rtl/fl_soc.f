// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Sources of the chip, top fl_soc, in compile order. Every build reads this list. Paths count from this file: -F fl_soc.f.
// `python -m fluxlock.generate.registers rtl` writes what lies in build/generated: register blocks from regs/*.rdl, and the core.

// Packages and register blocks.
pkg/fl_pkg.sv
../build/generated/fl_sys_regs_pkg.sv
../build/generated/fl_sys_regs.sv
../build/generated/fl_irq_regs_pkg.sv
../build/generated/fl_irq_regs.sv
../build/generated/fl_timer_regs_pkg.sv
../build/generated/fl_timer_regs.sv
../build/generated/fl_uart_regs_pkg.sv
../build/generated/fl_uart_regs.sv
../build/generated/fl_sense_regs_pkg.sv
../build/generated/fl_sense_regs.sv
../build/generated/fl_zcd_regs_pkg.sv
../build/generated/fl_zcd_regs.sv
../build/generated/fl_comm_regs_pkg.sv
../build/generated/fl_comm_regs.sv
../build/generated/fl_pwm_regs_pkg.sv
../build/generated/fl_pwm_regs.sv
../build/generated/fl_safety_regs_pkg.sv
../build/generated/fl_safety_regs.sv
../build/generated/fl_capture_regs_pkg.sv
../build/generated/fl_capture_regs.sv
../build/generated/fl_freewheel_regs_pkg.sv
../build/generated/fl_freewheel_regs.sv
../build/generated/fl_hall_regs_pkg.sv
../build/generated/fl_hall_regs.sv
../build/generated/fl_foc_regs_pkg.sv
../build/generated/fl_foc_regs.sv
../build/generated/fl_encoder_regs_pkg.sv
../build/generated/fl_encoder_regs.sv
../build/generated/fl_injection_regs_pkg.sv
../build/generated/fl_injection_regs.sv
../build/generated/fl_can_regs_pkg.sv
../build/generated/fl_can_regs.sv
../build/generated/fl_spi_regs_pkg.sv
../build/generated/fl_spi_regs.sv
common/fl_sine_pkg.sv
zcd/fl_asin_pkg.sv
foc/fl_foc_pkg.sv
injection/fl_injection_pkg.sv
can/fl_can_pkg.sv
soc/fl_bus_pkg.sv
soc/fl_map_pkg.sv
soc/fl_vector_pkg.sv

common/fl_fifo.sv
common/fl_ram.sv
common/fl_sincos.sv
common/fl_sync.sv

sense/fl_auto_zero.sv
sense/fl_current_window.sv
sense/fl_sample_scheduler.sv
sense/fl_sense.sv

zcd/fl_angle_time.sv
zcd/fl_commutation_timer.sv
zcd/fl_crossing_time.sv
zcd/fl_freewheel.sv
zcd/fl_hall.sv
zcd/fl_interpolator.sv
zcd/fl_interval_meter.sv
zcd/fl_zcd.sv

encoder/fl_encoder.sv

foc/fl_angle_nco.sv
foc/fl_edge_current.sv
foc/fl_foc.sv
foc/fl_mac.sv
foc/fl_modulator.sv
foc/fl_ratio.sv
foc/fl_sqrt.sv

injection/fl_injection.sv
injection/fl_injection_mac.sv
injection/fl_injection_path.sv
injection/fl_iq_demod.sv
injection/fl_lock_in.sv
injection/fl_separator.sv

pwm/fl_carrier.sv
pwm/fl_leg_carrier.sv
pwm/fl_pwm_state.sv
pwm/fl_sequencer.sv

safety/fl_async_clear.sv
safety/fl_brake.sv
safety/fl_clock_monitor.sv
safety/fl_driver_enable.sv
safety/fl_gate_guard.sv
safety/fl_settings_lock.sv
safety/fl_trip.sv
safety/fl_watchdog.sv

can/fl_can.sv
can/fl_can_bit_timing.sv
can/fl_can_bsp.sv
can/fl_can_confinement.sv
can/fl_can_rx.sv
can/fl_can_tx.sv

soc/fl_can_wb.sv
soc/fl_capture.sv
soc/fl_capture_wb.sv
soc/fl_comm_wb.sv
soc/fl_cpu.sv
soc/fl_encoder_wb.sv
soc/fl_foc_wb.sv
soc/fl_freewheel_wb.sv
soc/fl_hall_wb.sv
soc/fl_injection_wb.sv
soc/fl_interconnect.sv
soc/fl_interval.sv
soc/fl_irq.sv
soc/fl_irq_wb.sv
soc/fl_pwm_wb.sv
soc/fl_safety_wb.sv
soc/fl_sense_wb.sv
soc/fl_six_step.sv
soc/fl_soc.sv
soc/fl_spi.sv
soc/fl_spi_wb.sv
soc/fl_sys_wb.sv
soc/fl_timer.sv
soc/fl_timer_wb.sv
soc/fl_uart.sv
soc/fl_uart_rx.sv
soc/fl_uart_tx.sv
soc/fl_uart_wb.sv
soc/fl_vector.sv
soc/fl_zcd_wb.sv

// Soft core.
../build/generated/VexRiscv.v
