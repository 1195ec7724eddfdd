# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Settings of vector control in a scenario file."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from fluxlock.config.fields import Model, conflict, quantity
from fluxlock.config.injection import Injection

Regulator = Literal["A", "B", "C"]
InversePark = Literal["held", "exact"]


class Vector(Model):
    """Settings of `method = "vector"`. Regulators of a salient machine know the mean inductance, the observer L_q."""

    update: Literal["single", "double"] = Field(
        default="double",
        description="New voltages once a carrier, or at its start and its middle. T_s is the time between two updates.",
    )
    delay: float | None = quantity(
        "T_d over T_s: from the mean instant of the current samples to the update at which their voltage acts. The "
        "shortest leaves room for the conversion and 83 clocks, 600 with the regulator on the core. A single sample "
        "is free of the carrier's ripple at 1, with `single` update at 0.5 too; elsewhere ripple counts as current.",
        "",
        0.0,
        1.0,
        default=None,
        absent="the shortest that fits, of a single sample free of ripple",
    )
    believed_delay: float | None = quantity(
        "T_d over T_s that regulators, observer and inverse Park are told, in place of the one that sampling has: what "
        "an unknown delay costs.",
        "",
        0.0,
        1.0,
        default=None,
        absent="the right one",
    )
    window: Literal["sample", "carrier"] = Field(
        default="sample",
        description="Current of one `sample`, or the mean of the samples in a T_s (`carrier`), of up to 255.",
    )
    regulator: Regulator = Field(
        default="C",
        description="Current regulator: A complex vector PI, B without and C with the delay in its model.",
    )
    current_regulator: Literal["rtl", "c"] = Field(
        default="rtl",
        description="Where the current regulator runs: in hardware, or on the core (`c`), with the same voltages bit "
        "for bit 10 us later. It takes the core's time at every sample: up to 20 000 a second.",
    )
    park: InversePark = Field(
        default="exact",
        description="Angle of the inverse Park transform: that of the sample, or that in the middle of the time in "
        "which the voltage acts.",
    )
    bandwidth_hz: float = quantity("Bandwidth of regulator A.", "Hz", 1, 20e3, default=800.0)
    gamma: float = quantity("Gain of the regulators B and C.", "", 0.01, 1.0, default=0.35)
    observer_pole: float = quantity(
        "Both poles of the EMF observer, a control tick; nearer to 1 with noise.", "", 0.0, 0.98, default=0.7
    )
    observer_every: int | None = quantity(
        "Samples a control tick (observer, angle, speed).",
        "",
        1,
        255,
        default=None,
        absent="tick at most 20 kHz, with injection 10.5 kHz",
    )
    pll_hz: float | None = quantity(
        "Bandwidth of the phase-locked loop.",
        "Hz",
        1,
        5e3,
        default=None,
        absent="by the rule of the [theory page](../theory/vector.md#bandwidths); with injection by "
        "[another one](../theory/five-phase.md#loops-by-rule)",
    )
    pll_order: int = quantity("Its order: 3 follows an acceleration without lag.", "", 2, 3, default=3)
    start_current_a: float | None = quantity(
        "Amplitude of the current that aligns the rotor and pulls it along until the hand-over.",
        "A",
        0.01,
        2000,
        default=None,
        absent="0.35 `rated_current_a`, at most 0.6 of the limit",
    )
    start_accel_rpm_per_s: float | None = quantity(
        "Acceleration until the hand-over.",
        "r/min/s",
        1,
        1e8,
        default=None,
        absent="0.3 of what the start current reaches without load",
    )
    handover_rpm: float | None = quantity(
        "Speed at which the observed angle takes over; below 0.6 of it the forced frame does, or the injection.",
        "r/min",
        1,
        2e6,
        default=None,
        absent="a tenth of `max_speed_rpm`, more if the EMF is small; with injection: never",
    )
    speed_hz: float | None = quantity(
        "Bandwidth of the speed loop.",
        "Hz",
        0.1,
        2000,
        default=None,
        absent="by the rule of the [theory page](../theory/vector.md#bandwidths); with injection by "
        "[another one](../theory/five-phase.md#loops-by-rule)",
    )
    weakening: bool = Field(default=False, description="Field weakening: negative i_d where the voltage is short.")
    dead_time_compensation: bool = Field(
        default=True, description="Voltage that the dead time takes is added by the sign of the measured current."
    )

    angle: Literal["observer", "encoder"] = Field(
        default="observer",
        description="What the frame follows: the observed EMF, or the motor file's encoder, at every speed from the "
        "alignment on.",
    )
    mounting: Literal["given", "learnt"] = Field(
        default="given",
        description="Mounting of the encoder: from the motor file if there is an index, or learnt at every alignment.",
    )

    injection: Injection | None = Field(
        default=None, description="Square-wave injection: angle and speed from standstill on."
    )

    @model_validator(mode="after")
    def _injection(self) -> Self:
        if self.injection is None:
            return self
        given = self.model_fields_set
        for key in ("start_current_a", "start_accel_rpm_per_s", "weakening", "mounting"):
            if key in given:
                raise conflict(key, "does not go with [drive.vector.injection]; leave it out")
        for key, value in (
            ("window", "sample"),
            ("angle", "observer"),
            ("park", "exact"),
            ("current_regulator", "rtl"),
        ):
            if getattr(self, key) != value:
                raise conflict(key, f'must be "{value}" with [drive.vector.injection]')
        return self

    @model_validator(mode="after")
    def _regulator(self) -> Self:
        unused = "gamma" if self.regulator == "A" else "bandwidth_hz"
        if unused in self.model_fields_set:
            raise conflict(unused, f'does not belong to regulator = "{self.regulator}"')
        return self
