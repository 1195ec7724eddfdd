# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The simulator's main as seen from Python: `sim/native/cosim.h`, for use inside the simulator's process."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluxlock.base.paths import ROOT
from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming
from fluxlock.cosim.plan import CanPlace
from fluxlock.headers import CData, bind

CONSOLE_BYTES = 1 << 16
HEADER = ROOT / "sim" / "native" / "cosim.h"


@cache
def types() -> CData:
    """Type table of the interface."""
    return bind([HEADER], HEADER.parent)


@cache
def simulator() -> CData:
    """Functions of the simulator whose process this is."""
    return types().dlopen(None)


def peek(address: int, count: int) -> NDArray[np.uint32]:
    """Words of the soft core's memory as they are now; its data cache writes through."""
    words: NDArray[np.uint32] = np.zeros(count, np.uint32)
    if simulator().cosim_peek(address, types().from_buffer("uint32_t[]", words), count):
        raise ValueError(f"peek of {count} words at {address:#x} is outside of the memory")
    return words


class CanNode:
    """A node beside the chip on its CAN bus: frames in and out, everything else is native."""

    def __init__(self, number: int) -> None:
        self._lib, self._number = simulator(), number
        self._head, self._data = types().new("uint32_t[4]"), types().new("uint8_t[8]")

    def send(self, frame: Frame) -> None:
        """Queue a frame; it is sent until it has been acknowledged, in the order of the queue."""
        head = [frame.id, frame.ext, frame.rtr, frame.dlc]
        self._lib.cosim_can_send(self._number, head, frame.data.ljust(8, b"\0"))

    def take(self) -> Frame | None:
        """The oldest frame received from others, None if there is none."""
        if not self._lib.cosim_can_take(self._number, self._head, self._data):
            return None
        identifier, ext, rtr, dlc = self._head
        count = 0 if rtr else min(dlc, 8)
        return Frame(identifier, bool(ext), bool(rtr), dlc, bytes(self._data[0:count]))

    def disturb(self, start: int, end: int, level: int) -> None:
        """The bus has this level, 0 dominant, from one cycle up to another, both to come."""
        self._lib.cosim_can_force(start, end, level)

    @property
    def waiting(self) -> int:
        """Frames in the queue that have not been sent."""
        return int(self.state.waiting)

    @property
    def state(self) -> CData:
        """Queue and counters as they are now, `can_state_t`."""
        state = types().new("can_state_t *")
        self._lib.cosim_can_state(self._number, state)
        return state


class Core:
    """The soft core at its stops, for a debugger: the chip must show its core (`core_probe.h`)."""

    def __init__(self) -> None:
        self._lib, self._types = simulator(), types()
        self.stop = self._lib.cosim_core_stop()

    def debug(self, on_stop: Callable[[], None]) -> None:
        """Call a function at every stop, first in front of the next instruction. Nothing goes on until it returns."""
        self._callback = self._types.callback("core_stop_fn", on_stop)
        self._lib.cosim_core_debug(self._callback)

    def leave(self) -> None:
        """No more stops."""
        self._lib.cosim_core_debug(self._types.NULL)

    def set_break(self, address: int, on: bool) -> None:
        """Stop in front of the instruction there, or no longer."""
        self._lib.cosim_core_break(address, int(on))

    def set_watch(self, address: int, size: int, kinds: int, on: bool) -> None:
        """Stop behind an access of these kinds (1 reads, 2 writes), or no longer."""
        self._lib.cosim_core_watch(self._types.new("core_watch_t *", (address, size, kinds)), int(on))

    def resume(self, steps: int = 0) -> None:
        """At a stop: how many instructions later the next one is asked for, 0: none is."""
        self._lib.cosim_core_resume(steps)

    def request(self) -> None:
        """Stop in front of the next instruction."""
        self._lib.cosim_core_request()

    def read(self, address: int, count: int) -> bytes | None:
        """Memory as the program sees it; None: there is none."""
        found = bytearray(count)
        if self._lib.cosim_core_read(address, self._types.from_buffer("uint8_t[]", found), count):
            return None
        return bytes(found)


class Native:
    """Plant hook, event log, console line. status: live counters, `cosim_status_t`.

    log_capacity: rows that fit between two calls of `take_log`.
    """

    def __init__(self, log_capacity: int = 1 << 18) -> None:
        self._lib, self._types = simulator(), types()
        self.status = self._lib.cosim_status()
        self._log: NDArray[np.int64] = np.zeros((log_capacity, 4), np.int64)
        self._rows = self._types.from_buffer("int64_t[]", self._log)
        self._buffer = self._types.new(f"char[{CONSOLE_BYTES}]")
        self._lib.cosim_log(self._rows, log_capacity)

    def attach(self, address: int, state: NDArray[np.float64], io: NDArray[np.int32]) -> None:
        """Call the plant kernel at `address` at every gate edge and sample strobe. The arrays must stay alive."""
        kernel, buffer = self._types.cast("plant_fn", address), self._types.from_buffer
        self._keep = (buffer("double[]", state), buffer("int32_t[]", io))
        self._lib.cosim_attach(kernel, *self._keep)

    def configure(
        self, conversion_cycles: int, bit_cycles: int, log_strobes: bool = False, gate_polarity: int = 0
    ) -> None:
        """Set converter time (strobe to valid), console bit time, whether strobes are logged, and the inverter's gates.

        Unit: clocks. gate_polarity: bit 0, 1: upper, lower gates are on at low level.
        """
        self._lib.cosim_configure(conversion_cycles, bit_cycles, int(log_strobes), gate_polarity)

    def take_log(self) -> NDArray[np.int64]:
        """Rows [cycle, kind, a, b] since the last call; raises BufferError if rows were lost."""
        status = self.status
        if status.log_lost:
            raise BufferError(f"event log overflow: {status.log_lost} rows lost before cycle {status.cycle}")
        rows = self._log[: status.log_count].copy()
        self._lib.cosim_log(self._rows, len(self._log))
        return rows

    def rows(self, first: int) -> NDArray[np.int64]:
        """Rows of the log from a place on, which stay in it."""
        return self._log[first : self.status.log_count]

    def send(self, line: str) -> None:
        """Queue a console line, sent bit by bit from the next clock on."""
        data = (line + "\n").encode("ascii")
        self._lib.cosim_console_send(data, len(data))

    def receive(self) -> str:
        """What the chip has sent on its console since the last call."""
        count = self._lib.cosim_console_take(self._buffer, CONSOLE_BYTES)
        return bytes(self._types.buffer(self._buffer, count)).decode("ascii", errors="replace")

    def upset_names(self) -> list[tuple[str, int]]:
        """Name and bits of every register that can be flipped, by its number."""
        lib = self._lib
        return [(self._text(lib.cosim_upset_name(n)), lib.cosim_upset_bits(n)) for n in range(lib.cosim_upset_count())]

    def _text(self, characters: CData) -> str:
        return bytes(self._types.string(characters)).decode()

    def upset(self, number: int, bit: int) -> None:
        """Flip a bit of a register of the chip."""
        if self._lib.cosim_upset(number, bit):
            raise ValueError(f"there is no bit {bit} of register {number}")

    def register_value(self, number: int) -> int:
        """Lowest 64 bits of a register of the chip, by its number in `upset_names`."""
        return int(self._lib.cosim_upset_value(number))

    def upset_memory(self, address: int, bit: int) -> None:
        """Flip a bit of a word of the soft core's memory."""
        if self._lib.cosim_upset_memory(address, bit):
            raise ValueError(f"there is no bit {bit} at {address:#x}")

    def force_pin(self, pin: str, cycles: int, level: int | None = None) -> None:
        """A single input of the chip has a level, None: the opposite of the one that is driven, for so many clocks."""
        names = [self._text(self._lib.cosim_pin_name(n)) for n in range(self._lib.cosim_pin_count())]
        if pin not in names:
            raise ValueError(f"the chip has no pin {pin!r}; pins: {', '.join(names)}")
        code = -1 if level is None else level
        if self._lib.cosim_force_pin(names.index(pin), code, cycles):
            raise ValueError(f"level {level}, {cycles} clocks: a level is 0 or 1, and lasts a clock or more")

    def open_can(self, timing: BitTiming, place: CanPlace) -> CanNode:
        """Put a node on the CAN bus of the chip's pins; its first bit begins now. `brp` is in clocks of the chip."""
        segments = (timing.brp, timing.prop, timing.ps1, timing.ps2, timing.sjw)
        return CanNode(self._lib.cosim_can_open(*segments, place.clock_error, place.delay_cycles))

    def log_can(self, on: bool) -> None:
        """Log the CAN pins at every change from now on, or no longer."""
        self._lib.cosim_can_log(int(on))

    def trace_core(self, path: Path, start: int, end: int) -> None:
        """Write the instructions that leave the core in these clocks into a file; the chip must show its core."""
        if self._lib.cosim_core_trace(str(path).encode(), start, end):
            raise OSError(f"cannot write the trace {path}")

    def end_trace(self) -> tuple[int, int]:
        """Complete the file; lowest stack pointer meanwhile, and its clock."""
        deepest = self._types.new("core_stack_t *")
        if self._lib.cosim_core_trace_end(deepest):
            raise OSError("cannot write the trace of the core to its end: is the disk full?")
        return int(deepest.sp), int(deepest.cycle)

    def record(self, on: bool) -> None:
        """Start or stop recording converter codes, console bytes and pins for a replay."""
        self._lib.cosim_record(int(on))

    def save_recording(self, path: Path) -> None:
        """Write the recording for `--replay`."""
        if self._lib.cosim_record_save(str(path).encode()):
            raise OSError(f"cannot write the recording {path}")
