// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "hal/can.h"

#include "hal/reg.h"

#define QUANTA_MAX 25u
#define QUANTA_MIN 8u
#define CYCLES_A_QUANTUM_MAX 256u
#define JUMP_MAX 4u
#define BUFFERS 3u

uint32_t can_bit_timing(uint32_t clock_hz, uint32_t kbit_s) {
  const uint32_t bits_s = 1000u * kbit_s;
  if (bits_s == 0u || clock_hz % bits_s != 0u) {
    return 0;
  }
  const uint32_t bit_cycles = clock_hz / bits_s;
  for (uint32_t quanta = QUANTA_MAX; quanta >= QUANTA_MIN; quanta--) {
    const uint32_t brp = bit_cycles / quanta;
    if (brp * quanta == bit_cycles && brp <= CYCLES_A_QUANTUM_MAX) {
      const uint32_t after = quanta / 5u;  // phase segment 2
      const uint32_t jump = (after < JUMP_MAX) ? after : JUMP_MAX;
      return FIELD(FL_CAN_REGS__BIT_TIMING__BRP, brp - 1u) | FIELD(FL_CAN_REGS__BIT_TIMING__TSEG1, quanta - after - 2u) |
             FIELD(FL_CAN_REGS__BIT_TIMING__TSEG2, after - 1u) | FIELD(FL_CAN_REGS__BIT_TIMING__SJW, jump - 1u);
    }
  }
  return 0;
}

void can_join(uint32_t bit_timing) {
  reg_write(REG(can.control), 0);
  reg_write(REG(can.bit_timing), bit_timing);
  reg_write(REG(can.control), FIELD(FL_CAN_REGS__CONTROL__ENABLE, 1) | FIELD(FL_CAN_REGS__CONTROL__RECOVER, 1));
}

void can_set_filter(uint32_t k, const can_filter_t *filter) {
  const uint32_t enable = FIELD(FL_CAN_REGS__FILTER_MASK__ENABLE, filter->enable ? 1 : 0);
  reg_write(REG(can.filter_mask) + 4u * k, 0);
  reg_write(REG(can.filter_id) + 4u * k, filter->id);
  reg_write(REG(can.filter_mask) + 4u * k,
            enable | filter->mask | FL_CAN_REGS__FILTER_MASK__RTR_bm | FL_CAN_REGS__FILTER_MASK__EXT_bm);
}

bool can_take(can_frame_t *frame, bool *lost) {
  const uint32_t info = reg_read(REG(can.rx_info));
  if (BITS(FL_CAN_REGS__RX_INFO__VALID, info) == 0u) {
    return false;
  }
  const uint32_t id = reg_read(REG(can.rx_id));
  const uint32_t length = BITS(FL_CAN_REGS__RX_INFO__DLC, info);
  *lost = BITS(FL_CAN_REGS__RX_INFO__LOST, info) != 0u;
  frame->id = BITS(FL_CAN_REGS__RX_ID__ID, id);
  frame->flags = (uint8_t)((((id & FL_CAN_REGS__RX_ID__EXT_bm) != 0u) ? CAN_EXTENDED : 0) |
                           (((id & FL_CAN_REGS__RX_ID__RTR_bm) != 0u) ? CAN_REMOTE : 0));
  frame->length = (uint8_t)((length < 8u) ? length : 8u);
  can_put(&frame->data[0], 4, reg_read(REG(can.rx_data[0])));
  can_put(&frame->data[4], 4, reg_read(REG(can.rx_data[1])));
  reg_write(REG(can.rx_command), FIELD(FL_CAN_REGS__RX_COMMAND__TAKE, 1));
  return true;
}

// The lowest of the waiting buffers goes first: one behind all of them keeps the order.
bool can_send(const can_frame_t *frame) {
  uint32_t buffer = 0;
  uint32_t pending = BITS(FL_CAN_REGS__STATUS__PENDING, reg_read(REG(can.status)));
  for (; pending != 0u; pending >>= 1) {
    buffer++;
  }
  if (buffer == BUFFERS) {
    return false;
  }
  reg_write(REG(can.tx_id), frame->id);
  reg_write(REG(can.tx_data[0]), can_get(&frame->data[0], 4));
  reg_write(REG(can.tx_data[1]), can_get(&frame->data[4], 4));
  reg_write(REG(can.tx_command), 1u << buffer | FIELD(FL_CAN_REGS__TX_COMMAND__DLC, frame->length));
  return true;
}

bool can_is_bus_off(void) { return BITS(FL_CAN_REGS__STATUS__BUS_OFF, reg_read(REG(can.status))) != 0u; }
