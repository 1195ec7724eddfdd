# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The table of settings and the firmware: the build names what stands in one and not in the other."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from fluxlock.base.paths import GENERATED
from fluxlock.firmware.toolchain import SW, WARNINGS, generate_headers
from fluxlock.interface.settings import Setting, SettingsError, c_header, check_uses, load_settings
from fluxlock.interface.values import load_values
from tests.firmware.firmware_bench import Bench

SWITCH = Setting("planted", "switch", "Planted.", min=0, max=1)


@pytest.fixture(scope="module")
def ready() -> Bench:
    """A drive that is ready."""
    bench = Bench()
    assert bench.until_state("ready", 0.1)
    return bench


def compiled(tmp_path: Path, settings: tuple[Setting, ...]) -> str:
    """What the compiler says of settings.c with the header of these settings."""
    generate_headers()
    (tmp_path / "settings_table.h").write_text(c_header(settings))
    command = ["-m", "ziglang", "cc", "-c", "-o", str(tmp_path / "settings.o"), *WARNINGS]
    includes = [f"-I{tmp_path}", "-I.", f"-I{GENERATED}"]
    done = subprocess.run(
        [sys.executable, *command, *includes, "drive/settings.c"], cwd=SW, capture_output=True, text=True, check=False
    )
    assert (done.returncode == 0) == (not done.stderr), done.stderr
    return done.stderr


def test_every_setting_has_its_range_on_the_console(ready: Bench) -> None:
    """The console lists each setting of the table, takes the ends of its range, by word too, and nothing beyond.

    Verifies: FW-23
    """
    names = [line.split()[0] for line in ready.fw.command("get")[:-1]]
    assert names == [item.name for item in (*load_values(), *load_settings())]
    known = [s for s in load_settings() if "six-step" in s.methods]
    assert ready.fw.command("help")[1].split()[1:] == [s.name for s in known]
    for s in set(load_settings()) - set(known):
        assert ready.fw.command(f"set {s.name} 0") == ["error: not with six-step"]
    for s in known:
        for value, word in enumerate(s.choices):
            if s.name != "mode":
                assert ready.fw.command(f"set {s.name} {word}") == ["ok"]
            assert value == s.choices.index(word)
        if s.min is None or s.max is None or s.permitted or s.name == "mode":
            continue  # its range is the parameters'
        for value in (s.min, s.max):
            assert ready.fw.command(f"set {s.name} {value}") == ["ok"], s.name
            shown = s.choices[value] if s.choices else str(value)
            assert ready.fw.command(f"get {s.name}") == [f"{s.name} {shown}", "ok"]
        for value in (s.min - 1, s.max + 1):
            permitted = s.zero and value == 0
            assert ready.fw.command(f"set {s.name} {value}") == ["ok" if permitted else "error: value out of range"]


def test_a_setting_that_nothing_uses_is_named() -> None:
    """An entry of the table that no C source takes from the settings.

    Verifies: FW-23
    """
    sources = sorted(SW.rglob("*.c"))
    check_uses(sources, load_settings())
    with pytest.raises(SettingsError, match=r"no C source uses the setting planted$"):
        check_uses(sources, (*load_settings(), SWITCH))


def test_a_missing_function_is_named(tmp_path: Path) -> None:
    """A function that the table names and settings.c lacks, and one of settings.c that the table does not name.

    Verifies: FW-23
    """
    assert compiled(tmp_path, load_settings()) == ""
    with_setter = replace(SWITCH, functions=("set",))
    assert "set_planted" in compiled(tmp_path, (*load_settings(), with_setter))
    without = tuple(replace(s, functions=()) if s.name == "current_loop" else s for s in load_settings())
    assert "unused function 'set_current_loop'" in compiled(tmp_path, without)


def test_a_member_without_an_entry_is_named(tmp_path: Path) -> None:
    """What settings.c uses of a setting that the table has no longer.

    Verifies: FW-23
    """
    without = tuple(s for s in load_settings() if s.name != "current_loop")
    assert "no member named 'current_loop'" in compiled(tmp_path, without)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ('name = "a"\nkind = "switch"\ntext = "A."\ncolour = "red"', "setting a: unknown key colour"),
        ('name = "a"\nkind = "switch"', "setting a: no text"),
        ('name = "a"\nkind = "bool"\ntext = "A."', "setting a: kind bool, permitted switch, choice, number"),
        ('name = "a"\nkind = "choice"\ntext = "A."', "setting a: choices belong to the kind choice"),
        ('name = "a"\nkind = "switch"\ntext = "A."\nmethods = ["v"]', "setting a: unknown method v"),
    ],
)
def test_contradictions_are_named(tmp_path: Path, entry: str, message: str) -> None:
    """A wrong entry is refused by its name.

    Verifies: FW-23
    """
    table = tmp_path / "settings.toml"
    table.write_text(f"[[setting]]\n{entry}\n")
    with pytest.raises(SettingsError, match=f"^{message}$"):
        load_settings(table)
    table.write_text('[[setting]]\nname = "b"\nkind = "switch"\ntext = "B."\n' * 2)
    load_settings.cache_clear()
    with pytest.raises(SettingsError, match="the name b stands twice"):
        load_settings(table)
