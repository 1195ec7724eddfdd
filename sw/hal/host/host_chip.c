// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "hal/host/host_chip.h"

#include <string.h>

#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/host/host_flash.h"
#include "hal/reg.h"

#define FIFO_LENGTH 65536u
#define OFFSETS 13u

typedef struct {
  uint16_t data[FIFO_LENGTH];  // as the receive register has them
  uint32_t head;
  uint32_t tail;
} fifo_t;

static struct {
  uint32_t reg[HOST_REGISTER_WORDS];
  uint32_t block[512];
  uint32_t telemetry[512];
  int32_t auto_zero[OFFSETS];
  fifo_t to_firmware;
  fifo_t from_firmware;
  uint32_t spi_rx;
  int32_t capture[HOST_CAPTURE_RECORDS][4];
} host;

static void push(fifo_t *fifo, uint32_t word) {
  if (fifo->head - fifo->tail < FIFO_LENGTH) {
    fifo->data[fifo->head % FIFO_LENGTH] = (uint16_t)word;
    fifo->head++;
  }
}

uint32_t *fl_host_registers(void) { return host.reg; }
uint8_t *fl_host_parameter_block(void) { return (uint8_t *)host.block; }
uint8_t *fl_host_telemetry(void) { return (uint8_t *)host.telemetry; }
int32_t *fl_host_auto_zero_offsets(void) { return host.auto_zero; }
int32_t *fl_host_capture(void) { return host.capture[0]; }
void *cpu_parameter_block(void) { return host.block; }
void *cpu_telemetry(void) { return host.telemetry; }
// Ticks come between calls: nothing interrupts.
uint32_t critical_enter(void) { return 0; }
void critical_leave(uint32_t state) { (void)state; }

static uint32_t *at(uint32_t address) { return &host.reg[((address - REG_BASE) / 4u) % HOST_REGISTER_WORDS]; }

void fl_host_reset(void) {
  memset(&host, 0, sizeof host);
  *at(REG(sys.id)) = FL_SYS_REGS__ID__MAGIC_reset;
  *at(REG(sys.build)) =
      FL_SYS_REGS__BUILD__MAP_VERSION_reset | FIELD(FL_SYS_REGS__BUILD__PHASES, PHASES) |
      FIELD(FL_SYS_REGS__BUILD__CHANNELS, 9);
  *at(REG(sys.clock)) = 50000000u;
  *at(REG(sys.blocks)) = FL_SYS_REGS__BLOCKS__FITTED_bm;
  for (uint32_t i = 0; i < OFFSETS; i++) {
    host.auto_zero[i] = CODE_MIDDLE_Q4;
  }
}

void fl_host_raise(uint32_t sources) { *at(REG(irq.pending)) |= sources; }

uint32_t fl_host_uart_send(const uint8_t *data, uint32_t length) {
  uint32_t n = 0;
  for (; n < length && host.to_firmware.head - host.to_firmware.tail < FIFO_LENGTH; n++) {
    push(&host.to_firmware, data[n] | (uint32_t)FL_UART_REGS__RX__VALID_bm);
  }
  fl_host_raise(IRQ_UART_RX);
  return n;
}

void fl_host_uart_lose(uint32_t ends, bool begun) {
  push(&host.to_firmware, (ends & 0x7Fu) | (begun ? 0x80u : 0u) | (uint32_t)FL_UART_REGS__RX__LOST_bm);
  fl_host_raise(IRQ_UART_RX);
}

uint32_t fl_host_uart_receive(uint8_t *data, uint32_t length) {
  uint32_t n = 0;
  for (; n < length && host.from_firmware.tail != host.from_firmware.head; n++) {
    data[n] = (uint8_t)host.from_firmware.data[host.from_firmware.tail % FIFO_LENGTH];
    host.from_firmware.tail++;
  }
  return n;
}

uint32_t reg_read(uint32_t address) {
  if (address == REG(uart.rx)) {
    fifo_t *fifo = &host.to_firmware;
    if (fifo->head == fifo->tail) {
      return 0;
    }
    return fifo->data[fifo->tail++ % FIFO_LENGTH];
  }
  if (address == REG(uart.status)) {
    return *at(address) | FL_UART_REGS__STATUS__TX_READY_bm;
  }
  if (address == REG(spi.rx)) {
    return host.spi_rx;
  }
  const uint32_t lane = (address - REG(capture.data)) / 4u;
  if (lane < 4u) {
    return (uint32_t)host.capture[*at(REG(capture.read_address)) % HOST_CAPTURE_RECORDS][lane];
  }
  return *at(address);
}

// The key clears latched trips whose cause is gone, and what a deadline trip was; what is present is the first from then on.
static void safety_command(uint32_t value) {
  if (BITS(FL_SAFETY_REGS__COMMAND__CLEAR_KEY, value) == 0xA5u) {
    const uint32_t now = BITS(FL_SAFETY_REGS__TRIP__NOW, *at(REG(safety.trip)));
    *at(REG(safety.trip)) = FIELD(FL_SAFETY_REGS__TRIP__LATCHED, now) | FIELD(FL_SAFETY_REGS__TRIP__NOW, now) |
                            FIELD(FL_SAFETY_REGS__TRIP__FIRST, now);
    if ((now & TRIP_DEADLINE) == 0u) {
      *at(REG(safety.monitor)) &= ~(uint32_t)FL_SAFETY_REGS__MONITOR__CAUSE_bm;
    }
  }
}

static void auto_zero(uint32_t value) {
  const uint32_t mask = BITS(FL_SENSE_REGS__AUTO_ZERO__MASK, value);
  for (uint32_t c = 0; c < OFFSETS && (value & FL_SENSE_REGS__AUTO_ZERO__START_bm) != 0u; c++) {
    if ((mask & (1u << c)) != 0u) {
      *at(REG(sense.offset[0]) + 4u * c) = (uint32_t)host.auto_zero[c];
    }
  }
}

void reg_write(uint32_t address, uint32_t value) {
  if (address == REG(uart.tx)) {
    push(&host.from_firmware, (uint8_t)value);
  } else if (address == REG(spi.control)) {
    host_flash_select(BITS(FL_SPI_REGS__CONTROL__SELECT, value) != 0u);
  } else if (address == REG(spi.tx)) {
    host.spi_rx = host_flash_exchange((uint8_t)value);
  } else if (address == REG(irq.pending)) {
    *at(address) &= ~value;
  } else if (address == REG(timer.update)) {
    *at(address) |= (value & FL_TIMER_REGS__UPDATE__COMMIT_bm) << FL_TIMER_REGS__UPDATE__PENDING_bp;
  } else if (address == REG(safety.command)) {
    safety_command(value);
  } else if (address == REG(safety.guard)) {
    const uint32_t built = FL_SAFETY_REGS__GUARD__HIGH_ACTIVE_LOW_bm | FL_SAFETY_REGS__GUARD__LOW_ACTIVE_LOW_bm;
    *at(address) = (*at(address) & built) | (value & ~built);
  } else if (address == REG(sense.auto_zero)) {
    auto_zero(value);
  } else {
    *at(address) = value;
  }
}
