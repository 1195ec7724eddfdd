# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Which build of the chip a scenario runs on."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT, tool_environment
from fluxlock.config import ConfigError, load_scenario
from fluxlock.cosim import run
from fluxlock.cosim.chip import compiler_words


@pytest.mark.parametrize(
    ("name", "phases", "injection", "method", "overrides"),
    [
        ("demo", 3, False, "six-step", ()),
        ("vector/start", 3, False, "vector", ()),
        ("vector/ipm-injection", 3, True, "vector", ()),
        ("five-phase/yu", 5, True, "vector", ()),
        ("demo", 3, False, None, ("can={}",)),
    ],
)
def test_chip_of_a_scenario(
    name: str,
    phases: int,
    injection: bool,
    method: str | None,
    overrides: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Phases of the motor, path of the method, injection path of the drive, CAN controller of a bus with both paths.

    Verifies: SOC-28
    """
    monkeypatch.setattr(run, "build_chip", lambda waves, **options: {"waves": waves, **options})
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.toml", overrides)
    expected = {
        "waves": False,
        "phases": phases,
        "injection": injection,
        "can": bool(overrides),
        "native": False,
        "gate_polarity": 0,
        "method": method,
        "probe": False,
        "signals": (),
    }
    assert run.chip_of(scenario) == expected
    assert run.chip_of(scenario, waves=True) == {**expected, "waves": True, "method": None if overrides else method}
    assert run.chip_of(scenario, native=True) == {**expected, "native": True, "can": True, "method": None}
    shown = ("fl_trip.*",)
    assert run.chip_of(scenario, signals=shown) == {**expected, "signals": shown}
    assert run.chip_of(scenario, can=True) == {**expected, "can": True, "method": None}


def test_chip_of_the_inverters_polarity(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gates that are active low are the chip's; the simulated inverter and the parameter block know them.

    Verifies: SOC-28
    """
    monkeypatch.setattr(run, "build_chip", lambda waves, **options: options["gate_polarity"])
    for high, low in ((0, 0), (1, 0), (0, 1), (1, 1)):
        keys = [f"inverter.gate_{side}_active_low=true" for side, on in (("high", high), ("low", low)) if on]
        scenario = load_scenario(ROOT / "scenarios" / "demo.toml", keys)
        assert run.chip_of(scenario) == high | low << 1


def test_can_and_injection() -> None:
    """The image with the CANopen node has no injection: refused by the key; bit rates are those the clock can make.

    Verifies: SOC-28
    """
    with pytest.raises(ConfigError, match=r"--set: can: the image with the CANopen node has no room"):
        load_scenario(ROOT / "scenarios" / "vector" / "ipm-injection.toml", ("can={}",))
    with pytest.raises(ConfigError, match=r"can\.bit_rate_kbit_per_s: 800 is none of"):
        load_scenario(ROOT / "scenarios" / "demo.toml", ("can={bit_rate_kbit_per_s=800}",))


def test_the_compiler_is_the_one_of_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Verilator's rules set compiler and linker: the environment's variable reaches them through make's words."""
    monkeypatch.setenv("CXX", "my-c++ -m64")
    env = tool_environment()
    rules = f"include {env['VERILATOR_ROOT']}/include/verilated.mk\nshow:\n\t@echo '$(CXX)|$(LINK)'\n"
    (tmp_path / "Makefile").write_text(rules)

    def shown(words: list[str]) -> str:
        line = ["make", "-s", "-C", str(tmp_path), "show", *words]
        return subprocess.run(line, env=env, capture_output=True, text=True, check=True).stdout.strip()

    assert shown(compiler_words(env)) == "my-c++ -m64|my-c++ -m64"
    assert "my-c++" not in shown([])
    monkeypatch.delenv("CXX")
    assert compiler_words(tool_environment()) == []
