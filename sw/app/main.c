// The image for the soft core: entry from crt0, traps from trap.S.
#include "app/app.h"
#include "hal/cpu.h"
#include "hal/soc/trap.h"

// Rounds of an idle loop between two looks at the console: keeps the bus quiet.
#define IDLE_ROUNDS 64u

static app_t app;

void trap_current(void) { app_current_interrupt(&app); }

void trap_control(void) { app_control_interrupt(&app); }

void trap_deferred(void) { app_deferred_interrupt(&app); }

int main(void) {
  app_boot(&app);
  trap_enable();
  for (;;) {
    app_poll(&app);
    for (uint32_t i = 0; i < IDLE_ROUNDS; i++) {
      __asm__ volatile("nop");
    }
  }
}
