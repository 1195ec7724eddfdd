# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Injection on machines that nobody tuned it for: the right way, or a named fault."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_scenario
from fluxlock.config.vector_timing import vector_timing
from fluxlock.native.injection_run import InjectionRun
from tests.injection.injection_bench import SCENARIOS, scenario_of

RIGHT = ("compressor", "ebike", "ferrite-synrm", "five-phase-ipm", "gimbal", "traction")
REFUSED = ("five-phase-surface", "servo", "surface")
YU, IPM = ROOT / "scenarios" / "five-phase" / "yu.toml", ROOT / "scenarios" / "vector" / "ipm-injection.toml"
ONCE = "drive.start.restart_retries=0"
NAMED_S, OPENED_S, WRONG_DEG, SEARCHED_DEG, RMS_DEG, POLE_DEG = 0.05, 0.1, 90.0, 10.0, 3.0, 30.0


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.parametrize("direction", [1, -1])
def test_starts_the_right_way(name: str, direction: int) -> None:
    """From three rest angles with what the files leave out by rule: right pole, quiet rotor, right angle.

    Verifies: INJC-15
    """
    scenario = scenario_of(name)
    rpm = next(event.speed_rpm for event in scenario.event if event.speed_rpm is not None)
    for theta_deg in (17.0, 143.0, 265.0):
        life = InjectionRun(scenario, theta_deg=theta_deg, target_rpm=direction * rpm)
        assert life.start(), (theta_deg, life.fault)
        life.run(0.2)
        assert life.fault == "none", theta_deg
        assert life.searched_deg() <= SEARCHED_DEG, theta_deg
        assert life.rms_deg(life.found_s + 0.05) <= RMS_DEG, theta_deg
        assert life.wrong_deg(life.found_s) <= SEARCHED_DEG, theta_deg


@pytest.mark.parametrize("name", REFUSED)
def test_refused_before_building(name: str) -> None:
    """Machines whose search would not tell the poles apart: one line that says what would.

    Verifies: INJC-09
    """
    with pytest.raises(ConfigError) as caught:
        load_scenario(SCENARIOS / f"{name}.toml")
    (problem,) = caught.value.problems
    assert problem.key == "drive.vector.injection.search_current_a"
    assert "of the search change the HF current by" in problem.message
    assert "permitted from 1.2 % on" in problem.message


@pytest.mark.parametrize("name", RIGHT)
def test_wrong_pole_is_named(name: str) -> None:
    """A rotor half a turn from where the drive takes it to be: named in time, before it has turned far.

    Verifies: INJC-15
    """
    life = InjectionRun(scenario_of(name, "drive.vector.injection.search=false", ONCE), theta_deg=178.0)
    assert life.start()
    life.run(0.2)
    assert life.fault == "angle_lost"
    assert life.fault_s - life.found_s <= NAMED_S
    assert life.wrong_deg(life.found_s) <= WRONG_DEG


# The traction machine trips by over-current before a look of the supervision: that name, and not the lost angle's.
@pytest.mark.parametrize("name", [name for name in RIGHT if name != "traction"])
@pytest.mark.parametrize("share", [0.05, 0.2])
def test_rotor_that_jumps_by_half_a_turn(name: str, share: float) -> None:
    """At speed: the lost angle has its name in time, and is never an overspeed.

    Verifies: INJC-15
    """
    scenario = scenario_of(name, ONCE)
    life = InjectionRun(scenario, target_rpm=share * scenario.motor.max_speed_rpm)
    assert life.start()
    life.run(0.35)
    jumped_s = life.chip.now
    life.chip.turn(np.pi)
    life.run(0.1)
    assert life.fault == "angle_lost"
    assert life.fault_s - jumped_s <= NAMED_S
    assert life.wrong_deg(jumped_s) <= WRONG_DEG


@pytest.mark.parametrize(
    ("name", "share"), [("compressor", 0.0), ("compressor", 0.05), ("ebike", 0.0), ("ebike", 0.05), ("ebike", 0.2)]
)
def test_rotor_that_jumps(name: str, share: float) -> None:
    """By a sixth and a third of a turn, also where the drive holds the rotor still: followed, or named, in time.

    Verifies: INJC-15
    """
    scenario = scenario_of(name, ONCE)
    for jump_deg in (60.0, 120.0, -60.0, -120.0):
        life = InjectionRun(scenario, target_rpm=(share or 0.05) * scenario.motor.max_speed_rpm)
        assert life.start()
        life.run(0.2)
        if share == 0.0:
            life.aim(0)
        life.run(0.25)
        jumped_s = life.chip.now
        life.chip.turn(np.radians(jump_deg))
        life.run(0.15)
        if life.fault == "none":
            assert np.abs(life.window(jumped_s + NAMED_S)["error_deg"]).max() < POLE_DEG, jump_deg
        else:
            assert life.fault == "angle_lost"
            assert life.fault_s - jumped_s <= NAMED_S, jump_deg
        if share > 0.0:
            assert life.wrong_deg(jumped_s) <= WRONG_DEG, jump_deg


@pytest.mark.parametrize("held_s", [0.5, 0.503, 0.506])
@pytest.mark.parametrize("name", ["compressor", "ebike", "gimbal"])
def test_rotor_that_is_held_jumps_by_half_a_turn(name: str, held_s: float) -> None:
    """Neither wave nor EMF shows that where it stands: the current that looks at the poles does, and none too early.

    The jump comes at several places of a look, which noise in the EMF must not end.

    Verifies: INJC-17
    """
    scenario = scenario_of(name, ONCE)
    life = InjectionRun(scenario, target_rpm=0.05 * scenario.motor.max_speed_rpm)
    assert life.start()
    life.run(0.2)
    life.aim(0)
    life.run(held_s)
    assert life.fault == "none"
    assert life.rms_deg(life.chip.now - 0.2) <= RMS_DEG
    jumped_s = life.chip.now
    life.chip.turn(np.pi)
    life.run(0.1)
    assert life.fault == "angle_lost"
    assert life.fault_s - jumped_s <= NAMED_S


@pytest.mark.parametrize("file", [IPM, YU, *RIGHT])
@pytest.mark.parametrize("phase", [0, 1, 2])
def test_phase_that_is_open_before_the_start(file: Path | str, phase: int) -> None:
    """The search's two waves tell it from a salient rotor: its name, and the rotor has not moved.

    Verifies: INJC-20
    """
    scenario = load_scenario(file) if isinstance(file, Path) else scenario_of(file)
    life = InjectionRun(scenario)
    life.chip.open_phase(phase)
    assert not life.start()
    assert life.fault == "open_phase"
    assert life.chip.fw.command("get open_phases")[0] == f"open_phases {'ABC'[phase]}"
    assert life.searched_deg() <= SEARCHED_DEG


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.parametrize("share", [0.02, 0.3])
@pytest.mark.parametrize("phase", [0, 1])
def test_phase_that_opens_while_the_drive_runs(name: str, share: float, phase: int) -> None:
    """Whatever shows first, its name or that of what it does to the HF current, the drive does not go on as if it ran.

    Four phases of five carry the torque on for a while.

    Verifies: INJC-20
    """
    scenario = scenario_of(name)
    life = InjectionRun(scenario, target_rpm=share * scenario.motor.max_speed_rpm)
    assert life.start()
    life.run(0.3)
    assert life.fault == "none"
    opened_s = life.chip.now
    life.chip.open_phase(phase)
    ended_s: list[float] = []

    def each(run: InjectionRun) -> None:
        if run.chip.fw.state != "running":
            ended_s.append(run.chip.now)

    life.run(0.5, each)
    assert ended_s[0] - opened_s <= (OPENED_S if scenario.motor.phases == 3 else 2 * OPENED_S)
    names = ("open_phase", "no_saliency", "injection_signal", "injection_noise", "phase_over_current")
    # A rotor that still coasts is not searched yet.
    assert life.fault in names or life.chip.fw.state == "starting", (life.fault, life.chip.fw.state)
    assert life.wrong_deg(opened_s) <= WRONG_DEG


@pytest.mark.parametrize("late_every", [2, 3, 4, 5])
def test_late_steps_keep_their_turns(late_every: int) -> None:
    """Every so many sets miss their update: no turn of speed, limits and supervision is left out for ever.

    Verifies: INJC-19
    """
    life = InjectionRun(load_scenario(IPM))
    life.chip.hardware.late_every = late_every
    assert life.start()
    life.run(0.4)
    rows = life.window(life.chip.now - 0.05)
    assert life.fault == "none"
    assert abs(rows["rpm"].mean() - 400.0) < 20.0
    assert np.abs(rows["error_deg"]).max() < 5.0


def test_idle_rotor_is_searched_again() -> None:
    """A place that was known counts for the first start alone: gates off, the rotor may be elsewhere.

    Verifies: INJC-17
    """
    life = InjectionRun(scenario_of("ebike", "drive.vector.injection.search=false"), theta_deg=0.0)
    assert life.start()
    life.run(0.1)
    assert life.chip.fw.command("stop") == ["ok"]
    life.run(0.3)
    life.chip.turn(np.pi)
    assert life.chip.fw.command("start") == ["ok"]
    life.run(0.4)
    assert life.fault == "none" and life.chip.fw.state == "running"
    assert life.rms_deg(life.chip.now - 0.1) <= RMS_DEG


def test_lost_angle_is_searched_again() -> None:
    """With restarts left the drive searches once more, and the log keeps the name.

    Verifies: INJC-15
    """
    life = InjectionRun(scenario_of("ebike"))
    assert life.start()
    life.run(0.1)
    life.chip.turn(np.pi)
    life.run(0.6)
    assert life.fault == "none"
    assert life.rms_deg(life.chip.now - 0.1) <= RMS_DEG
    assert any("angle_lost" in line for line in life.chip.fw.command("faults"))


@pytest.mark.parametrize("name", ["compressor", "ebike", "gimbal"])
@pytest.mark.parametrize("inertia", [0.2, 1.0])
def test_no_wrong_pole_from_any_angle(name: str, inertia: float) -> None:
    """Seventeen rest angles, also with a rotor five times lighter than the file says: right, or not sure by name.

    Verifies: INJC-15
    """
    scenario = scenario_of(name, ONCE)
    light = scenario.motor.model_copy(update={"inertia_kgm2": inertia * scenario.motor.inertia_kgm2})
    for theta_deg in np.arange(17) * 360.0 / 17 + 3.0:
        life = InjectionRun(scenario, theta_deg=float(theta_deg), machine=light)
        if life.start():
            assert abs(life.chip.error_deg) < POLE_DEG, theta_deg
        else:
            assert life.fault in {"polarity_unsure", "injection_signal"}, theta_deg


@pytest.mark.parametrize("factor", [0.85, 1.15])
def test_saliency_is_that_of_the_machine(factor: float) -> None:
    """A file whose inductances are off by 15 % ends in no fault: the search has measured both axes.

    Verifies: INJC-15
    """
    life = InjectionRun(load_scenario(YU, [f"drive.motor_error.inductance={factor}"]))
    assert life.start()
    life.run(0.2)
    assert life.fault == "none"
    assert life.rms_deg(life.found_s + 0.05) <= RMS_DEG


@pytest.mark.parametrize("name", RIGHT)
def test_control_step_has_its_time(name: str) -> None:
    """By rule a control tick is no shorter than 4700 clocks, for the chip's step takes 3500 in the mean.

    Verifies: INJC-16
    """
    scenario = scenario_of(name)
    assert vector_timing(scenario.drive, scenario.inverter).tick_cycles >= 4700


def test_heavy_file() -> None:
    """Twenty times the inertia: given bandwidths are refused, by rule the same machine runs.

    Verifies: INJC-16
    """
    heavy = "motor.inertia_kgm2=1.6e-3"
    with pytest.raises(ConfigError) as caught:
        load_scenario(IPM, [heavy])
    assert any("closes a loop through the demodulator, S = 6" in p.message for p in caught.value.problems)
    vector = 'drive.vector={update="single", observer_every=2, injection={method="iq", amplitude_v=6, period=8}}'
    life = InjectionRun(load_scenario(IPM, [heavy, vector]))
    assert life.start()
    life.run(0.3)
    assert life.fault == "none"
    assert life.rms_deg(0.15) <= RMS_DEG


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        (["drive.vector.pll_hz=80", "drive.vector.speed_hz=20"], "20 Hz is too fast for drive.vector.pll_hz = 80 Hz"),
        (["drive.vector.pll_hz=500"], "500 Hz is too fast for a wave of 2500 Hz, permitted up to 417 Hz"),
        (["event=[{at_s=0.01, speed_rpm=3500}]"], "wave of 2500 Hz up to a tenth of it, 3000 r/min"),
        (["drive.vector.injection.amplitude_v=0.02"], "less than 2 steps of the converter"),
        (["motor.saturation.plus=0.07", "motor.saturation.minus=-0.035"], "is not below minus"),
        (["drive.vector.injection.search_current_a=2"], "permitted from 1.2 % on, 4.11 A"),
        (
            ["drive.vector.injection.search_current_a=17.5", "inverter.protection.phase_current_a=20"],
            "beside drive.current_limit_a permitted up to 2 A",
        ),
        (
            ["inverter.sensing.noise_lsb=20"],
            "12.2 deg rms of noise in each angle, permitted up to 5.7 deg, from 12.8 V",
        ),
        (
            ["drive.vector.injection.speed_filter_hz=0.1"],
            "too slow for a speed loop of 6.67 Hz, permitted from 6.67 Hz",
        ),
        (["drive.vector.gamma=1"], "regulators 1.15 times as fast on the d axis, permitted up to 0.696"),
        (["drive.vector.injection.search_rise_a_per_s=10"], "permitted 371 to 3.71e+04 A/s"),
        (["drive.vector.injection.samples=100"], "or lower drive.vector.injection.samples = 100"),
        (
            ["drive.vector.injection.period=100"],
            "over 100 updates makes 75 A, beside drive.current_limit_a permitted up",
        ),
        (["inverter.supply_v=3"], "6 V is not below the largest voltage, 1.656 V"),
    ],
)
def test_refused_by_its_key(overrides: list[str], text: str) -> None:
    """What would swing, drown in noise or take the wrong pole is refused before anything is built.

    Verifies: INJC-09
    """
    with pytest.raises(ConfigError) as caught:
        load_scenario(SCENARIOS / "ebike.toml", overrides)
    assert any(text in p.message for p in caught.value.problems), [p.message for p in caught.value.problems]
    about_injection = [p.key for p in caught.value.problems if p.key.startswith("drive.vector.injection")]
    assert len(about_injection) <= 1, about_injection
