# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware as a shared library in this process: register file, UART and control ticks driven from Python.

One instance a process. Whoever plays the chip writes the snapshot registers, calls `tick()` and reads the settings.
Where a process has several threads they take turns: `one_at_a_time`.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluxlock.firmware.binding import names, new, open_library, types, view
from fluxlock.firmware.block import ParameterBlock
from fluxlock.generate.memory import BLOCK_MAX_BYTES
from fluxlock.headers import CData

REGISTER_WORDS = 0x4000
OFFSETS = 13  # channels of the auto-zero
RECEIVED_BYTES = 65536
_TURN = threading.Lock()
_HELD: ContextVar[bool] = ContextVar("held", default=False)  # by this thread


@contextmanager
def one_at_a_time() -> Iterator[None]:
    """Within, or in a function that it decorates, no other thread of this process has the library: it has one state.

    Around everything from the making of a `HostFirmware` to its last use.
    """
    if _HELD.get():
        raise RuntimeError("a twin runs already in this thread, and a process has one: run them one after the other")
    with _TURN:
        before = _HELD.set(True)
        try:
            yield
        finally:
            _HELD.reset(before)


def register_offsets() -> dict[str, int]:
    """Byte offsets of all registers, `block.register`, as in the generated C header; arrays by their first element."""
    blocks = {name: place for name, place in types().typeof("fluxlock_regs_t").fields if place.type.kind == "struct"}
    return {
        f"{block}.{register}": place.offset + inner.offset
        for block, place in blocks.items()
        for register, inner in place.type.fields
    }


class HostFirmware:
    """Loads the library and resets it; then `boot`, `tick` and `poll` as the chip's events would.

    library: one that holds more than the firmware. Another thread than the first has waited for its turn.
    """

    def __init__(self, library: Path | None = None) -> None:
        if not _HELD.get() and threading.current_thread() is not threading.main_thread():
            raise RuntimeError("a thread beside others uses the library within `one_at_a_time`")
        self.lib: CData = open_library(library)
        self.lib.fl_host_reset()
        self.offsets = register_offsets()
        self.registers: NDArray[np.uint32] = view(self.lib.fl_host_registers(), REGISTER_WORDS, np.uint32)
        self.auto_zero_offsets: NDArray[np.int32] = view(self.lib.fl_host_auto_zero_offsets(), OFFSETS, np.int32)
        self._block = view(self.lib.fl_host_parameter_block(), BLOCK_MAX_BYTES, np.uint8)
        self._telemetry = types().cast("telemetry_t *", self.lib.fl_host_telemetry())
        self._states, self._phases = names("drive_state_t"), names("phase_t")
        self._received = new(f"uint8_t[{RECEIVED_BYTES}]")

    def index(self, register: str, element: int = 0) -> int:
        """Index of a register in `registers`."""
        return self.offsets[register] // 4 + element

    def load(self, block: ParameterBlock | bytes) -> None:
        """Put a parameter block where the firmware looks for it."""
        data = block.pack() if isinstance(block, ParameterBlock) else block
        self._block[:] = 0
        self._block[: len(data)] = np.frombuffer(data, dtype=np.uint8)

    def boot(self) -> None:
        """Run the boot sequence."""
        self.lib.fl_host_boot()

    def tick(self) -> None:
        """One control interrupt."""
        self.lib.fl_host_tick()

    def poll(self) -> None:
        """Deferred interrupts and one round of the main loop."""
        self.lib.fl_host_poll()

    def telemetry(self) -> CData:
        """A copy of the telemetry, `telemetry_t`."""
        copy = new("telemetry_t")
        copy[0] = self._telemetry[0]
        return copy

    @property
    def state(self) -> str:
        """Name of the drive's state."""
        return self._states[int(self._telemetry.state)]

    @property
    def phase(self) -> str:
        """Name of the phase of the start."""
        return self._phases[int(self._telemetry.phase)]

    def command(self, line: str) -> list[str]:
        """Send a console line and return the lines of the reply."""
        data = (line + "\n").encode()
        self.lib.fl_host_uart_send(data, len(data))
        self.poll()
        return self.replies()

    def replies(self) -> list[str]:
        """Lines that the console has sent since they were last taken."""
        length = self.lib.fl_host_uart_receive(self._received, RECEIVED_BYTES)
        return bytes(types().buffer(self._received, length)).decode().splitlines()
