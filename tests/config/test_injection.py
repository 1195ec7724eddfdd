# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Square-wave injection in scenario files: what is refused, and what the firmware is told."""

from __future__ import annotations

import cmath
import math
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_scenario
from fluxlock.cosim.parameters import parameter_block
from fluxlock.firmware.schema import HEADER_WORDS
from fluxlock.generate.memory import BLOCK_MAX_BYTES, STATE_OFFSET

SCENARIOS = ROOT / "scenarios"
TIAN, YU = SCENARIOS / "five-phase" / "tian.toml", SCENARIOS / "five-phase" / "yu.toml"
PRINTED = SCENARIOS / "five-phase" / "tian-printed.toml"
IPM, ENCODER = SCENARIOS / "vector" / "ipm-injection.toml", SCENARIOS / "vector" / "encoder.toml"
KEY = "drive.vector.injection"


@pytest.mark.parametrize(
    ("path", "overrides", "expected"),
    [
        (TIAN, [f"{KEY}.period=15"], "injection.period: 15 must be even"),
        (YU, [f"{KEY}.period=8"], 'injection.period: 8 must be 4 with method = "separator"'),
        (IPM, [f"{KEY}.third_ratio=0.1"], f"{KEY}.third_ratio: belongs to a motor of five phases"),
        (TIAN, ["drive.vector.weakening=true"], "vector.weakening: does not go with [drive.vector.injection]"),
        (IPM, ["drive.vector.angle=encoder"], 'vector.angle: must be "observer" with [drive.vector.injection]'),
        (YU, ["drive.vector.observer_every=2"], '"separator" needs drive.vector.observer_every = 1'),
        (TIAN, [f"{KEY}.amplitude_v=110"], f"{KEY}.amplitude_v: 110 V is not below the largest voltage, 95.4 V"),
        (IPM, [f"{KEY}.period=40"], "over 40 updates makes 15 A, beside drive.current_limit_a permitted up to 9 A"),
        (IPM, ["motor.inductance_q_h=0.1e-3"], "inductance_q_h: 0.0001 H is not above inductance_h (0.0002 H)"),
        (YU, ["drive.vector.handover_rpm=1600"], "handover_rpm: 1600 r/min is above max_speed_rpm of the motor"),
        (YU, ["drive.vector.handover_rpm=10"], "handover_rpm: 10 r/min has an EMF of 924 mV, less than 10 steps"),
        (YU, [f"{KEY}.search_current_a=7.5"], f"{KEY}.search_current_a: 7.5 A is above drive.current_limit_a (7 A)"),
        (
            YU,
            [f"{KEY}.search_current_a=7"],
            "legs of one side carry 11.3 A together at some angles; permitted below 5.87",
        ),
        (TIAN, ["drive.method=six-step"], "phases: 5 needs drive.method"),
    ],
)
def test_refused(path: Path, overrides: list[str], expected: str) -> None:
    """Each by its key, in one line.

    Verifies: INJC-09
    """
    with pytest.raises(ConfigError) as caught:
        load_scenario(path, overrides)
    lines = [f"{p.key}: {p.message}" for p in caught.value.problems]
    assert any(expected in line for line in lines), lines


def test_search_rise_beyond_the_block() -> None:
    """A slope that no parameter holds is charged to its key, before the block is packed.

    Verifies: INJC-09
    """
    with pytest.raises(ConfigError) as caught:
        load_scenario(IPM, [f"{KEY}.search_rise_a_per_s=1e7"])
    assert [p.key for p in caught.value.problems] == [f"{KEY}.search_rise_a_per_s"]


def test_no_search() -> None:
    """Without a search its current does not matter: a driven shaft without current.

    Verifies: INJC-09
    """
    low = "drive.current_limit_a=0.05"
    with pytest.raises(ConfigError, match="search_current_a"):
        load_scenario(YU, [low])
    load_scenario(YU, [low, f"{KEY}.search=false"])


def test_only_the_cause() -> None:
    """A limit of the current beyond the trip is named itself, not the wave that would have no room beside it.

    Verifies: INJC-09
    """
    with pytest.raises(ConfigError) as caught:
        load_scenario(IPM, ["drive.current_limit_a=30"])
    assert [problem.key for problem in caught.value.problems] == ["drive.current_limit_a"]


@pytest.mark.parametrize("path", [TIAN, YU, IPM])
def test_parameters(path: Path) -> None:
    """Wave, ratio of the inductances and expected current by hand; the whole block fits.

    Verifies: INJC-09
    """
    scenario = load_scenario(path)
    block = parameter_block(scenario)
    motor, spec = scenario.motor, scenario.drive.vector.injection
    assert spec is not None and motor.inductance_q_h is not None
    sensing = scenario.inverter.sensing
    clocks = block.number("vector_sample_cycles")
    assert block.number("injection_rate_turn_q36") * clocks * spec.period == pytest.approx(2**36, rel=1e-5)
    assert block.number("injection_v_q17") / 2**17 * sensing.voltage_full_scale_v == pytest.approx(
        spec.amplitude_v, rel=1e-4
    )
    l_d, l_q = motor.inductance_h[0], motor.inductance_q_h
    if motor.third is not None:
        l_d -= motor.third.mutual_h**2 / motor.third.inductance_d_h
        l_q -= motor.third.mutual_h**2 / motor.third.inductance_q_h
    assert block.gain("injection_ratio") == pytest.approx(l_q / (l_q - l_d))
    # Triangle of the current, its fundamental with I/Q.
    peak_a = spec.amplitude_v / l_d * clocks / 50e6 * spec.period / 4
    shown = peak_a * (8 / math.pi**2 if spec.method == "iq" else 1.0)
    assert block.number("injection_expected_i_q21") == pytest.approx(
        shown / sensing.current_full_scale_a * 2**21, rel=1e-4
    )
    assert STATE_OFFSET < len(block.pack()) <= BLOCK_MAX_BYTES


@pytest.mark.parametrize("regulated", [False, True])
def test_expected_behind_a_filter(regulated: bool) -> None:
    """Lock-in and conventional method: what they show of the current of R and L_d, with regulators of A beside it.

    Verifies: INJC-09
    """
    removed = f"{KEY}.remove={'false' if regulated else 'true'}"
    scenario = load_scenario(PRINTED, [removed])
    motor, spec = scenario.motor, scenario.drive.vector.injection
    assert spec is not None and motor.third is not None
    r_ohm = motor.resistance_ohm[0]
    l_h = motor.inductance_h[0] - motor.third.mutual_h**2 / motor.third.inductance_d_h
    ts_s = parameter_block(scenario).number("vector_sample_cycles") / 50e6
    # A voltage acts from one to two samples after it; the regulator's zero lies on the winding's pole.
    kept, gain = math.exp(-r_ohm / l_h * ts_s), 2 * math.pi * scenario.drive.vector.bandwidth_hz * l_h
    i = before = u = integral = 0.0
    total = 0j
    periods, settle = 60, 40
    for k in range(periods * spec.period):
        i, before = kept * i + (1 - kept) / r_ohm * before, u
        wave = spec.amplitude_v if k % spec.period < spec.period / 2 else -spec.amplitude_v
        integral -= gain * r_ohm / l_h * ts_s * i
        u = wave + (integral - gain * i if regulated else 0.0)
        if k >= settle * spec.period:
            total += i * cmath.exp(-2j * math.pi * (k - 1) / spec.period)
    fundamental = total * 2 / ((periods - settle) * spec.period)
    # Of a wave that begins with its sine, a sample after it was computed, an inductance has -cos.
    seen = {"lock-in": abs(fundamental) * 2 / math.pi, "conventional": -fundamental.real / 2}
    for method, value in seen.items():
        block = parameter_block(load_scenario(PRINTED, [removed, f"{KEY}.method={method}"]))
        expected = block.number("injection_expected_i_q21") / 2**21 * scenario.inverter.sensing.current_full_scale_a
        assert expected == pytest.approx(value, rel=0.06), method


def test_speed_of_the_hand_over() -> None:
    """The EMF takes over at it, within 20 ms, and gives back at 0.6 of it; beyond it the wave takes no voltage.

    Verifies: INJC-11
    """
    assert parameter_block(load_scenario(YU)).number("injection_fade_q16") == 0
    scenario = load_scenario(YU, ["drive.vector.handover_rpm=450"])
    block = parameter_block(scenario)
    tick_s = block.number("tick_cycles") / 50e6
    assert block.number("injection_fade_q16") == pytest.approx(2**16 * tick_s / 0.02, abs=0.5)
    turns = 450 / 60 * 9 / 50e6
    for name, share in (("vector_handover_turn_q36", 1.0), ("vector_back_turn_q36", 0.6)):
        assert block.number(name) == pytest.approx(share * turns * 2**36, abs=0.5)
    # It takes 145 V: of the circle of 153 V the wave leaves 140 V.
    needs = ["event[0]={at_s=0.002,speed_rpm=1300}", "load.constant_nm=11", "window=[]", "expect=[]"]
    load_scenario(YU, ["drive.vector.handover_rpm=450", "inverter.supply_v=300", *needs])
    with pytest.raises(ConfigError, match="beside drive\\.vector\\.injection"):
        load_scenario(YU, ["inverter.supply_v=300", *needs])


def test_none() -> None:
    """A vector drive without injection is told nothing of one.

    Verifies: INJC-09
    """
    block = parameter_block(load_scenario(ENCODER))
    assert "injection" not in block.values
    names = [p.name for p in block.schema.parameters]
    first = block.schema.offsets[names[names.index("injection")]]
    assert block.words()[first] == 0
    assert len(block.pack()) == 4 * (HEADER_WORDS + first), "the block ends before it"
