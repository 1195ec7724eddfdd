# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Parameter schema, block, compiler and image."""

from __future__ import annotations

import itertools
import math
import os
import struct
import subprocess
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest

from fluxlock.base.paths import REGISTER_BLOCKS, ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Inverter, Motor, Scenario, load_scenario
from fluxlock.config.drive import TICK_HZ
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware import (
    ParameterBlock,
    ParameterError,
    build_firmware,
    compile_parameters,
    gain,
    load_schema,
    write_image,
)
from fluxlock.firmware.host import HostFirmware
from fluxlock.firmware.schema import HEADER_WORDS, SCHEMA_FILE, Schema, c_header, markdown_table
from fluxlock.firmware.toolchain import IMAGE_LIMIT_BYTES, SW
from fluxlock.generate.memory import BLOCK_ADDRESS, RAM_WORDS, STACK_BYTES, TELEMETRY_ADDRESS
from tests.firmware import machines
from tests.firmware.firmware_bench import INVERTER_1, MOTOR_1, OTHERS, small_motor


def told(motor: Motor = MOTOR_1, inverter: Inverter = INVERTER_1, **drive: object) -> Scenario:
    """A scenario with these parts."""
    return machines.scenario(motor, inverter, machines.drive(**drive))


def block(**drive: object) -> ParameterBlock:
    """A valid block."""
    return compile_parameters(told(**drive))


def boot(data: bytes) -> HostFirmware:
    """Firmware booted on these bytes, with some ticks and a start attempt behind it."""
    fw = HostFirmware()
    fw.load(data)
    fw.boot()
    for _ in range(3):
        fw.tick()
    return fw


def test_library_keeps_its_own_symbols(tmp_path: Path) -> None:
    """Boot works in a process where another library has put its own `crc32` into the global scope, as zlib does.

    Verifies: FW-03
    """
    (tmp_path / "other.cpp").write_text(
        'extern "C" unsigned crc32(unsigned, const void *, unsigned) { __builtin_trap(); }'
    )
    other = tmp_path / "libother.so"
    compiler = os.environ.get("CXX", "g++")
    subprocess.run([compiler, "-shared", "-fPIC", "-o", other, tmp_path / "other.cpp"], check=True)
    (tmp_path / "block.bin").write_bytes(block().pack())
    program = (
        "import ctypes, pathlib; from fluxlock.firmware.host import HostFirmware;"
        f"ctypes.CDLL({str(other)!r}, ctypes.RTLD_GLOBAL); fw = HostFirmware();"
        f"fw.load(pathlib.Path({str(tmp_path / 'block.bin')!r}).read_bytes()); fw.boot(); print(fw.state)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "init"), done.stderr


def repacked(words: dict[str, int], **drive: object) -> bytes:
    """A block whose words were changed after the check of the writer, with a right CRC."""
    import zlib

    b = block(**drive)
    data = bytearray(b.pack())
    for name, value in words.items():
        struct.pack_into("<i", data, 4 * (HEADER_WORDS + b.schema.offsets[name]), value)
    struct.pack_into("<I", data, 12, zlib.crc32(bytes(data[16:])))
    return bytes(data)


def patched(offset: int, value: int) -> bytes:
    """A block with one header word replaced."""
    data = bytearray(block().pack())
    struct.pack_into("<I", data, offset, value)
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (bytes(1024), "parameter_magic"),
        (patched(4, 0x00010000), "parameter_version"),
        (patched(8, 4), "parameter_version"),
        (patched(12, 0x12345678), "parameter_crc"),
        (patched(200, 77), "parameter_crc"),
        (repacked({"pole_pairs": 0}), "parameter_range"),
        (repacked({"duty_max_q30": 2**30 + 1}), "parameter_range"),
        # Limits that no code exceeds, a watchdog that is off.
        (repacked({"trip_phase_lsb": 2047}), "parameter_range"),
        (repacked({"trip_dc_lsb": 2047}), "parameter_range"),
        (repacked({"trip_over_voltage_lsb": 4095}), "parameter_range"),
        (repacked({"watchdog_cycles": 0}), "parameter_range"),
        (repacked({"clock_hz": 40_000_000}), "chip"),
    ],
)
def test_wrong_block_stays_in_init(data: bytes, fault: str) -> None:
    """Every defect has its own name; the drive stays in init, keeps the gates off and refuses to start.

    Verifies: FW-03
    """
    fw = boot(data)
    assert fw.state == "init"
    assert fw.command("status") == ["state init", f"fault {fault}", "ok"]
    assert fw.command("start") == ["error: no valid parameters"]
    assert fw.command("set speed_rpm 1000") == ["error: no valid parameters"]
    assert fw.command("clear") == ["error: no valid parameters"]
    for _ in range(50):
        fw.tick()
    assert fw.state == "init"
    assert int(fw.registers[fw.index("safety.guard")]) & 1 == 0
    assert int(fw.registers[fw.index("sense.scheduler")]) == 0


@pytest.mark.parametrize(
    ("method", "words", "absent", "fits"),
    [
        ("six-step", {}, ("hall", "encoder", "injection", "capture", "freewheel", "can"), True),
        ("six-step", {"hall_mode": 2}, ("encoder",), True),
        ("six-step", {"hall_mode": 2}, ("hall",), False),
        ("six-step", {}, ("zcd",), False),
        ("six-step", {}, ("foc",), True),
        ("vector", {}, ("hall", "encoder", "injection", "zcd", "comm"), True),
        ("vector", {}, ("foc",), False),
        ("vector", {"encoder_quarters": 4096}, ("encoder",), False),
    ],
)
def test_chip_without_a_block(method: str, words: dict[str, int], absent: tuple[str, ...], fits: bool) -> None:
    """A chip without a block that the parameters use keeps the drive in init; without any other block it boots.

    Verifies: FW-03
    """
    fw = HostFirmware()
    fw.load(repacked(words, method=method))
    there = sum(1 << i for i, name in enumerate(REGISTER_BLOCKS) if name not in absent)
    fw.registers[fw.index("sys.blocks")] = there
    fw.boot()
    assert f"fault {'none' if fits else 'chip'}" in fw.command("status")


def test_chip_without_the_injection_path() -> None:
    """A drive that injects stays in init on a chip without the path, and boots with it.

    Verifies: FW-03
    """
    injecting = parameter_block(load_scenario(ROOT / "scenarios" / "vector" / "ipm-injection.toml"))
    for there, fault in ((0x1FFFF, "none"), (0x1FFFF & ~(1 << REGISTER_BLOCKS.index("injection")), "chip")):
        fw = HostFirmware()
        fw.load(injecting)
        fw.registers[fw.index("sys.blocks")] = there
        fw.boot()
        assert f"fault {fault}" in fw.command("status")


def test_chip_of_another_polarity() -> None:
    """A chip whose gate pins are built for another polarity than the inverter's keeps the drive in init.

    Verifies: FW-03
    """
    for wanted in range(4):
        for built in range(4):
            fw = HostFirmware()
            fw.load(repacked({"gate_polarity": wanted}))
            fw.registers[fw.index("safety.guard")] = built << 4
            fw.boot()
            assert f"fault {'none' if built == wanted else 'chip'}" in fw.command("status")


def test_good_block_is_accepted() -> None:
    """The unchanged block boots.

    Verifies: FW-03
    """
    fw = boot(block().pack())
    assert fw.command("get fault") == ["fault none", "ok"]


def test_wrong_chip_is_named() -> None:
    """Another register map version is refused.

    Verifies: FW-03
    """
    fw = HostFirmware()
    fw.load(block())
    fw.registers[fw.index("sys.build")] += 1
    fw.boot()
    assert fw.command("get fault") == ["state init", "fault chip", "ok"]


def test_writer_refuses_what_does_not_fit() -> None:
    """Missing, unknown and out-of-range values have messages that name parameter and range.

    Verifies: FW-12
    """
    b = block()
    b.values["duty_max_q30"] = 2**30 + 1
    with pytest.raises(ParameterError, match=r"duty_max_q30: 1073741825 is outside 536870912..1073741824"):
        b.pack()
    b = block()
    del b.values["pole_pairs"]
    with pytest.raises(ParameterError, match="pole_pairs has no value"):
        b.pack()
    with pytest.raises(KeyError):
        block().update({"nonsense": 1})
    with pytest.raises(ParameterError):
        gain(1e12)


def test_vector_parameters_may_be_missing_with_six_step_only() -> None:
    """A six-step block has something permitted in their places, which the firmware accepts; a vector block needs all.

    Verifies: FW-12
    """
    b = block()
    assert not [name for name in b.values if name.startswith(("vector_", "encoder_", "injection"))]
    assert boot(b.pack()).command("get fault") == ["fault none", "ok"]
    b.update({"method": 1})
    with pytest.raises(ParameterError, match="vector_double has no value"):
        b.pack()


def test_schema_makes_header_and_table() -> None:
    """Header and documentation list every parameter once; the version word follows the layout.

    Verifies: FW-12
    """
    schema = load_schema()
    header, table = c_header(schema), markdown_table(schema)
    for p in schema.parameters:
        assert header.count(f"parameters_t, {p.member})" if p.member else f" {p.name}") >= 1
        assert table.count(f"| `{p.name}`") == 1
        assert p.min <= p.max
    changed = replace(schema, parameters=(*schema.parameters[1:], schema.parameters[0]))
    assert changed.version_word != schema.version_word
    assert 4 * (schema.words + HEADER_WORDS) <= 2048


def swapped(schema: Schema, first: str, second: str) -> Schema:
    """Two parameters with each other's places of their groups."""
    member = {first: schema[second].member, second: schema[first].member}
    return replace(schema, parameters=tuple(replace(p, member=member.get(p.name, p.member)) for p in schema.parameters))


@pytest.mark.parametrize(
    "names", [(), ("vector_pll_angle", "vector_pll_speed"), ("vector_speed_ki", "vector_speed_kp")]
)
def test_groups_are_records_of_control(names: tuple[str, str] | tuple[()], tmp_path: Path) -> None:
    """The compiler takes the groups as they are, and names a parameter that lies elsewhere than the record has it.

    Verifies: FW-12
    """
    schema = load_schema()
    source = tmp_path / "params.c"
    source.write_text(c_header(swapped(schema, *names) if names else schema))
    system = resources.files("ziglang") / "lib" / "include"
    clang = [sys.executable, "-m", "ziglang", "clang", "-target", "riscv32-freestanding-none", "-std=c11"]
    command = [*clang, "-fsyntax-only", f"-isystem{system}", f"-I{SW}", str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == (not names), done.stderr
    for name in names:
        assert "static assertion failed" in done.stderr and f": {name}" in done.stderr


def test_group_is_one_run(tmp_path: Path) -> None:
    """A group whose parameters are not one after the other is refused.

    Verifies: FW-12
    """
    text = SCHEMA_FILE.read_text()
    apart = text.replace('member = "vector_pll.speed"\n', "")
    path = tmp_path / "params.toml"
    path.write_text(apart)
    with pytest.raises(ValueError, match="each group is one run of parameters"):
        load_schema(path)


MOTORS = [
    MOTOR_1,
    *(motor for motor, _, _, _ in OTHERS),
    small_motor(1, 0.0397, 27.8e-6, 1.27e-3, 5e-7, 10.0, 60_000.0),
    small_motor(21, 0.2, 0.3e-3, 8e-3, 3e-3, 15.0, 600.0),
    small_motor(1, 0.02, 8e-6, 0.4e-3, 5e-8, 10.0, 250_000.0),
]
INVERTERS = [
    INVERTER_1,
    machines.inverter(
        supply_v=12.0, voltage_full_scale_v=15.0, current_full_scale_a=30.0, phase_current_a=29.0, dc_current_a=29.0
    ),
    machines.inverter(supply_v=48.0, voltage_full_scale_v=60.0, current_full_scale_a=60.0, divider_pole_s=1e-6),
]


@pytest.mark.parametrize(("motor", "inverter"), list(itertools.product(MOTORS, INVERTERS)))
def test_every_machine_compiles(motor: Motor, inverter: Inverter) -> None:
    """Blocks of very different machines are within the schema, and the gains mean what the formulas say.

    Verifies: FW-12, FW-13
    """
    b, psi_vs = compile_parameters(told(motor, inverter, carrier_hz=30e3)), motor.psi_vs[0]
    assert len(b.pack()) < 2048
    volt = 2**25 / inverter.sensing.voltage_full_scale_v
    k_e = motor.pole_pairs * psi_vs * (2.0 if motor.emf == "trapezoidal" else 3 * math.sqrt(3) / math.pi)
    assert b.gain("emf") * 256 * 60 / (2 * math.pi) / volt == pytest.approx(k_e, rel=1e-6)
    # The floating voltage at hand-over is well above the converter's step.
    w_e = b.number("handover_rpm") * math.pi / 30 * motor.pole_pairs
    step = inverter.sensing.voltage_full_scale_v / 2**12
    assert (1.0 if motor.emf == "trapezoidal" else 0.75) * psi_vs * w_e >= 29 * step or (
        b.number("handover_rpm") == pytest.approx(0.3 * motor.max_speed_rpm, abs=1)
    )
    assert b.number("handover_rpm") < b.number("stop_rpm") < b.number("speed_max_rpm")
    # Same acceleration in both of its units.
    accel = b.number("start_accel_rpm_q20") / 2**20 * TICK_HZ * math.pi / 30
    first_s = b.number("start_first_cycles") / CLOCK_HZ
    assert 0.5 * accel * motor.pole_pairs * first_s**2 == pytest.approx(math.pi / 6, rel=1e-3)
    assert 0.02 <= b.number("align_ticks") / TICK_HZ <= 0.6


def test_image_carries_the_block(tmp_path: Path) -> None:
    """All words of the RAM in hex: the code from the reset vector, the block at its address, telemetry area clear.

    Verifies: FW-01, FW-12
    """
    image = build_firmware()
    assert image == build_firmware()
    code = image.read_bytes()
    assert len(code) <= BLOCK_ADDRESS - STACK_BYTES, "room for the stack"
    assert code[:0x80] == bytes(0x80)
    path = write_image(tmp_path / "ram.hex", image, block())
    words = [int(line, 16) for line in path.read_text().split()]
    assert len(words) == RAM_WORDS
    data = struct.pack(f"<{RAM_WORDS}I", *words)
    assert data[: len(code)] == code
    packed = block().pack()
    assert data[BLOCK_ADDRESS : BLOCK_ADDRESS + len(packed)] == packed
    assert not any(data[TELEMETRY_ADDRESS:])
    too_long = tmp_path / "long.bin"
    too_long.write_bytes(bytes(BLOCK_ADDRESS + 4))
    with pytest.raises(ParameterError, match="reach into the parameter block"):
        write_image(tmp_path / "x.hex", too_long, block())


def test_image_of_five_phases_has_no_six_step_drive() -> None:
    """It is shorter than that of three phases, though it has a second subspace.

    Verifies: INJC-12
    """
    three, five = (build_firmware(phases=phases).stat().st_size for phases in (3, 5))
    assert five < three - 8_000
    assert five < IMAGE_LIMIT_BYTES - 8_000, "room for what comes"


def test_power_stage_keys_reach_the_block() -> None:
    """Precharge time and voltage limits of the inverter; the limits left out are below the converter's full scale.

    Verifies: FW-12
    """
    values = compile_parameters(told(inverter=machines.inverter(precharge_s=15e-3))).values
    assert values["precharge_ticks"] == 150
    values = compile_parameters(told()).values
    assert values["trip_over_voltage_lsb"] == round(0.98 * 4096)
    assert values["trip_under_voltage_lsb"] == round(0.6 * 25 / 30 * 4096)
    values = compile_parameters(told(inverter=machines.inverter(voltage_full_scale_v=40.0))).values
    assert values["trip_over_voltage_lsb"] == round(1.25 * 25 / 40 * 4096)
    assert values["brake_longest_cycles"] == 0, "the chip drives no brake"
    stated = machines.inverter(over_voltage_v=28.0, under_voltage_v=20.0)
    values = compile_parameters(told(inverter=stated)).values
    assert values["trip_over_voltage_lsb"] == round(28 / 30 * 4096)
    assert values["trip_under_voltage_lsb"] == round(20 / 30 * 4096)


def test_brake_keys_reach_the_block() -> None:
    """Thresholds in raw codes, longest time in clocks, age of four sample sets in the longest gap between two.

    Verifies: FW-50
    """
    brake = {"on_v": 27.5, "off_v": 26.0, "resistance_ohm": 1.0, "longest_on_s": 0.25}
    link = {"dc_link_f": 1e-3, "supply_resistance_ohm": 1e-3}
    inverter = machines.inverter(sample_period_s=2e-6, brake_chopper=brake, **link)
    values = compile_parameters(told(inverter=inverter)).values
    assert (values["brake_on_lsb"], values["brake_off_lsb"]) == (3755, 3550)
    assert values["brake_longest_cycles"] == 12_500_000
    assert values["sample_age_cycles"] == 4 * 100
    values = compile_parameters(told(inverter=inverter, zcd={"sampling": "carrier"})).values
    assert values["sample_age_cycles"] == 4 * values["carrier_longest_cycles"]
