// Program of its own for the chip: writes registers by a table, in its order, and waits for control ticks in between. It
// knows no block, so that it runs on every build of the chip.
#include "hal/cpu.h"
#include "hal/reg.h"
#include "hal/soc/trap.h"

typedef struct {
  uint32_t address;  // of the register; 0: commit, and wait
  uint32_t value;    // to write; control ticks to wait for
} row_t;

typedef struct {
  uint32_t count;
  row_t row[];
} table_t;

// Nothing interrupts: no source is enabled.
void trap_current(void) {}
void trap_control(void) {}
void trap_deferred(void) {}

int main(void) {
  const table_t *table = (const table_t *)RAM_TABLE;
  for (uint32_t i = 0; i < table->count; i++) {
    const row_t row = table->row[i];
    if (row.address != 0u) {
      reg_write(row.address, row.value);
      continue;
    }
    reg_write(REG(timer.update), FIELD(FL_TIMER_REGS__UPDATE__COMMIT, 1));
    const uint32_t from = reg_read(REG(timer.tick_count));
    while (reg_read(REG(timer.tick_count)) - from < row.value) {
    }
  }
  for (;;) {
  }
}
