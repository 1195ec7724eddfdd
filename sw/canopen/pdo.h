// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Process data: four RPDOs and four TPDOs with mapping, SYNC, inhibit time and event timer.
#ifndef FL_PDO_H
#define FL_PDO_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/can_frame.h"
#include "canopen/timer.h"

typedef struct canopen canopen_t;

#define PDO_COUNT 4u
#define PDO_MAPPED 8u
#define PDO_TYPE_CYCLIC_MAX 240u
#define PDO_TYPE_EVENT_MIN 254u
// Numbers of the entries from one TPDO to the next.
#define PDO_TPDO_STEP (OD_TPDO2_COUNT - OD_TPDO1_COUNT)

// What a PDO carries.
typedef struct {
  bool enabled;
  uint32_t can_id;
  uint32_t type;
  uint32_t count;
  uint32_t number[PDO_MAPPED];  // OD_COUNT: bytes that mean nothing
  uint32_t bytes[PDO_MAPPED];
  uint32_t length;  // of all
} pdo_map_t;

typedef struct {
  pdo_map_t map;
  bool waiting;  // for SYNC
  uint8_t data[8];
  uint32_t data_length;
  span_t wrong;  // since something was wrong with one
} rpdo_t;

typedef struct {
  pdo_map_t map;
  uint8_t data[8];  // as last sent
  bool told;        // since operational began
  uint32_t syncs;   // since the last one sent
  span_t inhibit;
  span_t event;
} tpdo_t;

typedef struct {
  rpdo_t rpdo[PDO_COUNT];
  tpdo_t tpdo[PDO_COUNT];
} pdo_t;

// pdo_setup.c: CAN-IDs, mapping, begin.

// Whether a CAN-ID may be given to the PDO, SYNC or EMCY of an entry: not a reserved one, and of no other of them in use.
bool pdo_id_is_free(const canopen_t *node, uint32_t number, uint32_t can_id);
// The first object in use with a CAN-ID that is not its default, and reserved or used twice; OD_COUNT: none.
uint32_t pdo_id_taken(const canopen_t *node);
// Nothing is wrong with the k-th RPDO any more.
void pdo_forgive(canopen_t *node, uint32_t k);
// SDO_OK, or why a communication or mapping object of a PDO cannot be written now.
uint32_t pdo_check(canopen_t *node, uint32_t number, uint32_t value);
// Work out the mapping from the objects; one that cannot be is switched off.
void pdo_configure(canopen_t *node);
// Operational begins: nothing waits, every TPDO is new.
void pdo_start(canopen_t *node);

// pdo.c: values on their way.

// A frame; false: it is of no RPDO.
bool pdo_receive(canopen_t *node, const can_frame_t *frame);
void pdo_sync(canopen_t *node);
// TPDOs by event.
void pdo_step(canopen_t *node);

#endif
