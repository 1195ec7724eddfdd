# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The plant: inverter, machine, load and sensing, event-driven and exact between events.

Written once; runs compiled (numba, called natively by the simulator) or as plain Python, with the same bits.
"""

from .edge_params import EdgeParams
from .params import (
    CHANNEL_NAMES,
    EncoderParams,
    HallParams,
    InverterParams,
    MachineParams,
    MechanicsParams,
    PlantParams,
    RecordingParams,
    SaturationParams,
    SensingParams,
    ThirdParams,
    channel_names,
)
from .plant import Drained, Plant, PlantError
from .trajectory import EVENT_DTYPE, WAVE_DTYPE, angle_between

__all__ = [
    "CHANNEL_NAMES",
    "EVENT_DTYPE",
    "WAVE_DTYPE",
    "Drained",
    "EdgeParams",
    "EncoderParams",
    "HallParams",
    "InverterParams",
    "MachineParams",
    "MechanicsParams",
    "Plant",
    "PlantError",
    "PlantParams",
    "RecordingParams",
    "SaturationParams",
    "SensingParams",
    "ThirdParams",
    "angle_between",
    "channel_names",
]
