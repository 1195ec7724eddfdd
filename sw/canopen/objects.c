// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/objects.h"

#include "canopen/abort.h"
#include "canopen/drive_link.h"
#include "control/fixed.h"
#include "control/placement.h"
#include "hal/capture.h"

SMALL_CODE_BEGIN

#define DISABLED (1u << 31)
#define SIGNATURE_SAVE 0x65766173u  // "save"
#define SIGNATURE_LOAD 0x64616F6Cu  // "load"

uint32_t objects_read(canopen_t *node, uint32_t number) {
  if ((od_entry(number)->flags & OD_LIVE) != 0u) {
    return od_extend(number, link_read(node->app, number));
  }
  return node->value[number];
}

static bool is_enabled(const canopen_t *node) { return node->drive.state == PDS_ENABLED; }

static uint32_t check_store(const canopen_t *node, uint32_t value, uint32_t signature) {
  if (value != signature) {
    return SDO_REFUSED;
  }
  // The console may have started the motor too.
  link_status_t status;
  link_status(node->app, &status);
  const bool turns = status.state == STATE_STARTING || status.state == STATE_RUNNING || status.state == STATE_STOPPING;
  return (turns || is_enabled(node) || node->drive.state == PDS_QUICK_STOP) ? SDO_STATE : SDO_OK;
}

static uint32_t check_consumer(const canopen_t *node, uint32_t number, uint32_t value) {
  const uint32_t id = value >> 16;
  if (id > 127u || id == node->node_id || (id == 0u && (value & 0xFFFFu) != 0u)) {
    return SDO_VALUE;
  }
  for (uint32_t k = 0; k < NMT_CONSUMERS; k++) {
    const uint32_t other = OD_HEARTBEAT_CONSUMER_NODE_1 + k;
    const bool used = (node->value[other] & 0xFFFFu) != 0u && (value & 0xFFFFu) != 0u;
    if (other != number && used && node->value[other] >> 16 == id) {
      return SDO_INCOMPATIBLE;
    }
  }
  return SDO_OK;
}

// The ID of EMCY in use stays.
static uint32_t check_emcy_id(const canopen_t *node, uint32_t value) {
  const uint32_t old = node->value[OD_EMCY_COB_ID];
  if ((value & ~(DISABLED | 0x7FFu)) != 0u) {
    return SDO_VALUE;
  }
  if ((value & DISABLED) != 0u) {
    return SDO_OK;
  }
  if ((old & DISABLED) == 0u && old != value) {
    return SDO_STATE;
  }
  return pdo_id_is_free(node, OD_EMCY_COB_ID, value) ? SDO_OK : SDO_VALUE;
}

uint32_t objects_check(canopen_t *node, uint32_t number, uint32_t value) {
  const od_entry_t *entry = od_entry(number);
  if ((entry->flags & OD_WRITE) == 0u) {
    return SDO_READ_ONLY;
  }
  const uint32_t abort = od_check(number, value);
  if (abort != SDO_OK) {
    return abort;
  }
  if (entry->index >= 0x1400u && entry->index < 0x1C00u) {
    return pdo_check(node, number, value);
  }
  switch (number) {
    case OD_STORE_PARAMETERS_SAVE_ALL:
      return check_store(node, value, SIGNATURE_SAVE);
    case OD_RESTORE_DEFAULTS_RESTORE_ALL:
      return check_store(node, value, SIGNATURE_LOAD);
    case OD_SYNC_COB_ID:
      return pdo_id_is_free(node, number, value) ? SDO_OK : SDO_VALUE;
    case OD_EMCY_COB_ID:
      return check_emcy_id(node, value);
    case OD_HEARTBEAT_CONSUMER_NODE_1:
    case OD_HEARTBEAT_CONSUMER_NODE_2:
    case OD_HEARTBEAT_CONSUMER_NODE_3:
    case OD_HEARTBEAT_CONSUMER_NODE_4:
      return check_consumer(node, number, value);
    case OD_MODES_OF_OPERATION:
      return (value == OPERATION_TORQUE && !link_has_torque(node->app)) ? SDO_STATE : SDO_OK;
    default:
      return SDO_OK;
  }
}

uint32_t objects_write(canopen_t *node, uint32_t number, uint32_t value) {
  const od_entry_t *entry = od_entry(number);
  node->written = true;
  if ((entry->flags & OD_LIVE) != 0u) {
    return link_write(node->app, number, value) ? SDO_OK : SDO_VALUE;
  }
  if (number == OD_STORE_PARAMETERS_SAVE_ALL) {
    return store_save(node) ? SDO_OK : SDO_HARDWARE;
  }
  if (number == OD_RESTORE_DEFAULTS_RESTORE_ALL) {
    return store_forget(node) ? SDO_OK : SDO_HARDWARE;
  }
  node->value[number] = value;
  node->wanted_fresh = node->wanted_fresh || entry->index < 0x1800u;
  if (entry->index >= 0x1400u && entry->index < 0x1C00u) {
    pdo_configure(node);
  } else if (entry->index == 0x1016u) {
    nmt_watch(node, number - OD_HEARTBEAT_CONSUMER_NODE_1);
  }
  switch (number) {
    case OD_CONTROLWORD:
      cia402_control(node, value);
      break;
    case OD_ERROR_FIELD_COUNT:
      emcy_forget(node);
      break;
    default:
      break;
  }
  return SDO_OK;
}

uint32_t objects_length(const canopen_t *node, uint32_t number) {
  if (number == OD_CAPTURE_RECORDS) {
    return capture_bytes();
  }
  if (number == OD_WIRING_TABLES) {
    return link_wiring(node->app) != 0 ? WIRING_TABLE_BYTES : 0u;
  }
  if (number == OD_DEVICE_LABEL) {
    return node->label_length;
  }
  const char *text = od_string(number);
  uint32_t length = 0;
  while (text != 0 && text[length] != '\0') {
    length++;
  }
  return length;
}

void objects_bytes(const canopen_t *node, uint32_t number, uint32_t offset, uint8_t *data, uint32_t count) {
  if (number == OD_CAPTURE_RECORDS) {
    capture_read(offset, data, count);
    return;
  }
  const uint8_t *from = (number == OD_DEVICE_LABEL)    ? node->label
                        : (number == OD_WIRING_TABLES) ? link_wiring(node->app)
                                                       : (const uint8_t *)od_string(number);
  for (uint32_t i = 0; i < count; i++) {
    data[i] = from[offset + i];
  }
}

static void from_drive(canopen_t *node) {
  link_ratings_t r;
  link_ratings(node->app, &r);
  const uint32_t accel = (r.accel_rpm_s < 1) ? 1u : (uint32_t)r.accel_rpm_s;
  const uint32_t most = od_entry(OD_QUICK_STOP_DECELERATION)->max;
  node->value[OD_PROFILE_ACCELERATION] = accel;
  node->value[OD_PROFILE_DECELERATION] = accel;
  node->value[OD_QUICK_STOP_DECELERATION] = clamp_u32(2u * accel, 1u, most);
  node->value[OD_RATED_CURRENT] = (uint32_t)r.rated_ma;
  node->value[OD_RATED_TORQUE] = (uint32_t)r.rated_mnm;
  node->value[OD_MAX_MOTOR_SPEED] = (uint32_t)r.speed_max_rpm;
  // Profile velocity, cyclic synchronous velocity; torque where the method has it.
  node->value[OD_SUPPORTED_DRIVE_MODES] = 1u << 2 | 1u << 8 | (r.torque ? 1u << 9 : 0u);
}

void objects_defaults(canopen_t *node, uint32_t first, uint32_t last) {
  for (uint32_t n = 0; n < OD_COUNT; n++) {
    const od_entry_t *entry = od_entry(n);
    if (entry->index >= first && entry->index <= last) {
      node->value[n] = od_default(n, node->node_id);
    }
  }
  if (first <= 0x2000u && last >= 0x6000u) {
    node->label_length = 0;
    from_drive(node);
  }
  node->value[OD_DEVICE_NODE_ID] = node->node_id;
  // One that cannot be leaves the default: the node comes on the bus in any case.
  if (node->bit_rate_kbit_s != 0u && od_check(OD_DEVICE_BIT_RATE, node->bit_rate_kbit_s) == SDO_OK) {
    node->value[OD_DEVICE_BIT_RATE] = node->bit_rate_kbit_s;
  }
}

SMALL_CODE_END
