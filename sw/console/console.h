// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Console on the UART: one command a line (CR or LF ends it), replies end with `ok` or `error: ...`.
#ifndef FL_CONSOLE_H
#define FL_CONSOLE_H

#include "app/app.h"

void console_init(void);
// A word of the UART's receive FIFO, from its handler.
void console_receive(uint32_t word);
// Take received bytes up to the end of a line, and run that. Main loop.
void console_poll(app_t *app);
// Bytes wait for another round.
bool console_waits(void);

#endif
