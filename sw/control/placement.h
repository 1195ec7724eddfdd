// Where a function lies in the image. The path of the control step while running (HOT) is laid out in one piece, so
// that most of it stays in the 4 KiB direct-mapped instruction cache; what it calls only on rare events stays out of
// it (COLD). SHARED functions exist once instead of being inlined.
#ifndef FL_PLACEMENT_H
#define FL_PLACEMENT_H

#define HOT __attribute__((hot))
#define SHARED __attribute__((hot, noinline))
#define COLD __attribute__((noinline, cold))

#endif
