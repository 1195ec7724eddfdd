# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The parameter block: values by name, packed with magic, version, length and CRC as the firmware checks them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fluxlock.firmware.schema import HEADER_WORDS, MAGIC, SHIFT_MAX, SHIFT_MIN, Parameter, Schema, load_schema
from fluxlock.generate.memory import (
    BLOCK_ADDRESS,
    BLOCK_MAX_BYTES,
    CAN_SETUP_ADDRESS,
    RAM_WORDS,
    TABLE_ADDRESS,
    TABLE_END,
)

Value = int | tuple[int, ...]


class ParameterError(ValueError):
    """A value does not fit its parameter. parameter: its name, empty where the block as a whole is meant."""

    def __init__(self, message: str, parameter: str = "") -> None:
        self.parameter = parameter
        super().__init__(f"parameter {parameter}: {message}" if parameter else message)


def gain(value: float, name: str = "") -> tuple[int, int]:
    """Mantissa and shift of a real factor: 30 significant bits, shift 4..62. name: of its parameter, for the error.

    >>> gain(0.5)
    (1073741824, 31)
    """
    if value == 0.0:
        return 0, SHIFT_MIN
    shift = 0
    magnitude = abs(value)
    while magnitude < 2**30 and shift < SHIFT_MAX:
        magnitude *= 2.0
        shift += 1
    mantissa = round(magnitude)
    if mantissa > 0x7FFFFFFF:
        mantissa = round(magnitude / 2.0)
        shift -= 1
    if shift < SHIFT_MIN:
        raise ParameterError(f"gain {value:.4g} is too large, largest {2.0 ** (31 - SHIFT_MIN):.4g}", name)
    return (mantissa if value > 0 else -mantissa), shift


def shared_gains(name: str, *values: float) -> tuple[tuple[int, ...], int]:
    """Mantissas of several positive factors with one shift, the largest normalised. name: see `gain`."""
    top, shift = gain(max(values), name)
    del top
    return tuple(max(1, round(v * 2.0**shift)) for v in values), shift


@dataclass
class ParameterBlock:
    """All values of a block. Missing or out-of-range values are refused when it is packed."""

    values: dict[str, Value] = field(default_factory=dict)
    schema: Schema = field(default_factory=load_schema)

    def __getitem__(self, name: str) -> Value:
        return self.values[name]

    def number(self, name: str) -> int:
        """Value of a parameter that is a single word."""
        value = self.values[name]
        if not isinstance(value, int):
            raise ParameterError(f"parameter {name} is not a single number")
        return value

    def gain(self, name: str) -> float:
        """Value of a gain as a real number."""
        value = self.values[name]
        if isinstance(value, int) or self.schema[name].kind != "gain":
            raise ParameterError(f"parameter {name} is not a gain")
        return float(value[0]) * 2.0 ** -value[1]

    def update(self, values: Mapping[str, Value]) -> None:
        """Replace values; unknown names are refused."""
        for name, value in values.items():
            self.schema[name]
            self.values[name] = value

    def _unused(self, p: Parameter) -> Value | None:
        """Value of a parameter that the six-step method, or a vector drive without injection, does not need."""
        group = p.name.partition("_")[0]
        owner = {"vector": "method", "encoder": "method", "injection": "injection"}.get(group)
        if owner is None or self.values.get(owner, 0) != 0:
            return None
        return (0, p.min) if p.kind == "gain" else (max(p.min, min(0, p.max)),) * p.count

    def words(self) -> list[int]:
        """Payload as signed 32-bit words, every value checked against the schema; unknown names are refused."""
        result: list[int] = []
        for name in self.values.keys() - self.schema.offsets.keys():
            raise ParameterError("is no parameter", name)
        for p in self.schema.parameters:
            value = self.values.get(p.name, self._unused(p))
            if value is None:
                raise ParameterError(f"parameter {p.name} has no value")
            words = (value,) if isinstance(value, int) else tuple(value)
            if len(words) != p.words:
                raise ParameterError(f"{len(words)} words, {p.words} wanted", p.name)
            checked = words[1::2] if p.kind == "gain" else words
            for word in checked:
                if not p.min <= word <= p.max:
                    raise ParameterError(f"{word} is outside {p.min}..{p.max} {p.unit}", p.name)
            if any(not -(2**31) <= word < 2**31 for word in words):
                raise ParameterError(f"{words} does not fit 32 bits", p.name)
            result.extend(words)
        return result

    def pack(self) -> bytes:
        """The block as bytes, little endian; without an injection it ends before the parameters of one."""
        words = self.words()
        if self.values.get("injection", 0) == 0:
            words = words[: self.schema.offsets["injection"]]
        payload = struct.pack(f"<{len(words)}i", *words)
        header = struct.pack(f"<{HEADER_WORDS}I", MAGIC, self.schema.version_word, len(payload), zlib.crc32(payload))
        block = header + payload
        if len(block) > BLOCK_MAX_BYTES:
            raise ParameterError(f"the parameter block of {len(block)} bytes exceeds {BLOCK_MAX_BYTES}")
        return block


def write_image(
    path_hex: Path,
    image: Path,
    params: ParameterBlock | None,
    table: bytes = b"",
    can_setup: tuple[int, int] | None = None,
) -> Path:
    """Write the RAM contents for `$readmemh`: firmware plus parameter block, one 32-bit word a line.

    `image` is the flat binary of the firmware; it must end below the parameter block. params: None for a program that
    reads none. table: what a program of `sw/images/bench` reads from TABLE_ADDRESS on. can_setup: node-ID and kbit/s of
    the CANopen node.
    """
    code = image.read_bytes()
    if len(code) > (TABLE_ADDRESS if table else BLOCK_ADDRESS):
        raise ParameterError(f"{image}: {len(code)} bytes reach into the parameter block at {BLOCK_ADDRESS:#x}")
    if TABLE_ADDRESS + len(table) > TABLE_END:
        raise ParameterError(f"a table of {len(table)} bytes is longer than {TABLE_END - TABLE_ADDRESS}")
    memory = bytearray(4 * RAM_WORDS)
    memory[: len(code)] = code
    memory[TABLE_ADDRESS : TABLE_ADDRESS + len(table)] = table
    block = params.pack() if params else b""
    memory[BLOCK_ADDRESS : BLOCK_ADDRESS + len(block)] = block
    if can_setup is not None:
        struct.pack_into("<2I", memory, CAN_SETUP_ADDRESS, *can_setup)
    path_hex.parent.mkdir(parents=True, exist_ok=True)
    words = struct.unpack(f"<{RAM_WORDS}I", memory)
    path_hex.write_text("".join(f"{word:08x}\n" for word in words))
    return path_hex
