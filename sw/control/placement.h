// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the compiler is to know of a function: on the path of the control step while running (HOT), the same and called
// from one place of the image (INLINED), large or called from several places (SHARED), part of the design of the gains,
// beside which the control step runs (DESIGN), called on rare events only (COLD); in the last two the compiler saves room,
// not time, and the last three stay out of line. The core's conditional branches reach 4 KiB: in a longer function every
// rare case costs the usual one a jump. SMALL_CODE_BEGIN and SMALL_CODE_END enclose functions whose time does not matter.
#ifndef FL_PLACEMENT_H
#define FL_PLACEMENT_H

#define HOT __attribute__((hot))
#define INLINED __attribute__((hot, always_inline))
#define SHARED __attribute__((hot, noinline))
#if defined(__clang__)
#define COLD __attribute__((noinline, cold, minsize))
#define SMALL_CODE_BEGIN _Pragma("clang attribute push(__attribute__((minsize)), apply_to = function)")
#define SMALL_CODE_END _Pragma("clang attribute pop")
#else
#define COLD __attribute__((noinline, cold))
#define SMALL_CODE_BEGIN
#define SMALL_CODE_END
#endif
#define DESIGN COLD

#endif
