# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The moving scope: what it shows is the run's, it ends in time, and a still stands beside it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError
from fluxlock.results import scope
from fluxlock.results.rundata import RunData, save_trace
from tests.results.synthetic import Drive, make_run

SVG = "{http://www.w3.org/2000/svg}"
IMAGES = ROOT / "docs" / "images"
EVENTS = [{"at_s": 0.004, "command": "start"}, {"at_s": 0.012, "load_factor": 1.25}, {"at_s": 0.013, "speed_rpm": 9e3}]


def result_of(metrics: dict[str, Any] | None = None) -> dict[str, Any]:
    settings = {"name": "x", "description": "a < b & c", "motor": {"name": "Motor"}, "event": EVENTS}
    settings["window"] = [{"name": name, "from_s": 0.01, "to_s": 0.015} for name in metrics or {}]
    return {"metrics": metrics or {}, "scenario": {"settings": settings}}


@pytest.fixture(scope="module")
def run() -> RunData:
    """60 000 r/min; crossings 0.2° late and early in turns, one of them far off."""
    return make_run(Drive(crossing_error=lambda k: 40.0 if k == 3 else 0.2 * (-1) ** k))


def test_caption(run: RunData) -> None:
    """Speed and named errors of the first window, without one of the second half.

    Verifies: FRONT-65
    """
    errors = {key: {"rms": None} for key in scope.ERRORS.values()}
    crossings = {"zcp_error_deg": {"rms": 0.0194}, "commutation_error_deg": {"rms": 0.0301}}
    metrics = {"speed_rpm": {"min": 59_998.4, "max": 60_002.1}, **errors, **crossings}
    text = scope.caption(run, result_of({"steady": metrics, "loaded": {}}))
    turns, span = "The simulated rotor turns at", "r/min from 0.01 to 0.015 s"
    errors_text = "crossing error 0.019° rms, commutation error 0.030° rms"
    assert text.replace("\u00a0", " ") == f"{turns} 59 998 to 60 002 {span}: {errors_text}."
    text = scope.caption(run, result_of()).replace("\u00a0", " ")
    half = rf"60 000 to 60 000 r/min from {run.duration_s / 2:g} to {run.duration_s:g} s"
    errors_text = r"crossing error 0\.199° rms, commutation error \d\.\d{3}° rms"
    assert re.fullmatch(rf"{turns} {half}: {errors_text}\.", text)
    vector = {"speed_rpm": {"min": 1.0, "max": 2.0}, **errors, "angle_error_deg": {"rms": 0.5}}
    text = scope.caption(run, result_of({"w": vector})).replace("\u00a0", " ")
    assert text == f"{turns} 1 to 2 {span}: angle error 0.500° rms."
    silent = {"speed_rpm": {"min": 1.0, "max": 2.0}, **errors}
    assert scope.caption(run, result_of({"w": silent})) == f"{turns} 1 to 2 {span}."


def test_picture(run: RunData) -> None:
    """Every crossing is a dot, at its error or at the edge; events and state are named; the curve is the speed.

    Verifies: FRONT-65
    """
    root = ElementTree.fromstring(scope.svg(run, result_of()))
    assert root.findtext(f"{SVG}title") == "Motor: a < b & c"
    texts = [text.text or "" for text in root.iter(f"{SVG}text")]
    assert "start" in texts and "load × 1.25" in texts and "lock" in texts and "running" in texts
    assert "60\u00a0000\u00a0r/min" in texts and "crossing error 0.199°" in texts
    paths = {path.get("stroke"): path.get("d") or "" for path in root.iter(f"{SVG}path") if "h0" in path.get("d", "")}
    crossings = len(scope.Analysis(run).crossings.cycle)
    assert paths[scope.BEYOND_COLOUR].count("M") == 1
    assert paths[scope.ERROR_COLOUR].count("M") == crossings - 1 > 100
    heights = {float(y) for y in re.findall(r"M[\d.]+ ([\d.]+)h0", paths[scope.ERROR_COLOUR])}
    middle = sum(scope.ERROR) / 2
    assert {-1, 1} == {round((y - middle) / 22.5) for y in heights}  # 0.2° of 0.4°, half of 90 px


def test_motion(run: RunData) -> None:
    """It moves for at most 8 s, all parts in step; the still has no motion and shows the whole run.

    Verifies: FRONT-65
    """
    text = scope.svg(run, result_of())
    moving = [e for e in ElementTree.fromstring(text).iter() if e.tag.startswith(f"{SVG}animate")]
    assert {e.get("dur") for e in moving} == {"8s"}
    for element in moving:
        values, times = ((element.get(key) or "").split(";") for key in ("values", "keyTimes"))
        assert len(values) == len(times) and [float(t) for t in times] == sorted(map(float, times))
    shapes = [e for e in moving if e.get("attributeName") == "d"]
    assert len(shapes) == 3
    for element in shapes:
        assert len({value.count(" ") for value in (element.get("values") or "").split(";")}) == 1, "shapes blend"
    # One reading is visible at any time.
    shown = [e for e in moving if e.get("attributeName") == "visibility"]
    for share in (0.0, 0.3, 0.6, 0.95):
        visible = 0
        for element in shown:
            steps = zip(
                (element.get("keyTimes") or "").split(";"), (element.get("values") or "").split(";"), strict=True
            )
            visible += [value for at, value in steps if float(at) <= share][-1] == "visible"
        assert visible == 1
    still = scope.svg(run, result_of(), moving=False)
    assert "<animate" not in still and still.count("h0") == text.count("h0")


def test_command(run: RunData, tmp_path: Path) -> None:
    """The command draws both pictures of a folder; what is no run, or no SVG, is one line.

    Verifies: FRONT-65, FRONT-02
    """
    folder = tmp_path / "run"
    folder.mkdir()
    save_trace(folder / "trace.npz", run)
    (folder / "result.json").write_text(json.dumps(result_of()))
    done = CliRunner().invoke(cli.app, ["scope", str(folder)])
    assert done.exit_code == 0 and "The simulated rotor turns at " in done.output
    assert (folder / "scope.svg").read_text() == scope.svg(run, result_of())
    assert "<animate" not in (folder / "scope-still.svg").read_text()
    for words in ([str(tmp_path)], [str(folder), "--out", str(tmp_path / "x.png")]):
        assert isinstance(CliRunner().invoke(cli.app, ["scope", *words]).exception, ConfigError)
    (folder / "trace.npz").write_text("no trace")
    assert isinstance(CliRunner().invoke(cli.app, ["scope", str(folder)]).exception, ConfigError)


def test_picture_of_the_readme() -> None:
    """The README's pictures are light and short, and its caption is theirs.

    Verifies: FRONT-65
    """
    text = (IMAGES / "scope.svg").read_text(encoding="utf-8")
    caption = ElementTree.fromstring(text).findtext(f"{SVG}desc")
    assert caption and caption == ElementTree.parse(IMAGES / "scope-still.svg").getroot().findtext(f"{SVG}desc")
    assert (IMAGES / "scope.svg").stat().st_size < 1e6
    assert {float(s) for s in re.findall(r'dur="([\d.]+)s"', text)} == {scope.TOTAL_S} and scope.TOTAL_S <= 8.0
    assert caption in (ROOT / "README.md").read_text(encoding="utf-8")
