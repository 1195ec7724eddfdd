# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A play becomes a test: what was done on a page, exported, runs to the same numbers."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fluxlock.config import load_scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import Fault
from fluxlock.cosim.outcome import Run, finished
from fluxlock.interface.settings import load_settings
from fluxlock.live import messages
from fluxlock.live.source import RefusedError
from fluxlock.live.twin import Twin
from fluxlock.native import averaged_motor as am
from fluxlock.native import six_step_run, vector_run
from fluxlock.native.play import ScenarioPlay
from fluxlock.native.player import player

SPINDLE, VECTOR = "scenarios/own-spindle.toml", "scenarios/vector/start.toml"
PLAYS = [(SPINDLE, 12_000), (VECTOR, 30_000)]
START_S = 0.5  # by which both run
TICK_V = 2e-3  # of a ramp of 26 V/s within a control tick


def run(twin: Twin, seconds: float) -> None:
    """Advance as the page's process does, in pieces."""
    end = twin.now + seconds
    while twin.now < end - 1e-9:
        twin.advance(min(0.0033, end - twin.now))
        twin.take()


def machine(play: ScenarioPlay) -> bytes:
    """All of the machine's state, bit for bit."""
    if isinstance(play, vector_run.Play):
        state = play.chip.state
        return b"".join(state[name].tobytes() for name in ("theta", "omega", "i", "vdc", "torque_nm", "samples"))
    assert isinstance(play, six_step_run.Play)
    return bytes(play.chip.model.s[: am.NOTES].tobytes())


def repeated(twin: Twin, folder: Path) -> tuple[ScenarioPlay, Run]:
    """Export, read the files, run them."""
    for name, text in twin.export("my-play").items():
        (folder / name).write_text(text, encoding="utf-8")
    scenario = load_scenario(folder / "my-play.toml")
    again = player(scenario, scenario.seed)
    return again, finished(again.run(), scenario)


@pytest.mark.parametrize(("file", "target"), PLAYS)
def test_repeats(tmp_path: Path, file: str, target: int) -> None:
    """Load, supply, speed and a switch of a play, exported, end in the machine state of the play, bit for bit.

    Verifies: LIVE-04
    """
    scenario = load_scenario(file)
    twin = Twin(scenario, scenario.seed)
    run(twin, START_S)
    twin.act(messages.LoadFactor(kind="load", factor=1.25))
    run(twin, 0.041)
    twin.act(messages.Set(kind="set", name="speed_rpm", value=str(target)))
    twin.act(messages.Supply(kind="supply", volt=0.95 * scenario.inverter.supply_v, ramp_s=0.02))
    run(twin, 0.123456)
    assert twin.status()["state"] == "running", twin.said
    twin.act(messages.Drive(kind="drive", do="stop"))
    run(twin, 0.012)
    played, told = machine(twin.play), twin.status()
    again, outcome = repeated(twin, tmp_path)
    assert again.now == told["t_s"] and machine(again) == played
    assert outcome.verdict.passed, outcome.verdict.lines
    assert len(twin.done) == 6, "two of the file, four of the page"


@pytest.mark.parametrize(("file", "target"), PLAYS)
def test_open_phase(tmp_path: Path, file: str, target: int) -> None:
    """A click on an open phase ends in a named fault; the exported play expects it, and gets it at the same time.

    Verifies: LIVE-04, LIVE-07
    """
    scenario = load_scenario(file)
    twin = Twin(scenario, scenario.seed)
    run(twin, START_S)
    assert twin.status()["state"] == "running"
    twin.act(messages.Break(kind="fault", fault=Fault(kind="open_phase", phases=["A"])))
    while (told := twin.status())["state"] != "fault" and twin.now < START_S + 2.0:
        run(twin, 0.01)
    assert told["state"] == "fault" and told["fault"] != "none", told
    played = machine(twin.play)
    again, outcome = repeated(twin, tmp_path)
    assert machine(again) == played
    assert outcome.result["fault"] == told["fault"] and outcome.verdict.passed, outcome.verdict.lines


@pytest.mark.parametrize(
    ("file", "button", "named"),
    [
        (SPINDLE, "Stuck rotor", "phase_over_current"),
        (SPINDLE, "Supply loss", "phase_over_current"),
        (VECTOR, "Stuck rotor", "stalled"),
    ],
)
def test_buttons(tmp_path: Path, file: str, button: str, named: str) -> None:
    """A click ends in the drive's fault by its name, and the exported play ends in the same state.

    A link at 0 V is no end of the source.

    Verifies: LIVE-04, LIVE-07
    """
    scenario = load_scenario(file)
    twin = Twin(scenario, scenario.seed)
    run(twin, START_S)
    (order,) = (entry["order"] for entry in twin.hello()["faults"] if entry["name"] == button)
    message = messages.parse(json.dumps(order))
    assert isinstance(message, messages.Break | messages.Supply)
    twin.act(message)
    while (told := twin.status())["fault"] == "none" and twin.now < START_S + 1.0:
        run(twin, 0.01)
    assert told["fault"] == named
    played = machine(twin.play)
    again, outcome = repeated(twin, tmp_path)
    assert machine(again) == played and outcome.verdict.passed, outcome.verdict.lines


def test_every_button_has_an_order_or_a_reason() -> None:
    """No button is without effect in silence; a click that the source does not have is refused with the same words.

    Verifies: LIVE-07
    """
    for file in (SPINDLE, VECTOR):
        twin = Twin(load_scenario(file), 1)
        for entry in twin.hello()["faults"]:
            assert (entry["order"] is None) == bool(entry["why"]) and entry["text"], entry
        with pytest.raises(RefusedError, match=r"no Hall sensors|has no hall_glitch"):
            twin.act(messages.Break(kind="fault", fault=Fault(kind="hall_glitch")))


@pytest.mark.parametrize(("file", "noise"), [(SPINDLE, "M_NOISE"), (VECTOR, "noise_a")])
def test_mended(file: str, noise: str) -> None:
    """Noise and a rotor that stands end with `Mend all`; the rotor turns on from where it stood.

    Verifies: LIVE-07
    """
    twin = Twin(load_scenario(file), 1)

    def level() -> float:
        chip = twin.play.chip  # type: ignore[attr-defined]  # both machines have one
        return float(chip.model.m[am.M_NOISE]) if noise == "M_NOISE" else float(chip.plant.noise_a[0])

    run(twin, 0.05)
    before = level()
    twin.act(messages.Break(kind="fault", fault=Fault(kind="noisy_channels", noise_lsb=50.0)))
    twin.act(messages.Break(kind="fault", fault=Fault(kind="stuck_rotor")))
    assert level() > 10.0 * before
    run(twin, 0.01)
    assert twin.play.shaft[0] == 0.0
    twin.act(messages.Break(kind="fault", fault=Fault(kind="clear")))
    run(twin, 0.05)
    assert level() == before and twin.play.shaft[0] != 0.0


@pytest.mark.parametrize(("file", "target"), PLAYS)
def test_fault_pin(file: str, target: int) -> None:
    """The driver's pin is a level: `clear` helps only after it is mended.

    Verifies: LIVE-07
    """
    scenario = load_scenario(file)
    twin = Twin(scenario, scenario.seed)
    run(twin, 0.05)
    twin.act(messages.Break(kind="fault", fault=Fault(kind="fault_pin")))
    run(twin, 0.01)
    assert twin.status()["fault"] == "fault_pin"
    twin.act(messages.Drive(kind="drive", do="clear"))
    run(twin, 0.01)
    assert twin.status()["fault"] == "fault_pin"
    twin.act(messages.Break(kind="fault", fault=Fault(kind="clear")))
    twin.act(messages.Drive(kind="drive", do="clear"))
    run(twin, 0.01)
    assert twin.status()["fault"] == "none"


def test_refused() -> None:
    """What the twin does not have and what the console refuses is said in one line, and leaves no event.

    Verifies: LIVE-07
    """
    scenario = load_scenario(SPINDLE)
    twin = Twin(scenario, scenario.seed)
    for action in (
        messages.Break(kind="fault", fault=Fault(kind="shorted_winding", phases=["A"])),
        messages.Break(kind="fault", fault=Fault(kind="open_phase", phases=["A", "B"])),
        messages.Break(kind="fault", fault=Fault(kind="open_phase", phases=["E"])),
        messages.Set(kind="set", name="no_such", value="1"),
        messages.Set(kind="set", name="accel_rpm_s", value="0"),
    ):
        with pytest.raises(RefusedError, match=r"^[^\n]+$"):
            twin.act(action)
    assert twin.done == [] and twin.now == 0.0


def test_settings() -> None:
    """Every console setting of the method is there with unit, range and the drive's own value.

    Verifies: LIVE-01
    """
    for file, method in ((SPINDLE, "six-step"), (VECTOR, "vector")):
        scenario = load_scenario(file)
        shown = {entry["name"]: entry for entry in Twin(scenario, 1).settings}
        assert list(shown) == [s.name for s in load_settings() if method in s.methods]
        assert shown["speed_rpm"]["high"] == scenario.motor.max_speed_rpm
        assert shown["current_limit_a"]["unit"] == "A" and shown["current_limit_a"]["low"] == 0.0
        assert float(shown["current_limit_a"]["value"]) == pytest.approx(scenario.current_limit_a, rel=1e-3)
        assert all(entry["value"] for entry in shown.values())


def test_load_that_drives_the_rotor_off(tmp_path: Path) -> None:
    """Behind the fault a constant load turns the rotor backwards: time stands where the model ends.

    The export repeats the play, though the load's ramp goes on beyond its end.

    Verifies: LIVE-04, LIVE-07
    """
    scenario = load_scenario("scenarios/six-step/torque-limit.toml")
    twin = Twin(scenario, scenario.seed)
    for _ in range(2000):
        twin.advance(0.005)
        twin.take()
    assert twin.now < 5.0 and twin.status()["state"] == "fault"
    assert -4.0 < twin.play.shaft[0] * RPM_PER_RAD_S / scenario.motor.max_speed_rpm < -3.0
    assert [entry for entry in twin.said if "model ends here" in entry["text"]] == twin.said[-1:]
    again, _ = repeated(twin, tmp_path)
    assert again.now == pytest.approx(twin.now) and again.shaft == pytest.approx(twin.play.shaft, rel=1e-9)


def test_export_within_ramps(tmp_path: Path) -> None:
    """Two ramps of the supply, the second before the end of the first, and an export before the end of the second.

    Verifies: LIVE-04
    """
    scenario = load_scenario(VECTOR)
    twin = Twin(scenario, scenario.seed)
    run(twin, START_S)
    for volt in (24.0, 22.0):
        twin.act(messages.Supply(kind="supply", volt=volt, ramp_s=0.1))
        run(twin, 0.04)
    again, outcome = repeated(twin, tmp_path)
    assert outcome.verdict.passed, outcome.verdict.lines
    assert again.supply_v == pytest.approx(twin.play.supply_v, abs=TICK_V) and 23.0 < again.supply_v < 24.0
    assert again.shaft == pytest.approx(twin.play.shaft, rel=1e-4)


def test_five_phases() -> None:
    """The page of a five-phase twin has the currents of all its phases."""
    twin = Twin(load_scenario("scenarios/five-phase/yu.toml"), 1)
    assert not {"current_d", "current_e"} & {*twin.hello()["without"]} and "gate_ah" in twin.hello()["without"]
    run(twin, 0.2)
    assert twin.status()["state"] != "fault"
