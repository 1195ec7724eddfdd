# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`[sensing.edge]` of an inverter file: presets, keys over them, refusals."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import get_args

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_inverter, load_scenario
from fluxlock.config.edge import PRESETS, Preset
from fluxlock.cosim.convert import plant_params
from fluxlock.plant import EdgeParams

SPINDLE = ROOT / "scenarios" / "own-spindle.toml"
KEY = "inverter.sensing.edge"
FULL_A = 25.0


def edge_of(*overrides: str) -> EdgeParams | None:
    """Edge terms that the plant gets from the scenario with keys of the table."""
    scenario = load_scenario(SPINDLE, [f"{KEY}.{override}" for override in overrides])
    return plant_params(scenario, 10, ()).sensing.edge


def test_nothing_by_default() -> None:
    """Without the table, and with the preset `clean`, the plant has no edge terms.

    Verifies: FRONT-90
    """
    assert edge_of() is None and edge_of("preset=clean") is None


def test_presets() -> None:
    """Each preset is whole; T and G have the values of their page; all but `clean` say something.

    Verifies: FRONT-90
    """
    assert set(get_args(Preset)) == set(PRESETS)
    fitted = EdgeParams(48.0, 2.0, 600e-9, 1.2, 700e3, 4e-6, 0.10, 3.5e-6)
    assert edge_of("preset=T") == fitted
    assert edge_of("preset=G") == dataclasses.replace(fitted, step_v=2.5, lobe_v=0.69)
    assert all(edge_of(f"preset={name}") is not None for name in PRESETS if name != "clean")
    divider = edge_of("preset=divider")
    assert divider is not None and divider.current_step_a == pytest.approx(0.02 * FULL_A)


def test_keys_go_before_the_preset() -> None:
    """A key replaces the value of the preset, also by 0; a table in the file does the same as `--set`.

    Verifies: FRONT-90
    """
    terms = edge_of("preset=T", "ring_v=0", "slew_s=50e-9", "reference_v=24")
    assert terms == EdgeParams(24.0, 2.0, 600e-9, 0.0, 700e3, 4e-6, 0.10, 3.5e-6, slew_s=50e-9)


def test_table_in_the_file(tmp_path: Path) -> None:
    """The table stands in the inverter file.

    Verifies: FRONT-90
    """
    text = (ROOT / "inverters" / "drive-48v.toml").read_text(encoding="utf-8")
    path = tmp_path / "my-inverter.toml"
    path.write_text(f'{text}\n[sensing.edge]\npreset = "G"\nlobe_v = 0.5\n', encoding="utf-8")
    terms = load_inverter(path).sensing.edge.params(FULL_A)
    assert terms is not None and (terms.step_v, terms.lobe_v) == (2.5, 0.5)


@pytest.mark.parametrize(
    ("overrides", "key", "said"),
    [
        (["preset=t"], "preset", "permitted: clean, T, G, cable, divider"),
        (["step_tau_s=-1e-9"], "step_tau_s", "out of range, permitted 0 to 0.001 s"),
        (["ring_v=1", "ring_tau_s=1e-6", "ring_hz=30e6"], "ring_hz", "out of range, permitted 0 to 25000000 Hz"),
        (["step_v=nan"], "step_v", "out of range"),
        (["step_v=1"], "step_tau_s", "must be above 0 beside step_v = 1"),
        (["preset=T", "ring_tau_s=0"], "ring_tau_s", "must be above 0 beside ring_v = 1.2"),
        (["lobe_s=1e-6"], "lobe_s", "has no effect without lobe_v"),
        (["preset=T", "ring_tau_s=100e-9"], "ring_hz", "are no ring"),
        (["own=1"], "own", "has no effect without step_v, ring_v or lobe_v"),
        (["preset=T", "coupling=0"], "coupling", "reach no channel"),
        (["reference_v=24"], "reference_v", "has no effect without a height"),
        (["slew_s=1e-6"], "slew_s", "longer than min_pulse_s (6e-07 s)"),
        (["ring=1"], "ring", "unknown key"),
        (["preset=3"], "preset", "permitted"),
    ],
)
def test_refused(overrides: list[str], key: str, said: str) -> None:
    """What cannot be, or has no effect, is refused by one line that names the key.

    Verifies: FRONT-90, FRONT-02
    """
    with pytest.raises(ConfigError) as caught:
        load_scenario(SPINDLE, [f"{KEY}.{override}" for override in overrides])
    assert len(caught.value.problems) == 1
    line = str(caught.value.problems[0])
    assert f"sensing.edge.{key}:" in line and said in line, line
