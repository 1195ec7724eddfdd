// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// C interface between the simulator's main, the plant kernel and Python (ctypes).
#pragma once
#include <cstdint>

// Plant kernel: advance to t_cycle with the old gates, then take `gates`.
// gates: bit 2X = upper, 2X+1 = lower switch of leg X, in force from now on. flags: bit 0 sample strobe, bit 1 gates changed,
// bit 2 the brake switch, in force from now on.
// state: double[], io: int32[32], [0..channels-1] converter codes, [16] heartbeat, [17] pins (bit 0 gate-driver fault, 1..3 Hall A, B, C),
// [18] encoder A, B, Z in bits 0, 1, 2, [19] clocks within which the next call must come for it, 0: there is none.
// Returns 0, else a fault code; the kernel is not called again after one.
typedef int32_t (*plant_fn)(int64_t t_cycle, int32_t gates, int32_t flags, double* state, int32_t* io);

constexpr int IO_HEARTBEAT = 16;
constexpr int IO_PINS = 17;
constexpr int IO_ENCODER = 18;
constexpr int IO_ENCODER_WAIT = 19;

// Kinds of log rows [cycle, kind, a, b]; stamps in b are converted to cycles of this log.
enum log_kind : int64_t {
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
    LOG_CAN = 9,          // CAN pins, on a change (only when their logging is on); a: chip's transmit pin | bus << 1
};

// A node on the CAN bus beside the chip.
struct can_state_t {
    int64_t waiting;  // frames in its queue
    int64_t sent;     // and acknowledged
    int64_t errors;   // found on the bus
    int64_t tec, rec;
    int64_t bus_off;
};

struct cosim_status_t {
    int64_t cycle;      // rising edges so far
    int64_t log_count;  // rows written since the last cosim_log()
    int64_t log_lost;   // rows lost to a full log
    int64_t events;     // plant kernel calls
    int64_t edges;      // of these with a gate change
    int64_t strobes;    // of these with a sample strobe
    int64_t t_fault;    // cycle of the plant fault
    int32_t fault;      // 0, the kernel's code, or -2: an exception in the kernel (heartbeat stood still)
    int32_t uart_lost;  // bytes from the chip lost to a full buffer
};
