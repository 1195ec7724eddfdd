# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware as code of this machine on the chip's bus, in place of the chip's core: how it is asked for."""

from __future__ import annotations

import shlex
import shutil
from dataclasses import dataclass

from fluxlock.config import ConfigError, Problem


@dataclass(frozen=True)
class NativeFirmware:
    """It runs in the simulator's process.

    sanitize: with the sanitizers of addresses and undefined behaviour. debugger: command that starts the simulator.
    """

    sanitize: bool = False
    debugger: tuple[str, ...] = ()


def native_firmware(native: bool, sanitize: bool, debugger: str) -> NativeFirmware | None:
    """What the options of these names say; None: the chip has its core. ConfigError names an option that is wrong."""
    for option, given in (("--sanitize", sanitize), ("--debugger", debugger)):
        if given and not native:
            raise ConfigError([Problem(option, "", "needs --native: the core's image is no program of this machine")])
    try:
        words = tuple(shlex.split(debugger))
    except ValueError as error:
        raise ConfigError([Problem("--debugger", debugger, str(error))]) from None
    if words and shutil.which(words[0]) is None:
        raise ConfigError([Problem("--debugger", words[0], "there is no such program on PATH")])
    return NativeFirmware(sanitize, words) if native else None
