# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""From the checked files to the records of plant and firmware."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_scenario
from fluxlock.config.scenario import Event
from fluxlock.config.vector_design import told_machine
from fluxlock.cosim import convert
from fluxlock.cosim.convert import plant_params
from fluxlock.cosim.parameters import check_parameters, parameter_block
from fluxlock.cosim.plan import Action
from fluxlock.plant import EncoderParams

DEMO = ROOT / "scenarios" / "demo.toml"


def test_wrong_motor_values_reach_the_firmware_only() -> None:
    """The factors of drive.motor_error scale what the parameter block is made from; the plant stays.

    Verifies: FRONT-30
    """
    right = load_scenario(DEMO)
    factors = {"resistance": 1.2, "inductance": 0.8, "flux": 1.1, "inertia": 0.7}
    wrong = load_scenario(DEMO, [f"drive.motor_error.{name}={factor}" for name, factor in factors.items()])
    before, after = told_machine(right), told_machine(wrong)
    assert after.winding_ohm == pytest.approx(1.2 * before.winding_ohm)
    assert after.inductance_h == pytest.approx(0.8 * before.inductance_h)
    assert after.psi_vs == pytest.approx(1.1 * before.psi_vs)
    assert plant_params(wrong, 1, ()) == plant_params(right, 1, ())
    blocks = [parameter_block(s).values for s in (right, wrong)]
    assert {name for name in blocks[0] if blocks[0][name] != blocks[1][name]} >= {
        *("emf", "zcd_peak", "resistance_high", "start_accel_rpm_q20")
    }


def test_sampling_once_a_carrier() -> None:
    """Continuous sampling is the default; once a carrier falls into the shortest pulse, settled.

    Verifies: FW-35
    """
    assert load_scenario(DEMO).drive.zcd.sampling == "continuous"
    values = parameter_block(load_scenario(DEMO, ["drive.zcd.sampling=carrier"])).values
    assert values["sample_mode"] == 3 and parameter_block(load_scenario(DEMO)).values["sample_mode"] == 1
    offset, settle, least = (values[name] for name in ("sample_offset_cycles", "zcd_settle_cycles", "least_on_cycles"))
    assert isinstance(offset, int) and isinstance(settle, int) and isinstance(least, int)
    assert settle < offset < least
    blank = values["zcd_blank_cycles"]
    assert isinstance(blank, int) and blank > offset


def test_values_that_no_parameter_holds_are_named() -> None:
    """Machine values beyond the firmware's formats: one message with file and parameter.

    Verifies: FRONT-02
    """
    scenario = load_scenario(DEMO, ["mechanics.mode=locked", "motor.resistance_ohm=100"])
    with pytest.raises(
        ConfigError,
        match=r"^--set: motor.resistance_ohm: 100 Ohm does not fit the firmware \(parameter align_v_q25: .* is outside",
    ) as caught:
        parameter_block(scenario)
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize("name", ["demo", "six-step/patterns", "six-step/hall", "six-step/highest-speed"])
def test_gains_that_no_parameter_holds_are_named(name: str) -> None:
    """The largest permitted inertia: the key with its value, and what else may be changed.

    Verifies: FRONT-02
    """
    scenario = ROOT / "scenarios" / f"{name}.toml"
    heavy = load_scenario(scenario, ["motor.inertia_kgm2=10"])
    with pytest.raises(ConfigError) as caught:
        parameter_block(heavy)
    (line,) = map(str, caught.value.problems)
    assert line.startswith("--set: motor.inertia_kgm2: 10 kg*m^2 does not fit the firmware (parameter speed_")
    assert "is too large, largest 1.342e+08); change it or motor.psi_vs (" in line
    assert "drive.speed_bandwidth_hz (" in line


def test_current_bandwidth_is_not_cut_off() -> None:
    """What the key permits reaches the firmware whole: a tick's share of the pole at the highest and half of it.

    Verifies: FRONT-04
    """
    highest, half = (
        parameter_block(load_scenario(DEMO, [f"drive.current_bandwidth_hz={hz}"])).number("current_wt_q16")
        for hz in (185, 92.5)
    )
    assert highest == pytest.approx(2 * math.pi * 185 * 1e-4 * 2**16, abs=0.5)
    assert half == pytest.approx(highest / 2, abs=1)


def test_parameters_from_a_file_name_it(tmp_path: Path) -> None:
    """A value that does not fit is charged to the file that states it, by its key there.

    Verifies: FRONT-02
    """
    motor = tmp_path / "heavy.toml"
    text = (ROOT / "motors" / "motor-1.toml").read_text(encoding="utf-8")
    motor.write_text(text.replace("inertia_kgm2 = 5e-7", "inertia_kgm2 = 10.0"), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        parameter_block(load_scenario(DEMO, [f"motor={motor}"]))
    assert str(caught.value).startswith(f"{motor}: inertia_kgm2: 10 kg*m^2 does not fit the firmware")


def test_carriers_of_console_lines() -> None:
    """`set carrier_hz` as the firmware judges it: its period from four least pulses (80 clocks) to the longest carrier.

    Verifies: FRONT-03, FRONT-04
    """

    def refused(hz: int) -> str:
        scenario = load_scenario(DEMO, [f'event=[{{at_s=0.1,command="set carrier_hz {hz}"}}]'])
        try:
            check_parameters(scenario)
        except ConfigError as error:
            return str(error)
        return ""

    block = parameter_block(load_scenario(DEMO))
    least, most = 4 * block.number("min_pulse_cycles"), block.number("carrier_longest_cycles")

    def firmware_takes(hz: int) -> bool:
        return least <= (50_000_000 + hz // 2) // hz <= most

    limits = [hz for hz in range(1, 700_000) if firmware_takes(hz) != firmware_takes(hz + 1)]
    assert len(limits) == 2
    low, high = limits[0] + 1, limits[1]
    assert refused(low) == refused(high) == ""
    for hz in (1, low - 1, high + 1, 2_000_000_000):
        permitted = f"{hz} Hz is not a carrier of this drive, permitted {low} to {high} Hz"
        assert refused(hz) == f"--set: event[0].command: {permitted}"


def test_salient_machine() -> None:
    """The plant gets both inductances and the encoder, the six-step firmware the mean, and its parameters compile.

    Verifies: FRONT-42, FRONT-43
    """
    scenario = ROOT / "scenarios" / "own-spindle.toml"
    ipm = [f"motor={ROOT / 'motors' / 'ipm-4pp.toml'}", "event[0].speed_rpm=3000", "expect=[]"]
    salient = load_scenario(scenario, ipm)
    machine = plant_params(salient, 1, ()).machine
    assert (machine.l_h, machine.l_q_h) == ((0.2e-3,) * 3, 0.4e-3)
    assert machine.encoder == EncoderParams(1024, index=True, offset_deg=37.0)
    assert plant_params(load_scenario(scenario), 1, ()).machine.encoder is None
    assert told_machine(salient).inductance_h == pytest.approx(0.3e-3)
    compiled = parameter_block(salient).values
    mean, other = (
        load_scenario(scenario, [*ipm, f"motor.inductance_h={henry}", f"motor.inductance_q_h={henry}"])
        for henry in (0.3e-3, 0.2e-3)
    )
    assert compiled == parameter_block(mean).values
    assert compiled != parameter_block(other).values


def test_a_hall_glitch_and_a_dead_core_are_made_of_pins_and_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """The glitch inverts an input for 1 ms; the core's first instruction of its interrupt is another one for 5 ms.

    Verifies: FRONT-30
    """
    scenario = load_scenario(DEMO)
    monkeypatch.setattr(convert, "entry", lambda image, function: 0x100)
    monkeypatch.setattr(convert, "rewrite", lambda image, at, word, cycle: (Action(cycle, "memory", {"address": at}),))
    event = Event.model_validate({"at_s": 0.1, "fault": {"kind": "hall_glitch"}})
    (glitch,) = convert.actions_of(scenario, event, Path())
    assert glitch == Action(5_000_000, "pin", {"pin": "hall_i[0]", "cycles": 50_000, "level": None})
    event = Event.model_validate({"at_s": 0.1, "fault": {"kind": "dead_core"}})
    cycles = [action.cycle for action in convert.actions_of(scenario, event, Path())]
    assert cycles == [5_000_000, 5_250_000]
