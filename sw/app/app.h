// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The application: what the image does at boot, in its three interrupt handlers and in the main loop. The same code runs
// on the chip and on the host.
//
//   current line   regulator step in C, if the scenario asks for it     pre-empts the two others
//   control line   trips, then the control step of drive/
//   deferred line  UART, gains of the vector control, load generator
//   main loop      console, and the node where there is one
//
// Times are in clocks (50 MHz) and wrap.
// Errors: boot checks chip and parameter block. A wrong one leaves the drive in init with a fault that the console names.
// The gates stay off.
#ifndef FL_APP_H
#define FL_APP_H

#include <stdint.h>

#include "app/telemetry.h"
#include "drive/drive.h"

// Main loop and node are supervised as the control step is: each must have done a round within its window, else the
// watchdog gets no report, the gates open and the firmware starts anew (crash.h). An idle drive may be as much later as
// the flash needs to erase and write what is stored.
typedef enum { WORK_LOOP, WORK_NODE, WORKS } work_t;
#define WINDOW_LOOP_MS 200u  // the console prints all that it knows in a round
#define WINDOW_NODE_MS 50u
#define IDLE_LATE_MS 5000u

typedef struct {
  drive_t drive;
  telemetry_t *telemetry;
  uint32_t polled;  // when the main loop came round last, 0: not yet
  uint32_t quiet_round_cycles;  // of the main loop's last round that nothing interrupted
  uint32_t idle_cycles;         // that the rounds took without what interrupted them; wraps
  uint32_t clocks_ms;           // clocks a millisecond
  uint32_t booted;              // clock of the first round, 0: a second has passed since
  uint32_t works;               // that are supervised, 0: none
  work_t work;                  // at which the main loop is
  uint32_t due[WORKS];          // clock at which the round of each must be over
  uint32_t due_first;           // the earlier one
} app_t;

// Check the parameter block, configure the chip, start the control tick. Interrupts are still off in the core.
void app_boot(app_t *app);
// Work of the current line: the current regulator in C, if the scenario has it. Not interruptible.
void app_current_interrupt(app_t *app);
// Work of the control line: trip first, then the control step. Only the current line interrupts it.
void app_control_interrupt(app_t *app);
// Work of the deferred line: UART, design of the gains and load generator. The other lines pre-empt it.
void app_deferred_interrupt(app_t *app);
// One round of the main loop: the console.
void app_poll(app_t *app);

// Supervise the first `works` of work_t from now on.
void app_watch(app_t *app, uint32_t works);
// The main loop begins a round of one of them, and has done it; one within the other is allowed.
work_t app_begin(app_t *app, work_t work);
void app_done(app_t *app, work_t work, work_t before);

// Set a setting between two control ticks; main loop only.
setting_result_t app_set(app_t *app, setting_t setting, int32_t value);

#endif
