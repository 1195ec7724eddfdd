# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""How long samples of a crossing wait after an edge: the key, the rule in its place, what is refused and shown."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock.base.paths import ROOT
from fluxlock.cli import app
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, load_scenario
from fluxlock.config.settling import NOISES, SAMPLES_AFTER_CLAMP, crossing_settling, edge_settling_s, residue_v
from fluxlock.cosim.parameters import parameter_block
from fluxlock.plant import EdgeParams

SPINDLE = ROOT / "scenarios" / "own-spindle.toml"
EDGE = "inverter.sensing.edge.preset"


def clocks(*overrides: str) -> dict[str, int]:
    """Parameters that follow from the settle time."""
    values = parameter_block(load_scenario(SPINDLE, overrides)).values
    names = ("zcd_settle_cycles", "zcd_blank_cycles", "least_on_cycles", "on_time_floor_cycles")
    found = {}
    for name in names:
        value = values[name]
        assert isinstance(value, int)
        found[name] = value
    return found


def test_clean_edges_wait_for_the_dividers() -> None:
    """Without edge terms: 6 time constants of 200 ns and a sample of 1 us, in clocks; a pulse holds three samples more.

    Verifies: FRONT-92
    """
    assert clocks() == {
        "zcd_settle_cycles": 110,
        "zcd_blank_cycles": 110,
        "least_on_cycles": 260,
        "on_time_floor_cycles": 310,
    }
    assert clocks(f"{EDGE}=clean") == clocks()


def test_samples_after_a_clamp_are_those_of_the_register() -> None:
    """The warning's number is what the chip's field holds: so many are passed over, and the next one counts.

    Verifies: FRONT-95
    """
    text = (ROOT / "rtl" / "regs" / "fl_zcd_regs.rdl").read_text(encoding="utf-8")
    field = re.search(r"need_previous\[(\d+):(\d+)\]", text)
    assert field is not None
    assert 1 << (int(field[1]) - int(field[2]) + 1) == SAMPLES_AFTER_CLAMP


def test_key_is_the_register() -> None:
    """The key sets the time to the first sample that counts, after gate edges and commutations; pulses follow.

    Verifies: FRONT-92
    """
    assert clocks("drive.zcd.settle_us=3", f"{EDGE}=T") == {
        "zcd_settle_cycles": 150,
        "zcd_blank_cycles": 150,
        "least_on_cycles": 300,
        "on_time_floor_cycles": 350,
    }


@pytest.mark.parametrize("own", [0.0, 0.4])
@pytest.mark.parametrize("pole_s", [0.0, 50e-9, 200e-9, 600e-9, 4e-6])
def test_bound_holds(pole_s: float, own: float) -> None:
    """The terms, integrated numerically with the pole, never exceed the bound, which is not more than twice them.

    own: of a jump by half the supply of the open terminal itself, whose diode ends at the same edge.

    Verifies: FRONT-92
    """
    edge = EdgeParams(48.0, 2.0, 600e-9, 1.2, 700e3, 4e-6, own=own, coupling=0.5, slew_s=100e-9)
    h = 2e-9
    t = h * np.arange(8000)
    before = (0.5 + own / 2) * (2.0 * np.exp(-t / 600e-9) + 1.2 * np.exp(-t / 4e-6) * np.cos(2 * math.pi * 700e3 * t))
    before -= 48.0 * np.clip(1 - t / 100e-9, 0, None)
    behind, y = np.empty(t.size), 0.0
    for k, value in enumerate(before):
        y = y + (value - y) * (1 - math.exp(-h / pole_s)) if pole_s else value
        behind[k] = y
    bounds = np.array([residue_v(edge, pole_s, 48.0, float(at)) for at in t])
    assert np.all(np.abs(behind) <= 1.01 * bounds + 1e-3)
    late = slice(2000, None)
    assert np.abs(behind[late]).max() > 0.3 * bounds[late].max()


def test_rule_waits_for_the_edges() -> None:
    """The rule's time is that at which the bound is 3 times the noise; with T it is limited by the carrier.

    Verifies: FRONT-92
    """
    s = load_scenario(SPINDLE, [f"{EDGE}=cable"])
    sensing = s.inverter.sensing
    edge = sensing.edge.params(25.0)
    assert edge is not None
    settle_s = edge_settling_s(sensing, 48.0)
    assert residue_v(edge, sensing.divider_pole_s, 48.0, settle_s) == pytest.approx(NOISES * 60 / 4096, rel=1e-3)
    found = crossing_settling(s.drive, s.inverter)
    assert found.settle_s == settle_s and "times the noise" in found.reason
    assert clocks(f"{EDGE}=cable")["zcd_settle_cycles"] == round(settle_s * CLOCK_HZ)
    limited = load_scenario(SPINDLE, [f"{EDGE}=T"])
    found = crossing_settling(limited.drive, limited.inverter)
    assert found.settle_s < edge_settling_s(limited.inverter.sensing, 48.0) and "of the carrier" in found.reason


def test_what_leaves_no_samples_is_refused() -> None:
    """The message says what would run; that runs.

    Verifies: FRONT-92, FRONT-02
    """
    with pytest.raises(ConfigError) as caught:
        load_scenario(SPINDLE, ["drive.zcd.settle_us=48"])
    (problem,) = caught.value.problems
    assert str(problem) == (
        "--set: drive.zcd.settle_us: 48 us leaves no samples in a carrier of 20000 Hz: permitted up to 47 us, or a "
        "slower carrier"
    )
    assert load_scenario(SPINDLE, ["drive.zcd.settle_us=47"]).drive.zcd.settle_us == 47
    for value, said in (("-1", "out of range"), ("nan", "out of range"), ("soon", "must be a number")):
        with pytest.raises(ConfigError, match=said):
            load_scenario(SPINDLE, [f"drive.zcd.settle_us={value}"])


def test_motor_info_shows_it() -> None:
    """With an inverter file `motor info` prints the time with its reason.

    Verifies: FRONT-92
    """
    files = (str(ROOT / "motors" / "spindle-2pp.toml"), "--inverter", str(ROOT / "inverters" / "drive-48v.toml"))
    result = CliRunner().invoke(app, ["motor", "info", *files])
    assert result.exit_code == 0
    assert "samples of a crossing count from 2.2 us after a gate edge" in " ".join(result.stdout.split())
