# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Compile the firmware with zig's clang: the image for the soft core and the shared library for the host.

Results are cached below `build/` under a hash of everything that enters them.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from elftools.elf.elffile import ELFFile

from fluxlock.base.paths import BUILD, GENERATED, ROOT, content_hash
from fluxlock.base.writable import file_lock
from fluxlock.canopen import c_tables
from fluxlock.canopen.dictionary import load_dictionary
from fluxlock.firmware.schema import SCHEMA_FILE, c_header, load_schema
from fluxlock.generate import memory
from fluxlock.generate.memory import BOOT_ADDRESS, BOOT_BYTES, CACHE_BYTES, RAM_WORDS, STATE_OFFSET, image_end
from fluxlock.generate.registers import generate_registers
from fluxlock.interface import names, settings, values

SW = ROOT / "sw"
# link.ld puts the state into the lines of the cache behind it and asserts that both end in time.
IMAGE_LIMIT_BYTES = image_end() - (CACHE_BYTES - STATE_OFFSET)
NO_ROOM = "no room for image and state"  # what it says otherwise
RESET_VECTOR = 0x80

WARNINGS = ("-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Werror")
TARGET_FLAGS = (
    *(
        "-target",
        "riscv32-freestanding-none",
        "-mcpu=sifive_e31-a-c-zca+use_postra_scheduler+relax",
        "-O2",
        "-fno-unroll-loops",
        "-fomit-frame-pointer",
    ),
    *("-ffreestanding", "-nostdlib", "-fno-builtin", "-ffunction-sections", "-fdata-sections"),
    *("-fno-sanitize=all", "-fno-stack-protector", "-flto"),  # inlines across the layers
    "-g",  # for the debugger and the profile: the ELF beside the image, which stays the same
)
# -Bsymbolic: our crc32 is not to be replaced by that of a zlib which Python has loaded.
HOST_FLAGS = (
    *("-O1", "-g", "-fPIC", "-shared", "-DFL_HOST=1", "-fno-omit-frame-pointer"),
    *("-fsanitize=undefined", "-fsanitize-trap=undefined", "-Wl,-Bsymbolic"),
)
# With the machine's own compiler: zig brings no runtime of the address sanitizer.
SANITIZER_FLAGS = (
    *("-O1", "-g", "-fPIC", "-shared", "-DFL_HOST=1", "-fno-omit-frame-pointer"),
    *("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-semantic-interposition", "-Wl,-Bsymbolic"),
)
# With the machine's GCC, which counts lines and branches when COVERAGE_VARIABLE names a folder: for that, unoptimised.
COVERAGE_VARIABLE = "FLUXLOCK_C_COVERAGE"
COVERAGE_FLAGS = (
    *("-O0", "-g", "-fPIC", "-shared", "-std=c11", "-DFL_HOST=1", "-Wl,-Bsymbolic"),
    *("--coverage", "-fprofile-abs-path", "-fno-semantic-interposition"),
)
SOC = "hal/soc/"
IMAGES = "images/"  # what composes the rest
MAIN = f"{IMAGES}main.c"
TARGET_ONLY = (MAIN, SOC)
HOST_ONLY = (f"{IMAGES}host_main.c", "hal/host/")
BENCH = f"{IMAGES}bench/"  # programs of their own, a source each
COMMISSION = f"{IMAGES}commission/"  # the program that measures a machine
BOOT = f"{IMAGES}boot/"  # the loader, and what it has of the firmware
BOOT_PARTS = ("control/crc32.c", *(f"hal/{name}.c" for name in ("can", "can_setup", "flash", "uart")))
FUZZ_MAIN = f"{IMAGES}fuzz_main.c"  # in place of main.c: writes to registers at random
PROGRAMS = (BENCH, COMMISSION, BOOT, FUZZ_MAIN)
APPLICATION = ("app/", "console/")  # not in programs of their own
HELD = {"six-step": "-DHELD=1", "vector": "-DHELD=2"}  # what the images with the node drive: chip_io.h
# The node, in a host library and an image of its own: what is of the chip alone, and of the host alone.
CHIP_NODE = "canopen/chip_node."
HOST_NODE = f"{IMAGES}host_node."
CANOPEN = ("canopen/", HOST_NODE)


class FirmwareError(RuntimeError):
    """The compiler refused the sources, or the image does not fit."""


def _sources() -> list[Path]:
    """All but those of the CANopen node: a change there is none of the image."""
    found = (p for p in SW.rglob("*") if p.suffix in {".c", ".h", ".S", ".ld"})
    return sorted(p for p in found if not p.relative_to(SW).as_posix().startswith(CANOPEN))


def _selected(excluded: tuple[str, ...], suffixes: tuple[str, ...]) -> list[str]:
    """Sources in the order of the link, which places code and data and so has a part in every trace and in the size.

    First what serves one image, by the names of its files, then folder by folder.
    """
    names = [p.relative_to(SW).as_posix() for p in _sources() if p.suffix in suffixes]
    first = ("app/", "console/", IMAGES)
    names.sort(key=lambda name: (0, name.rpartition("/")[2]) if name.startswith(first) else (1, name))
    return [name for name in names if not name.startswith(excluded)]


def _generate(name: str, text: str) -> Path:
    header = GENERATED / name
    if not header.exists() or header.read_text() != text:
        header.parent.mkdir(parents=True, exist_ok=True)
        header.write_text(text)
    return header


def generate_headers() -> tuple[Path, ...]:
    """Write what comes from the tables and the memory map below `build/generated`, only when they changed."""
    settings.check_uses(_sources())
    names.check_uses(_sources())
    texts = {
        "params.h": c_header(load_schema()),
        "ram.h": memory.c_header(),
        "settings_table.h": settings.c_header(),
        "names.h": names.c_header(),
        "values_table.h": values.c_header(),
    }
    return tuple(_generate(name, text) for name, text in texts.items())


def generate_canopen() -> Path:
    """Write the node's table of objects beside them."""
    dictionary = load_dictionary()
    c_tables.check_reads(dictionary, c_tables.READER.read_text(encoding="utf-8"))
    return _generate("canopen_objects.h", c_tables.c_header(dictionary))


def _run(command: list[str]) -> str:
    try:
        done = subprocess.run(command, cwd=SW, capture_output=True, text=True, check=False)
    except OSError as error:
        raise FirmwareError(f"{command[0]}: {error.strerror}") from error
    if done.returncode:
        raise FirmwareError(f"firmware does not compile: {' '.join(command)}\n{done.stdout}{done.stderr}")
    return done.stdout


def _zig(arguments: list[str]) -> None:
    _run([sys.executable, "-m", "ziglang", *arguments])


def host_headers() -> list[Path]:
    """Headers of the host library, the loader and the CANopen node, with what they include from the build folder."""
    generate_registers()
    generate_canopen()
    found = [p for p in SW.rglob("*.h") if not p.relative_to(SW).as_posix().startswith((SOC, "hal/include/"))]
    return [*found, *generate_headers(), *(GENERATED / name for name in ("fluxlock_regs.h", "canopen_objects.h"))]


def _key(*extra: object) -> str:
    generate_registers()
    headers = generate_headers()
    names = [p.relative_to(SW).as_posix() for p in _sources()]
    return content_hash([*_sources(), SCHEMA_FILE, *headers, GENERATED / "fluxlock_regs.h"], names, *extra)


def host_sources() -> str:
    """Hash of sources and options of the host library, without the place that the library itself has in it."""
    with file_lock(BUILD / ".firmware.lock"):
        return _key("host", HOST_FLAGS, WARNINGS)


def build_firmware(
    build_dir: Path | None = None,
    phases: int = 3,
    can_method: str | None = None,
    method: str | None = None,
    ram_words: int = RAM_WORDS,
) -> Path:
    """Flat binary of the image for the soft core of a chip with 3 or 5 phases, at address 0; cached by content hash.

    can_method: the image with the CANopen node, for a chip with a CAN controller. It holds this one method of driving,
    "vector" without injection: the memory is too small for more. method: without the node, but one method only as
    well, for a chip of three phases with less RAM, ram_words.
    """
    name, node, defined, key = _variant(phases, can_method)
    if method is not None:
        name, defined = f"{name}-{method}", (*defined, HELD[method])
    if ram_words != RAM_WORDS:
        name, defined = f"{name}-{ram_words // 256}k", (*defined, f"-DIMAGE_LIMIT={image_end(ram_words):#x}")
    sources = [*_selected((*HOST_ONLY, *PROGRAMS), (".c", ".S")), *node]
    return _build_image(name, sources, build_dir or BUILD / "firmware", defined, key)


def _variant(phases: int, can_method: str | None) -> tuple[str, list[str], tuple[str, ...], str]:
    """Of an image: its name, the node's sources, what is defined, the hash of what _key does not know."""
    name, defined = ("fluxlock", ()) if phases == 3 else (f"fluxlock-{phases}", (f"-DPHASES={phases}",))
    if can_method is None:
        return name, [], defined, ""
    node, key = _canopen(HOST_NODE)
    return f"{name}-can-{can_method}", node, (*defined, "-DFL_CAN=1", HELD[can_method]), key


@dataclass(frozen=True)
class BusLibrary:
    """The firmware as a library that drives the chip's bus; preload: what its process must load before anything."""

    path: Path
    preload: Path | None = None


def build_bus_library(phases: int = 3, can_method: str | None = None, sanitize: bool = False) -> BusLibrary:
    """The image's C sources, main() and all, for this machine: for a simulator of the chip without its core.

    phases, can_method: as in `build_firmware`. Undefined behaviour traps; sanitize: the sanitizers of addresses and of
    undefined behaviour report and end the process, for which there must be a GCC.
    """
    name, node, defined, key = _variant(phases, can_method)
    sources = [*_selected((*HOST_ONLY, SOC, *PROGRAMS), (".c",)), *node]
    name = f"lib{name}-bus"
    folder = BUILD / "firmware"
    if not sanitize:
        return BusLibrary(_library(name, sources, folder, (*HOST_FLAGS, *WARNINGS, *defined), key))
    compiler = os.environ.get("CC", "cc")
    runtime = _run([compiler, "-print-file-name=libasan.so"]).strip()
    if not Path(runtime).is_absolute():
        raise FirmwareError(f"{compiler} has no address sanitizer: CC must name a GCC with its libasan")
    flags = (*SANITIZER_FLAGS, "-std=c11", *defined)
    return BusLibrary(_library(f"{name}-sanitized", sources, folder, flags, key, compiler), Path(runtime))


def build_program(name: str) -> Path:
    """Flat binary of `sw/images/bench/<name>.c` with control, drive and hal: a program in place of the firmware."""
    sources = _selected((*HOST_ONLY, *APPLICATION, IMAGES), (".c", ".S"))
    return _build_image(name, [f"{BENCH}{name}.c", *sources], BUILD / "firmware")


def build_fuzz(phases: int, method: str) -> Path:
    """Flat binary of the firmware with the main loop of `fuzz_main.c`, for a chip with 3 or 5 phases.

    For three phases it holds the one method of driving: with both it does not fit.
    """
    sources = _selected((*HOST_ONLY, *PROGRAMS, MAIN), (".c", ".S"))
    _, _, defined, _ = _variant(phases, None)
    held = (HELD[method],) if phases == 3 else ()
    return _build_image(f"fuzz-{phases}-{method}", [FUZZ_MAIN, *sources], BUILD / "firmware", (*defined, *held))


def build_program_library(name: str) -> Path:
    """The host library with `sw/images/bench/<name>.c`, whose main() is for the core only."""
    return _host_library(f"libfluxlock-{name}", [f"{BENCH}{name}.c"], BUILD / "firmware")


def build_commission() -> Path:
    """Flat binary of the program of `sw/images/commission`, which measures a machine in place of the firmware."""
    own = [f"{COMMISSION}{p.name}" for p in sorted((SW / COMMISSION).glob("*.c"))]
    sources = _selected((*HOST_ONLY, *APPLICATION, IMAGES), (".c", ".S"))
    return _build_image("commission", ["console/format.c", "console/line.c", *own, *sources], BUILD / "firmware")


def build_loader(listen_ms: int | None = None) -> Path:
    """Contents of the ROM of a chip with Boot for `$readmemh`: the loader.

    listen_ms: how long it listens for a host before it starts what the flash holds, default the loader's own.
    """
    name, defined = ("boot", ()) if listen_ms is None else (f"boot-{listen_ms}", (f"-DLISTEN_MS={listen_ms}u",))
    sources = [*(f"{BOOT}{p.name}" for p in sorted((SW / BOOT).glob("*.[cS]"))), *BOOT_PARTS]
    binary = _build_image(name, sources, BUILD / "firmware", ("-Os", *defined), "", f"{BOOT}link.ld", BOOT_ADDRESS)
    image = binary.with_suffix(".hex")
    data = binary.read_bytes()[BOOT_ADDRESS:].ljust(BOOT_BYTES, b"\0")
    image.write_text("".join(f"{int.from_bytes(data[i : i + 4], 'little'):08x}\n" for i in range(0, len(data), 4)))
    return image


def build_link_library(registers: Path) -> Path:
    """The loader's frames on UART and CAN for this machine.

    registers: C source of reg_read and reg_write, with its header beside it.
    """
    sources = [f"{BOOT}link.c", *BOOT_PARTS, str(registers)]
    return _library(
        "libboot-link",
        sources,
        BUILD / "firmware",
        (*HOST_FLAGS, *WARNINGS),
        content_hash([registers, registers.with_suffix(".h")]),
    )


def _canopen(without: str) -> tuple[list[str], str]:
    """Sources of the node but one, and the hash of what enters them; writes their table of objects."""
    files = [p for p in sorted(SW.rglob("*.[ch]")) if p.relative_to(SW).as_posix().startswith(CANOPEN)]
    table = generate_canopen()
    names = [p.relative_to(SW).as_posix() for p in files if p.suffix == ".c"]
    return [name for name in names if not name.startswith(without)], content_hash([*files, table])


def _build_image(
    name: str,
    sources: list[str],
    folder: Path,
    defined: tuple[str, ...] = (),
    key: str = "",
    script: str = "hal/soc/link.ld",
    origin: int = RESET_VECTOR,
) -> Path:
    """key: hash of the sources that _key does not know; origin: where the script puts the first byte.

    The file starts at address 0.
    """
    with file_lock(BUILD / ".firmware.lock"):
        image = folder / f"{name}-{_key('target', WARNINGS, TARGET_FLAGS, *filter(None, [key]))}.bin"
        if image.exists():
            return image
        folder.mkdir(parents=True, exist_ok=True)
        elf = image.with_suffix(".elf")
        partial = image.with_suffix(".part")
        includes = ["-I.", "-Ihal/include", f"-I{GENERATED}"]
        link = ["-T", script, "-Wl,--gc-sections", "-o", str(elf)]
        try:
            _zig(["cc", *TARGET_FLAGS, *WARNINGS, *defined, *includes, *sources, *link])
        except FirmwareError as error:
            if NO_ROOM in str(error):
                raise FirmwareError(f"{name}: image and state do not fit") from None
            raise
        partial.write_bytes(bytes(origin) + flat_binary(elf))
        partial.replace(image)
    return image


def flat_binary(elf: Path) -> bytes:
    """What the sections of an ELF file put into a memory, from its lowest load address on; gaps are 0.

    Zig's objcopy does the same, but is compiled from its sources at its first use, which takes half a minute.
    """
    with elf.open("rb") as stream:
        file = ELFFile(stream)
        loaded = [segment for segment in file.iter_segments("PT_LOAD") if segment["p_filesz"]]
        parts = {
            segment["p_paddr"] + section["sh_addr"] - segment["p_vaddr"]: section.data()
            for segment in loaded
            for section in file.iter_sections()
            if section["sh_type"] != "SHT_NOBITS" and segment.section_in_segment(section)
        }
    begin = min(parts)
    image = bytearray(max(at + len(data) for at, data in parts.items()) - begin)
    for at, data in parts.items():
        image[at - begin : at - begin + len(data)] = data
    return bytes(image)


def build_host_library(build_dir: Path | None = None, can_method: str | None = None, phases: int = 3) -> Path:
    """Shared library of the same sources for this machine, undefined behaviour traps; cached by content hash.

    can_method: without what the image with the CANopen node leaves out.
    """
    folder = build_dir or BUILD / "firmware"
    if phases != 3:
        return _host_library(f"libfluxlock-{phases}", [], folder, "", (f"-DPHASES={phases}",))
    if can_method is not None:
        return _host_library(f"libfluxlock-{can_method}", [], folder, "", (HELD[can_method],))
    return _host_library("libfluxlock", [], folder)


def build_canopen_library() -> Path:
    """The same with the CANopen node on the drive."""
    sources, key = _canopen(CHIP_NODE)
    return _host_library("libfluxlock-canopen", sources, BUILD / "firmware", key)


def _host_library(name: str, added: list[str], folder: Path, key: str = "", defined: tuple[str, ...] = ()) -> Path:
    """added: sources that _key does not know, and key: their hash."""
    sources = [*_selected((*TARGET_ONLY, *PROGRAMS), (".c",)), *added]
    return _library(name, sources, folder, (*HOST_FLAGS, *WARNINGS, *defined), key)


def _library(
    name: str, sources: list[str], folder: Path, flags: tuple[str, ...], key: str, compiler: str | None = None
) -> Path:
    """key: hash of the sources that _key does not know. compiler: of the machine, in place of zig's."""
    if compiler is None and (counts := os.environ.get(COVERAGE_VARIABLE)):
        compiler, folder = os.environ.get("CC", "cc"), Path(counts)
        flags = (*COVERAGE_FLAGS, *(flag for flag in flags if flag.startswith("-D") and flag not in COVERAGE_FLAGS))
    with file_lock(BUILD / ".firmware.lock"):
        library = folder / f"{name}-{_key('host', ROOT, flags, *filter(None, [key, compiler]))}.so"
        if library.exists():
            return library
        folder.mkdir(parents=True, exist_ok=True)
        partial = library.with_suffix(".part")
        arguments = [*flags, "-I.", f"-I{GENERATED}", *sources, "-o", str(partial)]
        if compiler is None:
            _zig(["cc", *arguments])
        else:
            _run([compiler, *arguments])
        partial.replace(library)
    return library
