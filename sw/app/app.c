// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Boot, interrupt handlers and main loop (contract: app.h). This file moves snapshot and command between the chip's
// registers (hal/) and the drive (drive/), which knows no register.
#include "app/app.h"

#include "app/crash.h"
#include "console/console.h"
#include "control/placement.h"
#include "drive/parameters.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/uart.h"

// Tick and UART while no valid block says otherwise: 10 kHz and 1 Mbaud at 50 MHz.
#define DEFAULT_TICK_CYCLES 5000u
#define UART_BIT_CYCLES 50u
#define CONTROL_SOURCES ((uint32_t)IRQ_TICK | (uint32_t)IRQ_TRIP)
#define DEFERRED_SOURCES ((uint32_t)IRQ_UART_RX | (uint32_t)IRQ_LOAD | (uint32_t)IRQ_MACHINE_TIMER)
#define DESIGN_STAGES_PER_SECOND 900u
// Control steps between two reports to the watchdog, which waits for twice as many.
#define REPORT_TICKS 4u
// The firmware that has run for so long is up.
#define UP_MS 1000u

static fault_t boot_fault(const parameter_block_t *block) {
  if (!chip_is_known()) {
    return FAULT_CHIP;
  }
  const fault_t fault = parameters_check(block);
  const parameters_t *p = &block->parameters;
  const bool held = method_is_held(p->method, p->injection != 0);
  if (fault == FAULT_NONE && ((uint32_t)p->clock_hz != chip_clock_hz() || !held || !chip_fits(p))) {
    return FAULT_CHIP;
  }
  return fault;
}

HOT static void receive_all(void) {
  for (uint32_t word = uart_take(); word != 0u; word = uart_take()) {
    console_receive(word);
  }
}

SMALL_CODE_BEGIN
COLD void app_boot(app_t *app) {
  const parameter_block_t *block = cpu_parameter_block();
  const parameters_t *p = &block->parameters;
  __builtin_memset(app, 0, sizeof *app);  // an assignment of a whole object would need as much stack
  app->telemetry = cpu_telemetry();
  telemetry_init(app->telemetry);
  chip_gates_off();
  uart_configure(UART_BIT_CYCLES);
  console_init();
  const fault_t fault = boot_fault(block);
  drive_init(&app->drive, p, fault);
  if (fault == FAULT_NONE) {
    chip_configure(p);
    if (method_is_vector(p->method)) {
      chip_set_machine_timer((uint32_t)p->clock_hz / DESIGN_STAGES_PER_SECOND);
    }
  }
  if (fault == FAULT_NONE && crash_fault() != FAULT_NONE) {
    drive_fail(&app->drive, crash_fault());
  }
  telemetry_update(app->telemetry, &app->drive);
  chip_irq_configure(CONTROL_SOURCES, DEFERRED_SOURCES);
  // Bytes that came before: their event is gone, and a full FIFO would never give another.
  receive_all();
  chip_set_tick((fault == FAULT_NONE) ? (uint32_t)p->tick_cycles : DEFAULT_TICK_CYCLES);
}
SMALL_CODE_END

HOT static void write_guard(drive_t *drive) {
  if (__builtin_expect(drive->guard.fresh, 0)) {
    chip_write_guard(&drive->guard);
  }
}

// While running, telemetry follows the ticks that have read everything.
HOT static void vector_control_step(app_t *app) {
  drive_t *drive = &app->drive;
  vector_command_t *command = &drive->method.vector.command;
  chip_snapshot_t snapshot;
  chip_read_vector(&snapshot, command, drive->p);
  if (drive->order.state == STATE_INIT) {
    chip_read_offsets(&snapshot);
  }
  drive_vector_step(drive, &snapshot);
  write_guard(drive);
  chip_write_vector(command, drive->p);
  if (drive->method.vector.whole || drive->order.state != STATE_RUNNING) {
    telemetry_update(app->telemetry, drive);
    telemetry_update_vector(app->telemetry, &drive->method.vector.report.vector);
  }
}

SHARED static void six_step_control_step(app_t *app) {
  drive_t *drive = &app->drive;
  six_step_command_t *command = &drive->method.six_step.command;
  chip_snapshot_t snapshot;
  // Who runs needs no terminal voltage: the hardware watches them for crossings.
  chip_read(&snapshot, drive->order.state != STATE_RUNNING);
  if (drive->order.state == STATE_INIT) {
    chip_read_offsets(&snapshot);
  }
  if (command->threshold.read || command->edge.read) {
    chip_read_sectors(&snapshot);
  }
  if (drive->p->hall_mode != HALL_OFF) {
    chip_read_hall(&snapshot);
    if (command->edge.read) {
      chip_read_phases(&snapshot);
    }
  }
  drive_step(drive, &snapshot);
  write_guard(drive);
  chip_write(command, drive->p);
  chip_read_freewheel(&app->telemetry->freewheel);
  telemetry_update(app->telemetry, drive);
}

HOT static void control_step(app_t *app) {
  drive_t *drive = &app->drive;
  if (__builtin_expect(drive->p == 0, 0)) {
    drive_wait(drive);
    telemetry_update(app->telemetry, drive);
  } else if (method_is_vector(drive->p->method)) {
    vector_control_step(app);
  } else {
    six_step_control_step(app);
  }
}

// Of an image that holds vector control. The voltage first: what the step needs of the limit comes after it. An update
// during the entry has ended the step, and the next one may not have its currents yet.
HOT void app_current_interrupt(app_t *app) {
  if (!method_is_vector(METHOD_VECTOR)) {
    return;
  }
  chip_direct_t direct;
  if (!chip_read_direct(&direct)) {
    return;
  }
  const complex_t wanted_v_q25 = vector_want(&app->drive.method.vector, direct.i_q17);
  chip_write_direct(&direct, wanted_v_q25);
  vector_bound(&app->drive.method.vector, wanted_v_q25);
}

COLD static void trip_interrupt(app_t *app) {
  const uint32_t start = chip_now();
  // The gates are off already; the control step names the cause. Nothing to do but take the event.
  chip_irq_clear(IRQ_TRIP);
  if (app->drive.p != 0 && method_is_vector(app->drive.p->method)) {
    // What tripped may have ended the samples, and the ticks with them.
    chip_tick_by_time();
  }
  cycles_add(&app->telemetry->handler[HANDLER_TRIP], chip_now() - start);
}

void app_watch(app_t *app, uint32_t works) {
  app->works = works;
  app->clocks_ms = chip_clock_hz() / 1000u;
  app_done(app, WORK_LOOP, WORK_LOOP);
  app_done(app, WORK_NODE, WORK_LOOP);
}

work_t app_begin(app_t *app, work_t work) {
  const work_t before = app->work;
  app->work = work;
  return before;
}

void app_done(app_t *app, work_t work, work_t before) {
  const uint32_t now = chip_now();
  const uint32_t window_ms = (work == WORK_NODE) ? WINDOW_NODE_MS : WINDOW_LOOP_MS;
  app->due[work] = now + app->clocks_ms * window_ms;
  app->work = before;
  const bool node = app->works > (uint32_t)WORK_NODE && (int32_t)(app->due[WORK_NODE] - app->due[WORK_LOOP]) < 0;
  app->due_first = app->due[node ? WORK_NODE : WORK_LOOP];
}

COLD static bool hangs(app_t *app, uint32_t late_cycles) {
  const bool idle = !order_active(&app->drive.order);
  if (app->works == 0u || (idle && late_cycles < app->clocks_ms * IDLE_LATE_MS)) {
    return false;
  }
  crash((app->work == WORK_NODE) ? CRASH_NODE : CRASH_MAIN_LOOP, 0, cpu_interrupted(), 0);
  drive_fail(&app->drive, crash_fault());
  return true;
}

// The watchdog hears of the control step, but not if main loop or node hangs.
HOT static void report(app_t *app, uint32_t now) {
  if (__builtin_expect((int32_t)(app->due_first - now) < 0, 0) && hangs(app, now - app->due_first)) {
    return;
  }
  chip_report_step(app->drive.order.tick / REPORT_TICKS);
}

HOT void app_control_interrupt(app_t *app) {
  const uint32_t pending = chip_irq_pending();
  if (__builtin_expect((pending & (uint32_t)IRQ_TRIP) != 0u, 0)) {
    trip_interrupt(app);
  }
  if (__builtin_expect((pending & (uint32_t)IRQ_TICK) != 0u, 1)) {
    telemetry_t *telemetry = app->telemetry;
    const uint32_t start = chip_now();
    const uint32_t tick_time = chip_tick_time();
    chip_irq_clear(IRQ_TICK);
    control_step(app);
    if (app->drive.order.tick % REPORT_TICKS == 0u) {
      report(app, start);
    }
    cycles_add(&telemetry->handler[HANDLER_CONTROL], chip_now() - start);
    cycles_add(&telemetry->handler[HANDLER_CONTROL_ENTRY], start - tick_time);
  }
}

void app_deferred_interrupt(app_t *app) {
  telemetry_t *telemetry = app->telemetry;
  const uint32_t pending = chip_irq_pending();
  if ((pending & (uint32_t)IRQ_UART_RX) != 0u) {
    const uint32_t start = chip_now();
    chip_irq_clear(IRQ_UART_RX);
    receive_all();
    cycles_add(&telemetry->handler[HANDLER_UART], chip_now() - start);
  }
  if ((pending & (uint32_t)IRQ_MACHINE_TIMER) != 0u) {
    const uint32_t start = chip_now();
    chip_irq_clear(IRQ_MACHINE_TIMER);
    if (app->drive.p != 0 && method_is_vector(app->drive.p->method)) {
      vector_design(&app->drive.method.vector);
    }
    cycles_add(&telemetry->handler[HANDLER_DESIGN], chip_now() - start);
  }
  if ((pending & (uint32_t)IRQ_LOAD) != 0u) {
    const uint32_t start = chip_now();
    chip_irq_clear(IRQ_LOAD);
    const uint32_t busy_cycles = (uint32_t)app->drive.settings.irq_load / 2u;
    while (chip_now() - start < busy_cycles) {
    }
    cycles_add(&telemetry->handler[HANDLER_LOAD], chip_now() - start);
  }
}

void app_poll(app_t *app) {
  const uint32_t now = chip_now();
  if (app->polled != 0u) {
    cycles_t *idle = &app->telemetry->handler[HANDLER_IDLE];
    const uint32_t round_cycles = now - app->polled;
    cycles_add(idle, round_cycles);
    // The shortest round ever is shorter than the usual one, 284 of 310 clocks with a vector drive.
    if (round_cycles <= idle->min + idle->min / 8u) {
      app->quiet_round_cycles = round_cycles;
    }
    app->idle_cycles += app->quiet_round_cycles;
  } else {
    app->booted = now;
  }
  if (app->booted != 0u && now - app->booted > UP_MS * app->clocks_ms) {
    app->booted = 0;
    crash_is_over();
  }
  app->polled = now;
  if (!cpu_stack_is_whole()) {
    crash(CRASH_STACK, 0, 0, 0);
  }
  console_poll(app);
  app_done(app, WORK_LOOP, WORK_LOOP);
}
