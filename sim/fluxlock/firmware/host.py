# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The firmware as a shared library in this process: register file, UART and control ticks driven from Python.

One instance a process. Whoever plays the chip writes the snapshot registers, calls `tick()` and reads the settings.
"""

from __future__ import annotations

import ctypes
import re
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fluxlock.firmware.block import ParameterBlock
from fluxlock.firmware.toolchain import build_host_library
from fluxlock.memory import BLOCK_MAX_BYTES, TELEMETRY_MAX_BYTES
from fluxlock.paths import GENERATED

REGISTER_WORDS = 0x4000
STATES = ("init", "ready", "starting", "running", "stopping", "fault")
HANDLERS = ("control", "control_entry", "trip", "uart", "load", "design", "idle")
_TELEMETRY_WORDS = (
    *(
        "magic",
        "length_bytes",
        "published_q32",
        "tick",
        "state",
        "phase",
        "fault",
        "limit",
        "speed_rpm_q8",
        "reference_rpm_q8",
    ),
    *("target_rpm", "u_v_q25", "duty_q30", "period_cycles", "vdc_v_q25", "idc_q17", "motor_q17", "crossings"),
    *("commutations", "lost_locks", "fault_count", "freewheel_sum_cycles", "freewheel_max", "freewheel_count"),
)
TELEMETRY_TARGET = _TELEMETRY_WORDS.index("target_rpm")


def parse_telemetry(data: bytes) -> dict[str, int]:
    """Words of the telemetry structure (RAM from TELEMETRY_ADDRESS), signed, by name."""
    values = struct.unpack_from(f"<{len(_TELEMETRY_WORDS)}i", data)
    return dict(zip(_TELEMETRY_WORDS, values, strict=True))


def register_offsets(header: Path) -> dict[str, int]:
    """Byte offsets of all registers, `block.register`, from the generated C header; arrays by their first element."""
    text = header.read_text()
    bodies: dict[str, list[tuple[str, str, int]]] = {}
    for match in re.finditer(r"typedef struct[^{]*\{([^}]*)\}\s*(\w+);", text):
        fields = re.findall(r"(\w+)\s+(\w+)(?:\[(\w+)\])?;", match.group(1))
        bodies[match.group(2)] = [(kind, name, int(count, 0) if count else 1) for kind, name, count in fields]
    sizes = {"uint32_t": 4, "uint8_t": 1}
    for name, fields in bodies.items():
        sizes[name] = sum(sizes[kind] * count for kind, _, count in fields)
    result: dict[str, int] = {}
    position = 0
    for kind, block, count in bodies["fluxlock_regs_t"]:
        if kind in bodies:
            inner = position
            for field_kind, register, field_count in bodies[kind]:
                result[f"{block}.{register}"] = inner
                inner += sizes[field_kind] * field_count
        position += sizes[kind] * count
    return result


class HostFirmware:
    """Loads the library and resets it; then `boot`, `tick` and `poll` as the chip's events would.

    library: one that holds more than the firmware.
    """

    def __init__(self, library: Path | None = None) -> None:
        self.lib = ctypes.CDLL(str(library or build_host_library()))
        for name, kind in (
            ("fl_host_registers", ctypes.POINTER(ctypes.c_uint32)),
            ("fl_host_auto_zero_offsets", ctypes.POINTER(ctypes.c_int32)),
            ("fl_host_parameter_block", ctypes.POINTER(ctypes.c_uint8)),
            ("fl_host_telemetry", ctypes.POINTER(ctypes.c_uint8)),
            ("fl_host_uart_receive", ctypes.c_uint32),
            ("fl_host_uart_send", ctypes.c_uint32),
        ):
            getattr(self.lib, name).restype = kind
        self.lib.fl_host_reset()
        self.offsets = register_offsets(GENERATED / "fluxlock_regs.h")
        self.registers: NDArray[np.uint32] = np.ctypeslib.as_array(self.lib.fl_host_registers(), (REGISTER_WORDS,))
        self.auto_zero_offsets: NDArray[np.int32] = np.ctypeslib.as_array(self.lib.fl_host_auto_zero_offsets(), (13,))
        self._block = np.ctypeslib.as_array(self.lib.fl_host_parameter_block(), (BLOCK_MAX_BYTES,))
        self._telemetry = np.ctypeslib.as_array(self.lib.fl_host_telemetry(), (TELEMETRY_MAX_BYTES,))

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

    def telemetry(self) -> dict[str, int]:
        """The telemetry structure."""
        return parse_telemetry(self._telemetry.tobytes())

    @property
    def state(self) -> str:
        """Name of the drive's state."""
        return STATES[self.telemetry()["state"]]

    def command(self, line: str) -> list[str]:
        """Send a console line and return the lines of the reply."""
        data = (line + "\n").encode()
        self.lib.fl_host_uart_send(data, len(data))
        self.poll()
        return self.replies()

    def replies(self) -> list[str]:
        """Lines that the console has sent since they were last taken."""
        buffer = ctypes.create_string_buffer(65536)
        length = self.lib.fl_host_uart_receive(buffer, len(buffer))
        return buffer.raw[:length].decode().splitlines()
