"""Compile the firmware with zig's clang: the image for the soft core and the shared library for the host.

Results are cached below `build/` under a hash of everything that enters them.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from fluxlock import memory
from fluxlock.build import file_lock, generate_registers
from fluxlock.canopen import c_tables
from fluxlock.canopen.dictionary import load_dictionary
from fluxlock.firmware.schema import SCHEMA_FILE, c_header, load_schema
from fluxlock.memory import BLOCK_ADDRESS, CACHE_BYTES, STACK_BYTES, STATE_OFFSET
from fluxlock.paths import BUILD, GENERATED, ROOT, content_hash

SW = ROOT / "sw"
# link.ld puts the state into the lines of the cache behind it and asserts the stack above.
IMAGE_LIMIT_BYTES = BLOCK_ADDRESS - STACK_BYTES - (CACHE_BYTES - STATE_OFFSET)

WARNINGS = ("-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Werror")
TARGET_FLAGS = (
    *(
        "-target",
        "riscv32-freestanding-none",
        "-mcpu=generic_rv32+m+relax",
        "-O2",
        "-fno-unroll-loops",
        "-fomit-frame-pointer",
    ),
    *("-ffreestanding", "-nostdlib", "-fno-builtin", "-ffunction-sections", "-fdata-sections"),
    *("-fno-sanitize=all", "-fno-stack-protector", "-flto"),  # inlines across the layers
)
# -Bsymbolic: our crc32 is not to be replaced by that of a zlib which Python has loaded.
HOST_FLAGS = (
    *("-O1", "-g", "-fPIC", "-shared", "-DFL_HOST=1", "-fno-omit-frame-pointer"),
    *("-fsanitize=undefined", "-fsanitize-trap=undefined", "-Wl,-Bsymbolic"),
)
TARGET_ONLY = ("app/main.c", "hal/soc/")
HOST_ONLY = ("app/host_main.c", "hal/host/")
BENCH = "bench/"  # programs of their own, a source each
COMMISSION = "commission/"  # the program that measures a machine
FUZZ_MAIN = "app/fuzz_main.c"  # in place of main.c: writes to registers at random
PROGRAMS = (BENCH, COMMISSION, FUZZ_MAIN)
CANOPEN = "canopen/"  # the node: in the host library of its own, not in the image
CANOPEN_HOST = "host_node.c"


class FirmwareError(RuntimeError):
    """The compiler refused the sources, or the image does not fit."""


def _sources() -> list[Path]:
    """All but those of the CANopen node: a change there is none of the image."""
    found = (p for p in SW.rglob("*") if p.suffix in {".c", ".h", ".S", ".ld"})
    return sorted(p for p in found if not p.relative_to(SW).as_posix().startswith(CANOPEN))


def _selected(excluded: tuple[str, ...], suffixes: tuple[str, ...]) -> list[str]:
    names = [p.relative_to(SW).as_posix() for p in _sources() if p.suffix in suffixes]
    return [name for name in names if not name.startswith(excluded)]


def _generate(name: str, text: str) -> Path:
    header = GENERATED / name
    if not header.exists() or header.read_text() != text:
        header.parent.mkdir(parents=True, exist_ok=True)
        header.write_text(text)
    return header


def generate_headers() -> tuple[Path, Path]:
    """Write `params.h` (schema) and `ram.h` (memory map) below `build/generated`, only when they changed."""
    return _generate("params.h", c_header(load_schema())), _generate("ram.h", memory.c_header())


def _zig(arguments: list[str]) -> None:
    command = [sys.executable, "-m", "ziglang", *arguments]
    done = subprocess.run(command, cwd=SW, capture_output=True, text=True, check=False)
    if done.returncode:
        raise FirmwareError(f"firmware does not compile: {' '.join(command)}\n{done.stdout}{done.stderr}")


def _key(*extra: object) -> str:
    generate_registers()
    headers = generate_headers()
    names = [p.relative_to(SW).as_posix() for p in _sources()]
    return content_hash([*_sources(), SCHEMA_FILE, *headers, GENERATED / "fluxlock_regs.h"], names, *extra)


def build_firmware(build_dir: Path | None = None, phases: int = 3) -> Path:
    """Flat binary of the image for the soft core of a chip with 3 or 5 phases, at address 0; cached by content hash."""
    sources = _selected((*HOST_ONLY, *PROGRAMS), (".c", ".S"))
    name, defined = ("fluxlock", ()) if phases == 3 else (f"fluxlock-{phases}", (f"-DPHASES={phases}",))
    return _build_image(name, sources, build_dir or BUILD / "firmware", defined)


def build_program(name: str) -> Path:
    """Flat binary of `sw/bench/<name>.c` with control, drive and hal: a program of its own in place of the firmware."""
    sources = _selected((*HOST_ONLY, *PROGRAMS, "app/"), (".c", ".S"))
    return _build_image(name, [f"{BENCH}{name}.c", *sources], BUILD / "firmware")


def build_fuzz() -> Path:
    """Flat binary of the firmware with the main loop of `fuzz_main.c`, for a chip with three phases."""
    sources = _selected((*HOST_ONLY, *PROGRAMS, "app/main.c"), (".c", ".S"))
    return _build_image("fuzz", [FUZZ_MAIN, *sources], BUILD / "firmware")


def build_program_library(name: str) -> Path:
    """The host library with `sw/bench/<name>.c`, whose main() is for the core only."""
    return _host_library(f"libfluxlock-{name}", [f"{BENCH}{name}.c"], BUILD / "firmware")


def build_commission() -> Path:
    """Flat binary of the program of `sw/commission`, which measures a machine in place of the firmware."""
    sources = _selected((*HOST_ONLY, BENCH, "app/"), (".c", ".S"))
    return _build_image("commission", ["app/format.c", *sources], BUILD / "firmware")


def _canopen() -> tuple[list[str], str]:
    """Sources of the node, and the hash of what enters them; writes their table of objects."""
    files = sorted(p for p in (SW / CANOPEN).iterdir() if p.suffix in {".c", ".h"})
    table = _generate("canopen_objects.h", c_tables.c_header(load_dictionary()))
    return [f"{CANOPEN}{p.name}" for p in files if p.suffix == ".c"], content_hash([*files, table])


def check_canopen() -> None:
    """Compile the CANopen node for the core; it is in no image. FirmwareError if it does not compile."""
    sources, _ = _canopen()
    _key()
    with tempfile.TemporaryDirectory(dir=GENERATED) as folder:
        for name in (source for source in sources if not source.endswith(CANOPEN_HOST)):
            includes = ["-I.", "-Ihal/include", f"-I{GENERATED}"]
            _zig(["cc", *TARGET_FLAGS, *WARNINGS, *includes, "-c", name, "-o", f"{folder}/{Path(name).stem}.o"])


def _build_image(name: str, sources: list[str], folder: Path, defined: tuple[str, ...] = ()) -> Path:
    with file_lock(BUILD / ".firmware.lock"):
        image = folder / f"{name}-{_key('target', WARNINGS, TARGET_FLAGS)}.bin"
        if image.exists():
            return image
        folder.mkdir(parents=True, exist_ok=True)
        elf = image.with_suffix(".elf")
        partial = image.with_suffix(".part")
        includes = ["-I.", "-Ihal/include", f"-I{GENERATED}"]
        link = ["-T", "hal/soc/link.ld", "-Wl,--gc-sections", "-o", str(elf)]
        _zig(["cc", *TARGET_FLAGS, *WARNINGS, *defined, *includes, *sources, *link])
        _zig(["objcopy", "-O", "binary", str(elf), str(partial)])
        # The image starts at the reset vector; the file is to start at address 0.
        data = bytes(0x80) + partial.read_bytes()
        if len(data) > IMAGE_LIMIT_BYTES:
            raise FirmwareError(f"the image of {len(data)} bytes exceeds {IMAGE_LIMIT_BYTES}")
        partial.write_bytes(data)
        partial.replace(image)
    return image


def build_host_library(build_dir: Path | None = None) -> Path:
    """Shared library of the same sources for this machine, undefined behaviour traps; cached by content hash."""
    return _host_library("libfluxlock", [], build_dir or BUILD / "firmware")


def build_canopen_library() -> Path:
    """The same with the CANopen node on the drive."""
    sources, key = _canopen()
    return _host_library("libfluxlock-canopen", sources, BUILD / "firmware", key)


def _host_library(name: str, added: list[str], folder: Path, key: str = "") -> Path:
    """added: sources that _key does not know, and key: their hash."""
    with file_lock(BUILD / ".firmware.lock"):
        library = folder / f"{name}-{_key('host', WARNINGS, HOST_FLAGS, *filter(None, [key]))}.so"
        if library.exists():
            return library
        folder.mkdir(parents=True, exist_ok=True)
        partial = library.with_suffix(".part")
        sources = [*_selected((*TARGET_ONLY, *PROGRAMS), (".c",)), *added]
        _zig(["cc", *HOST_FLAGS, *WARNINGS, "-I.", f"-I{GENERATED}", *sources, "-o", str(partial)])
        partial.replace(library)
    return library
