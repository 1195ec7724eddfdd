// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "native_node.h"

#include "can_bus.h"

can_node_t* node_new() { return new can_node_t; }
void node_send(can_node_t* node, uint32_t id, int ext, int rtr, int dlc, const uint8_t* data) {
    can_frame_t frame;
    frame.id = id;
    frame.ext = static_cast<uint8_t>(ext);
    frame.rtr = static_cast<uint8_t>(rtr);
    frame.dlc = static_cast<uint8_t>(dlc);
    for (int i = 0; i < frame.bytes(); i++) frame.data[i] = data[i];
    node->queue.push_back(frame);
}
void node_step(can_node_t* node, int seen, int64_t* view) {
    if (seen >= 0) node->step(seen);
    const int64_t now[8] = {node->level(), node->between, node->bus_off, node->tec, node->rec, node->sent, node->errors,
                            static_cast<int64_t>(node->received.size())};
    for (int i = 0; i < 8; i++) view[i] = now[i];
}
void node_last(const can_node_t* node, uint32_t* head, uint8_t* data) {
    const can_frame_t& frame = node->received.back();
    head[0] = frame.id, head[1] = frame.ext, head[2] = frame.rtr, head[3] = frame.dlc;
    for (int i = 0; i < 8; i++) data[i] = frame.data[i];
}

can_bus_t* bus_new() { return new can_bus_t; }
can_node_t* bus_open(can_bus_t* bus, int64_t now, int brp, int prop, int ps1, int ps2, int sjw, double clock_error,
                     double delay) {
    return bus->open(now, {brp, prop, ps1, ps2, sjw, clock_error, delay});
}
void bus_force(can_bus_t* bus, int64_t start, int64_t end, int level) { bus->force(start, end, level); }
void bus_chip(can_bus_t* bus, int64_t now, int level) { bus->chip(now, level); }
void bus_run(can_bus_t* bus, int64_t now) { bus->run(now); }
int64_t bus_next(const can_bus_t* bus) { return bus->next; }
int bus_level(const can_bus_t* bus) { return bus->level; }
