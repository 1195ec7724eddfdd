// Traps of the soft core. Control line: machine timer interrupt, runs with interrupts off. Deferred line: external
// interrupt 0, runs with interrupts on and its own source masked, so that only the control line pre-empts it.
#ifndef FL_TRAP_H
#define FL_TRAP_H

// Called by trap.S; the application provides them.
void trap_control(void);
void trap_deferred(void);

// Let both lines interrupt from now on.
void trap_enable(void);

#endif
