# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Lives of random machines that nobody tuned the drive for: drawn, run on the host, judged, counted.

`ranges` and `draw` make a machine with inverter, load and a motor file that is wrong by some percent. `life` is what
happens to it, an ordinary scenario. `run` refuses or runs it, `judge` says how it went, `book` keeps it.
"""
