// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The native node and bus for test_native_node.py.
#ifndef NATIVE_NODE_H
#define NATIVE_NODE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct can_node_t can_node_t;
typedef struct can_bus_t can_bus_t;

can_node_t *node_new(void);
void node_send(can_node_t *node, uint32_t id, int ext, int rtr, int dlc, const uint8_t *data);
// Steps unless seen is negative, then: level, between, bus-off, both counters, frames sent, errors, frames received.
void node_step(can_node_t *node, int seen, int64_t view[8]);
// The last frame received; head: id, ext, rtr, dlc.
void node_last(const can_node_t *node, uint32_t head[4], uint8_t data[8]);

can_bus_t *bus_new(void);
can_node_t *bus_open(can_bus_t *bus, int64_t now, int brp, int prop, int ps1, int ps2, int sjw, double clock_error,
                     double delay);
void bus_force(can_bus_t *bus, int64_t start, int64_t end, int level);
void bus_chip(can_bus_t *bus, int64_t now, int level);
void bus_run(can_bus_t *bus, int64_t now);
int64_t bus_next(const can_bus_t *bus);
int bus_level(const can_bus_t *bus);

#ifdef __cplusplus
}
#endif

#endif
