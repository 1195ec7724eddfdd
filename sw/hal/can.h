// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The CAN controller, polled: frames in and out in their order. Identifiers are standard ones, extended ones with
// CAN_ID_EXTENDED where they are sent or filtered.
#ifndef FL_CAN_H
#define FL_CAN_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/can_frame.h"
#include "hal/reg.h"

#define CAN_FILTERS 8u
#define CAN_ID_EXTENDED FL_CAN_REGS__TX_ID__EXT_bm

typedef struct {
  uint32_t id;
  uint32_t mask;  // bits that must be equal; of no use with enable false
  bool enable;
} can_filter_t;

// Word of the bit timing register for a bit rate in kbit/s: 8 to 25 quanta, sample point near 80 %, widest jump.
// 0: no such bit is a whole number of clocks.
uint32_t can_bit_timing(uint32_t clock_hz, uint32_t kbit_s);
// Leave the bus, take the timing, join it again after eleven recessive bits; bus-off ends by itself.
void can_join(uint32_t bit_timing);
// What the k-th filter keeps of the data frames; others are dropped by the hardware.
void can_set_filter(uint32_t k, const can_filter_t *filter);
// The oldest frame received. False: there is none. *lost: frames before it were lost to a full FIFO.
bool can_take(can_frame_t *frame, bool *lost);
// Send a frame after those put before. False: no room now.
bool can_send(const can_frame_t *frame);
bool can_is_bus_off(void);

#endif
