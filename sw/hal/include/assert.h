// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The freestanding compiler has no <assert.h>; the generated register header includes it for static_assert alone.
#ifndef FL_ASSERT_H
#define FL_ASSERT_H

#undef static_assert
#define static_assert _Static_assert

#endif
