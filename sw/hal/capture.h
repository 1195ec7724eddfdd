// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The capture buffer: its registers, and its records as bytes.
#ifndef FL_CAPTURE_H
#define FL_CAPTURE_H

#include <stdint.h>

#define CAPTURE_LANES 4u
#define CAPTURE_RECORD_BYTES (4u * CAPTURE_LANES)  // a signed word of 32 bits each
#define CAPTURE_TERMINALS 0x06020100u  // lanes: terminal voltages of A, B, C, and the link's
#define CAPTURE_AT_ONCE 1u             // control: arm, every sample set from now on

// Registers as in the register map; writing the control with its bit 0 arms.
uint32_t capture_control(void);
uint32_t capture_lanes(void);
uint32_t capture_status(void);
void capture_configure(uint32_t control);
void capture_set_lanes(uint32_t lanes);

// Records of a capture, 0: the chip has none.
uint32_t capture_depth(void);
// Lanes of a record of the finished capture.
void capture_look(uint32_t record, int32_t values[CAPTURE_LANES]);
// Bytes of the finished capture, 0 while there is none.
uint32_t capture_bytes(void);
// Bytes from an offset on, little endian; offset + count <= capture_bytes().
void capture_read(uint32_t offset, uint8_t *data, uint32_t count);

#endif
