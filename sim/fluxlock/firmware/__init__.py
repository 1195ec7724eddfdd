# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Firmware: parameter schema and block, gains from the motor file, image and host library."""

from fluxlock.firmware.block import ParameterBlock, ParameterError, gain, write_image
from fluxlock.firmware.compiler import compile_parameters
from fluxlock.firmware.schema import load_schema
from fluxlock.firmware.toolchain import (
    BusLibrary,
    FirmwareError,
    build_bus_library,
    build_canopen_library,
    build_commission,
    build_firmware,
    build_host_library,
    build_program,
    build_program_library,
)

__all__ = [
    "BusLibrary",
    "FirmwareError",
    "ParameterBlock",
    "ParameterError",
    "build_bus_library",
    "build_canopen_library",
    "build_commission",
    "build_firmware",
    "build_host_library",
    "build_program",
    "build_program_library",
    "compile_parameters",
    "gain",
    "load_schema",
    "write_image",
]
