# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""CANopen: the object dictionary `sw/canopen/objects.toml`, and C tables, EDS, DBC, accessors and page made from it."""
