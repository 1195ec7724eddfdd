// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// C interface between the simulator's main, the plant kernel and Python, which reads this header (fluxlock.headers).
#ifndef COSIM_H
#define COSIM_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// Plant kernel: advance to t_cycle with the old gates, then take `gates`.
// gates: bit 2X = upper, 2X+1 = lower switch of leg X, in force from now on. flags: bit 0 sample strobe, bit 1 gates changed,
// bit 2 the brake switch, in force from now on.
// state: double[], io: int32[32], [0..channels-1] converter codes, [16] heartbeat, [17] pins (bit 0 gate-driver fault, 1..3 Hall A, B, C),
// [18] encoder A, B, Z in bits 0, 1, 2, [19] clocks within which the next call must come for it, 0: there is none.
// Returns 0, else a fault code; the kernel is not called again after one.
typedef int32_t (*plant_fn)(int64_t t_cycle, int32_t gates, int32_t flags, double *state, int32_t *io);

enum { IO_HEARTBEAT = 16, IO_PINS = 17, IO_ENCODER = 18, IO_ENCODER_WAIT = 19 };

// Kinds of log rows [cycle, kind, a, b]; stamps in b are converted to cycles of this log.
enum {
    LOG_GATES = 1,        // a: gates
    LOG_COMMUTATION = 2,  // a: new sector, b: scheduled instant
    LOG_CROSSING = 3,     // a: sector | late << 4, b: crossing time
    LOG_TRIP = 4,         // a: causes
    // Committed settings took effect; a: drive's speed (r/min, q8) << 32 | lost locks << 20 | limit << 16 | fault << 8 | state,
    // b: target (r/min) << 32 | reference (r/min, q8), of the firmware's telemetry.
    LOG_UPDATE = 5,
    LOG_STROBE = 6,       // sample strobe (only when strobe logging is on)
    LOG_PINS = 7,         // a: pins at the chip (bit 0 gate-driver fault, 1..3 Hall A, B, C), from after this edge on
    LOG_ANGLE = 8,        // instant of a current sample of the vector path; a: angle of the frame there, b: what firmware publishes beyond it, 2^32 = one turn
    LOG_ENABLE = 10,      // driver enable of a board, on a change; a: its level
    LOG_CAN = 9,          // CAN pins, on a change (only when their logging is on); a: chip's transmit pin | bus << 1
};

// A node on the CAN bus beside the chip.
typedef struct {
    int64_t waiting;  // frames in its queue
    int64_t sent;     // and acknowledged
    int64_t errors;   // found on the bus
    int64_t tec, rec;
    int64_t bus_off;
} can_state_t;

typedef struct {
    int64_t cycle;      // rising edges so far
    int64_t log_count;  // rows written since the last cosim_log()
    int64_t log_lost;   // rows lost to a full log
    int64_t events;     // plant kernel calls
    int64_t edges;      // of these with a gate change
    int64_t strobes;    // of these with a sample strobe
    int64_t t_fault;    // cycle of the plant fault
    int32_t fault;      // 0, the kernel's code, or -2: an exception in the kernel (heartbeat stood still)
    int32_t uart_lost;  // bytes from the chip lost to a full buffer
} cosim_status_t;

// From now on the plant kernel is called. state and io must stay alive.
void cosim_attach(plant_fn fn, double *state, int32_t *io);
// Live counters.
const cosim_status_t *cosim_status(void);
// Log into these rows from now on, from the first.
void cosim_log(int64_t *rows, int64_t capacity);
// Clocks from strobe to valid and of a console bit. polarity: bit 0, 1: upper, lower gates are on at low level.
void cosim_configure(int64_t conversion_cycles, int64_t bit_cycles, int32_t log_strobes, int32_t polarity);

void cosim_console_send(const char *text, int64_t size);
// Number of bytes taken.
int64_t cosim_console_take(char *buffer, int64_t size);

// Copy words of the soft core's memory. What can fail returns 0, or -1 if it has.
int32_t cosim_peek(uint32_t address, uint32_t *words, int32_t count);
// Flip a bit of the soft core's memory; its caches do not hear of it.
int32_t cosim_upset_memory(uint32_t address, int32_t bit);
// Flip a bit of register n: between two clock edges, what depends on it follows at the next one.
int32_t cosim_upset_count(void);
const char *cosim_upset_name(int32_t n);
int32_t cosim_upset_bits(int32_t n);
int32_t cosim_upset(int32_t n, int32_t bit);
// Lowest 64 bits of register n as it is now.
uint64_t cosim_upset_value(int32_t n);

// A node on the chip's CAN bus from now on; its number. Times in quanta, brp in clocks per quantum; the node's clock is
// fast by the error, the delay to the chip in clocks.
int32_t cosim_can_open(int32_t brp, int32_t prop, int32_t ps1, int32_t ps2, int32_t sjw, double error, double delay);
// head: identifier, extended, remote, length code; data: 8 bytes.
void cosim_can_send(int32_t node, const uint32_t *head, const uint8_t *data);
int32_t cosim_can_take(int32_t node, uint32_t *head, uint8_t *data);  // 0: there is none
void cosim_can_state(int32_t node, can_state_t *state);
// A disturbance: the bus has this level from a cycle up to another, both to come.
void cosim_can_force(int64_t start, int64_t end, int32_t level);
void cosim_can_log(int32_t on);

// A disturbance: a pin has this level, or with -1 the opposite of the one that is driven, for so many clock edges from the
// next but one on.
int32_t cosim_pin_count(void);
const char *cosim_pin_name(int32_t n);
int32_t cosim_force_pin(int32_t pin, int32_t level, int64_t cycles);

// The core in front of an instruction that it has not begun, for a debugger; only of a chip built with core_probe.h.
enum { CORE_HALT = 1, CORE_STEP = 2, CORE_BREAK = 3, CORE_WATCH = 4 };  // why it stopped
enum { CORE_READS = 1, CORE_WRITES = 2 };                               // kinds of a watchpoint, one or both
typedef struct {
    int64_t cycle;
    uint32_t pc, x[32];
    int32_t reason;
    uint32_t touched;  // address that met a watchpoint, and its kinds
    uint32_t kinds;
} core_stop_t;
typedef struct {
    uint32_t address, size, kinds;
} core_watch_t;
// Called at every stop, the first in front of the next instruction; chip and motor stand until it returns.
typedef void (*core_stop_fn)(void);
void cosim_core_debug(core_stop_fn fn);  // 0: no more stops
const core_stop_t *cosim_core_stop(void);
void cosim_core_break(uint32_t address, int32_t on);
void cosim_core_watch(const core_watch_t *watch, int32_t on);
void cosim_core_resume(int64_t steps);  // at a stop: instructions until the next, 0: none is asked for
void cosim_core_request(void);          // stop in front of the next instruction
// Memory as the program sees it at a stop; -1: there is none.
int32_t cosim_core_read(uint32_t address, uint8_t *bytes, int32_t count);

// Instructions that left the core in a row: count of them, a clock and 4 bytes apart, from this clock and place on.
typedef struct {
    int64_t cycle;
    uint32_t pc, count;
} core_row_t;
typedef struct {
    int64_t cycle;
    int64_t sp;  // lowest stack pointer, at this clock
} core_stack_t;
// Write rows of the clocks from..to into a file, until the end.
int32_t cosim_core_trace(const char *path, int64_t from, int64_t to);
int32_t cosim_core_trace_end(core_stack_t *deepest);

void cosim_record(int32_t on);
// int64 counts, inputs, codes.
int32_t cosim_record_save(const char *path);

#ifdef __cplusplus
}
#endif

#endif
