# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A page that shows a running drive: knobs, faults, a scope, and the scenario that repeats what was done.

`worker` runs the source in a process of its own, `link` is the page's side of it, `server` speaks to browsers.
"""
