# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Vector cases (Yang 2020, chapter 7). Scenarios: scenarios/vector."""

from fluxverify.regression.vector import (
    bandwidth,
    catching,
    chip_steps,
    controllers,
    core,
    encoder,
    identify,
    methods,
    observer,
    parameter_errors,
    sequence,
    transforms,
    weakening,
)

__all__ = [
    "bandwidth",
    "catching",
    "chip_steps",
    "controllers",
    "core",
    "encoder",
    "identify",
    "methods",
    "observer",
    "parameter_errors",
    "sequence",
    "transforms",
    "weakening",
]
