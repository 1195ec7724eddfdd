# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commissioning: measure a machine through the chip and write its motor file (docs/theory/identify.md).

What is kept apart: `procedure` and `estimate`, which make the numbers, get a `NamePlate` and an `Inverter` and import
neither motor nor plant; `simulate` alone holds the machine that is measured, and hands it to the plant only.
"""
