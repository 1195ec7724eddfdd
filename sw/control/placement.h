// What the compiler is to know of a function: on the path of the control step while running (HOT), the same but once in
// the image instead of inlined (SHARED), called by it on rare events only and kept out of line (COLD).
#ifndef FL_PLACEMENT_H
#define FL_PLACEMENT_H

#define HOT __attribute__((hot))
#define SHARED __attribute__((hot, noinline))
#define COLD __attribute__((noinline, cold))

#endif
