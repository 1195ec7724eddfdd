# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Settings of square-wave injection in a scenario file."""

from __future__ import annotations

from typing import Literal, Self, get_args

from pydantic import Field, model_validator

from fluxlock.config.fields import Model, conflict, quantity

InjectionMethod = Literal["lock-in", "conventional", "iq", "separator"]
Sequence = Literal["held-tian", "held", "half-step", "exact"]

SEQUENCES: tuple[Sequence, ...] = get_args(Sequence)


class Injection(Model):
    """Square wave on the d axis: its current shows the saliency axis.

    The motor needs `inductance_q_h` above `inductance_h`.
    """

    method: InjectionMethod = Field(
        description="Demodulation: `lock-in` by the sign of the HF current on the d axis, `conventional` by a sine, "
        "`iq` by complex sums over whole periods, `separator` from four samples a period without a filter.",
    )
    amplitude_v: float = quantity("Amplitude of the wave.", "V", 0.01, 1500)
    period: int = quantity("Injection period in updates, even; 4 with `separator`.", "", 4, 1000)
    sequence: Sequence = Field(
        default="exact",
        description="Angle of the inverse Park transform: that of the sample (`held-tian`), half a T_s before the "
        "middle of the voltage's effect (`held`), that middle (`half-step`, `exact`). With `held` and `half-step` the "
        "reported angle goes with it.",
    )
    remove: bool = Field(default=True, description="The regulators do not see the HF current.")
    samples: int = quantity("Converter samples averaged in a current sample.", "", 1, 255, default=1)
    low_hz: float = quantity("Low-pass of `lock-in` and `conventional`.", "Hz", 1, 1000, default=51.5)
    third_ratio: float = quantity("i_q of subspace 3 over i_q, five phases only.", "", -0.5, 0.5, default=0.0)
    speed_filter_hz: float | None = quantity(
        "Low-pass before the speed regulator.",
        "Hz",
        0.1,
        1000,
        default=None,
        absent="by the rule of the [theory page](../theory/five-phase.md#loops-by-rule)",
    )
    compensation: Literal["off", "on", "following"] = Field(
        default="following",
        description="Curve of cross-saturation of the motor file, which turns published angle and references; "
        "`following`: the frame moves the other way when it changes.",
    )
    search: bool = Field(
        default=True,
        description="A start looks for the rotor and the polarity of its magnet; `false`: the first start takes the "
        "rotor to stand at 0, later ones look for it.",
    )
    search_current_a: float | None = quantity(
        "Current on the d axis that tells the poles apart.",
        "A",
        0.01,
        2000,
        default=None,
        absent="`saturation.current_a` of the motor file, else its rated current; less for a light rotor, and where "
        "voltage or trips ask for it",
    )
    search_rise_a_per_s: float | None = quantity(
        "Its slope.", "A/s", 1, 1e7, default=None, absent="2 ms to the current"
    )

    @model_validator(mode="after")
    def _period(self) -> Self:
        if self.period % 2:
            raise conflict("period", f"{self.period} must be even")
        if self.method == "separator" and self.period != 4:
            raise conflict("period", f'{self.period} must be 4 with method = "separator"')
        return self
