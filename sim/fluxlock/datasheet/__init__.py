# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""From the values of a data sheet to a motor file: units, kinds of constants, contradictions."""
