// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// One CANopen node on the drive of the host library, frames and time from outside.
#ifndef FL_HOST_NODE_H
#define FL_HOST_NODE_H

#include <stdint.h>

enum { HOST_NO_FRAME = 9 };  // in place of a length

// After fl_host_boot.
void fl_can_boot(uint32_t node_id, uint32_t now_us);
// Bit rate beside the parameters, for the next boot, 0: none.
void fl_can_setup_rate(uint32_t kbit_s);
void fl_can_receive(uint32_t id, uint32_t flags, uint32_t length, const uint8_t *data);
void fl_can_step(uint32_t now_us);
// Length of the next frame to send; HOST_NO_FRAME: none.
uint32_t fl_can_next(uint32_t *id, uint8_t *data);
void fl_can_bus_off(void);
void fl_can_bus_back(void);
void fl_can_overrun(void);
// Identifier that the k-th filter wants, and the bits of it that count; UINT32_MAX: the filter is off.
uint32_t fl_can_wanted(uint32_t k, uint32_t *mask);
// Value of an entry by its number, as an SDO upload would read it.
uint32_t fl_can_value(uint32_t number);
// Sectors of both slots in the flash: they survive fl_can_boot.
uint8_t *fl_can_memory(void);
uint32_t fl_can_memory_bytes(void);

#endif
