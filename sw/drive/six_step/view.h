// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What every part of the six-step drive may read.
#ifndef FL_SIX_STEP_VIEW_H
#define FL_SIX_STEP_VIEW_H

#include "drive/six_step/measure.h"

typedef struct {
  const parameters_t *p;
  const settings_t *settings;
  const order_t *order;
  const chip_snapshot_t *in;
  const measured_t *m;
} six_step_view_t;

#endif
