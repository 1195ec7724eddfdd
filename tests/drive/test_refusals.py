# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What `fluxlock.drive` refuses before a simulator starts, and names of register fields."""

from __future__ import annotations

import inspect
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_scenario
from fluxlock.drive import Bench, Drive, bench, run_tests
from fluxlock.drive.bench import check_signals, check_tests, find_scenario, own_folder
from fluxlock.drive.drive import FAULT_DETAILS
from fluxlock.drive.registers import field_name
from fluxlock.firmware.host import register_offsets
from fluxlock.plant import Plant
from fluxlock.plant.plant import FAULT_KINDS

DEMO = ROOT / "scenarios" / "demo.toml"


@pytest.mark.parametrize(
    ("signal", "said"),
    [
        ("trip_o", "is no signal; write module.variable"),
        ("fl_trap.trip_o", "there is no module fl_trap"),
        ("fl_trip.trapped_o", "module fl_trip has no variable trapped_o"),
        ('fl_trip.a" -var "b', "is no signal"),
    ],
)
def test_wrong_signals(signal: str, said: str) -> None:
    """A signal that the chip does not have is refused before anything is built.

    Verifies: DRV-07
    """
    with pytest.raises(ConfigError) as error:
        check_signals([signal])
    assert said in str(error.value) and "\n" not in str(error.value)
    check_signals(["fl_trip.trip_o", "fl_trip.*_o"])


def test_wrong_scenarios() -> None:
    """A file that is not there, a wrong override, overrides of an object.

    Verifies: DRV-07
    """
    with pytest.raises(ConfigError, match=r"my-motor\.toml"):
        Bench("my-motor.toml")
    with pytest.raises(ConfigError, match=r"my-motor\.toml") as error:
        run_tests("my-motor.toml", __file__)
    assert f"looked in {Path(__file__).parent} and {Path.cwd()}" in str(error.value)
    assert len(error.traceback) == 2, "this test, and run_tests, which pytest leaves out"
    with pytest.raises(ConfigError, match="carier_hz"):
        Bench(DEMO, "drive.carier_hz=20_000")
    with pytest.raises(ConfigError, match="belong to a file; give them to load_scenario"):
        Bench(load_scenario(DEMO), "drive.carrier_hz=20_000")


OWN_TESTS = """
import cocotb
from fluxlock.drive import drive_test

@cocotb.test()
async def plain(dut): ...

@drive_test(name="named")
async def function(drive): ...

@cocotb.test()
@cocotb.parametrize(a=[1, 2])
async def pairs(dut, a): ...
"""


def test_wrong_tests(tmp_path: Path) -> None:
    """A test that a module does not have, which would pass as none; those that it has by the names that cocotb takes.

    Verifies: DRV-07
    """
    vector = ROOT / "cocotb_tests" / "drive" / "test_vector.py"
    with pytest.raises(ConfigError, match=r"test_vector\.py: nosuch: no such test; there is \w+, "):
        check_tests(vector, ["nosuch"])
    with pytest.raises(ConfigError, match="Path: no such test"):  # a name of the module, but none of a test
        check_tests(vector, ["Path"])
    check_tests(vector, [])
    (tmp_path / "test_own.py").write_text(OWN_TESTS)
    for known in ("plain", "test_own.plain", "named", "pairs", "pairs/a=1", "pl.*"):
        check_tests(tmp_path / "test_own.py", [known])
    with pytest.raises(ConfigError, match="function: no such test; there is plain, named, pairs"):
        check_tests(tmp_path / "test_own.py", ["function"])


def test_signal_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """One signal without a list around it is no list of its letters.

    Verifies: DRV-07
    """
    monkeypatch.setattr(bench, "generate_registers", lambda: None)
    with pytest.raises(ConfigError, match=r"signals: fl_trap\.trip_o: there is no module fl_trap"):
        Bench(DEMO, signals="fl_trap.trip_o")


def test_scenarios_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file beside the test's is found wherever pytest runs, before one of the current folder and a shipped one.

    Verifies: DRV-02
    """
    beside, current = tmp_path / "tests", tmp_path / "current"
    for folder in (beside, current):
        folder.mkdir()
        (folder / "spindle.toml").touch()
    (current / "other.toml").touch()
    monkeypatch.chdir(current)
    module = beside / "test_spindle.py"
    assert find_scenario("spindle.toml", module) == beside / "spindle.toml"
    assert find_scenario("other.toml", module) == current / "other.toml"
    assert find_scenario("scenarios/demo.toml", module) == DEMO
    assert find_scenario("spindle.toml", "package.test_spindle") == current / "spindle.toml"
    assert find_scenario(DEMO, module) == DEMO


def test_folders_of_simulations(tmp_path: Path) -> None:
    """A bench gets the same folder each time, empty; a second one at that time gets another.

    Verifies: DRV-08
    """
    with ExitStack() as first, ExitStack() as second:
        folders = [own_folder(tmp_path / "spindle-1.5", held) for held in (first, second)]
        assert [folder.name for folder in folders] == ["spindle-1.5", "spindle-1.5-1"]
        folders[0].mkdir()
        (folders[0] / "results.xml").touch()
    with ExitStack() as held:
        assert own_folder(tmp_path / "spindle-1.5", held) == folders[0] and not folders[0].exists()


def test_a_runner_of_ones_own_keeps_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody holds the bench whose arguments a runner got: its folder is still not emptied by the next one.

    Verifies: DRV-08
    """

    @dataclass(frozen=True)
    class Plan:
        folder: Path
        actions: tuple[()] = ()

        def save(self) -> Path:
            return self.folder / "plan"

    def prepare(_scenario: object, folder: Path, _seed: int) -> Plan:
        folder.mkdir(parents=True)
        return Plan(folder)

    monkeypatch.setattr(bench, "BUILD", tmp_path)
    monkeypatch.setattr(bench, "generate_registers", lambda: None)
    monkeypatch.setattr(bench, "chip_of", lambda _scenario, signals: SimpleNamespace(key="", executable=tmp_path))
    monkeypatch.setattr(bench, "prepare", prepare)
    names = [Path(Bench(DEMO).arguments()["test_dir"]).name for _ in range(2)]
    assert names[1] == f"{names[0]}-1"
    assert [Bench(DEMO, seed=2).folder for _ in range(2)] == [Bench(DEMO, seed=2).folder] * 2


def test_faults_are_those_of_the_plant() -> None:
    """`Drive.fault` knows each kind of the plant, and what it takes.

    Verifies: DRV-01
    """
    assert set(FAULT_DETAILS) == set(FAULT_KINDS)
    there = inspect.signature(Plant.inject_fault).parameters
    assert {name for names in FAULT_DETAILS.values() for name in names} == set(there) - {"self", "kind", "phases"}
    for kind in FAULT_KINDS:
        assert f"`{kind}`" in str(Drive.fault.__doc__)


def test_names_of_fields() -> None:
    """Fields have the names of the register reference: block, register with its index, field.

    Verifies: DRV-01
    """
    registers = register_offsets()
    inside = "fl_soc__DOT__g_six_step__DOT__u_six_step__DOT__u_{}__DOT__u_regs__DOT__field_storage_{}"
    names = {
        inside.format("pwm", "period_cycles"): "pwm.period.cycles",
        inside.format("comm", "hall_offset_3_interval_q16"): "comm.hall_offset[3].interval_q16",
        inside.format("hall", "map_code0"): "hall.map.code0",
        "fl_soc__DOT__u_safety__DOT__u_regs__DOT__field_storage_brake_level_on_lsb": "safety.brake_level.on_lsb",
        "fl_soc__DOT__u_safety__DOT__u_regs__DOT__field_storage_brake_enable": "safety.brake.enable",
        "fl_soc__DOT__u_safety__DOT__u_trip__DOT__tripped_o": None,
    }
    assert {name: field_name(name, registers) for name in names} == names
