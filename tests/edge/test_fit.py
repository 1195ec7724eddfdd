# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock edge fit`: known terms come back, with noise, offset, slope and a pole; bad files end in one line."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock.cli import app
from fluxlock.config import ConfigError
from fluxlock.config.edge import Edge
from fluxlock.edge.fit import fit_record
from fluxlock.edge.record import read_record

HZ = 100e6
STEP, RING, LOBE = (2.0, 600e-9), (1.2, 700e3, 4e-6), (0.69, 3.5e-6)


def write(
    path: Path, *, noise_v: float = 0.0, edge: str = "off", jump_v: float = 48.0, pole_s: float = 0.0, seed: int = 1
) -> Path:
    """Record of the terms on 20 V that fall by 10 mV/us, integrated with a pole; the lobe after a turn-off only."""
    t = np.arange(-100, 3000) / HZ
    after = np.maximum(t, 0.0)
    v = STEP[0] * np.exp(-after / STEP[1]) + RING[0] * np.exp(-after / RING[2]) * np.cos(2 * np.pi * RING[1] * after)
    if edge == "off":
        v += LOBE[0] * after / LOBE[1] * np.exp(1 - after / LOBE[1])
    v = np.where(t >= 0, v, 0.0) * jump_v / 48.0
    if pole_s:
        fine = np.exp(-1 / HZ / pole_s)
        out, y = [], 0.0
        for now, following in zip(v, [*v[1:], v[-1]], strict=True):
            out.append(y)
            y = y * fine + (1 - fine) * 0.5 * (now + following)
        v = np.array(out)
    v = v + 20.0 - 1e4 * t + noise_v * np.random.default_rng(seed).standard_normal(t.size)
    head = f"# sampling_hz = {HZ}\n# edge = {edge}\n# edge_at_s = 0\n# jump_v = {jump_v}\n# pole_s = {pole_s}\n"
    rows = "\n".join(f"{1e6 * a:.4f},{b:.6f}" for a, b in zip(t, v, strict=True))
    path.write_text(f"{head}time_us,open_v\n{rows}\n", encoding="utf-8")
    return path


def check(keys: dict[str, float], tolerance: float, lobe: bool) -> None:
    wanted = {"step_v": STEP[0], "step_tau_s": STEP[1], "ring_v": RING[0], "ring_hz": RING[1], "ring_tau_s": RING[2]}
    wanted |= {"lobe_v": LOBE[0], "lobe_s": LOBE[1]} if lobe else {}
    assert keys.keys() == {"reference_v", *wanted}
    for key, value in wanted.items():
        assert keys[key] == pytest.approx(value, rel=tolerance), key


@pytest.mark.parametrize("edge", ["on", "off"])
@pytest.mark.parametrize("noise_v", [0.0, 0.05])
def test_known_terms(tmp_path: Path, edge: str, noise_v: float) -> None:
    """A synthetic record gives its own values back: to 1 % without noise, to 8 % with 50 mV rms of it.

    Verifies: FRONT-91
    """
    print("seed 1")
    found = fit_record(read_record(write(tmp_path / "my-scope.csv", noise_v=noise_v, edge=edge)), 48.0)
    check(found.keys, 0.08 if noise_v else 0.01, edge == "off")
    assert found.residual_v == pytest.approx(noise_v, abs=2e-3)


def test_falling_edge_of_another_height(tmp_path: Path) -> None:
    """Heights hold for the reference, whatever the jump and its sign.

    Verifies: FRONT-91
    """
    found = fit_record(read_record(write(tmp_path / "my-scope.csv", jump_v=-24.0, edge="on")), 48.0)
    check(found.keys, 0.01, False)


def test_pole_of_the_probe(tmp_path: Path) -> None:
    """The pole before the probe is taken out.

    Verifies: FRONT-91
    """
    found = fit_record(read_record(write(tmp_path / "my-scope.csv", pole_s=200e-9, edge="on")), 48.0)
    check(found.keys, 0.03, False)


def test_printed_table_is_one_of_the_inverter_file(tmp_path: Path) -> None:
    """What the command prints can be pasted: it passes the check of the table.

    Verifies: FRONT-91
    """
    result = CliRunner().invoke(app, ["edge", "fit", str(write(tmp_path / "my-scope.csv", noise_v=0.02))])
    assert result.exit_code == 0, result.output
    table = tomllib.loads(result.stdout)["sensing"]["edge"]
    terms = Edge.model_validate(table).params(25.0)
    assert terms is not None and terms.ring_hz == pytest.approx(RING[1], rel=0.02)
    assert "mV rms" in result.stderr


def flat(text: str) -> str:
    """A record without an edge."""
    rows = [row.split(",") for row in text.splitlines() if not row.startswith("#")][1:]
    noise = np.random.default_rng(4).standard_normal(len(rows))
    head = [line for line in text.splitlines() if line.startswith("#")]
    return "\n".join([*head, "time_us,open_v", *(f"{row[0]},{n:.4f}" for row, n in zip(rows, noise, strict=True))])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.replace("open_v", "volts"), "no column open_v or open_mv"),
        (lambda t: t.replace("# jump_v = 48.0\n", ""), "jump_v: is missing"),
        (lambda t: t.replace("jump_v = 48.0", "jump_v = 0"), "jump_v: 0 is not permitted"),
        (lambda t: t.replace("jump_v = 48.0", "jump_v = high"), 'jump_v: "high" is no number'),
        (lambda t: t.replace("edge = off", "edge = up"), 'edge: must be "on" or "off"'),
        (lambda t: t.replace("sampling_hz = 100000000.0", "sampling_hz = 1e6"), "does not agree with the times"),
        (lambda t: t.replace("edge_at_s = 0", "edge_at_s = 1"), "leaves 0 samples behind the edge"),
        (lambda t: "\n".join(t.splitlines()[:30]), "samples, at least 100 are needed"),
        (lambda t: t.replace("\n0.0500,", "\n0.0500,nan,"), "must be 2 numbers"),
        (lambda t: t.replace("# edge =", "# edgy = 1\n# edge ="), 'unknown key, did you mean "edge"?'),
        (lambda t: "", "has no column"),
    ],
)
def test_bad_files(tmp_path: Path, change: object, said: str) -> None:
    """Each is refused by one line that names file and place.

    Verifies: FRONT-91, FRONT-02
    """
    path = write(tmp_path / "my-scope.csv")
    assert callable(change)
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        read_record(path)
    assert len(caught.value.problems) == 1 and said in str(caught.value.problems[0]), str(caught.value.problems[0])


def test_nothing_to_fit(tmp_path: Path) -> None:
    """A missing file and a record of noise are refused by the command, exit code 2.

    Verifies: FRONT-91
    """
    with pytest.raises(ConfigError, match="file not found"):
        read_record(tmp_path / "none.csv")
    path = write(tmp_path / "my-scope.csv")
    path.write_text(flat(path.read_text(encoding="utf-8")), encoding="utf-8")
    assert len(fit_record(read_record(path), 48.0).keys) == 1
