// A voltage channel that shows one code while the others swing: it does not follow its terminal.
//
// A channel that works never repeats its value for long: of a turning rotor every terminal sweeps its whole range in a
// turn, and the converter adds noise.
#ifndef FL_STUCK_H
#define FL_STUCK_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
  int32_t last_q17[3];
  uint32_t same_ticks[3];
} stuck_t;

void stuck_reset(stuck_t *stuck);

// One tick's terminal voltages. True: one or two of the channels have kept their value for `limit` ticks. About 60 clocks.
bool stuck_step(stuck_t *stuck, const int32_t v_q17[3], uint32_t limit);

#endif
