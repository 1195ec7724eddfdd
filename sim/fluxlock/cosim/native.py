# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""ctypes binding of the C interface in `sim/native/cosim.h`, for use inside the simulator's process."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming
from fluxlock.cosim.plan import CanPlace


class Status(ctypes.Structure):
    """Counters of the simulator main; fields as in `cosim_status_t`."""

    _fields_ = [(name, ctypes.c_int64) for name in
                ("cycle", "log_count", "log_lost", "events", "edges", "strobes", "t_fault")] + [
                ("fault", ctypes.c_int32), ("uart_lost", ctypes.c_int32)]  # fmt: skip

    cycle: int
    log_count: int
    log_lost: int
    events: int
    edges: int
    strobes: int
    t_fault: int
    fault: int
    uart_lost: int


class CanState(ctypes.Structure):
    """A node on the CAN bus; fields as in `can_state_t`."""

    _fields_ = [(name, ctypes.c_int64) for name in ("waiting", "sent", "errors", "tec", "rec", "bus_off")]

    waiting: int
    sent: int
    errors: int
    tec: int
    rec: int
    bus_off: int


class CanNode:
    """A node beside the chip on its CAN bus: frames in and out, everything else is native."""

    def __init__(self, library: ctypes.CDLL, number: int) -> None:
        self._lib, self._number = library, number
        self._head, self._data = (ctypes.c_uint32 * 4)(), (ctypes.c_uint8 * 8)()

    def send(self, frame: Frame) -> None:
        """Queue a frame; it is sent until it has been acknowledged, in the order of the queue."""
        head = (ctypes.c_uint32 * 4)(frame.id, frame.ext, frame.rtr, frame.dlc)
        self._lib.cosim_can_send(self._number, head, frame.data.ljust(8, b"\0"))

    def take(self) -> Frame | None:
        """The oldest frame received from others, None if there is none."""
        if not self._lib.cosim_can_take(self._number, self._head, self._data):
            return None
        identifier, ext, rtr, dlc = self._head
        count = 0 if rtr else min(dlc, 8)
        return Frame(identifier, bool(ext), bool(rtr), dlc, bytes(self._data)[:count])

    def disturb(self, start: int, end: int, level: int) -> None:
        """The bus has this level, 0 dominant, from one cycle up to another, both to come."""
        self._lib.cosim_can_force(ctypes.c_int64(start), ctypes.c_int64(end), level)

    @property
    def waiting(self) -> int:
        """Frames in the queue that have not been sent."""
        return self.state.waiting

    @property
    def state(self) -> CanState:
        """Queue and counters as they are now."""
        state = CanState()
        self._lib.cosim_can_state(self._number, ctypes.byref(state))
        return state


class Native:
    """The simulator main as seen from Python: plant hook, event log, console line.

    log_capacity: rows that fit between two calls of `take_log`.
    """

    def __init__(self, log_capacity: int = 1 << 18) -> None:
        self._lib = ctypes.CDLL(None)
        self._lib.cosim_status.restype = ctypes.POINTER(Status)
        self._lib.cosim_attach.argtypes = [ctypes.c_void_p] * 3
        self._lib.cosim_log.argtypes = [ctypes.c_void_p, ctypes.c_int64]
        self._lib.cosim_configure.argtypes = [ctypes.c_int64, ctypes.c_int64, ctypes.c_int32, ctypes.c_int32]
        self._lib.cosim_console_send.argtypes = [ctypes.c_char_p, ctypes.c_int64]
        self._lib.cosim_console_take.argtypes = [ctypes.c_char_p, ctypes.c_int64]
        self._lib.cosim_console_take.restype = ctypes.c_int64
        self._lib.cosim_peek.argtypes = [ctypes.c_uint32, ctypes.c_void_p, ctypes.c_int32]
        self._lib.cosim_peek.restype = ctypes.c_int32
        self._lib.cosim_record.argtypes = [ctypes.c_int32]
        self._lib.cosim_record_save.argtypes = [ctypes.c_char_p]
        self._lib.cosim_record_save.restype = ctypes.c_int32
        self._log: NDArray[np.int64] = np.zeros((log_capacity, 4), np.int64)
        self._buffer = ctypes.create_string_buffer(1 << 16)
        self._lib.cosim_log(self._log.ctypes.data, log_capacity)

    @property
    def status(self) -> Status:
        """Live counters (a view, not a copy)."""
        return self._lib.cosim_status().contents  # type: ignore[no-any-return]

    def attach(self, address: int, state: NDArray[np.float64], io: NDArray[np.int32]) -> None:
        """Call the plant kernel at `address` at every gate edge and sample strobe. The arrays must stay alive."""
        self._keep = (state, io)
        self._lib.cosim_attach(address, state.ctypes.data, io.ctypes.data)

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
        self._lib.cosim_log(self._log.ctypes.data, len(self._log))
        return rows

    def send(self, line: str) -> None:
        """Queue a console line, sent bit by bit from the next clock on."""
        data = (line + "\n").encode("ascii")
        self._lib.cosim_console_send(data, len(data))

    def receive(self) -> str:
        """What the chip has sent on its console since the last call."""
        count = self._lib.cosim_console_take(self._buffer, len(self._buffer))
        return self._buffer.raw[:count].decode("ascii", errors="replace")

    def peek(self, address: int, count: int) -> NDArray[np.uint32]:
        """Words of the soft core's memory as they are now; its data cache writes through."""
        words: NDArray[np.uint32] = np.zeros(count, np.uint32)
        if self._lib.cosim_peek(address, words.ctypes.data, count):
            raise ValueError(f"peek of {count} words at {address:#x} is outside of the memory")
        return words

    def upset_names(self) -> list[tuple[str, int]]:
        """Name and bits of every register that can be flipped, by its number."""
        name = self._lib.cosim_upset_name
        name.restype = ctypes.c_char_p
        return [(name(n).decode(), self._lib.cosim_upset_bits(n)) for n in range(self._lib.cosim_upset_count())]

    def upset(self, number: int, bit: int) -> None:
        """Flip a bit of a register of the chip."""
        if self._lib.cosim_upset(number, bit):
            raise ValueError(f"there is no bit {bit} of register {number}")

    def upset_memory(self, address: int, bit: int) -> None:
        """Flip a bit of a word of the soft core's memory."""
        if self._lib.cosim_upset_memory(ctypes.c_uint32(address), bit):
            raise ValueError(f"there is no bit {bit} at {address:#x}")

    def force_pin(self, pin: str, cycles: int, level: int | None = None) -> None:
        """A single input of the chip has a level, None: the opposite of the one that is driven, for so many clocks."""
        name = self._lib.cosim_pin_name
        name.restype = ctypes.c_char_p
        names = [name(n).decode() for n in range(self._lib.cosim_pin_count())]
        if pin not in names:
            raise ValueError(f"the chip has no pin {pin!r}; pins: {', '.join(names)}")
        code = -1 if level is None else level
        if self._lib.cosim_force_pin(names.index(pin), code, ctypes.c_int64(cycles)):
            raise ValueError(f"level {level}, {cycles} clocks: a level is 0 or 1, and lasts a clock or more")

    def open_can(self, timing: BitTiming, place: CanPlace) -> CanNode:
        """Put a node on the CAN bus of the chip's pins; its first bit begins now. `brp` is in clocks of the chip."""
        far = (ctypes.c_double(place.clock_error), ctypes.c_double(place.delay_cycles))
        number = self._lib.cosim_can_open(timing.brp, timing.prop, timing.ps1, timing.ps2, timing.sjw, *far)
        return CanNode(self._lib, number)

    def log_can(self, on: bool) -> None:
        """Log the CAN pins at every change from now on, or no longer."""
        self._lib.cosim_can_log(int(on))

    def record(self, on: bool) -> None:
        """Start or stop recording converter codes, console bytes and pins for a replay."""
        self._lib.cosim_record(int(on))

    def save_recording(self, path: Path) -> None:
        """Write the recording for `--replay`."""
        if self._lib.cosim_record_save(str(path).encode()):
            raise OSError(f"cannot write the recording {path}")
