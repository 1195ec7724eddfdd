# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The CAN bus in a scenario file."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from fluxlock.config.fields import Model, conflict, quantity

# Of which 50 MHz has whole bits of 25 quanta.
BIT_RATES = (10, 20, 50, 100, 125, 250, 500, 1000)


class Can(Model):
    """The chip has its CAN controller, the firmware its CANopen node. Not with `[drive.vector.injection]`."""

    node_id: int = quantity("CANopen node-ID after power-up.", "", 1, 127, default=1)
    bit_rate_kbit_per_s: int = Field(
        default=500, description=f"Bit rate after power-up, kbit/s: {', '.join(map(str, BIT_RATES))}."
    )

    @model_validator(mode="after")
    def _rate(self) -> Self:
        if self.bit_rate_kbit_per_s not in BIT_RATES:
            permitted = ", ".join(map(str, BIT_RATES))
            raise conflict("bit_rate_kbit_per_s", f"{self.bit_rate_kbit_per_s} is none of {permitted}")
        return self
