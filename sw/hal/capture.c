// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "hal/capture.h"

#include <stdbool.h>

#include "hal/reg.h"

uint32_t capture_control(void) { return reg_read(REG(capture.control)); }
uint32_t capture_lanes(void) { return reg_read(REG(capture.lanes)); }
uint32_t capture_status(void) { return reg_read(REG(capture.status)); }
void capture_configure(uint32_t control) { reg_write(REG(capture.control), control); }
void capture_set_lanes(uint32_t lanes) { reg_write(REG(capture.lanes), lanes); }

uint32_t capture_depth(void) { return BITS(FL_CAPTURE_REGS__STATUS__DEPTH, capture_status()); }

uint32_t capture_bytes(void) {
  const bool done = BITS(FL_CAPTURE_REGS__STATUS__DONE, capture_status()) != 0u;
  return done ? capture_depth() * CAPTURE_RECORD_BYTES : 0u;
}

void capture_look(uint32_t record, int32_t values[CAPTURE_LANES]) {
  reg_write(REG(capture.read_address), record);
  // The buffer needs two clocks after a new address: a read in between takes longer.
  (void)reg_read(REG(capture.status));
  for (uint32_t lane = 0; lane < CAPTURE_LANES; lane++) {
    values[lane] = (int32_t)reg_read(REG(capture.data) + 4u * lane);
  }
}

void capture_read(uint32_t offset, uint8_t *data, uint32_t count) {
  for (uint32_t i = 0; i < count; i++) {
    const uint32_t at = offset + i;
    int32_t values[CAPTURE_LANES];
    capture_look(at / CAPTURE_RECORD_BYTES, values);
    data[i] = (uint8_t)((uint32_t)values[(at & 12u) / 4u] >> (8u * (at & 3u)));
  }
}
