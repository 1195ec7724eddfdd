# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Fault campaign: many faults at many moments of running drives, and how each run ends."""
