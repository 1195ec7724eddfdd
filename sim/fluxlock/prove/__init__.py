# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Whether the drive holds a motor on an inverter, and by how much the motor file may be wrong: `fluxlock prove`.

`life` is what happens to the machine, an ordinary scenario; `cases` are the lives that are run on the twin; `page` is
what was found, as a picture and JSON.
"""
