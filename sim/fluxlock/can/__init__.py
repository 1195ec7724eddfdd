# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""CAN 2.0 (ISO 11898-1) at bit level: frames, a node, and the bus that joins nodes in time.

Levels are the wire's: 0 dominant, 1 recessive.
"""
